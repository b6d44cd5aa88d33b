//! What is asked for gets coarser bit by bit, and nothing else changes: where levels fade into each other no picture differs much from the
//! one before; where they do not, some do.

mod common;

use common::{built_hybrid, renderer, scan, scene};
use gigalod::geom::camera::UpAxis;
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Frame, Look, Renderer};
use gigalod::runtime::{Fineness, Scene, ViewId};

const SIZE: ImageSize = ImageSize { width: 320, height: 240 };
const STEPS: i32 = 48;
/// So coarse that a pop is seen.
const FIRST_PX: f32 = 3.0;
/// As a camera that comes nearer by a hundredth does.
const STEP: f32 = 1.01;

/// Mean differences of pictures to the one before, of 255.
fn differences(scene: &mut Scene, renderer: &mut Renderer) -> Vec<f64> {
    let camera = Camera::orbit(&scene.bounds(), UpAxis::Y, [20.0, 5.0], 1.0, 40f64.to_radians(), SIZE);
    let mut pictures = (0..STEPS).map(|step| {
        scene.select_converged(ViewId(0), &camera, &Fineness::px(FIRST_PX * STEP.powi(step)));
        let draws = scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
        let look = Look { samples: 4, ..Look::default() };
        renderer.picture(&Frame { camera, look, draws }).unwrap().rgba
    });
    let mut before = pictures.next().unwrap();
    let difference = |picture: Vec<u8>| {
        let sum: u64 = before.iter().zip(&picture).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        before = picture;
        sum as f64 / f64::from(SIZE.width * SIZE.height * 3)
    };
    pictures.map(difference).collect()
}

#[test]
fn nothing_pops_where_levels_fade() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built_hybrid(&path, folder.path()));
    let [pops, fades] = [false, true].map(|fades| {
        scene.set_cross_fade(fades);
        let all = differences(&mut scene, &mut renderer);
        let (largest, still) = (all.iter().copied().fold(0.0, f64::max), all.iter().filter(|by| **by == 0.0).count());
        println!(
            "cross-fade {fades}: largest step {largest:.3}, {still} without a change, {:.3} in all",
            all.iter().sum::<f64>()
        );
        largest
    });
    assert!(pops > 0.1 && fades < 0.5 * pops, "{pops} {fades}");
}
