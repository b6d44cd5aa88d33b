//! Everything a developer does, in one place: `cargo xtask help`.
//!
//! Needs the Rust toolchain and nothing else: what is missing is installed where that is possible, and named where it is not.
#![forbid(unsafe_code)]

mod bench;
mod figures;
mod fuzz;
mod program;
mod setup;
mod soak;
mod steps;
mod watch;

use anyhow::{Result, bail};

const HELP: &str = "\
cargo xtask COMMAND

  demo [ARGS]   make a statue of 2 million triangles, build it, draw four pictures into ./demo
  test          everything CI runs: format, lints, documentation, tests, shaders, web build
  bench [--large] [--only importing|building|drawing|hybrid]  measure against the targets, write docs/benchmarks.md (with
                100 M triangles two hours, most of them for hybrid)
  soak [--triangles N] [--largest]  what takes too long for `test`: 50 kills of a build of 5 million triangles; a minute of
                fuzzing each reader; memory, disk and verify of 100 million triangles (or N ≥ 10 million), written to docs/soak.md;
                with 372 million as well, which needs 30 GB of disk
  fuzz [SECONDS]  bytes of all kinds to each reader, for a minute each; installs a nightly compiler and cargo-fuzz (part of soak)
  setup         install what demo and test need (they do it by themselves)

Environment of `test` and `bench`:
  GIGALOD_DATA  folder of real models; tests that want them are skipped without it
  REQUIRE_GPU   set: a test that finds no graphics adapter fails instead of being skipped
";

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let command = arguments.next().unwrap_or_default();
    let rest: Vec<String> = arguments.collect();
    match command.as_str() {
        "setup" => setup::everything(),
        "demo" => steps::demo(&rest),
        "bench" => bench::bench(&rest),
        "soak" => soak::soak(&rest),
        "fuzz" => fuzz::fuzz(fuzz::seconds(&rest)?),
        "test" if rest.is_empty() => steps::test(),
        "" | "help" | "-h" | "--help" => {
            print!("{HELP}");
            Ok(())
        }
        _ => bail!("unknown command: {command} {}\n\n{HELP}", rest.join(" ")),
    }
}
