//! `gigalod verify`. Splats are judged here, hybrid files in `verify_hybrid`.

use super::args::VerifyArgs;
use super::error::{CliError, Outcome};
use super::files;
use super::info::shown;
use super::inputs::{Inputs, Sense};
use super::progress::{Console, Work};
use super::verify_hybrid;
use gigalod::verify::{self, Measured, Problems, Sampled, SplatTree};
use gigalod_build::{Progress, SideLog};
use gigalod_format::splats::SplatFile;
use gigalod_format::{Container, InputCounts, Kind, Metadata};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, LengthUnit};
use gigalod_import::{Batch, Material, read_all};
use gigalod_reference::Mesh;
use glam::DVec3;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

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
    let container = files::open_container(&args.file)?;
    // It is not needed for drawing, but it has a checksum too.
    let metadata = container.read_metadata().map_err(|error| CliError::format(&args.file, &error))?;
    let name = args.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let work = console.work(&name);
    match container.kind() {
        Kind::Splats => splats(args, container, &metadata, &work, console),
        Kind::Hybrid => verify_hybrid::run(args, container, &metadata, &work, console),
        kind => Err(CliError::in_file(&args.file, format!("a {} file, which verify does not know", kind.name()))),
    }
}

/// Each of the problems as a warning.
pub(super) fn tell(args: &VerifyArgs, problems: &[String], console: &Console) {
    for problem in problems {
        console.warn(&CliError::in_file(&args.file, problem));
    }
}

/// What there is to say of so many problems.
pub(super) fn verdict(problems: &Problems) -> String {
    match problems.count {
        0 => "sound".to_string(),
        1 => "1 problem".to_string(),
        count => format!("{count} problems"),
    }
}

