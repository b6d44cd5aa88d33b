//! What the runtime allocates while a camera flies, counted to the byte: the budget bounds decoded pages; lists of splats depend
//! on what is drawn; and what else there is on neither.

mod counting;

use counting::peak_of;
use gigalod::build::{NoProgress, Options, splats};
use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::runtime::residency::{InlineLoader, Loader, ThreadedLoader};
use gigalod::runtime::{Instance, Residency, Scene, Similarity, SplatList, ViewId};
use gigalod_synth::{Order, PathKind, PathOptions, StatueOptions, camera_path, write_statue};
use std::io::Cursor;
use std::sync::Arc;

const MIB: u64 = 1 << 20;

/// Pages on their way from the file, requests, and the rest.
const BESIDES: u64 = MIB;

/// For each splat of the fullest frame: its 20 bytes, and as many again twice while the list grows.
const LIST_BYTES: u64 = 3 * SplatList::SPLAT_BYTES;

#[test]
fn a_flight_allocates_no_more_than_its_budget_and_its_lists() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("statue.glod");
    {
        let mut ply = Vec::new();
        let options = StatueOptions { triangles: 3_000_000, seed: 5, colors: true, order: Order::Coherent };
        write_statue(options, &mut ply, &mut |_, _| {}).unwrap();
        let stream = gigalod::import::open(Box::new(Cursor::new(ply))).unwrap();
        splats::build(stream, &Options::default(), &NoProgress, &out).unwrap();
    }
    let file = Arc::new(SplatFile::open(Container::open(Arc::new(FileStore::open(&out).unwrap())).unwrap()).unwrap());
    for budget in [MIB, 4 * MIB, 12 * MIB] {
        for threads in [0, 3] {
            let ((fullest, drawn), peak) = peak_of(|| fly(&file, budget, threads));
            let [mib, pages, all] = [budget / MIB, fullest / 1024, peak as u64 / 1024];
            println!("{mib} MiB: {pages} KiB of pages, {all} KiB in all, {drawn} splats at most");
            assert!(
                peak as u64 <= budget + drawn * LIST_BYTES + BESIDES,
                "{peak} bytes, {budget} for pages, {drawn} splats"
            );
            assert!(fullest > budget / 2, "the flight wants more than there is room for: {fullest} of {budget}");
        }
    }
}

/// Flies all paths. Returns the most that pages took, and the most splats drawn.
fn fly(file: &Arc<SplatFile>, budget: u64, threads: usize) -> (u64, u64) {
    let loader: Box<dyn Loader> =
        if threads == 0 { Box::<InlineLoader>::default() } else { Box::new(ThreadedLoader::new(threads).unwrap()) };
    let mut residency = Residency::new(budget, loader);
    let id = residency.add(file.clone());
    let mut scene = Scene::new(residency);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });
    let root = file.skeleton().root();
    let (mut fullest, mut drawn) = (0, 0);
    for kind in [PathKind::Approach, PathKind::SuddenTurn] {
        let path = camera_path(kind, &root.bounds, root.up, PathOptions { seconds: 1.0, seed: 1 });
        for pose in &path.frames {
            let size = ImageSize { width: 320, height: 180 };
            let camera = Camera::look_at(pose.eye, pose.target, path.up, path.fov_deg.to_radians(), size);
            let report = scene.select(ViewId(0), &camera, 1.0);
            scene.serve();
            // A camera slower than the loaders; with one that is faster no more is allocated.
            for _ in 0..4 {
                scene.residency_mut().receive(true);
            }
            fullest = fullest.max(scene.residency().resident_bytes());
            drawn = drawn.max(report.drawn);
        }
    }
    (fullest, drawn)
}
