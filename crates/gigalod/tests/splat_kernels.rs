//! Kernels: their shapes, that every way of drawing shows the same, what ellipses leave open, and which of them flicker.

mod common;

use common::{SIZE, built, draw, mesh, renderer, scan, scene, twelve_directions};
use gigalod::geom::camera::UpAxis;
use gigalod::geom::quantise::normal;
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Frame, Gpu, GpuLevel, Kernel, Lighting, Look, Picture, Renderer};
use gigalod::runtime::splats::{MATERIAL_SRGB, SplatList, SplatPiece};
use gigalod::runtime::{DrawSource, Fineness, Similarity, SplatBall, ViewId};
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::{supersampled_coverage, supersampled_picture};
use gigalod_reference::{Bvh, Shading, Truth};
use glam::{DQuat, DVec3, Vec3};

const WHITE: u32 = 0xffff;

fn same(a: &Picture, b: &Picture) -> bool {
    a.rgba == b.rgba && a.depth == b.depth && a.footprint_px == b.footprint_px
}

fn list(splats: impl IntoIterator<Item = (SplatBall, Vec3, u32)>) -> DrawSource {
    let mut piece = SplatPiece::default();
    for (ball, facing, color) in splats {
        piece.push(ball, u32::from(normal::encode(facing)) | color << 16);
    }
    DrawSource::Splats(SplatList { pieces: vec![piece] })
}

/// At the origin, looking along -z; a unit of length one unit away has 200 pixels.
fn small_camera() -> Camera {
    let size = ImageSize { width: 200, height: 200 };
    Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 2.0 * 0.5f64.atan(), size)
}

fn picture(renderer: &mut Renderer, camera: &Camera, kernel: Kernel, draws: &[(Similarity, &DrawSource)]) -> Picture {
    let lighting = Lighting { background: [0; 3], ..Lighting::default() };
    let look = Look { kernel, lighting, ..Look::default() };
    renderer.picture(&Frame { camera: *camera, look, draws: draws.to_vec() }).unwrap()
}

/// A ball 60 pixels across, its normal tilted by 60° towards the upper right: half as wide along the diagonal.
#[test]
fn shapes_are_as_the_paper_says() {
    let Some(mut renderer) = renderer() else { return };
    let camera = small_camera();
    let ball = SplatBall { center_in_eye: [0.0, 0.0, -1.0], radius: 0.148_34 };
    let tilted = Vec3::new(0.612_37, 0.612_37, 0.5);
    let mut areas = Vec::new();
    for kernel in Kernel::ALL {
        let splat = list([(ball, tilted, WHITE)]);
        let shown = picture(&mut renderer, &camera, kernel, &[(Similarity::IDENTITY, &splat)]);
        let covered = |x: usize, y: usize| shown.depth[y * 200 + x].is_finite();
        let area = shown.depth.iter().filter(|depth| depth.is_finite()).count();
        println!("{kernel:?}: {area} pixels");
        // Pressed together along the normal's diagonal (up is a smaller row), as wide as ever across it.
        let along = (0..100).filter(|at| covered(100 + at, 99 - at)).count();
        let across = (0..100).filter(|at| covered(100 + at, 100 + at)).count();
        let expected = match (kernel.is_elliptical(), kernel) {
            (true, Kernel::SquareEllipse) => [15, 30],
            (true, _) => [11, 21],
            (false, Kernel::Square) => [30, 30],
            (false, _) => [21, 21],
        };
        for (found, expected) in [along, across].into_iter().zip(expected) {
            assert!(found.abs_diff(expected) <= 1, "{kernel:?}: {along} {across}, expected {expected:?}");
        }
        areas.push(area as f64);
        // Facing the eye, an ellipse is a circle.
        if kernel.is_elliptical() {
            let facing = list([(ball, Vec3::Z, WHITE)]);
            let circle = picture(&mut renderer, &camera, kernel, &[(Similarity::IDENTITY, &facing)]);
            let area = circle.depth.iter().filter(|depth| depth.is_finite()).count() as f64;
            let round = areas[areas.len() - 1 - 3];
            assert!((area / round - 1.0).abs() < 0.02, "{kernel:?}: {area} {round}");
        }
    }
    let radius_px = 30.0;
    for (kernel, expected) in [4.0, std::f64::consts::PI, std::f64::consts::PI].into_iter().enumerate() {
        let expected = expected * radius_px * radius_px;
        assert!((areas[kernel] / expected - 1.0).abs() < 0.02, "{kernel} {areas:?}");
        assert!((areas[kernel + 3] / expected - 0.5).abs() < 0.02, "{kernel} {areas:?}");
    }
}

