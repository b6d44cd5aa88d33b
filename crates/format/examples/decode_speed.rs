//! How many nodes a second one thread decodes: `cargo run --release -p gigalod-format --example decode_speed -- FILE.glod`.
//!
//! Checksums and reading included, the best of 7; prints one JSON object.

use gigalod_format::splats::{PageId, SplatFile};
use gigalod_format::{Container, FileStore};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: decode_speed FILE.glod")?;
    let file = SplatFile::open(Container::open(Arc::new(FileStore::open(Path::new(&path))?))?)?;
    let pages = file.skeleton().pages().len() as u32;
    let mut best = f64::INFINITY;
    for _ in 0..7 {
        let begun = Instant::now();
        for page in 0..pages {
            std::hint::black_box(file.read_page(PageId(page))?);
        }
        best = best.min(begun.elapsed().as_secs_f64());
    }
    let nodes = file.skeleton().root().nodes as f64;
    println!("{{\"m_nodes_per_second\":{:.2}}}", nodes / best / 1e6);
    Ok(())
}
