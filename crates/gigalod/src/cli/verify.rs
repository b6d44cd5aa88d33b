//! `gigalod verify`.

use super::args::VerifyArgs;
use super::error::{CliError, Outcome};
use super::files;
use super::info::shown;
use super::inputs::{Inputs, Sense};
use super::progress::Console;
use gigalod::verify::{self, Measured, Problems, Sampled};
use gigalod_build::Progress;
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use gigalod_import::{Batch, Material, read_all};
use gigalod_reference::Mesh;
use serde::Serialize;
use std::fmt::Write;

/// The JSON object of `verify`.
#[derive(Serialize)]
struct VerifyReport<'a> {
    ok: bool,
    problems: &'a [String],
    nodes_checked: u64,
    measured: Option<MeasuredReport>,
}

#[derive(Serialize)]
struct MeasuredReport {
    hausdorff: f64,
    rms: f64,
    worst_ratio: f64,
    violations: u64,
}

pub(crate) fn run(args: &VerifyArgs, console: &Console) -> Result<Outcome, CliError> {
    let splats = files::open_splats(&args.file)?;
    // The metadata is not needed for drawing, but it has a checksum too.
    let metadata = splats.container().read_metadata().map_err(|error| CliError::format(&args.file, &error))?;
    let name = args.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let work = console.work(&name);
    work.begin("check", splats.skeleton().pages().len() as u64);
    let (tree, mut problems) = verify::check(&splats, &mut |pages| work.at(pages));
    let mut measured = None;
    if !args.against.is_empty() && problems.count == 0 {
        let originals = Inputs::find(&args.against, console)?;
        let (model, materials) = read_model(&originals, splats.skeleton().root().up, &work)?;
        let (origin, leaves) = (splats.skeleton().root().origin, splats.skeleton().root().leaves);
        let at = |done| work.at(done);
        let figures = if model.triangles.is_empty() {
            work.begin("measure", verify::steps_of_points(&tree, &model.vertices));
            expect_leaves(leaves, model.vertices.positions.len() as u64, "points", &mut problems);
            verify::against_points(&tree, origin, &model.vertices, &at)
        } else {
            let sampled = metadata.dicing.map(|dicing| Sampled::of(dicing.spacing, &model, &materials));
            let mesh = verify::mesh_of(model).map_err(|error| CliError::in_file(originals.name(), error))?;
            work.begin("measure", verify::steps(&tree, &mesh));
            match metadata.dicing {
                Some(dicing) => expect_samples(leaves, dicing.samples, count_referenced(&mesh), &mut problems),
                None => expect_leaves(leaves, count_referenced(&mesh), "referenced vertices", &mut problems),
            }
            verify::against(&tree, origin, &mesh, sampled.as_ref(), &at)
        };
        judge(&figures, &mut problems);
        measured = Some(figures);
    }
    work.finish();

    for problem in &problems.told {
        console.warn(&CliError::in_file(&args.file, problem));
    }
    let ok = problems.count == 0;
    let mut text = String::new();
    let verdict = if ok { "sound".to_string() } else { format!("{} problems", problems.count) };
    let _ = writeln!(text, "{}: {verdict}, {} nodes checked", args.file.display(), tree.nodes.len());
    if let Some(Measured { hausdorff, rms, worst_ratio, violations }) = measured {
        let unit = metadata.options.get("units").map_or("model units".into(), |unit| shown(unit));
        let _ = writeln!(
            text,
            "leaves against the original: largest distance {hausdorff:.4e}, rms {rms:.4e} ({unit})\n\
             all nodes: at most {worst_ratio:.4} of the stored error, {violations} violations"
        );
    }
    let json = VerifyReport {
        ok,
        problems: &problems.told,
        nodes_checked: tree.nodes.len() as u64,
        measured: measured.map(|m| MeasuredReport {
            hausdorff: m.hausdorff,
            rms: m.rms,
            worst_ratio: m.worst_ratio,
            violations: m.violations,
        }),
    };
    Ok(Outcome { good: ok, ..Outcome::new(&json, text) })
}

/// Turns figures that no sound file has into problems.
fn judge(measured: &Measured, problems: &mut Problems) {
    if measured.violations > 0 {
        let Measured { violations, worst_ratio, .. } = measured;
        problems.count += violations;
        problems
            .told
            .push(format!("{violations} violations of stored errors or enclosures, the worst ratio is {worst_ratio}"));
    }
}

/// There is a leaf for each of what the model has.
fn expect_leaves(leaves: u64, expected: u64, what: &str, problems: &mut Problems) {
    if leaves != expected {
        problems.count += 1;
        problems.told.push(format!("{leaves} leaves, expected one for each of {expected} {what}"));
    }
}

/// There is a leaf for each sample, and no more than one for each vertex besides.
fn expect_samples(leaves: u64, samples: u64, vertices: u64, problems: &mut Problems) {
    if leaves < samples || leaves - samples > vertices {
        problems.count += 1;
        problems.told.push(format!("{leaves} leaves, expected {samples} samples and at most {vertices} vertices"));
    }
}

fn count_referenced(mesh: &Mesh) -> u64 {
    let mut referenced = vec![false; mesh.positions().len()];
    for vertex in mesh.triangles().as_flattened() {
        referenced[*vertex as usize] = true;
    }
    referenced.iter().filter(|used| **used).count() as u64
}

/// Reads a whole model into memory, with its materials. Which way was up, and in which unit, when it was built is of no matter here.
fn read_model(originals: &Inputs, up: UpAxis, work: &dyn Progress) -> Result<(Batch, Vec<Material>), CliError> {
    let (mut stream, _) = originals.open(Sense { up: Some(up), unit: Some(LengthUnit::Metre) })?;
    work.begin("read", stream.bytes_consumed().1);
    let all = read_all(&mut *stream, &mut |done, _| work.at(done))
        .map_err(|error| CliError::import(originals.name(), &error))?;
    Ok((all, stream.materials().to_vec()))
}
