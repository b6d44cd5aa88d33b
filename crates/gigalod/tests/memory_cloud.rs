//! What the builder allocates for a point cloud, counted to the byte: `memory_bytes` bounds all of it, as for meshes.

mod budget;
mod clouds;
mod counting;

use budget::fullest;
use gigalod::build::{NoProgress, Options, splats};
use gigalod_synth::{Order, StatueOptions, write_statue};
use std::fs::File;
use std::io::BufWriter;

#[test]
fn a_build_of_a_point_cloud_allocates_no_more_than_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, ply, out) = (folder.path().join("mesh.ply"), folder.path().join("a.ply"), folder.path().join("a.glod"));
    let options = StatueOptions { triangles: 1_500_000, seed: 5, colors: true, order: Order::Coherent };
    write_statue(options, &mut BufWriter::new(File::create(&mesh).unwrap()), &mut |_, _| {}).unwrap();
    let mut points = clouds::vertices(&mesh);
    let mut most = 0.0_f64;
    for order in ["coherent", "shuffled", "with normals"] {
        if order == "shuffled" {
            points = clouds::shuffled(&points);
        }
        if order == "with normals" {
            points.normals = vec![glam::Vec3::Y; points.positions.len()];
        }
        std::fs::write(&ply, clouds::ply(&points)).unwrap();
        let build = |(), memory_bytes, threads| {
            let stream = gigalod::import::open(Box::new(File::open(&ply).unwrap())).unwrap();
            splats::build(stream, &Options { memory_bytes, threads, ..Options::default() }, &NoProgress, &out).unwrap();
        };
        // Out of core, even with more threads than there is room for; just so in memory; and easily.
        let budgets = [(64, 2), (64, 16), (148, 2), (256, 16)];
        most = most.max(fullest(order, &budgets, || (), build));
    }
    assert!(most > 0.4, "the counter counts");
}