#[test]
fn a_gaussian_is_half_opaque_on_the_silhouette_and_ends_at_twice_that() {
    let Some(mut renderer) = renderer() else { return };
    let ball = SplatBall { center_in_eye: [0.0, 0.0, -1.0], radius: 0.148_34 };
    let splat = list([(ball, Vec3::Z, WHITE)]);
    let shown = picture(&mut renderer, &small_camera(), Kernel::Gauss, &[(Similarity::IDENTITY, &splat)]);
    let linear = |x: usize| {
        let encoded = f64::from(shown.rgba[(100 * 200 + x) * 4]) / 255.0;
        if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
    };
    let middle = linear(100);
    assert!(middle > 0.5, "{middle}");
    // Pixels' centres lie half a pixel to the right of the middle.
    assert!((linear(129) / middle - 0.5).abs() < 0.03, "{}", linear(129) / middle);
    assert!((linear(114) / middle - 0.844).abs() < 0.03, "{}", linear(114) / middle);
    assert!(linear(157) > 0.0 && linear(161) == 0.0, "{} {}", linear(157), linear(161));
}

#[test]
fn small_or_large_in_one_phase_or_two_splats_show_the_same() {
    let (Some(path), Some(mut native)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(&path, folder.path()));
    let mut baseline = Renderer::new(Gpu::open_at(GpuLevel::WebGpu).unwrap()).unwrap();
    let mut without_storage = Renderer::new(Gpu::open_at(GpuLevel::WebGl).unwrap()).unwrap();
    assert_eq!(baseline.gpu().level(), GpuLevel::WebGpu);
    assert!(!baseline.gpu().has_wide_keys());
    let bounds = scene.bounds();
    for (zoom, threshold_px) in [(1.0, 1.0), (3.0, 20.0), (30.0, 1.0)] {
        let camera = Camera::orbit(&bounds, UpAxis::Y, [30.0, 20.0], zoom, 40f64.to_radians(), SIZE);
        for kernel in Kernel::ALL {
            let (_, expected) = draw(&mut scene, &mut native, &camera, threshold_px, kernel);
            assert!(expected.depth.iter().filter(|depth| depth.is_finite()).count() > 1000);
            for extent in [0, 3, 60] {
                native.set_compute_extent(extent);
                let (_, drawn) = draw(&mut scene, &mut native, &camera, threshold_px, kernel);
                assert!(same(&drawn, &expected), "{kernel:?} at zoom {zoom}, compute up to {extent} px");
                baseline.set_compute_extent(extent);
                let (_, drawn) = draw(&mut scene, &mut baseline, &camera, threshold_px, kernel);
                assert!(same(&drawn, &expected), "{kernel:?} at zoom {zoom}, 32 bits, compute up to {extent} px");
            }
            native.set_compute_extent(16);
            if kernel.is_gauss() {
                continue;
            }
            // By the depth test: the same but where two are equally near after rounding.
            let (_, drawn) = draw(&mut scene, &mut without_storage, &camera, threshold_px, kernel);
            let differing = std::iter::zip(&drawn.depth, &expected.depth)
                .filter(|(a, b)| a != b && (*a - *b).abs() > **a * f32::EPSILON)
                .count();
            assert_eq!(differing, 0, "{kernel:?} at zoom {zoom}, by the depth test");
            let other = std::iter::zip(drawn.rgba.as_chunks::<4>().0, expected.rgba.as_chunks::<4>().0);
            assert!(other.filter(|(a, b)| a != b).count() * 500 < SIZE.pixels(), "{kernel:?} at zoom {zoom}");
        }
    }
}

