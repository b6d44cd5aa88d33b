//! What the hybrid builder allocates, counted to the byte: `memory_bytes` bounds all of it, reader and output included.

mod budget;
mod counting;

use budget::fullest;
use gigalod::build::{NoProgress, Options, hybrid};
use gigalod_synth::{Order, StatueOptions, write_statue};
use std::fs::File;
use std::io::BufWriter;

#[test]
fn a_hybrid_build_allocates_no_more_than_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let (ply, out) = (folder.path().join("statue.ply"), folder.path().join("statue.glod"));
    let mut most = 0.0_f64;
    // Just so in memory, with 64 MiB; out of core, even with more threads than there is room for; and shuffled.
    let all = [
        (Order::Coherent, 280_000, &[(64, 2)][..]),
        (Order::Coherent, 320_000, &[(64, 16)]),
        (Order::Shuffled, 320_000, &[(64, 2)]),
    ];
    for (order, triangles, budgets) in all {
        let options = StatueOptions { triangles, seed: 5, colors: true, order };
        write_statue(options, &mut BufWriter::new(File::create(&ply).unwrap()), &mut |_, _| {}).unwrap();
        let build = |(), memory_bytes, threads| {
            let stream = gigalod::import::open(Box::new(File::open(&ply).unwrap())).unwrap();
            hybrid::build(stream, &Options { memory_bytes, threads, ..Options::default() }, &NoProgress, &out).unwrap();
        };
        most = most.max(fullest(&format!("{order:?}"), budgets, || (), build));
    }
    assert!(most > 0.4, "the counter counts");
}
