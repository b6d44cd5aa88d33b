//! Drawing: selection, rasterising, frame times under control, and how much each kernel shimmers.

use super::{Bench, Scope, data};
use crate::figures::{Row, at_least, at_most, plain, within};
use crate::program::number;
use anyhow::{Context, Result};
use serde_json::Value;

/// What a frame shall take.
const TARGET_MS: &str = "100";

pub(super) fn rows(bench: &Bench, scope: Scope<'_>, rows: &mut Vec<Row>) -> Result<()> {
    let models = models(bench, scope)?;
    for part in [selection, rasterising, frame_rate, poses] {
        for model in &models {
            part(bench, model, rows)?;
        }
    }
    shimmer(bench, rows)
}

/// Random poses against the ray tracer: what has no triangles is not judged, nor what does not fit into memory as they are.
fn poses(bench: &Bench, model: &Model, rows: &mut Vec<Row>) -> Result<()> {
    if !model.judged {
        return Ok(());
    }
    let report = bench.example("gigalod", "poses", &[&model.input, model.file])?;
    for (kernel, figures) in report["kernels"].as_object().context("kernels")? {
        let [holes, fat, false_claims] = ["holes", "fat", "false_claims"].map(|key| number(figures, key));
        rows.push(at_most(
            format!("{} random poses, {}, {kernel}: holes, fat pixels, false claims", figures["frames"], model.name),
            holes + fat + false_claims,
            0.0,
            &format!("(the tightest claim is needed to {:.0} %)", number(figures, "tightest") * 100.0),
        ));
    }
    Ok(())
}

/// What is drawn.
struct Model {
    name: &'static str,
    input: String,
    file: &'static str,
    /// Whether it can be judged by the ray tracer.
    judged: bool,
}

/// All models, built.
fn models(bench: &Bench, scope: Scope<'_>) -> Result<Vec<Model>> {
    let model = |name, file, input: &str, judged| Model { name, input: input.to_owned(), file, judged };
    let mut models = vec![model("statue, 7 M", "statue7.glod", bench.statue7()?, true)];
    let dragons = bench.dragons("dragons10.ply", "10M")?;
    models.extend(dragons.map(|input| model("dragon, replicated, 10 M", "dragons10.glod", input, true)));
    let lion = data("points/lion_takanawa_normals.ply");
    models.extend(lion.map(|path| model("lion, points", "lion.glod", &path.to_string_lossy(), false)));
    if scope.large {
        models.push(model("statue, 100 M", "statue100.glod", bench.statue100()?, false));
    }
    for model in &models {
        // Anew, since the format may have changed.
        bench.0.gigalod(&["build", &model.input, "--as", "splats", "-o", model.file])?;
    }
    Ok(models)
}

/// Warm cuts.
fn selection(bench: &Bench, model: &Model, rows: &mut Vec<Row>) -> Result<()> {
    let Model { name, file, .. } = model;
    let report = bench.example("gigalod-runtime", "select_speed", &[file, "1"])?;
    let cuts = report["cuts"].as_array().context("cuts")?;
    for threads in [1.0, 2.0] {
        let on = || cuts.iter().filter(|cut| number(cut, "threads") == threads);
        let rates = on().map(|cut| number(cut, "m_nodes_per_cpu_s"));
        let (slowest, fastest) = rates.fold((f64::INFINITY, 0.0), |(low, high), r| (r.min(low), f64::max(r, high)));
        let figure = format!("selection, {name}, {threads} threads: slowest of {} views", on().count());
        let unit = format!("M nodes a CPU-second (fastest {fastest:.0})");
        rows.push(at_least(figure, slowest, 30.0, &unit));
        let whole = on().find(|cut| cut["pose"] == "default" && number(cut, "threshold_px") == 1.0).context("view")?;
        rows.push(plain(
            format!("a cut of the whole at 1 px, {name}, {threads} threads"),
            format!("{:.1} ms for {:.2} M nodes", number(whole, "ms"), number(whole, "visited") / 1e6),
        ));
    }
    let allocations = cuts.iter().map(|cut| number(cut, "allocations")).fold(0.0, f64::max);
    rows.push(at_most(format!("allocations of a warm cut, {name}"), allocations, 0.0, ""));
    Ok(())
}

/// A splat that covers more pixels than these is no point.
const POINT_PX: f64 = 2.0;