/// Hundreds of splats over each pixel, many of them equally near, so that a few are drawn before the others where that pays.
#[test]
fn many_splats_over_each_other_show_the_nearest_whichever_are_drawn_first() {
    let Some(mut native) = renderer() else { return };
    let mut baseline = Renderer::new(Gpu::open_at(GpuLevel::WebGpu).unwrap()).unwrap();
    let mut state = 1u64;
    let mut random = |most: u32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32 % most
    };
    // A grid, so that there are splats in one and the same place, of another colour.
    let splats: Vec<_> = (0..40_000)
        .map(|_| {
            let [x, y, z] = [random(80), random(80), random(4)].map(|at| at as f32);
            let center_in_eye = [x * 0.0125 - 0.5, y * 0.0125 - 0.5, -1.0 - z * 0.05];
            (SplatBall { center_in_eye, radius: 0.02 + random(3) as f32 * 0.01 }, Vec3::Z, random(0x1_0000))
        })
        .collect();
    let source = list(splats.iter().copied());
    let draws = [(Similarity::IDENTITY, &source)];
    let camera = small_camera();
    for kernel in Kernel::ALL.into_iter().filter(|kernel| !kernel.is_gauss()) {
        let shown = picture(&mut native, &camera, kernel, &draws);
        let expected = picture(&mut baseline, &camera, kernel, &draws);
        assert!(same(&shown, &expected), "{kernel:?}: with keys of 32 bits");
        // What the first rounds found is forgotten with the next frame.
        let few = list(splats[..2000].iter().copied());
        let few = [(Similarity::IDENTITY, &few)];
        let [shown, expected] = [&mut native, &mut baseline].map(|renderer| picture(renderer, &camera, kernel, &few));
        assert!(same(&shown, &expected), "{kernel:?}: fewer");
    }
    // By what it is: the nearest front of all balls whose silhouette covers the middle of a pixel, the first of equals.
    let shown = picture(&mut native, &camera, Kernel::Round, &draws);
    for pixel in [[100, 100], [37, 141], [3, 7]] {
        let ray = camera.ray_through(glam::DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + 0.5);
        let depths = splats.iter().filter_map(|(ball, ..)| {
            let (center, radius) = (Vec3::from(ball.center_in_eye).as_dvec3(), f64::from(ball.radius));
            let along = ray.dot(center) / ray.length_squared();
            let apart = (center - ray * along).length_squared();
            (apart <= radius * radius).then(|| along - ((radius * radius - apart) / ray.length_squared()).sqrt())
        });
        let nearest = depths.fold(f64::INFINITY, f64::min);
        let drawn = f64::from(shown.depth[pixel[1] as usize * 200 + pixel[0] as usize]);
        // A splat is drawn a hundredth of a pixel larger than its ball, and there it has the depth of the ball's middle.
        assert!((drawn / nearest - 1.0).abs() < 1e-3, "{pixel:?}: {drawn} {nearest}");
    }
}

