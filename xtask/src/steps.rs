//! What the commands do, step by step.

use crate::setup;
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Crates that must also compile for the browser.
const WEB_CRATES: [&str; 5] = ["geom", "import", "format", "runtime", "render"];

/// Builds the program and runs its demo.
pub(crate) fn demo(arguments: &[String]) -> Result<()> {
    setup::system()?;
    run(cargo(&["run", "--release", "--package", "gigalod", "--", "demo"]).args(arguments))
}

/// Everything CI runs.
pub(crate) fn test() -> Result<()> {
    let begun = Instant::now();
    setup::everything()?;
    let mut times = Vec::new();
    let mut step = |name: &'static str, command: &mut Command| -> Result<()> {
        println!("\n=== {name}");
        let begun = Instant::now();
        run(command).with_context(|| format!("step \"{name}\" failed"))?;
        times.push((name, begun.elapsed().as_secs_f64()));
        Ok(())
    };
    step("format", &mut cargo(&["fmt", "--all", "--check"]))?;
    step("lints", &mut cargo(&["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"]))?;
    // Servers draw without a window: the program must not need the viewer's libraries.
    let headless = ["clippy", "--package", "gigalod", "--no-default-features", "--", "--deny", "warnings"];
    step("lints without a window", &mut cargo(&headless))?;
    step(
        "documentation",
        cargo(&["doc", "--workspace", "--no-deps", "--document-private-items"]).env("RUSTDOCFLAGS", "--deny warnings"),
    )?;
    let mut web = cargo(&["check", "--target", "wasm32-unknown-unknown"]);
    for name in WEB_CRATES {
        web.args(["--package", &format!("gigalod-{name}")]);
    }
    step("web build", &mut web)?;
    step("tests", &mut cargo(&["test", "--workspace", "--no-fail-fast"]))?;
    println!();
    for (name, seconds) in times {
        println!("{seconds:>7.1} s  {name}");
    }
    println!("{:>7.1} s  in all", begun.elapsed().as_secs_f64());
    Ok(())
}

/// Cargo, in the project's folder.
pub(crate) fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(project()).args(arguments);
    command
}

/// The project's folder.
pub(crate) fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask is a folder of the project")
}

/// Where cargo puts what it makes.
pub(crate) fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| project().join("target"), PathBuf::from)
}

/// Runs a command to its end.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let program = command.get_program().to_string_lossy().into_owned();
    let status = command.status().with_context(|| format!("could not start {program}"))?;
    if !status.success() {
        bail!("{command:?}: {status}");
    }
    Ok(())
}
