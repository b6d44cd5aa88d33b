//! Figures beside their targets, as a table of a report.

use anyhow::Result;
use std::fmt::Write;

/// One line of the report.
pub(crate) struct Row {
    pub(crate) figure: String,
    pub(crate) target: String,
    pub(crate) measured: String,
    /// None where there is nothing to meet.
    pub(crate) met: Option<bool>,
}

pub(crate) fn at_least(figure: String, measured: f64, target: f64, unit: &str) -> Row {
    let measured_text = format!("{measured:.2} {unit}");
    Row { figure, target: format!("≥ {target}"), measured: measured_text, met: Some(measured >= target) }
}

pub(crate) fn at_most(figure: String, measured: f64, target: f64, unit: &str) -> Row {
    let measured_text = format!("{measured:.2} {unit}");
    Row { figure, target: format!("≤ {target}"), measured: measured_text, met: Some(measured <= target) }
}

/// A figure that is not there met nothing, and missed nothing.
pub(crate) fn within(figure: String, measured: Option<f64>, [low, high]: [f64; 2], unit: &str) -> Row {
    let target = format!("{low}–{high}");
    let Some(measured) = measured else { return Row { figure, target, measured: "–".into(), met: None } };
    Row { figure, target, measured: format!("{measured:.1} {unit}"), met: Some((low..=high).contains(&measured)) }
}

pub(crate) fn plain(figure: String, measured: String) -> Row {
    Row { figure, target: String::new(), measured, met: None }
}

/// Rows of a table in Markdown.
pub(crate) fn table(rows: &[Row], out: &mut String) {
    out.push_str("| figure | measured | target | |\n|---|---|---|---|\n");
    for Row { figure, target, measured, met } in rows {
        let verdict = match met {
            Some(true) => "met",
            Some(false) => "**missed**",
            None => "",
        };
        let _ = writeln!(out, "| {figure} | {} | {target} | {verdict} |", measured.trim());
    }
}

/// What it was measured on: `2 cores of …`.
pub(crate) fn machine() -> Result<String> {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu = cpu
        .lines()
        .find_map(|line| line.strip_prefix("model name"))
        .map_or("unknown", |name| name.trim_matches([' ', '\t', ':']));
    Ok(format!("{} cores of {cpu}", std::thread::available_parallelism()?))
}