fn splats(
    args: &VerifyArgs,
    container: Container,
    metadata: &Metadata,
    work: &Work<'_>,
    console: &Console,
) -> Result<Outcome, CliError> {
    let splats = SplatFile::open(container).map_err(|error| CliError::format(&args.file, &error))?;
    work.begin("check", splats.skeleton().pages().len() as u64);
    let (tree, mut problems) = verify::check(&splats, &mut |pages| work.at(pages));
    let (mut measured, mut told) = (None, 0);
    if !args.against.is_empty() && problems.count == 0 {
        let originals = Inputs::find(&args.against, console)?;
        let root = splats.skeleton().root();
        let (model, materials) = read_model(&originals, root.up, work, console)?;
        expect_same_kind(&model, metadata, args, originals.name())?;
        expect_same(&model, metadata, &root.bounds, &mut problems);
        // Before what takes long.
        tell(args, &problems.told, console);
        told = problems.told.len();
        let splats = (&tree, root.origin);
        measured = Some(measure(model, &materials, splats, metadata, originals.name(), work, &mut problems)?);
    }
    work.finish();

    tell(args, &problems.told[told..], console);
    let ok = problems.count == 0;
    let mut text = String::new();
    let _ = writeln!(text, "{}: {}, {} nodes checked", args.file.display(), verdict(&problems), tree.nodes.len());
    if let Some(Measured { hausdorff, rms, worst_ratio, violations }) = measured {
        let unit = unit_of(metadata);
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

/// In which lengths are told.
pub(super) fn unit_of(metadata: &Metadata) -> String {
    metadata.options.get("units").map_or("model units".into(), |unit| shown(unit))
}

/// Holds the file against the model that it was built from.
fn measure(
    model: Batch,
    materials: &[Material],
    (tree, origin): (&SplatTree, DVec3),
    metadata: &Metadata,
    name: &Path,
    work: &dyn Progress,
    problems: &mut Problems,
) -> Result<Measured, CliError> {
    if metadata.repeated > tree.twins() {
        let (repeated, twins) = (metadata.repeated, tree.twins());
        problems.count += 1;
        problems.told.push(format!(
            "{repeated} repeated leaves, expected at most {twins}, as there are nodes with two of a kind"
        ));
    }
    let leaves = metadata.leaves - metadata.repeated.min(metadata.leaves);
    let at = |done| work.at(done);
    let figures = if model.triangles.is_empty() {
        work.begin("measure", verify::steps_of_points(tree, &model.vertices));
        expect_leaves(leaves, model.vertices.positions.len() as u64, "points", problems);
        verify::against_points(tree, origin, &model.vertices, &at)
    } else {
        let sampled = metadata.dicing.map(|dicing| Sampled::of(dicing.spacing, &model, materials));
        let mesh = verify::mesh_of(model).map_err(|error| CliError::in_file(name, error))?;
        work.begin("measure", verify::steps(tree, &mesh, sampled.as_ref()));
        match metadata.dicing {
            Some(dicing) => expect_samples(leaves, dicing.samples, count_referenced(&mesh), problems),
            None => expect_leaves(leaves, count_referenced(&mesh), "referenced vertices", problems),
        }
        verify::against(tree, origin, &mesh, sampled.as_ref(), &at)
    };
    judge(&figures, problems);
    Ok(figures)
}

/// Points cannot be held against triangles, nor triangles against points.
pub(super) fn expect_same_kind(
    model: &Batch,
    metadata: &Metadata,
    args: &VerifyArgs,
    name: &Path,
) -> Result<(), CliError> {
    let what = |has_triangles| if has_triangles { "a mesh" } else { "a cloud of points" };
    let (found, expected) = (!model.triangles.is_empty(), metadata.input.triangles > 0);
    if found == expected {
        return Ok(());
    }
    let text = format!("{}, expected {}, of which {} was built", what(found), what(expected), args.file.display());
    Err(CliError::in_file(name, text))
}

/// The file says how much was read, and how large that was.
pub(super) fn expect_same(model: &Batch, metadata: &Metadata, bounds: &Aabb, problems: &mut Problems) {
    let [vertices, triangles] = [model.vertices.positions.len(), model.triangles.len()].map(|count| count as u64);
    let found = match triangles {
        0 => InputCounts { points: vertices, ..InputCounts::default() },
        _ => InputCounts { triangles, vertices, points: 0 },
    };
    let words = |counts: &InputCounts| match counts {
        InputCounts { triangles: 0, points, .. } => format!("{points} points"),
        InputCounts { triangles, vertices, .. } => format!("{triangles} triangles and {vertices} vertices"),
    };
    let wrong = if found != metadata.input {
        Some(format!("{}, it has {}", words(&metadata.input), words(&found)))
    } else {
        let around = around(model);
        let corner = |at: &DVec3| format!("{} {} {}", at.x, at.y, at.z);
        let box_of = |bounds: &Aabb| format!("{} to {}", corner(&bounds.min), corner(&bounds.max));
        (around != *bounds).then(|| format!("bounds {}, it has {}", box_of(bounds), box_of(&around)))
    };
    if let Some(wrong) = wrong {
        problems.count += 1;
        problems.told.push(format!("built from another model than the one that it is held against: expected {wrong}"));
    }
}

/// Around all points, or all vertices that triangles use.
fn around(model: &Batch) -> Aabb {
    let positions = &model.vertices.positions;
    let include = |bounds: Aabb, at: DVec3| Aabb { min: bounds.min.min(at), max: bounds.max.max(at) };
    let nothing = Aabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
    match model.triangles.is_empty() {
        true => positions.iter().fold(nothing, |bounds, at| include(bounds, *at)),
        false => model
            .triangles
            .as_flattened()
            .iter()
            .fold(nothing, |bounds, vertex| include(bounds, positions[*vertex as usize])),
    }
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

/// There is a leaf for each of what the model has, those that repeat others not counted.
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
pub(super) fn read_model(
    originals: &Inputs,
    up: UpAxis,
    work: &dyn Progress,
    console: &Console,
) -> Result<(Batch, Vec<Material>), CliError> {
    let sense = Sense { up: Some(up), unit: Some(LengthUnit::Metre) };
    let (mut stream, _) = originals.open(sense, &SideLog::default(), console)?;
    work.begin("read", stream.bytes_consumed().1);
    let all = read_all(&mut *stream, &mut |done, _| work.at(done))
        .map_err(|error| CliError::import(originals.name(), &error))?;
    Ok((all, stream.materials().to_vec()))
}
