//! Measures the program against its targets and writes `docs/benchmarks.md`.
//!
//! Times are user and system seconds of whole processes with a warm page cache, the median of three runs, side by side in one
//! call; a ratio between two rows means more than either.

mod building;
mod drawing;
mod hybrid;
mod importing;

use crate::figures::{self, Row};
use crate::program::{Program, number};
use crate::setup;
use crate::steps::{cargo, project, run, target};
use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

const RUNS: usize = 3;

/// What is measured.
#[derive(Clone, Copy)]
struct Scope<'a> {
    /// Also a model of 100 million triangles.
    large: bool,
    /// One section instead of all.
    only: Option<&'a str>,
}

/// A heading, and what fills its table.
type Section = (&'static str, fn(&Bench, Scope<'_>, &mut Vec<Row>) -> Result<()>);

const SECTIONS: [Section; 4] = [
    ("importing", importing::rows),
    ("building", building::rows),
    ("drawing", drawing::rows),
    ("hybrid", hybrid::rows),
];

pub(crate) fn bench(arguments: &[String]) -> Result<()> {
    let mut scope = Scope { large: false, only: None };
    let mut rest = arguments.iter().map(String::as_str);
    while let Some(argument) = rest.next() {
        match argument {
            "--large" => scope.large = true,
            "--only" => scope.only = Some(rest.next().context("--only: expected a section")?),
            _ => bail!("usage: cargo xtask bench [--large] [--only importing|building|drawing|hybrid]"),
        }
    }
    setup::system()?;
    let bench = Bench(Program::build("bench")?);
    let path = project().join("docs/benchmarks.md");
    let mut found = false;
    for (name, fill) in SECTIONS.iter().filter(|(name, _)| scope.only.is_none_or(|only| only == *name)) {
        let mut rows = Vec::new();
        fill(&bench, scope, &mut rows)?;
        let mut section = format!("## {}{}\n\n{}\n\n", name[..1].to_uppercase(), &name[1..], origin(scope.large)?);
        figures::table(&rows, &mut section);
        print!("\n{section}");
        // Each as soon as it is measured, so that none is lost with a later one.
        let before = std::fs::read_to_string(&path).unwrap_or_default();
        std::fs::write(&path, with_section(&before, &section))?;
        found = true;
    }
    ensure!(found, "no such section: {}", scope.only.unwrap_or_default());
    Ok(())
}

const PREFACE: &str = "# Benchmarks

Written by `cargo xtask bench`; default options unless said otherwise. Times are user and system seconds, of builds the median
of three runs, page cache warm. A target that is missed says so.
";

fn origin(large: bool) -> Result<String> {
    Ok(format!("With{} models of 100 million triangles, on {}.", if large { "" } else { "out" }, figures::machine()?))
}

/// The report with a section in place of what stood under its heading; others stay, in their order.
fn with_section(report: &str, section: &str) -> String {
    let heading = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    let parts = report.split("\n## ").skip(1).map(|part| format!("## {}\n", part.trim_end()));
    let mut sections: Vec<String> = parts.collect();
    match sections.iter_mut().find(|old| heading(old) == heading(section)) {
        Some(old) => *old = section.to_owned(),
        None => sections.push(section.to_owned()),
    }
    format!("{PREFACE}\n{}", sections.join("\n"))
}

/// The program and its folder of models.
struct Bench(Program);

impl Bench {
    /// A model of 7 million triangles by `synth`, made once.
    fn statue7(&self) -> Result<&'static str> {
        self.0.make("statue7.ply", &["synth", "statue", "--triangles", "7M"])?;
        Ok("statue7.ply")
    }

    fn statue100(&self) -> Result<&'static str> {
        self.0.make("statue100.ply", &["synth", "statue", "--triangles", "100M"])?;
        Ok("statue100.ply")
    }

    /// Copies of the real scan of the dragon; none without real models.
    fn dragons(&self, name: &'static str, triangles: &str) -> Result<Option<&'static str>> {
        let Some(scan) = data("scans/dragon_vrip.ply.gz") else { return Ok(None) };
        self.0.make(name, &["synth", "replicate", &scan.to_string_lossy(), "--triangles", triangles])?;
        Ok(Some(name))
    }

    /// Runs an example of a package, given arguments in the folder of models; the JSON object that it prints.
    fn example(&self, package: &str, name: &str, arguments: &[&str]) -> Result<Value> {
        let text = self.output(package, name, arguments)?;
        serde_json::from_str(&text).with_context(|| format!("example {name}: {text}"))
    }

    /// The same for one that prints lines.
    fn lines(&self, package: &str, name: &str, arguments: &[&str]) -> Result<Vec<String>> {
        Ok(self.output(package, name, arguments)?.lines().map(String::from).collect())
    }

    fn output(&self, package: &str, name: &str, arguments: &[&str]) -> Result<String> {
        run(&mut cargo(&["build", "--release", "--quiet", "--package", package, "--example", name]))?;
        let program = target().join("release/examples").join(name);
        let out = Command::new(program.canonicalize()?).args(arguments).current_dir(&self.0.folder).output()?;
        let text = String::from_utf8_lossy(&out.stdout);
        if !out.status.success() {
            bail!("example {name} {}: {text}{}", arguments.join(" "), String::from_utf8_lossy(&out.stderr));
        }
        Ok(text.into_owned())
    }
}

/// A real model, where there is one.
fn data(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("GIGALOD_DATA").map(|data| Path::new(&data).join(name));
    let path = path.filter(|path| path.is_file());
    if path.is_none() {
        println!("not measured: {name} (GIGALOD_DATA)");
    }
    path
}

/// The report in the middle, by one of its numbers.
fn middle(mut reports: Vec<Value>, key: &str) -> Value {
    reports.sort_by(|a, b| number(a, key).total_cmp(&number(b, key)));
    let middle = reports.len() / 2;
    reports.swap_remove(middle)
}

#[cfg(test)]
mod tests {
    use super::with_section;

    #[test]
    fn a_section_takes_the_place_of_the_old_one() {
        let first = with_section("", "## Building\n\n| a |\n");
        let both = with_section(&first, "## Drawing\n\n| b |\n");
        assert!(both.ends_with("\n\n## Building\n\n| a |\n\n## Drawing\n\n| b |\n"), "{both}");
        let again = with_section(&both, "## Building\n\n| c |\n");
        assert_eq!(again, both.replace("| a |", "| c |"));
    }
}
