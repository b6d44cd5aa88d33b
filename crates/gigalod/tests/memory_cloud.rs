//! What the builder allocates for a point cloud, counted to the byte: `memory_bytes` bounds all of it, as for meshes.

mod clouds;
mod counting;

use counting::peak_of;
use gigalod::build::{NoProgress, Options, splats};
use gigalod_synth::{Order, StatueOptions, write_statue};
use std::fs::File;
use std::io::BufWriter;

#[test]
fn a_build_of_a_point_cloud_allocates_no_more_than_its_budget() {
    const MIB: u64 = 1 << 20;
    let folder = tempfile::tempdir().unwrap();
    let (mesh, ply, out) = (folder.path().join("mesh.ply"), folder.path().join("a.ply"), folder.path().join("a.glod"));
    let options = StatueOptions { triangles: 1_500_000, seed: 5, colors: true, order: Order::Coherent };
    write_statue(options, &mut BufWriter::new(File::create(&mesh).unwrap()), &mut |_, _| {}).unwrap();
    let mut points = clouds::vertices(&mesh);
    let mut fullest = 0.0_f64;
    for order in ["coherent", "shuffled", "with normals"] {
        if order == "shuffled" {
            points = clouds::shuffled(&points);
        }
        if order == "with normals" {
            points.normals = vec![glam::Vec3::Y; points.positions.len()];
        }
        std::fs::write(&ply, clouds::ply(&points)).unwrap();
        let mut build = |memory_bytes, threads| {
            let options = Options { memory_bytes, threads, ..Options::default() };
            let ((), peak) = peak_of(|| {
                let stream = gigalod::import::open(Box::new(File::open(&ply).unwrap())).unwrap();
                splats::build(stream, &options, &NoProgress, &out).unwrap();
            });
            let share = peak as f64 / memory_bytes as f64;
            println!("{order}, {} MiB, {threads} threads: {:.0} % allocated", memory_bytes / MIB, share * 100.0);
            assert!(share <= 1.0, "{order}: {peak} bytes allocated of {memory_bytes}, {threads} threads");
            fullest = fullest.max(share);
        };
        // Out of core, even with more threads than there is room for; just so in memory; and easily.
        build(64 * MIB, 2);
        build(64 * MIB, 16);
        build(148 * MIB, 2);
        build(256 * MIB, 16);
    }
    assert!(fullest > 0.4, "the counter counts");
}
