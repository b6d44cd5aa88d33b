//! Hybrid: speed of building, size of files, what is measured of the errors they claim, and what is drawn.

use super::{Bench, Scope, data};
use crate::figures::{Row, at_least, at_most, plain};
use crate::program::number;
use anyhow::{Context, Result};
use serde_json::Value;
use std::path::Path;

/// A model: its name, its file, and whether all of its nodes are measured.
type Model = (&'static str, String, bool);

pub(super) fn rows(bench: &Bench, scope: Scope<'_>, rows: &mut Vec<Row>) -> Result<()> {
    let scan = |name, file| data(file).map(|path| (name, path.to_string_lossy().into_owned(), true));
    let mut models: Vec<Model> = [
        scan("dragon", "scans/dragon_vrip.ply.gz"),
        scan("bunny", "scans/bun_zipper.ply"),
        scan("laurana, colours", "scans/laurana.ply"),
        scan("dragon, non-manifold", "scans/dragon_vrip_res2.ply.gz"),
    ]
    .into_iter()
    .flatten()
    .collect();
    models.push(("statue, 7 M", bench.statue7()?.into(), scope.large));
    models
        .extend(bench.dragons("dragons7.ply", "7M")?.map(|file| ("dragon, replicated, 7 M", file.into(), scope.large)));
    for model in &models {
        built(bench, model, rows)?;
    }
    for (name, file, _) in models.iter().filter(|(_, file, _)| Path::new(file).is_absolute()) {
        beside_truth(bench, name, file, rows)?;
    }
    if scope.large {
        large(bench, rows)?;
    }
    if let Some((name, file, _)) = models.first().filter(|(name, ..)| *name == "dragon") {
        quality(bench, name, file, rows)?;
        looks(bench, name, file, rows)?;
        drawn(bench, name, file, rows)?;
    }
    Ok(())
}

fn build(bench: &Bench, model: &str, out: &str, appearance: &str, threads: &str) -> Result<Value> {
    let options = ["--as", "hybrid", "--appearance", appearance, "--threads", threads];
    bench.0.gigalod(&[&["build", model, "-o", out], &options[..]].concat())
}

fn built(bench: &Bench, (name, model, is_measured): &Model, rows: &mut Vec<Row>) -> Result<()> {
    // Bytes of normals are in both: a file without appearance keeps them for shading.
    let mut levels = Vec::new();
    for (appearance, least, most_bytes) in [("on", 60.0, 4.5), ("off", 100.0, 2.5)] {
        let one = build(bench, model, "hybrid.glod", appearance, "1")?;
        let two = build(bench, model, "hybrid.glod", appearance, "2")?;
        let triangles = number(&one["input"], "triangles");
        let rate = triangles / number(&one, "cpu_seconds") / 1e3;
        let figure = format!("{name}, appearance {appearance}");
        rows.push(at_least(format!("build, {figure}"), rate, least, "k triangles a CPU-second"));
        let ratio = number(&two, "seconds") / number(&one, "seconds");
        rows.push(at_most(format!("two threads' wall time to one's, {figure}"), ratio, 0.65, ""));
        let bytes = number(&one, "output_bytes") / triangles;
        rows.push(at_most(format!("file, {figure}"), bytes, most_bytes, "bytes a triangle"));
        if *is_measured {
            let verified = bench.0.gigalod(&["verify", "hybrid.glod", "--against", model])?;
            let measured = &verified["measured"];
            let figure = format!("violations, {figure}");
            let ratios = format!(
                "(worst measured to stored {:.2}, median {:.2})",
                number(measured, "worst_ratio"),
                number(measured, "median_ratio"),
            );
            rows.push(at_most(figure, number(measured, "violations"), 0.0, &ratios));
        }
        if appearance == "on" && matches!(*name, "dragon" | "statue, 7 M") {
            let decoded = bench.example("gigalod-format", "decode_speed", &["hybrid.glod"])?;
            let rate = number(&decoded, "m_triangles_per_second");
            rows.push(at_least(format!("decoding, {name}, one thread"), rate, 30.0, "M triangles a second"));
        }
        let file = bench.0.gigalod(&["info", "hybrid.glod"])?;
        let reductions = file["reduction"].as_array().cloned().unwrap_or_default();
        let sum = |what| reductions.iter().map(|level| number(level, what)).sum::<f64>();
        let [inner, below, shading, original, one_child, shape] =
            ["inner_nodes", "below_two", "shading", "original", "one_child", "shape"].map(sum);
        rows.push(plain(
            format!("inner nodes with more than half of what their children have, {name}, appearance {appearance}"),
            format!(
                "{below} of {inner}: {shading} for their shading, {original} above leaves as coarse, {one_child} with one child, {shape} for their shape"
            ),
        ));
        levels.push(file);
    }
    if matches!(*name, "dragon" | "statue, 7 M") {
        averages(name, &levels, rows);
    }
    Ok(())
}

/// Triangles and points of a node on each level, as the hybrid paper's table 2 has them: of a file, and of one without appearance.
fn averages(name: &str, files: &[Value], rows: &mut Vec<Row>) {
    let levels = |file: &Value| file["per_level"].as_array().cloned().unwrap_or_default();
    let of = |level: &Value| {
        let each = |what| number(level, what) / number(level, "nodes");
        format!("{:.0} triangles and {:.0} points", each("triangles"), each("points"))
    };
    let deepest = files.iter().map(|file| levels(file).len()).max().unwrap_or_default();
    for level in 0..deepest {
        let of_files = files.iter().map(|file| levels(file).get(level).map_or("none".into(), of));
        let measured = of_files.collect::<Vec<_>>().join("; without appearance ");
        rows.push(plain(format!("a node of level {level}, {name}"), measured));
    }
}

fn large(bench: &Bench, rows: &mut Vec<Row>) -> Result<()> {
    let statue = bench.statue100()?;
    let out = "hybrid100.glod";
    let run = bench.0.gigalod(&["build", statue, "-o", out, "--as", "hybrid", "--memory", "1GiB"])?;
    let triangles = number(&run["input"], "triangles");
    let peak = number(&run, "peak_memory_bytes") / f64::from(1 << 20);
    rows.push(at_most("peak anonymous memory, 100 M triangles, --memory 1GiB".into(), peak, 1152.0, "MiB"));
    let rate = triangles / number(&run, "cpu_seconds") / 1e3;
    rows.push(at_least("build, statue, 100 M".into(), rate, 60.0, "k triangles a CPU-second"));
    let bytes = number(&run, "output_bytes") / triangles;
    rows.push(at_most("file, statue, 100 M".into(), bytes, 4.5, "bytes a triangle"));
    averages("statue, 100 M", &[bench.0.gigalod(&["info", out])?], rows);
    Ok(())
}

/// Distances at exact shares of the triangles, without appearance.
fn quality(bench: &Bench, name: &str, model: &str, rows: &mut Vec<Row>) -> Result<()> {
    let out = "hybrid_geometry.glod";
    bench.0.gigalod(&["build", model, "-o", out, "--as", "hybrid", "--appearance", "off", "--tmax", "1024"])?;
    let lines = bench.lines("gigalod", "hybrid_levels", &[out, model])?;
    let last: Value = serde_json::from_str(lines.last().context("no line")?)?;
    for (share, key, most) in [("1/8", "rms_at_1_8", 6.5), ("1/64", "rms_at_1_64", 40.0)] {
        let rms = number(&last, key) * 1e5;
        rows.push(at_most(format!("rms at {share} of the triangles, {name}"), rms, most, "e-5 of the diagonal"));
    }
    Ok(())
}

/// Real scans from four sides, near and far, beside what a ray tracer sees of the original.
fn beside_truth(bench: &Bench, name: &str, model: &str, rows: &mut Vec<Row>) -> Result<()> {
    const CAMERAS: [[&str; 3]; 4] = [["0", "0", "1"], ["130", "35", "1.3"], ["250", "-40", "3"], ["45", "10", "8"]];
    let (mut wrong, mut worst) = (0.0, 0.0f64);
    for [azimuth, elevation, zoom] in CAMERAS {
        let arguments = [model, "beside_truth.png", azimuth, elevation, zoom, "0.5", "hybrid"];
        let figures = bench.example("gigalod", "beside_truth", &arguments)?;
        wrong += number(&figures, "holes") + number(&figures, "fat");
        worst = worst.max(number(&figures, "flip_mean"));
    }
    let figure = format!("four cameras, {name}, 0.5 px");
    rows.push(at_most(format!("{figure}: holes and fat pixels"), wrong, 0.0, ""));
    rows.push(at_most(format!("{figure}: largest mean FLIP to the ray-traced original"), worst, 0.02, ""));
    Ok(())
}

/// Samples of a pixel where shimmer is judged: what the viewer shows at rest.
const SAMPLES: &str = "17";

/// Shimmer, and what keeping the appearance is worth: how near pictures of so many triangles are to a filtered one.
fn looks(bench: &Bench, name: &str, model: &str, rows: &mut Vec<Row>) -> Result<()> {
    let measure = |kind: &str, threshold_px: &str| -> Result<Value> {
        let report = bench.example("gigalod", "shimmer", &[model, threshold_px, kind, SAMPLES])?;
        Ok(report["kernels"]["Round"].clone())
    };
    let shimmer = measure("hybrid", "0.5")?;
    let figure = format!("a slow dolly at 0.5 px, {name}, {SAMPLES} samples a pixel");
    rows.push(at_most(format!("shimmer, {figure}"), number(&shimmer, "shimmer"), 1.2, "of the filtered original's"));
    rows.push(at_least(format!("sharpness, {figure}"), number(&shimmer, "sharpness"), 0.9, "of its"));
    let without: Vec<[f64; 2]> = ["0.5", "1", "2", "4", "8"]
        .iter()
        .map(|px| measure("geometry", px).map(|at| [number(&at, "primitives").ln(), number(&at, "psnr_db")]))
        .collect::<Result<_>>()?;
    for px in ["1", "2", "4"] {
        let with = measure("hybrid", px)?;
        let [count, db] = ["primitives", "psnr_db"].map(|key| number(&with, key));
        // Along a line between the two nearest.
        let between = without.windows(2).find(|two| two[1][0] <= count.ln()).context("as many without appearance")?;
        let [[more, db_more], [fewer, db_fewer]] = [between[0], between[1]];
        let expected = db_fewer + (db_more - db_fewer) * (count.ln() - fewer) / (more - fewer);
        let figure = format!("{:.0} k triangles, {name}: appearance kept ({db:.1} dB) against not", count / 1e3);
        rows.push(at_least(figure, db - expected, 0.0, "dB more"));
    }
    Ok(())
}

/// Primitives and time, in one run.
fn drawn(bench: &Bench, name: &str, model: &str, rows: &mut Vec<Row>) -> Result<()> {
    for (kind, out) in [("hybrid", "hybrid.glod"), ("splats", "splats.glod")] {
        bench.0.gigalod(&["build", model, "-o", out, "--as", kind])?;
    }
    let ways: [(&str, &str, &[&str]); 3] = [
        ("hybrid at 0.5 px", "hybrid.glod", &["--error", "0.5"]),
        ("splats at 0.5 px", "splats.glod", &["--error", "0.5"]),
        ("everything", "hybrid.glod", &["--full"]),
    ];
    for (way, file, options) in ways {
        for orbit in ["0,0,0.5", "0,0,1", "30,20,4"] {
            let view = ["render", file, "-o", "drawn.png", "--size", "640x480", "--orbit", orbit];
            let run = bench.0.gigalod(&[&view[..], options].concat())?;
            let counts = &run["drawn"];
            let primitives = number(counts, "triangles") + number(counts, "points");
            let text = format!("{:.3} M primitives, {:.0} ms", primitives / 1e6, number(&run, "frame_ms"));
            rows.push(plain(format!("{name}, --orbit {orbit}, {way}"), text));
        }
    }
    Ok(())
}
