//! `gigalod verify` of hybrid files.

use super::args::VerifyArgs;
use super::error::{CliError, Outcome};
use super::inputs::Inputs;
use super::progress::{Console, Work};
use super::verify::{expect_same, expect_same_kind, read_model, tell, unit_of, verdict};
use gigalod::verify::hybrid::{Measured, Structure, against, check, steps};
use gigalod::verify::{Problems, mesh_of};
use gigalod_build::Progress;
use gigalod_format::hybrid::HybridFile;
use gigalod_format::{Container, Metadata};
use serde::Serialize;
use std::fmt::Write;

/// The JSON object of `verify`.
#[derive(Serialize)]
struct Report<'a> {
    ok: bool,
    problems: &'a [String],
    nodes_checked: u64,
    structure: StructureReport,
    measured: Option<MeasuredReport>,
}

#[derive(Serialize)]
struct StructureReport {
    inner_nodes: u64,
    spare_nodes: u64,
    least_use: f64,
    full_nodes: u64,
    least_ratio: Option<f64>,
    cuts: Vec<CutReport>,
}

#[derive(Serialize)]
struct CutReport {
    level: usize,
    triangles: u64,
    ratio: Option<f64>,
}

#[derive(Serialize)]
struct MeasuredReport {
    hausdorff: f64,
    rms: f64,
    worst_ratio: f64,
    violations: u64,
    median_ratio: f64,
    nodes: u64,
    normal_p95: f64,
    normal_ratio_p95: f64,
}

pub(super) fn run(
    args: &VerifyArgs,
    container: Container,
    metadata: &Metadata,
    work: &Work<'_>,
    console: &Console,
) -> Result<Outcome, CliError> {
    let wrong = |error| CliError::format(&args.file, &error);
    let file = HybridFile::open(container).map_err(wrong)?;
    let root = *file.skeleton().root();
    work.begin("check", root.nodes);
    let (structure, mut problems) = check(&file, &mut |nodes| work.at(nodes));
    let (mut measured, mut told) = (None, 0);
    if !args.against.is_empty() && problems.count == 0 {
        let originals = Inputs::find(&args.against, console)?;
        let (model, _) = read_model(&originals, root.up, work, console)?;
        expect_same_kind(&model, metadata, args, originals.name())?;
        expect_same(&model, metadata, &root.bounds, &mut problems);
        // Before what takes long.
        tell(args, &problems.told, console);
        told = problems.told.len();
        let mesh = mesh_of(model).map_err(|error| CliError::in_file(originals.name(), error))?;
        work.begin("measure", steps(&file, &mesh));
        let found = against(&file, &mesh, &|done| work.at(done)).map_err(wrong)?;
        judge(&found, &mut problems);
        measured = Some(found);
    }
    work.finish();

    tell(args, &problems.told[told..], console);
    let ok = problems.count == 0;
    let text = text(args, &problems, &structure, measured.as_ref(), metadata, root.nodes);
    let json = Report {
        ok,
        problems: &problems.told,
        nodes_checked: root.nodes,
        structure: StructureReport {
            inner_nodes: structure.inner,
            spare_nodes: structure.spare,
            least_use: structure.least_use,
            full_nodes: structure.full,
            least_ratio: structure.least_ratio.map(|(ratio, _)| ratio),
            cuts: cuts(&structure),
        },
        measured: measured.map(|found| MeasuredReport {
            hausdorff: found.hausdorff,
            rms: found.rms,
            worst_ratio: found.worst_ratio,
            violations: found.violations.len() as u64,
            median_ratio: found.median_ratio,
            nodes: found.nodes,
            normal_p95: found.normal_p95,
            normal_ratio_p95: found.normal_ratio_p95,
        }),
    };
    Ok(Outcome { good: ok, ..Outcome::new(&json, text) })
}

/// Turns what no sound file has into problems.
fn judge(found: &Measured, problems: &mut Problems) {
    for violation in &found.violations {
        problems.add(|| violation.to_string());
    }
}

/// How many triangles are drawn at each level, and how many times more at the next.
fn cuts(structure: &Structure) -> Vec<CutReport> {
    let next = structure.cuts.iter().skip(1).map(Some).chain([None]);
    let ratio = |own: u64, next: Option<&u64>| next.filter(|_| own > 0).map(|next| *next as f64 / own as f64);
    let all = structure.cuts.iter().zip(next).enumerate();
    all.map(|(level, (own, next))| CutReport { level, triangles: *own, ratio: ratio(*own, next) }).collect()
}

fn text(
    args: &VerifyArgs,
    problems: &Problems,
    structure: &Structure,
    measured: Option<&Measured>,
    metadata: &Metadata,
    nodes: u64,
) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{}: {}, {nodes} nodes checked", args.file.display(), verdict(problems));
    if structure.inner > 0 {
        let Structure { inner, spare, least_use, full, least_ratio, .. } = structure;
        let _ = writeln!(
            text,
            "{spare} of {inner} inner nodes could not be simplified to three quarters of their error (the least uses {least_use:.3})"
        );
        let ratios: Vec<String> =
            cuts(structure).iter().filter_map(|cut| cut.ratio.map(|ratio| format!("{ratio:.2}"))).collect();
        let _ = write!(text, "triangles from level to level: {}; ", ratios.join(", "));
        let _ = match least_ratio {
            Some((ratio, node)) => writeln!(text, "below 2 at {full} nodes, the least {ratio:.2} (node {node})"),
            None => writeln!(text, "below 2 at {full} nodes"),
        };
    }
    if let Some(found) = measured {
        let unit = unit_of(metadata);
        let Measured { hausdorff, rms, worst_ratio, median_ratio, nodes, normal_p95, normal_ratio_p95, violations } =
            found;
        let _ = writeln!(
            text,
            "leaves against the original: largest distance {hausdorff:.4e}, rms {rms:.4e} ({unit})\n\
             {nodes} nodes: at most {worst_ratio:.4} of the stored error, {} violations; median of inner nodes {median_ratio:.3}\n\
             95 of 100 normals of inner nodes are right within {normal_p95:.4e} ({unit}), {normal_ratio_p95:.3} of the total error",
            violations.len()
        );
    }
    text
}
