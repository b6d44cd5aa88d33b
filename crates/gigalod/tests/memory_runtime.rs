//! What the runtime allocates while a camera flies, counted to the byte: the budget bounds pages, lists and what makes them; a warm
//! frame allocates nothing.

mod counting;

use counting::{allocations, peak_of};
use gigalod::build::{NoProgress, Options, splats};
use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::runtime::residency::{InlineLoader, Loader, ThreadedLoader};
use gigalod::runtime::{Fineness, Instance, Interrupt, Limit, Residency, Scene, Similarity, ViewId};
use gigalod_synth::{Order, PathKind, PathOptions, StatueOptions, camera_path, write_statue};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

const MIB: u64 = 1 << 20;

/// Pages that are being decoded, queues, names of threads, and the rest.
const BESIDES: u64 = MIB;

#[test]
fn a_flight_allocates_no_more_than_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let file = statue(&folder.path().join("statue.glod"), 3_000_000);
    for budget in [MIB, 4 * MIB, 16 * MIB] {
        for threads in [0, 3] {
            for interruptible in [false, true] {
                let (flight, peak) = peak_of(|| fly(&file, budget, threads, interruptible));
                let [mib, pages, all] = [budget / MIB, flight.most_page_bytes / 1024, peak as u64 / 1024];
                println!("{mib} MiB: {pages} KiB of pages, {all} KiB in all, {flight:?}");
                assert!(peak as u64 <= budget + BESIDES, "{peak} bytes, {budget} allowed");
                assert!(flight.most_bytes <= budget, "{flight:?}");
                assert!(flight.most_bytes > budget / 8 * 7, "the flight wants more than there is room for: {flight:?}");
                assert!(flight.limited > 0, "{flight:?}");
            }
        }
    }
}

/// What was seen of a flight.
#[derive(Debug, Default)]
struct Flight {
    most_page_bytes: u64,
    /// As the scene counts them.
    most_bytes: u64,
    most_splats: u64,
    /// Frames coarser than asked for, for want of memory.
    limited: u64,
}

/// Flies all paths.
fn fly(file: &Arc<SplatFile>, budget: u64, threads: usize, interruptible: bool) -> Flight {
    let loader: Box<dyn Loader> =
        if threads == 0 { Box::<InlineLoader>::default() } else { Box::new(ThreadedLoader::new(threads).unwrap()) };
    let mut residency = Residency::new(budget, loader);
    let id = residency.add(file.clone());
    let mut scene = Scene::new(residency);
    scene.set_cpu_budget(budget);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });
    let root = file.skeleton().root();
    let mut flight = Flight::default();
    let (fineness, interrupt) = (Fineness::px(1.0), Interrupt::default());
    for kind in [PathKind::Approach, PathKind::SuddenTurn] {
        let path = camera_path(kind, &root.bounds, root.up, PathOptions { seconds: 1.0, seed: 1 });
        for pose in &path.frames {
            let size = ImageSize { width: 320, height: 180 };
            let camera = Camera::look_at(pose.eye, pose.target, path.up, path.fov_deg.to_radians(), size);
            let report = if interruptible {
                scene.select_interruptible(ViewId(0), &camera, &fineness, &interrupt).expect("nobody interrupts")
            } else {
                scene.select(ViewId(0), &camera, &fineness)
            };
            scene.serve();
            // A camera slower than the loaders; with one that is faster no more is allocated.
            for _ in 0..4 {
                scene.residency_mut().receive(true);
            }
            flight.most_page_bytes = flight.most_page_bytes.max(scene.residency().resident_bytes());
            flight.most_bytes = flight.most_bytes.max(scene.cpu_bytes());
            flight.most_splats = flight.most_splats.max(report.drawn);
            flight.limited += u64::from(report.limited_by >= Some(Limit::Residency));
        }
    }
    flight
}

#[test]
fn a_warm_frame_allocates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = statue(&folder.path().join("statue.glod"), 400_000);
    let looks = [
        (Fineness::px(0.0), u64::MAX, 1),
        (Fineness::px(0.0), u64::MAX, 2),
        (Fineness::px(1.0), u64::MAX, 2),
        (Fineness { threshold_px: 0.5, most_splats: 20_000 }, u64::MAX, 2),
        // Too little for all pages and lists: what is missing is asked for in vain, frame after frame.
        (Fineness::px(0.5), 2 * MIB, 2),
    ];
    for (fineness, budget, threads) in looks {
        for interruptible in [false, true] {
            let ((), _) = peak_of(|| {
                let mut residency = Residency::new(budget.min(1 << 30), Box::<InlineLoader>::default());
                let id = residency.add(file.clone());
                let mut scene = Scene::new(residency);
                scene.splats_mut().set_threads(threads);
                scene.set_cpu_budget(budget);
                scene.add(Instance { file: id, placement: Similarity::IDENTITY });
                let (bounds, up) = (scene.bounds(), file.skeleton().root().up);
                let size = ImageSize { width: 640, height: 480 };
                let camera =
                    |turn: u32| Camera::orbit(&bounds, up, [30.0 + 0.01 * f64::from(turn), 10.0], 1.5, 0.7, size);
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
                assert_eq!(
                    allocated, 0,
                    "{fineness:?}, {budget} bytes, {threads} threads, interruptible: {interruptible}"
                );
            });
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
