//! Smooth edges: pictures of several samples a pixel beside the ray tracer's, and what must not change with them.

mod common;

use common::{built, built_hybrid, renderer, scan, scene};
use gigalod::geom::camera::UpAxis;
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Frame, Kernel, Lighting, Look, MOST_SAMPLES, RenderError, Renderer};
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod::runtime::{Fineness, Interrupt, Scene, ViewId};
use gigalod_reference::raytrace::supersampled_picture;
use gigalod_reference::{Bvh, Picture, Shading, metrics};

const SIZE: ImageSize = ImageSize { width: 240, height: 180 };
const VIEW: ViewId = ViewId(0);

fn look(samples: u32) -> Look {
    Look { samples, ..Look::default() }
}

fn drawn(scene: &mut Scene, renderer: &mut Renderer, camera: &Camera, look: Look) -> gigalod::render::Picture {
    scene.select_converged(VIEW, camera, &Fineness::px(0.5));
    let draws = scene.draws(VIEW).map(|(instance, cut)| (instance.placement, &cut.draw)).collect();
    renderer.picture(&Frame { camera: *camera, look, draws }).unwrap()
}

fn rgb(drawn: &gigalod::render::Picture) -> Picture {
    Picture {
        size: drawn.size,
        pixels: drawn.rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect(),
    }
}

#[test]
fn a_smooth_picture_is_near_the_ray_tracers_and_its_depths_are_those_of_one_sample() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let [triangles, splats] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let mesh = common::mesh(&path);
    let bvh = Bvh::build(&mesh);
    let hybrid = (scene(built_hybrid(&path, triangles.path())), Kernel::Round);
    let splats = (scene(built(&path, splats.path())), Kernel::RoundEllipse);
    for ((mut scene, kernel), gains) in [(hybrid, [5.0, 2.0]), (splats, [0.3, 0.0])] {
        // Nearer than the whole: cut off at all sides.
        let camera = Camera::orbit(&mesh.bounds(), UpAxis::Y, [20.0, 10.0], 2.0, 0.7, SIZE);
        let shading = Shading {
            to_light: camera.shoulder_light(),
            background_srgb: Lighting::default().background,
            plain_albedo_srgb: MATERIAL_SRGB,
        };
        let truth = supersampled_picture(&bvh, &camera, &shading, 8);
        let of = |samples: u32| Look { kernel, ..look(samples) };
        let [one, five, most] = [1, 5, 17].map(|samples| drawn(&mut scene, &mut renderer, &camera, of(samples)));
        assert!(
            one.depth == most.depth && one.footprint_px == most.footprint_px,
            "the G-buffer is that of pixels' middles"
        );
        let db =
            [&one, &five, &most].map(|picture| metrics::psnr_db(&truth, &rgb(picture), None).expect("they differ"));
        println!("{kernel:?}: {db:?} dB");
        assert!(db[1] > db[0] + gains[0] && db[2] > db[1] + gains[1], "{db:?}");
    }
}

#[test]
fn smoothing_is_refused_broken_off_and_takes_its_memory_from_the_budget() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built_hybrid(&path, folder.path()));
    let camera = Camera::orbit(&scene.bounds(), UpAxis::Y, [20.0, 10.0], 1.0, 0.7, SIZE);
    let first = drawn(&mut scene, &mut renderer, &camera, look(5));
    let draws = || scene.draws(VIEW).map(|(instance, cut)| (instance.placement, &cut.draw)).collect::<Vec<_>>();
    for samples in [0, MOST_SAMPLES + 1] {
        let refused = renderer.draw(&Frame { camera, look: look(samples), draws: draws() });
        assert_eq!(refused, Err(RenderError::Samples(samples)));
    }
    // Broken off, what is shown is the picture before.
    let interrupt = Interrupt::default();
    interrupt.set();
    let other = Frame { camera: Camera { eye: camera.eye + camera.right, ..camera }, look: look(17), draws: draws() };
    assert_eq!(renderer.draw_interruptible(&other, &interrupt), Ok(false));
    let again = renderer.picture(&Frame { camera, look: look(5), draws: draws() }).unwrap();
    assert!(again.rgba == first.rgba, "the same picture");
    assert!(renderer.redraw().unwrap(), "it lies there still");
    let (with, _) = (renderer.gpu_bytes(), renderer.draw(&Frame { camera, look: look(1), draws: draws() }).unwrap());
    assert_eq!(with - renderer.gpu_bytes(), 8 * SIZE.pixels() as u64, "the sum is freed when it is not needed");
    // What is left for splats is less by that.
    let size = ImageSize { width: 1000, height: 700 };
    renderer.set_budget(Some(48 << 20));
    let [most, fewer] = [1, 5].map(|samples| renderer.most_splats(size, &look(samples)));
    assert!(fewer > 0 && fewer < most, "{fewer} and {most}");
    renderer.draw(&Frame { camera: Camera { size, ..camera }, look: look(5), draws: draws() }).unwrap();
    assert!(renderer.gpu_bytes() <= 48 << 20);
}
