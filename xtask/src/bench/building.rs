//! Building: speed, size of the file, memory, decoding, and how little of a large file a first picture reads.

use super::{Bench, RUNS, Scope, middle};
use crate::figures::{Row, at_least, at_most, plain};
use crate::program::number;
use anyhow::Result;
use serde_json::Value;

pub(super) fn rows(bench: &Bench, scope: Scope<'_>, rows: &mut Vec<Row>) -> Result<()> {
    splats(bench, rows)?;
    if scope.large {
        large(bench, rows)?;
    }
    Ok(())
}

/// Some builds; the one in the middle by processor time.
fn build(bench: &Bench, model: &str, threads: &str) -> Result<Value> {
    let runs = (0..RUNS)
        .map(|_| bench.0.gigalod(&["build", model, "--as", "splats", "-o", "out.glod", "--threads", threads]))
        .collect::<Result<Vec<_>>>()?;
    Ok(middle(runs, "cpu_seconds"))
}

fn splats(bench: &Bench, rows: &mut Vec<Row>) -> Result<()> {
    let statue = bench.statue7()?;
    bench.0.make("statue7_shuffled.ply", &["synth", "statue", "--triangles", "7M", "--order", "shuffled"])?;
    bench.0.make("statue7_colors.ply", &["synth", "statue", "--triangles", "7M", "--colors"])?;
    let mut models = vec![("statue, coherent", statue), ("statue, shuffled", "statue7_shuffled.ply")];
    models.extend(bench.dragons("dragons7.ply", "7M")?.map(|model| ("dragon, replicated", model)));
    let mut rates = Vec::new();
    for (name, model) in models {
        let (one, two) = (build(bench, model, "1")?, build(bench, model, "2")?);
        for (run, threads) in [(&one, "one thread"), (&two, "two threads")] {
            let rate = number(run, "leaves") / number(run, "cpu_seconds") / 1e6;
            rates.push(rate);
            let figure = format!("build, 7 M triangles, {name}, {threads}");
            rows.push(at_least(figure, rate, 2.0, "M vertices a CPU-second"));
        }
        let ratio = number(&two, "seconds") / number(&one, "seconds");
        rows.push(at_most(format!("two threads' wall time to one's, {name}"), ratio, 0.65, ""));
        let per_leaf = number(&one, "output_bytes") / number(&one, "leaves");
        rows.push(at_most(format!("file, {name}"), per_leaf, 4.5, "bytes a leaf (goal 3.5)"));
        let peak = number(&one, "peak_memory_bytes") / f64::from(1 << 20);
        rows.push(plain(format!("peak anonymous memory, {name}"), format!("{peak:.0} MiB (--memory 2GiB)")));
    }
    let extremes = rates.iter().copied().fold((f64::INFINITY, 0.0), |(low, high), r| (r.min(low), r.max(high)));
    rows.push(at_most("fastest to slowest of these builds".into(), extremes.1 / extremes.0, 1.5, ""));
    let colored = build(bench, "statue7_colors.ply", "2")?;
    let per_leaf = number(&colored, "output_bytes") / number(&colored, "leaves");
    rows.push(at_most("file, statue with colours".into(), per_leaf, 6.5, "bytes a leaf (goal 5)"));

    bench.0.gigalod(&["build", statue, "--as", "splats", "-o", "statue7.glod"])?;
    let decoded = bench.example("gigalod-format", "decode_speed", &["statue7.glod"])?;
    let rate = number(&decoded, "m_nodes_per_second");
    rows.push(at_least("decoding, statue, one thread".into(), rate, 20.0, "M nodes a second"));
    Ok(())
}

fn large(bench: &Bench, rows: &mut Vec<Row>) -> Result<()> {
    let statue = bench.statue100()?;
    let run = bench.0.gigalod(&["build", statue, "--as", "splats", "-o", "statue100.glod", "--memory", "512MiB"])?;
    let peak = number(&run, "peak_memory_bytes") / f64::from(1 << 20);
    rows.push(at_most("peak anonymous memory, 100 M triangles, --memory 512MiB".into(), peak, 640.0, "MiB"));
    let rate = number(&run, "leaves") / number(&run, "cpu_seconds") / 1e6;
    rows.push(plain("build, 100 M triangles, --memory 512MiB".into(), format!("{rate:.2} M vertices a CPU-second")));
    let per_leaf = number(&run, "output_bytes") / number(&run, "leaves");
    rows.push(at_most("file, 100 M triangles".into(), per_leaf, 4.5, "bytes a leaf (goal 3.5)"));
    let first = bench.0.gigalod(&["render", "statue100.glod", "-o", "first.png", "--error", "4"])?;
    let share = number(&first, "bytes_read") / number(&run, "output_bytes") * 100.0;
    rows.push(at_most("first picture, --error 4: read of the file".into(), share, 0.5, "%"));
    Ok(())
}
