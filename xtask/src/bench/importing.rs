//! Importing: how fast files of each format are read.

use super::{Bench, Scope, data};
use crate::figures::{Row, at_least, plain};
use crate::program::number;
use anyhow::Result;
use serde_json::Value;

/// What a format is to reach: a key of the example's report, in millions.
const TARGETS: [(&str, &str, f64, &str); 3] = [
    ("PLY, binary", "mb_per_cpu_s", 300.0, "MB a CPU-second"),
    ("OBJ", "mb_per_cpu_s", 80.0, "MB a CPU-second"),
    ("LAZ", "vertices_per_cpu_s", 3e6, "points a CPU-second"),
];

pub(super) fn rows(bench: &Bench, _: Scope<'_>, rows: &mut Vec<Row>) -> Result<()> {
    let mut files = vec![("PLY, binary", bench.statue7()?.to_owned())];
    let real = [
        ("PLY, text, in gzip", "scans/dragon_vrip.ply.gz"),
        ("PLY, text", "scans/bun_zipper.ply"),
        ("OBJ", "city/railway_lod3_obj/railway_lod3.obj"),
        ("LAS", "points/autzen_trim.las"),
        ("LAZ", "points/autzen_crop.laz"),
        ("LAZ", "points/lion_takanawa.copc.laz"),
    ];
    files.extend(
        real.into_iter().filter_map(|(format, name)| Some((format, data(name)?.to_string_lossy().into_owned()))),
    );
    if let Some(scan) = data("scans/dragon_vrip.ply.gz") {
        let made = bench.lines("gigalod-import", "import_files", &[&scan.to_string_lossy(), "."])?;
        let format_of = |path: &str| match path.rsplit(['/', '.']).next() {
            Some("stl") if path.contains("text") => "STL, text",
            Some("stl") => "STL, binary",
            Some("obj") => "OBJ",
            Some("off") => "OFF",
            Some("xyz") => "XYZ",
            Some("pcd") => "PCD, binary",
            _ => "E57",
        };
        files.extend(made.into_iter().map(|path| (format_of(&path), path)));
    }
    let paths: Vec<&str> = files.iter().map(|(_, path)| path.as_str()).collect();
    let reports = bench.lines("gigalod-import", "import_speed", &paths)?;
    for ((format, path), report) in files.iter().zip(reports) {
        let report: Value = serde_json::from_str(&report)?;
        let name = path.rsplit('/').next().unwrap_or(path);
        let figure = format!("read, {format} ({name})");
        let speed = |key: &str| number(&report, key);
        rows.push(match TARGETS.iter().find(|(of, ..)| of == format) {
            Some((_, key, target, unit)) if *target >= 1e6 => {
                at_least(figure, speed(key) / 1e6, target / 1e6, &format!("M {unit}"))
            }
            Some((_, key, target, unit)) => at_least(figure, speed(key), *target, unit),
            None => {
                let points = speed("vertices_per_cpu_s") / 1e6;
                plain(figure, format!("{:.0} MB, {points:.1} M vertices a CPU-second", speed("mb_per_cpu_s")))
            }
        });
    }
    Ok(())
}
