//! What the runtime allocates while a camera flies, counted to the byte: the budget bounds pages, lists and what makes them.

mod counting;

use counting::peak_of;
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
const BESIDES: u64 = MIB / 2;

#[test]
fn a_flight_allocates_no_more_than_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let file = statue(&folder.path().join("statue.glod"), 3_000_000);
    for budget in [MIB, 4 * MIB, 12 * MIB] {
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

/// A statue, built.
fn statue(out: &Path, triangles: u64) -> Arc<SplatFile> {
    let mut ply = Vec::new();
    let options = StatueOptions { triangles, seed: 5, colors: true, order: Order::Coherent };
    write_statue(options, &mut ply, &mut |_, _| {}).unwrap();
    let stream = gigalod::import::open(Box::new(Cursor::new(ply))).unwrap();
    splats::build(stream, &Options::default(), &NoProgress, out).unwrap();
    Arc::new(SplatFile::open(Container::open(Arc::new(FileStore::open(out).unwrap())).unwrap()).unwrap())
}
