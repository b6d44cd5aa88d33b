//! `gigalod build`.

use super::args::{Appearance, BuildArgs, BuildOptions, Representation, UpAxisArg};
use super::cache;
use super::error::{CliError, Outcome};
use super::files;
use super::inputs::{Inputs, Sense};
use super::parse::readable_bytes;
use super::progress::Console;
use super::usage::Usage;
use gigalod_build::{BuildError, Options, Report, SideLog};
use gigalod_format::{InputCounts, Kind};
use gigalod_geom::camera::UpAxis;
use gigalod_import::ModelStream;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A model of fewer vertices is hardly a scan.
const FEW_VERTICES: u64 = 5_000;

/// The JSON object of `build`.
#[derive(Serialize)]
struct BuildReport<'a> {
    kind: &'a str,
    input: InputCounts,
    options: &'a BTreeMap<String, String>,
    nodes: u64,
    levels: u32,
    leaves: u64,
    repeated: u64,
    output_bytes: u64,
    seconds: f64,
    cpu_seconds: f64,
    peak_memory_bytes: u64,
    phases: Vec<PhaseReport>,
    resumed_after: Option<&'a str>,
}

#[derive(Serialize)]
struct PhaseReport {
    name: &'static str,
    seconds: f64,
}

pub(crate) fn run(args: &BuildArgs, console: &Console) -> Result<Outcome, CliError> {
    let inputs = Inputs::find(&args.inputs, console)?;
    files::check_output(&args.output, &inputs.files())?;
    let usage = Usage::watch();
    let recovery = if args.resume { Recovery::Resume } else { Recovery::Keep };
    let sense = Sense { up: args.up.map(UpAxis::from), unit: args.units };
    let report = build(&inputs, &args.output, &args.options, sense, recovery, console)?;
    let (seconds, cpu_seconds) = usage.seconds();
    let metadata = &report.metadata;
    let kind = metadata.options.get("as").map_or("splats", String::as_str);
    if kind == Kind::Splats.name() && metadata.leaves < FEW_VERTICES {
        let what = if metadata.input.points > 0 {
            format!("only {} points; splats are made for dense scans", metadata.leaves)
        } else {
            format!("only {} vertices; splats are made for dense scans", metadata.leaves)
        };
        console.warn(&CliError::in_file(inputs.name(), what));
    }
    let json = BuildReport {
        kind,
        input: metadata.input,
        options: &metadata.options,
        nodes: metadata.nodes,
        levels: metadata.levels,
        leaves: metadata.leaves,
        repeated: metadata.repeated,
        output_bytes: report.output_bytes,
        seconds,
        cpu_seconds,
        peak_memory_bytes: usage.peak_memory_bytes(),
        phases: report.phases.iter().map(|phase| PhaseReport { name: phase.name, seconds: phase.seconds }).collect(),
        resumed_after: report.resumed_after.as_deref(),
    };
    let diced = match metadata.dicing {
        Some(dicing) => format!(" (of {} diced triangles {})", dicing.triangles, dicing.samples),
        None => String::new(),
    };
    let (what, unit, count) = match json.kind {
        "hybrid" => (format!("{} nodes", metadata.nodes), "triangle", metadata.input.triangles),
        _ => (format!("{} splats", metadata.leaves), "leaf", metadata.leaves),
    };
    let text = format!(
        "{}: {} as {what}{diced} on {} levels, {} ({:.2} bytes a {unit}), in {seconds:.1} s\n",
        args.output.display(),
        match metadata.input {
            InputCounts { points, triangles: 0, .. } => format!("{points} points"),
            InputCounts { triangles, .. } => format!("{triangles} triangles"),
        },
        metadata.levels,
        readable_bytes(report.output_bytes),
        report.output_bytes as f64 / count as f64,
    );
    Ok(Outcome::new(&json, text))
}

impl From<UpAxisArg> for UpAxis {
    fn from(up: UpAxisArg) -> Self {
        match up {
            UpAxisArg::Y => Self::Y,
            UpAxisArg::Z => Self::Z,
        }
    }
}