/// Of several instances each pixel shows the nearest: what drawing them one by one and comparing depths shows.
#[test]
fn turned_instances_and_lists_of_many_buffers_hide_each_other() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = built(&path, folder.path());
    let bounds = scene(file.clone()).bounds();
    let camera = Camera::orbit(&bounds, UpAxis::Y, [0.0, 10.0], 1.0, 40f64.to_radians(), SIZE);
    let size = bounds.diagonal();
    let center = bounds.center();
    let placements = [([0.0, 0.0, 0.0], 0.0, 1.0), ([0.1, 0.0, 0.05], 1.9, 0.7), ([-0.15, 0.1, -0.1], 4.0, 1.3)].map(
        |(offset, angle, scale)| {
            let rotation = DQuat::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), angle);
            let offset: DVec3 = DVec3::from_array(offset) * size;
            Similarity { position: center + offset - rotation * (center * scale), rotation, scale }
        },
    );
    let draws: Vec<(Similarity, DrawSource)> = placements
        .map(|placement| {
            let mut residency = gigalod::runtime::Residency::new(
                1 << 30,
                Box::new(gigalod::runtime::residency::InlineLoader::default()),
            );
            let file = residency.add(file.clone());
            let mut scene = gigalod::runtime::Scene::new(residency);
            scene.add(gigalod::runtime::Instance { file, placement });
            scene.select_converged(ViewId(0), &camera, &Fineness::px(1.0));
            let mut drawn = scene.draws(ViewId(0)).map(|(_, selection)| selection.draw.clone());
            (placement, drawn.next().unwrap())
        })
        .into();
    for kernel in [Kernel::Square, Kernel::Round, Kernel::RoundEllipse] {
        let all: Vec<_> = draws.iter().map(|(placement, source)| (*placement, source)).collect();
        let together = picture(&mut renderer, &camera, kernel, &all);
        let apart: Vec<Picture> =
            all.iter().map(|one| picture(&mut renderer, &camera, kernel, std::slice::from_ref(one))).collect();
        let mut shown = [0; 3];
        for pixel in 0..SIZE.pixels() {
            let nearest = (0..3).min_by(|a, b| apart[*a].depth[pixel].total_cmp(&apart[*b].depth[pixel])).unwrap();
            let expected = &apart[nearest];
            assert_eq!(together.depth[pixel], expected.depth[pixel], "{kernel:?} {pixel}");
            assert_eq!(together.rgba[pixel * 4..][..4], expected.rgba[pixel * 4..][..4], "{kernel:?} {pixel}");
            shown[nearest] += usize::from(expected.depth[pixel].is_finite());
        }
        assert!(shown.into_iter().all(|pixels| pixels > 500), "{shown:?}");
    }
}

/// More splats than one binding holds on the software adapter: the last are drawn as the first are.
#[test]
fn nine_million_splats_are_drawn_from_several_buffers() {
    let Some(mut renderer) = renderer() else { return };
    let camera = small_camera();
    // A pixel each, over and over, all but the last few behind a wall of the first.
    let at = |x: i32, y: i32, z: f32, radius: f32| SplatBall {
        center_in_eye: [(x as f32 + 0.5) / 200.0 * z, (y as f32 + 0.5) / 200.0 * z, -z],
        radius: radius * z / 200.0,
    };
    let grid = |z: f32, from: i32| (from..100).flat_map(move |y| (-100..100).map(move |x| (x, y, z)));
    let wall: Vec<_> = grid(2.0, 0).collect();
    let mut piece = SplatPiece::default();
    let facing = u32::from(normal::encode(Vec3::Z));
    let mut number = 0;
    while piece.balls.len() < 9_000_000 {
        let (x, y, z) = wall[number % wall.len()];
        piece.push(at(x, y, z + 0.1 + number as f32 * 1e-7, 0.3), facing | 0x1111 << 16);
        number += 1;
    }
    for (x, y, z) in grid(2.0, 50) {
        piece.push(at(x, y, z, 0.3), facing | WHITE << 16);
    }
    let source = DrawSource::Splats(SplatList { pieces: vec![piece] });
    let shown = picture(&mut renderer, &camera, Kernel::Round, &[(Similarity::IDENTITY, &source)]);
    let pixel = |x: usize, y: usize| [shown.rgba[(y * 200 + x) * 4], shown.rgba[(y * 200 + x) * 4 + 1]];
    // Up is a smaller row: the last ones fill the upper quarter, the first the quarter below.
    let (last, first) = (pixel(77, 20), pixel(77, 80));
    assert!(last[0] > 200 && first[0] < 60 && shown.depth[150 * 200 + 77].is_infinite(), "{last:?} {first:?}");
    for (y, x) in (0..100).flat_map(|y| (0..200).map(move |x| (y, x))) {
        assert_eq!(pixel(x, y), if y < 50 { last } else { first }, "{x} {y}");
    }
}

