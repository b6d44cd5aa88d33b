//! How much a second one thread decodes: nodes of splats, triangles of hybrid files.
//!
//! `cargo run --release -p gigalod-format --example decode_speed -- FILE.glod`. Checksums and reading included, the best of 7; prints one
//! JSON object.

use gigalod_format::hybrid::{HybridFile, NodeId};
use gigalod_format::splats::{PageId, SplatFile};
use gigalod_format::{Container, FileStore, FormatError, Kind};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: decode_speed FILE.glod")?;
    let container = Container::open(Arc::new(FileStore::open(Path::new(&path))?))?;
    let (what, count, seconds) = match container.kind() {
        Kind::Splats => {
            let file = SplatFile::open(container)?;
            let pages = file.skeleton().pages().len() as u32;
            let seconds =
                best_of_7(pages, |page| file.read_page(PageId(page)).map(|page| drop(std::hint::black_box(page))))?;
            ("nodes", file.skeleton().root().nodes, seconds)
        }
        Kind::Hybrid => {
            let file = HybridFile::open(container)?;
            let nodes = file.skeleton().nodes();
            let seconds = best_of_7(nodes.len() as u32, |node| {
                file.read_page(NodeId(node)).map(|page| drop(std::hint::black_box(page)))
            })?;
            ("triangles", nodes.iter().map(|node| u64::from(node.triangles)).sum(), seconds)
        }
        kind => return Err(format!("{}: expected splats or hybrid", kind.name()).into()),
    };
    println!("{{\"m_{what}_per_second\":{:.2}}}", count as f64 / seconds / 1e6);
    Ok(())
}

/// Seconds for all pages.
fn best_of_7(pages: u32, decode: impl Fn(u32) -> Result<(), FormatError>) -> Result<f64, FormatError> {
    let mut best = f64::INFINITY;
    for _ in 0..7 {
        let begun = Instant::now();
        (0..pages).try_for_each(&decode)?;
        best = best.min(begun.elapsed().as_secs_f64());
    }
    Ok(best)
}