/// Splats through the compute passes and through the pipeline.
fn rasterising(bench: &Bench, model: &Model, rows: &mut Vec<Row>) -> Result<()> {
    let Model { name, file, .. } = model;
    let report = bench.example("gigalod", "render_speed", &[file, "--ways", "compute,quads"])?;
    let rate = |way: &str| number(&report["ways"][way], "points_per_cpu_second_without_upload") / 1e6;
    let (compute, quads) = (rate("compute"), rate("quads"));
    let figure = format!("{:.2} M points drawn at 1 px, {name}", number(&report, "points") / 1e6);
    let pixels = number(&report, "pixels_per_point");
    if pixels <= POINT_PX {
        rows.push(at_least(figure.clone(), compute, 20.0, "M points a CPU-second"));
    } else {
        // Its points are not points.
        rows.push(plain(figure.clone(), format!("{compute:.1} M a CPU-second, each of {pixels:.0} pixels")));
    }
    rows.push(at_least(format!("{figure}: compute to pipeline"), compute / quads, 4.0, "times"));
    Ok(())
}

/// Paths that are played in real time: kind, how often (a turn is over in a few frames), seconds.
const PLAYED: [(&str, u32, &str); 2] = [("walk", 1, "10"), ("sudden-turn", 6, "4")];

/// At first, pipelines are compiled and pages are read.
const COLD_SECONDS: f64 = 1.0;

/// Frames of paths that are played in real time.
fn frame_rate(bench: &Bench, model: &Model, rows: &mut Vec<Row>) -> Result<()> {
    let Model { name, file, .. } = model;
    for (path, times, seconds) in PLAYED {
        let (mut held_back_ms, mut widest_px, mut turns, mut reached_px, mut took) =
            (Vec::new(), 1.0f64, 0.0f64, 0.0f64, 0.0f64);
        for seed in 1..=times {
            let synth = ["synth", "path", path, "--around", file, "--seconds", seconds, "--seed", &seed.to_string()];
            bench.0.gigalod(&[&synth[..], &["-o", "path.json"]].concat())?;
            let report = bench.0.gigalod(&["bench", file, "--path", "path.json", "--target-ms", TARGET_MS])?;
            for frame in report["frames"].as_array().context("frames")?.iter().filter(|frame| is_held_back(frame)) {
                held_back_ms.push(number(frame, "frame_ms"));
                widest_px = widest_px.max(number(frame, "pixel_edge_px"));
            }
            let rest = &report["summary"]["rest"];
            turns = turns.max(number(rest, "sign_changes") / number(rest, "seconds").max(1.0));
            reached_px = reached_px.max(number(rest, "threshold_px"));
            took = took.max(number(rest, "seconds"));
        }
        held_back_ms.sort_by(f64::total_cmp);
        for (what, part) in [("median", 0.5), ("95th percentile", 0.95)] {
            let frames = held_back_ms.len();
            let figure = format!("--target-ms {TARGET_MS}, {path}, {name}: {what} of {frames} frames");
            let rank = ((frames as f64 * part).ceil() as usize).max(1) - 1;
            rows.push(within(figure, held_back_ms.get(rank).copied(), [80.0, 120.0], "ms"));
        }
        rows.push(plain(format!("{path}, {name}: pixels at most"), format!("{widest_px:.2} px wide")));
        rows.push(at_most(format!("at rest, {path}, {name}: turns of the threshold"), turns, 2.0, "a second"));
        rows.push(at_most(format!("at rest, {path}, {name}: threshold"), reached_px, 1.0, "px"));
        rows.push(plain(format!("at rest, {path}, {name}: {reached_px} px after"), format!("{took:.1} s")));
    }
    Ok(())
}

/// True for what a warm, moving camera saw coarser than a pixel for the sake of time.
fn is_held_back(frame: &Value) -> bool {
    let coarser = number(frame, "threshold_px") > 1.0 || number(frame, "pixel_edge_px") > 1.0;
    let shows = frame["moved"] == true && number(frame, "points") > 0.0;
    number(frame, "t") >= COLD_SECONDS && shows && coarser
}

/// A slow dolly, beside 16 rays a pixel.
fn shimmer(bench: &Bench, rows: &mut Vec<Row>) -> Result<()> {
    for (name, model) in [("dragon", "scans/dragon_vrip.ply.gz"), ("bunny", "scans/bun_zipper.ply")] {
        let Some(path) = data(model) else { continue };
        let report = bench.example("gigalod", "shimmer", &[&path.to_string_lossy()])?;
        let kernels = report["kernels"].as_object().context("kernels")?;
        for (kernel, figures) in kernels {
            rows.push(plain(format!("shimmer, {name}, {kernel}"), of_kernel(figures)));
        }
    }
    Ok(())
}

fn of_kernel(figures: &Value) -> String {
    let holes = figures["holes"].as_u64().map_or(String::new(), |holes| format!(", {holes} holes"));
    let [shimmer, sharpness] = ["shimmer", "sharpness"].map(|key| number(figures, key));
    format!("{shimmer:.2} of the reference's, sharpness {sharpness:.2}{holes}")
}