#[test]
fn what_ellipses_leave_open_is_little() {
    let (Some(path), Some(mut renderer)) = (scan("dragon_vrip.ply.gz"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(&path, folder.path()));
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    for threshold_px in [1.0, 4.0, 12.0] {
        let (mut holes, mut judged) = ([0; 3], 0);
        for orbit_deg in twelve_directions().into_iter().step_by(4) {
            let camera = Camera::orbit(&mesh.bounds(), UpAxis::Y, orbit_deg, 1.0, 40f64.to_radians(), SIZE);
            let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
            let touched = supersampled_coverage(&bvh, &camera, 4);
            let kernels = [Kernel::SquareEllipse, Kernel::RoundEllipse, Kernel::GaussEllipse];
            for (kernel, holes) in kernels.into_iter().zip(&mut holes) {
                let (_, picture) = draw(&mut scene, &mut renderer, &camera, threshold_px, kernel);
                let drawn = Drawn { depth: &picture.depth, data_footprint_px: Some(&picture.footprint_px) };
                let verdict = judge(&truth, &touched, &drawn, f64::from(threshold_px));
                assert!(verdict.fat.is_empty(), "{kernel:?} is no larger than what it is pressed from");
                *holes += verdict.holes.len();
                judged += verdict.judged.count() / 3;
            }
        }
        println!("dragon at {threshold_px} px: {holes:?} holes (square, round, gauss) of {judged} pixels");
        // At a pixel a few in a hundred thousand, where a normal leans over a silhouette; beyond that a few in a thousand.
        let most = if threshold_px == 1.0 { judged / 10_000 } else { judged / 100 };
        assert!(holes.into_iter().all(|holes| holes <= most), "{holes:?} of {judged}");
    }
}

/// The camera glides sideways by a tenth of a pixel at a time. What changes beyond what changes in a picture of 16 samples a
/// pixel is shimmer.
#[test]
fn gaussians_flicker_least() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(&path, folder.path()));
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    let size = ImageSize { width: 160, height: 120 };
    let start = Camera::orbit(&mesh.bounds(), UpAxis::Y, [20.0, 10.0], 1.0, 40f64.to_radians(), size);
    let distance = (mesh.bounds().center() - start.eye).length();
    let step = start.right * (0.1 * distance / start.focal_px());
    let cameras: Vec<Camera> = (0..9).map(|at| Camera { eye: start.eye + step * f64::from(at), ..start }).collect();
    let light = start.shoulder_light();
    let lighting = Lighting { towards_light: Some(light), ..Lighting::default() };
    let shading = Shading { to_light: light, background_srgb: lighting.background, plain_albedo_srgb: MATERIAL_SRGB };
    let green = |pixels: &[[u8; 3]]| pixels.iter().map(|pixel| f64::from(pixel[1])).collect::<Vec<_>>();
    let truth: Vec<Vec<f64>> =
        cameras.iter().map(|camera| green(&supersampled_picture(&bvh, camera, &shading, 4).pixels)).collect();
    let shimmer = |frames: &[Vec<f64>]| {
        let change = |frames: &[Vec<f64>], at: usize, pixel: usize| frames[at + 1][pixel] - frames[at][pixel];
        let steps = (0..frames.len() - 1).flat_map(|at| (0..size.pixels()).map(move |pixel| (at, pixel)));
        let excess = steps.map(|(at, pixel)| change(frames, at, pixel) - change(&truth, at, pixel));
        (excess.map(|excess| excess * excess).sum::<f64>() / (size.pixels() * (frames.len() - 1)) as f64).sqrt()
    };
    let [square, round, gauss] = [Kernel::Square, Kernel::Round, Kernel::Gauss].map(|kernel| {
        let frames = cameras.iter().map(|camera| {
            scene.select_converged(ViewId(0), camera, &Fineness::px(1.0));
            let draws =
                scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
            let look = Look { kernel, lighting, ..Look::default() };
            let shown = renderer.picture(&Frame { camera: *camera, look, draws }).unwrap();
            green(&shown.rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>())
        });
        shimmer(&frames.collect::<Vec<_>>())
    });
    println!("shimmer of 255: {square:.2} (square), {round:.2} (round), {gauss:.2} (gauss)");
    assert!(gauss < 0.7 * round && gauss < 0.7 * square, "{square} {round} {gauss}");
}
