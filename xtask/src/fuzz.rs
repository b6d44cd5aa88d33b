//! Fuzzes every reader: `cargo fuzz` on a nightly compiler, which it installs where they are missing.
//!
//! Takes how long each target runs; fails with the first that finds something. Good files to begin with come from the tests that
//! damage them on stable.

use crate::setup::answers;
use crate::steps::{cargo, project, run};
use anyhow::{Context, Result, bail};
use std::process::Command;

/// Bytes that a target may take, in MiB, and seconds that one input may take: the promise for any file of that size.
const LIMITS: [&str; 2] = ["-rss_limit_mb=1024", "-timeout=10"];

pub(crate) const USUAL_SECONDS: u64 = 60;

/// How long each target runs: what the command line says, or a minute.
pub(crate) fn seconds(arguments: &[String]) -> Result<u64> {
    match arguments {
        [] => Ok(USUAL_SECONDS),
        [seconds] => seconds.parse().with_context(|| format!("'{seconds}' seconds; usage: cargo xtask fuzz [SECONDS]")),
        _ => bail!("usage: cargo xtask fuzz [SECONDS]"),
    }
}

pub(crate) fn fuzz(seconds: u64) -> Result<()> {
    if !answers("rustup", &["run", "nightly", "cargo", "--version"]) {
        run(Command::new("rustup").args(["toolchain", "install", "nightly", "--profile", "minimal"]))?;
    }
    if !answers("cargo-fuzz", &["--version"]) {
        run(&mut cargo(&["install", "cargo-fuzz", "--locked"]))?;
    }
    let corpus = project().join("fuzz/corpus");
    // Without the viewer, which takes longest to compile and reads nothing by itself.
    let packages = ["--package", "gigalod-import", "--package", "gigalod", "--no-default-features"];
    let tests = ["test"].into_iter().chain(packages).chain(["--test", "hostile"]).collect::<Vec<_>>();
    run(cargo(&tests).env("GIGALOD_CORPUS", &corpus))?;
    let mut targets = std::fs::read_dir(project().join("fuzz/fuzz_targets"))?
        .map(|entry| Ok(entry?.path().file_stem().context("a name")?.to_string_lossy().into_owned()))
        .collect::<Result<Vec<_>>>()?;
    targets.sort();
    for target in &targets {
        println!("\n=== fuzzing {target} for {seconds} s");
        run(nightly()
            .arg("run")
            .args(options(target))
            .arg(target)
            .arg("--")
            .args(LIMITS)
            .arg(format!("-max_total_time={seconds}")))
        .with_context(|| format!("target \"{target}\"; its input lies in fuzz/artifacts/{target}"))?;
    }
    Ok(())
}

/// As fuzz/Cargo.toml says.
fn options(target: &str) -> &'static [&'static str] {
    match target {
        "las" => &["-O"],
        "glod" => &["--features", "glod"],
        _ => &[],
    }
}

fn nightly() -> Command {
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo", "fuzz"]).current_dir(project());
    // What cargo has told this program about the stable compiler.
    for name in ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN", "RUSTFLAGS"] {
        command.env_remove(name);
    }
    command
}
