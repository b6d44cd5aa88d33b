//! Checks that take too long for `cargo xtask test`, at sizes where they mean most: builds killed again and again, memory and
//! disk while a model is built that is far larger than both are meant for, and a look at what comes out.
//!
//! Each step says what it checks and what it found; a step that fails ends the soak. Memory and disk are sampled from outside,
//! a hundred times a second, so what the program says of itself is not believed but compared.

use crate::figures::{self, Row, at_most, plain};
use crate::fuzz;
use crate::program::{Program, number};
use crate::steps::project;
use crate::watch::{self, Peaks};
use anyhow::{Context, Result, bail, ensure};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

const MIB: f64 = (1 << 20) as f64;
const KILLS: usize = 50;
/// As journals name them, in order.
const PHASES: [&str; 4] = ["read", "leaves", "part of tree", "tree"];

/// What a statue takes on disk for each triangle: 19 bytes of scan, at most three times that of temporary files, and 2 of splats.
const BYTES_PER_TRIANGLE: u64 = 19 * 4 + 2;

pub(crate) fn soak(arguments: &[String]) -> Result<()> {
    const USAGE: &str = "usage: cargo xtask soak [--triangles N] [--largest]";
    let (mut triangles, mut largest) = (100_000_000_u64, false);
    let mut arguments = arguments.iter();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--largest" => largest = true,
            "--triangles" => {
                let value = arguments.next().context(USAGE)?;
                triangles = value.replace('_', "").parse().with_context(|| format!("'{value}' triangles; {USAGE}"))?;
            }
            _ => bail!(USAGE),
        }
    }
    ensure!(triangles >= 10_000_000, "{triangles} triangles, expected at least 10000000: fewer fit into memory");
    let soak = Soak(Program::build("soak")?);
    let mut rows = Vec::new();
    soak.kills(5_000_000, &mut rows)?;
    fuzz::fuzz(fuzz::USUAL_SECONDS)?;
    rows.push(plain("fuzzing of all readers".into(), format!("{} s each, nothing found", fuzz::USUAL_SECONDS)));
    soak.out_of_core("statue.ply", triangles, "512MiB", &mut rows)?;
    if largest {
        soak.out_of_core("largest.ply", 372_000_000, "2GiB", &mut rows)?;
    }
    let mut report = format!(
        "# Soak\n\nWritten by `cargo xtask soak{}` on {}. Memory is anonymous and resident, disk is what temporary files\n\
         take at once; both sampled a hundred times a second from outside.\n\n",
        if largest { " --largest" } else { "" },
        figures::machine()?
    );
    figures::table(&rows, &mut report);
    println!("\n{report}");
    if triangles >= 100_000_000 {
        std::fs::write(project().join("docs/soak.md"), report)?;
    }
    let missed = rows.iter().filter(|row| row.met == Some(false)).count();
    ensure!(missed == 0, "{missed} targets missed");
    Ok(())
}

struct Soak(Program);

impl Soak {
    /// A build that is killed, each time at another moment, and continued, has the bytes of one that was left alone.
    fn kills(&self, triangles: u64, rows: &mut Vec<Row>) -> Result<()> {
        println!("=== {KILLS} kills of a build of {triangles} triangles: the same bytes in the end");
        self.expect_room(triangles)?;
        let count = triangles.to_string();
        self.0.gigalod(&["synth", "statue", "--triangles", &count, "--colors", "-o", "killed.ply"])?;
        let begun = Instant::now();
        self.0.gigalod(&["build", "killed.ply", "--as", "splats", "-o", "whole.glod", "--memory", "64MiB"])?;
        let took = begun.elapsed();
        println!("left alone it takes {:.1} s", took.as_secs_f64());
        let [whole, killed, work] =
            ["whole.glod", "killed.glod", ".killed.glod.build"].map(|name| self.0.folder.join(name));
        let _ = (std::fs::remove_file(&killed), std::fs::remove_dir_all(&work));
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let (mut kills, mut completed, mut found) = (0, 0, Vec::new());
        while kills < KILLS {
            let mut build = self.0.command(&[
                "build",
                "killed.ply",
                "--as",
                "splats",
                "-o",
                "killed.glod",
                "--memory",
                "64MiB",
                "--resume",
            ]);
            let mut build = build.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
            // From the first phase to the last, at any moment of it.
            let phases = kills * (PHASES.len() + 1) / KILLS;
            let is_early = || phases > 0 && PHASES.iter().position(|name| *name == phase(&work)) < Some(phases - 1);
            while build.try_wait()?.is_none() && is_early() {
                std::thread::sleep(Duration::from_millis(1));
            }
            std::thread::sleep(took.mul_f64(random.next() / PHASES.len() as f64));
            build.kill()?;
            let finished = build.wait()?.success();
            if !finished {
                kills += 1;
                found.push(phase(&work));
            }
            // It may have been killed after it had its name.
            if killed.exists() {
                ensure!(same(&whole, &killed)?, "after {kills} kills: other bytes");
                std::fs::remove_file(&killed)?;
                completed += 1;
            }
        }
        self.0.gigalod(&[
            "build",
            "killed.ply",
            "--as",
            "splats",
            "-o",
            "killed.glod",
            "--memory",
            "64MiB",
            "--resume",
        ])?;
        ensure!(same(&whole, &killed)?, "after {kills} kills: other bytes");
        ensure!(!work.exists(), "{} is left", work.display());
        found.sort_unstable();
        let counts = found.chunk_by(|a, b| a == b).map(|run| format!("{} × {}", run.len(), run[0]));
        let counts = counts.collect::<Vec<_>>().join(", ");
        println!("{} builds, all the same; killed after {counts}", completed + 1);
        rows.push(plain(
            format!("{triangles} triangles, killed {KILLS} times and continued"),
            format!("{} builds, all with the same bytes", completed + 1),
        ));
        for file in [whole, killed, self.0.folder.join("killed.ply")] {
            std::fs::remove_file(file)?;
        }
        Ok(())
    }

