//! The program as it is released, run in a folder of models.

use crate::steps::{cargo, run, target};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

pub(crate) struct Program {
    program: PathBuf,
    /// Where it runs, and where models are.
    pub(crate) folder: PathBuf,
}

impl Program {
    /// Compiles it; `name` is the folder's.
    pub(crate) fn build(name: &str) -> Result<Self> {
        run(&mut cargo(&["build", "--release", "--package", "gigalod"]))?;
        let folder = target().join(name);
        std::fs::create_dir_all(&folder)?;
        Ok(Self { program: target().join("release/gigalod"), folder: folder.canonicalize()? })
    }

    /// A command of it, in the folder.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.arg("--json").args(arguments).current_dir(&self.folder);
        command
    }

    /// Runs a command that succeeds; what it reports.
    pub(crate) fn gigalod(&self, arguments: &[&str]) -> Result<Value> {
        let out = self.command(arguments).output()?;
        let text = String::from_utf8_lossy(&out.stdout);
        if !out.status.success() {
            bail!("gigalod {}: {text}", arguments.join(" "));
        }
        serde_json::from_str(&text).with_context(|| format!("gigalod {}", arguments.join(" ")))
    }

    /// A model of the folder, made once.
    pub(crate) fn make(&self, name: &str, arguments: &[&str]) -> Result<()> {
        if !self.folder.join(name).is_file() {
            self.gigalod(&[arguments, &["-o", name]].concat())?;
        }
        Ok(())
    }
}

/// A number of a report.
pub(crate) fn number(object: &Value, key: &str) -> f64 {
    object[key].as_f64().unwrap_or(f64::NAN)
}
