//! What the builder allocates, counted to the byte: `memory_bytes` bounds all of it, reader and output included.

mod budget;
mod counting;

use budget::fullest;
use gigalod::build::{NoProgress, Options, splats};
use gigalod_synth::{Order, StatueOptions, write_statue};
use std::fs::File;
use std::io::BufWriter;

#[test]
fn a_build_allocates_no_more_than_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let (ply, out) = (folder.path().join("statue.ply"), folder.path().join("statue.glod"));
    let mut most = 0.0_f64;
    for order in [Order::Coherent, Order::Shuffled] {
        let options = StatueOptions { triangles: 1_200_000, seed: 5, colors: true, order };
        write_statue(options, &mut BufWriter::new(File::create(&ply).unwrap()), &mut |_, _| {}).unwrap();
        let build = |(), memory_bytes, threads| {
            let stream = gigalod::import::open(Box::new(File::open(&ply).unwrap())).unwrap();
            splats::build(stream, &Options { memory_bytes, threads, ..Options::default() }, &NoProgress, &out).unwrap();
        };
        // Out of core, even with more threads than there is room for; just so in memory; and easily.
        let budgets = [(64, 2), (64, 16), (96, 2), (256, 16)];
        most = most.max(fullest(&format!("{order:?}"), &budgets, || (), build));
    }
    assert!(most > 0.4, "the counter counts");
}