    /// Memory and disk of a large build, and a check of all it wrote.
    fn out_of_core(&self, name: &str, triangles: u64, memory: &str, rows: &mut Vec<Row>) -> Result<()> {
        println!("=== {triangles} triangles with --memory {memory}: memory, disk, and verify");
        self.expect_room(triangles)?;
        let scan = self.0.folder.join(name);
        let made = self.0.gigalod(&["synth", "statue", "--triangles", &triangles.to_string(), "-o", name])?;
        let input_bytes = number(&made, "bytes");
        println!("{:.0} MiB of scan", input_bytes / MIB);
        let build = self.0.command(&["build", name, "--as", "splats", "-o", "out.glod", "--memory", memory]);
        let begun = Instant::now();
        let (report, Peaks { memory: peak_memory, disk }) = watch::run(build, &self.0.folder.join(".out.glod.build"))?;
        let minutes = begun.elapsed().as_secs_f64() / 60.0;
        let (said, seen) = (number(&report, "peak_memory_bytes") / MIB, peak_memory as f64 / MIB);
        println!("{minutes:.1} minutes; memory {seen:.0} MiB (it says {said:.0}); disk {:.0} MiB", disk as f64 / MIB);
        std::fs::remove_file(&scan)?;
        let budget: f64 = if memory == "2GiB" { 2048.0 } else { 512.0 };
        let what = format!("{} M triangles, --memory {memory}", triangles / 1_000_000);
        rows.push(at_most(format!("{what}: memory"), seen.max(said), budget + 128.0, "MiB"));
        rows.push(at_most(format!("{what}: temporary files to input"), disk as f64 / input_bytes, 3.0, ""));
        let rate = number(&report, "leaves") / number(&report, "cpu_seconds") / 1e6;
        rows.push(plain(format!("{what}: build"), format!("{minutes:.1} minutes, {rate:.2} M vertices a CPU-second")));
        let per_leaf = number(&report, "output_bytes") / number(&report, "leaves");
        rows.push(at_most(format!("{what}: file"), per_leaf, 4.5, "bytes a leaf (goal 3.5)"));
        let verified = self.0.gigalod(&["verify", "out.glod"])?;
        ensure!(verified["ok"] == true, "verify: {verified}");
        println!("verified: {} nodes", verified["nodes_checked"]);
        rows.push(plain(format!("{what}: verify"), format!("ok, {} nodes", verified["nodes_checked"])));
        std::fs::remove_file(self.0.folder.join("out.glod"))?;
        Ok(())
    }

    /// Too little disk is said before hours have passed.
    fn expect_room(&self, triangles: u64) -> Result<()> {
        let needed = triangles * BYTES_PER_TRIANGLE;
        let free = watch::free_bytes(&self.0.folder)?;
        ensure!(
            free >= needed,
            "{} has {:.1} GB free, expected {:.1} GB for {triangles} triangles",
            self.0.folder.display(),
            free as f64 / 1e9,
            needed as f64 / 1e9
        );
        Ok(())
    }
}

/// The phase that a work folder says is finished.
fn phase(work: &Path) -> String {
    let journal = std::fs::read_to_string(work.join("journal")).unwrap_or_default();
    let body: serde_json::Value =
        journal.lines().nth(1).and_then(|body| serde_json::from_str(body).ok()).unwrap_or_default();
    body["phase"].as_str().unwrap_or("nothing").to_string()
}

/// True for two files of the same bytes.
fn same(a: &Path, b: &Path) -> Result<bool> {
    let (mut a, mut b) = (File::open(a)?, File::open(b)?);
    if a.metadata()?.len() != b.metadata()?.len() {
        return Ok(false);
    }
    let (mut from_a, mut from_b) = (vec![0; 1 << 20], vec![0; 1 << 20]);
    loop {
        let read = a.read(&mut from_a)?;
        if read == 0 {
            return Ok(true);
        }
        b.read_exact(&mut from_b[..read])?;
        if from_a[..read] != from_b[..read] {
            return Ok(false);
        }
    }
}

/// Xorshift; the moments are the same each time, as far as the machine is.
struct Random(u64);

impl Random {
    /// In 0..1.
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
