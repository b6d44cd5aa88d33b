//! A warm hybrid frame allocates nothing: everything that the camera wants is resident, and it moves a little from frame to frame.
//!
//! One test a file: the counter counts what all threads of the program do.

mod common;
#[path = "../../gigalod/tests/counting/mod.rs"]
mod counting;

use common::octree::Octree;
use counting::allocations;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::residency::InlineLoader;
use gigalod_runtime::{Fineness, Instance, Interrupt, Residency, Scene, Similarity, ViewId};

#[test]
fn a_warm_hybrid_frame_allocates_nothing() {
    let octree = Octree::sphere(6, true);
    let size = ImageSize { width: 640, height: 480 };
    let looks = [
        (Fineness::px(0.0), u64::MAX),
        (Fineness::px(0.5), u64::MAX),
        (Fineness { most_splats: 20_000, ..Fineness::px(0.1) }, u64::MAX),
        // Too little for all pages and lists: what is missing is asked for in vain, frame after frame.
        (Fineness::px(0.1), 1 << 20),
    ];
    for (fineness, budget) in looks {
        for interruptible in [false, true] {
            let mut residency = Residency::new(budget.min(1 << 30), Box::<InlineLoader>::default());
            let id = residency.add(octree.file());
            let mut scene = Scene::new(residency);
            scene.set_cpu_budget(budget);
            scene.add(Instance { file: id, placement: Similarity::IDENTITY });
            let bounds = scene.bounds();
            let camera = |turn: u32| {
                let azimuth_deg = 30.0 + 0.01 * f64::from(turn);
                Camera::orbit(&bounds, UpAxis::Y, [azimuth_deg, 10.0], 1.5, 0.7, size)
            };
            let interrupt = Interrupt::default();
            let frame = |scene: &mut Scene, turn| {
                if interruptible {
                    scene.select_interruptible(ViewId(0), &camera(turn), &fineness, &interrupt).expect("nobody");
                } else {
                    scene.select(ViewId(0), &camera(turn), &fineness);
                }
                scene.serve();
            };
            // What the moving camera will want is there, as far as there is room.
            for turn in [20, 10, 0, 0] {
                scene.select_converged(ViewId(0), &camera(turn), &fineness);
                frame(&mut scene, turn);
                while scene.residency().is_loading() {
                    scene.residency_mut().receive(true);
                }
            }
            let before = allocations();
            for turn in 0..20 {
                frame(&mut scene, turn);
            }
            let allocated = allocations() - before;
            assert_eq!(allocated, 0, "{fineness:?}, {budget} bytes, interruptible: {interruptible}");
        }
    }
}