/// What becomes of a build that is interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Recovery {
    /// It is lost.
    Lost,
    /// If it does not fit into memory, it stays, to be continued.
    Keep,
    /// And what an earlier one has left is continued now.
    Resume,
}

/// Said where there is something to continue.
pub(crate) const CONTINUE: &str = "continue with --resume";

/// Builds a model into a file, with progress.
pub(crate) fn build(
    inputs: &Inputs,
    output: &Path,
    options: &BuildOptions,
    sense: Sense,
    recovery: Recovery,
    console: &Console,
) -> Result<Report, CliError> {
    let side = SideLog::default();
    let (stream, identity) = inputs.open(sense, &side, console)?;
    let representation = representation(&*stream, options);
    let is_auto = options.representation == Representation::Auto;
    let is_known = stream.declared_faces().is_some();
    let options = Options {
        memory_bytes: options.memory,
        threads: options.threads,
        up: sense.up,
        unit: sense.unit,
        spacing: options.spacing,
        resolution: options.res,
        most_triangles: options.tmax,
        keeps_looks: options.appearance == Appearance::On,
        only_suited: is_auto,
        input: (recovery != Recovery::Lost).then_some(identity),
        side: side.clone(),
        resume: recovery == Recovery::Resume,
    };
    let work = console.work(&inputs.name().file_name().unwrap_or_default().to_string_lossy());
    let built = match representation {
        Kind::Hybrid => gigalod_build::hybrid::build(stream, &options, &work, output),
        _ => gigalod_build::splats::build(stream, &options, &work, output),
    };
    let as_splats = |resume| {
        let (stream, _) = inputs.open(sense, &side, console)?;
        Ok(gigalod_build::splats::build(stream, &Options { resume, ..options.clone() }, &work, output))
    };
    let built = match built {
        // Some formats say only in the middle what they hold.
        Err(BuildError::NoTriangles | BuildError::Painted) if is_auto => as_splats(false)?,
        // So what was begun may be splats.
        Err(begun @ BuildError::OtherBuild { .. }) if is_auto && representation == Kind::Hybrid && !is_known => {
            match as_splats(true)? {
                Err(BuildError::OtherBuild { .. }) => Err(begun),
                other => other,
            }
        }
        other => other,
    };
    let built = built.map_err(|error| {
        let is_ours = !matches!(error, BuildError::Busy { .. } | BuildError::OtherBuild { .. });
        let error = CliError::build(inputs.name(), output, &error);
        let stays = is_ours && recovery != Recovery::Lost && gigalod_build::can_continue(output);
        if stays { error.hint(CONTINUE) } else { error }
    })?;
    warn_of_libraries(&side, console);
    cache::remember(inputs, output, &side)?;
    Ok(built)
}

/// What a model is built as, as far as its beginning says.
pub(super) fn representation(stream: &dyn ModelStream, options: &BuildOptions) -> Kind {
    match options.representation {
        Representation::Splats => Kind::Splats,
        Representation::Hybrid => Kind::Hybrid,
        Representation::Auto if suits_hybrid(stream, options) => Kind::Hybrid,
        Representation::Auto => Kind::Splats,
    }
}

/// A mesh whose colours, if any, are its vertices'. What materials say of triangles, splats sample, as finely as `--spacing` says.
fn suits_hybrid(stream: &dyn ModelStream, options: &BuildOptions) -> bool {
    stream.declared_faces() != Some(0) && stream.materials().is_empty() && options.spacing.is_none()
}

/// Pictures that are missing were told of when they were asked for; a missing library of materials changes only looks, too.
fn warn_of_libraries(side: &SideLog, console: &Console) {
    let paths = side.paths();
    let is_library = |path: &&PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mtl"));
    let is_there = |path: &Path| File::open(path).is_ok();
    for missing in paths.iter().filter(is_library).filter(|path| !is_there(path)) {
        // A line may name several, which were then asked for one by one.
        let name = missing.to_string_lossy();
        let is_several = paths
            .iter()
            .any(|path| is_there(path) && name.ends_with(&*path.file_name().unwrap_or_default().to_string_lossy()));
        if !is_several {
            console.warn(&CliError::in_file(
                missing,
                "could not be read: colours and pictures of its materials are not shown",
            ));
        }
    }
}
