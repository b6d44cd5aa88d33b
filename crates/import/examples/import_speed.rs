//! How fast models are read: a line of JSON for each file.
//!
//! `cargo run --release -p gigalod-import --example import_speed -- FILE...` prints the file, megabytes of it per second of
//! processor time (user and system), vertices and triangles per second, and their numbers. The file is read once before, so
//! that it is in the system's cache where it fits, and then as often as fills two seconds.

use gigalod_import::{Batch, ByteSource, ImportError, open_with};
use std::fs::File;
use std::io;
use std::path::Path;

/// Seconds of processor time that this process has used.
fn cpu_s() -> io::Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    // Fields after the name, which is in brackets; ticks are hundredths of a second on Linux.
    let fields: Vec<_> = stat.rsplit(')').next().unwrap_or_default().split_ascii_whitespace().collect();
    let ticks = |field: usize| fields.get(field).and_then(|ticks| ticks.parse::<f64>().ok()).unwrap_or_default();
    Ok((ticks(11) + ticks(12)) / 100.0)
}

/// Vertices and triangles of a file.
fn read(path: &Path) -> Result<[usize; 2], Box<dyn std::error::Error>> {
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let side = move |name: &str| -> io::Result<Box<dyn ByteSource>> { Ok(Box::new(File::open(folder.join(name))?)) };
    let mut stream = open_with(Box::new(File::open(path)?), Box::new(side))?;
    let (mut batch, mut counts) = (Batch::default(), [0; 2]);
    while stream.next(&mut batch).map_err(|error: ImportError| error.to_string())? {
        counts[0] += batch.vertices.positions.len();
        counts[1] += batch.triangles.len();
    }
    Ok(counts)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for name in std::env::args().skip(1) {
        let path = Path::new(&name);
        let bytes = path.metadata()?.len();
        let [vertices, triangles] = read(path)?;
        let (start, mut runs) = (cpu_s()?, 0);
        while cpu_s()? < start + 2.0 {
            read(path)?;
            runs += 1;
        }
        let per_s = |amount: f64| (amount * f64::from(runs) / (cpu_s().unwrap_or(start) - start)).round();
        println!(
            "{{\"file\": {name:?}, \"mb_per_cpu_s\": {}, \"vertices_per_cpu_s\": {}, \"triangles_per_cpu_s\": {}, \
             \"vertices\": {vertices}, \"triangles\": {triangles}}}",
            per_s(bytes as f64 / 1e6),
            per_s(vertices as f64),
            per_s(triangles as f64),
        );
    }
    Ok(())
}
