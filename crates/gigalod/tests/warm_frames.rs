//! A warm frame allocates nothing: everything that the camera wants is resident, and it moves a little from frame to frame.
//!
//! One test a file: the counter counts what all threads of the program do.

mod counting;

use counting::allocations;
use gigalod::build::{NoProgress, Options, splats};
use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::runtime::residency::InlineLoader;
use gigalod::runtime::{Fineness, Instance, Interrupt, Residency, Scene, Similarity, ViewId};
use gigalod_synth::{Order, StatueOptions, write_statue};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

const MIB: u64 = 1 << 20;

#[test]
fn a_warm_frame_allocates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = statue(&folder.path().join("statue.glod"), 400_000);
    let looks = [
        (Fineness::px(0.0), u64::MAX, 1),
        (Fineness::px(0.0), u64::MAX, 2),
        (Fineness::px(1.0), u64::MAX, 2),
        (Fineness { most_splats: 20_000, ..Fineness::px(0.5) }, u64::MAX, 2),
        // Too little for all pages and lists: what is missing is asked for in vain, frame after frame.
        (Fineness::px(0.5), 2 * MIB, 2),
    ];
    for (fineness, budget, threads) in looks {
        for interruptible in [false, true] {
            let mut residency = Residency::new(budget.min(1 << 30), Box::<InlineLoader>::default());
            let id = residency.add(file.clone());
            let mut scene = Scene::new(residency);
            scene.splats_mut().set_threads(threads);
            scene.set_cpu_budget(budget);
            scene.add(Instance { file: id, placement: Similarity::IDENTITY });
            let (bounds, up) = (scene.bounds(), file.skeleton().root().up);
            let size = ImageSize { width: 640, height: 480 };
            let camera = |turn: u32| Camera::orbit(&bounds, up, [30.0 + 0.01 * f64::from(turn), 10.0], 1.5, 0.7, size);
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
            assert_eq!(allocated, 0, "{fineness:?}, {budget} bytes, {threads} threads, interruptible: {interruptible}");
        }
    }
}

/// A statue, built.
fn statue(out: &Path, triangles: u64) -> Arc<SplatFile> {
    let mut ply = Vec::new();
    let options = StatueOptions { triangles, seed: 5, colors: true, order: Order::Coherent };
    write_statue(options, &mut ply, &mut |_, _| {}).unwrap();
    let stream = gigalod::import::open(Box::new(Cursor::new(ply))).unwrap();
    splats::build(stream, &Options::default(), &NoProgress, out).unwrap();
    Arc::new(SplatFile::open(Container::open(Arc::new(FileStore::open(out).unwrap())).unwrap()).unwrap())
}
