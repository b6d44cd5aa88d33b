//! Measures the program against its targets and writes `docs/benchmarks.md`.
//!
//! Times are user and system seconds of whole processes with a warm page cache, the median of three runs, side by side in one
//! call; a ratio between two rows means more than either.

use crate::figures::{self, Row, at_least, at_most, plain};
use crate::program::{Program, number};
use crate::setup;
use crate::steps::{cargo, project, run, target};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

const RUNS: usize = 3;

pub(crate) fn bench(arguments: &[String]) -> Result<()> {
    let large = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--large"] => true,
        _ => bail!("usage: cargo xtask bench [--large]"),
    };
    setup::system()?;
    run(&mut cargo(&["build", "--release", "--package", "gigalod-format", "--example", "decode_speed"]))?;
    let bench = Bench(Program::build("bench")?);
    let mut rows = Vec::new();
    bench.splats(&mut rows)?;
    if large {
        bench.large(&mut rows)?;
    }
    let report = report(&rows, large)?;
    print!("{report}");
    std::fs::write(project().join("docs/benchmarks.md"), report)?;
    Ok(())
}

struct Bench(Program);

impl Bench {
    /// Three builds; the one in the middle by processor time.
    fn build(&self, model: &str, threads: &str) -> Result<Value> {
        let mut runs = (0..RUNS)
            .map(|_| self.0.gigalod(&["build", model, "-o", "out.glod", "--threads", threads]))
            .collect::<Result<Vec<_>>>()?;
        runs.sort_by(|a, b| number(a, "cpu_seconds").total_cmp(&number(b, "cpu_seconds")));
        Ok(runs.swap_remove(RUNS / 2))
    }

    fn splats(&self, rows: &mut Vec<Row>) -> Result<()> {
        self.0.make("statue7.ply", &["synth", "statue", "--triangles", "7M"])?;
        self.0.make("statue7_shuffled.ply", &["synth", "statue", "--triangles", "7M", "--order", "shuffled"])?;
        self.0.make("statue7_colors.ply", &["synth", "statue", "--triangles", "7M", "--colors"])?;
        let mut models = vec![("statue, coherent", "statue7.ply"), ("statue, shuffled", "statue7_shuffled.ply")];
        let scan = std::env::var_os("GIGALOD_DATA").map(|data| Path::new(&data).join("scans/dragon_vrip.ply.gz"));
        match scan.filter(|scan| scan.is_file()) {
            Some(scan) => {
                let scan = scan.to_string_lossy().into_owned();
                self.0.make("dragons7.ply", &["synth", "replicate", &scan, "--triangles", "7M"])?;
                models.push(("dragon, replicated", "dragons7.ply"));
            }
            None => println!("GIGALOD_DATA not set: no real scan is measured"),
        }
        let mut rates = Vec::new();
        for (name, model) in models {
            let (one, two) = (self.build(model, "1")?, self.build(model, "2")?);
            for (run, threads) in [(&one, "one thread"), (&two, "two threads")] {
                let rate = number(run, "leaves") / number(run, "cpu_seconds") / 1e6;
                rates.push(rate);
                rows.push(at_least(
                    format!("build, 7 M triangles, {name}, {threads}"),
                    rate,
                    2.0,
                    "M vertices a CPU-second",
                ));
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
        let colored = self.build("statue7_colors.ply", "2")?;
        let per_leaf = number(&colored, "output_bytes") / number(&colored, "leaves");
        rows.push(at_most("file, statue with colours".into(), per_leaf, 6.5, "bytes a leaf (goal 5)"));

        self.0.gigalod(&["build", "statue7.ply", "-o", "statue7.glod"])?;
        let decode = target().join("release/examples/decode_speed");
        let out = Command::new(decode).arg(self.0.folder.join("statue7.glod")).output()?;
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        let rate = text.split_whitespace().next().and_then(|word| word.parse().ok()).context(text)?;
        rows.push(at_least("decoding, statue, one thread".into(), rate, 20.0, "M nodes a second"));
        Ok(())
    }

    fn large(&self, rows: &mut Vec<Row>) -> Result<()> {
        self.0.make("statue100.ply", &["synth", "statue", "--triangles", "100M"])?;
        let run = self.0.gigalod(&["build", "statue100.ply", "-o", "statue100.glod", "--memory", "512MiB"])?;
        let peak = number(&run, "peak_memory_bytes") / f64::from(1 << 20);
        rows.push(at_most("peak anonymous memory, 100 M triangles, --memory 512MiB".into(), peak, 640.0, "MiB"));
        let rate = number(&run, "leaves") / number(&run, "cpu_seconds") / 1e6;
        rows.push(plain(
            "build, 100 M triangles, --memory 512MiB".into(),
            format!("{rate:.2} M vertices a CPU-second"),
        ));
        let per_leaf = number(&run, "output_bytes") / number(&run, "leaves");
        rows.push(at_most("file, 100 M triangles".into(), per_leaf, 4.5, "bytes a leaf (goal 3.5)"));
        let first = self.0.gigalod(&["render", "statue100.glod", "-o", "first.png", "--error", "4"])?;
        let share = number(&first, "bytes_read") / number(&run, "output_bytes") * 100.0;
        rows.push(at_most("first picture, --error 4: read of the file".into(), share, 0.5, "%"));
        Ok(())
    }
}

fn report(rows: &[Row], large: bool) -> Result<String> {
    let mut out = format!(
        "# Benchmarks\n\nWritten by `cargo xtask bench{}` on {}; default options unless said otherwise. Times are user\n\
         and system seconds of whole processes, the median of {RUNS} runs, page cache warm. A target that is missed says so.\n\n",
        if large { " --large" } else { "" },
        figures::machine()?
    );
    figures::table(rows, &mut out);
    Ok(out)
}
