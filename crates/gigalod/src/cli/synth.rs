//! `gigalod synth`.

use super::args::{OrderArg, PathArgs, PathKindArg, ReplicateArgs, StatueArgs, SynthArgs, SynthWhat};
use super::error::{CliError, Outcome};
use super::parse::readable_bytes;
use super::progress::Console;
use super::{files, path_file};
use gigalod_build::Progress;
use gigalod_import::read_all;
use gigalod_synth::{
    Order, PathKind, PathOptions, ReplicaOptions, Scan, StatueOptions, SynthError, Written, camera_path, write_replicas,
};
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// The JSON object of `synth` and `demo`.
#[derive(Serialize)]
pub(crate) struct SynthReport {
    pub(crate) output: String,
    pub(crate) bytes: u64,
    pub(crate) triangles: u64,
    pub(crate) vertices: u64,
    pub(crate) points: u64,
    pub(crate) seconds: f64,
}

pub(crate) fn run(args: &SynthArgs, console: &Console) -> Result<Outcome, CliError> {
    let begun = Instant::now();
    let (output, written, poses) = match &args.what {
        SynthWhat::Statue(args) => (&args.output, statue(args, console)?, None),
        SynthWhat::Replicate(args) => (&args.output, replicate(args, console)?, None),
        SynthWhat::Path(args) => {
            let (bytes, poses) = path(args)?;
            (&args.output, Written { vertices: 0, triangles: 0, bytes }, Some(poses))
        }
    };
    let json = SynthReport {
        output: output.display().to_string(),
        bytes: written.bytes,
        triangles: written.triangles,
        vertices: written.vertices,
        points: 0,
        seconds: begun.elapsed().as_secs_f64(),
    };
    let what = match poses {
        Some(poses) => format!("{poses} poses"),
        None => format!("{} triangles, {} vertices", written.triangles, written.vertices),
    };
    let text = format!("{}: {what}, {}, in {:.1} s\n", output.display(), readable_bytes(written.bytes), json.seconds);
    Ok(Outcome::new(&json, text))
}

impl From<OrderArg> for Order {
    fn from(order: OrderArg) -> Self {
        match order {
            OrderArg::Coherent => Self::Coherent,
            OrderArg::Shuffled => Self::Shuffled,
        }
    }
}

fn statue(args: &StatueArgs, console: &Console) -> Result<Written, CliError> {
    files::check_output(&args.output, &[])?;
    let options =
        StatueOptions { triangles: args.triangles, seed: args.seed, colors: args.colors, order: args.order.into() };
    write_statue(&args.output, &options, console)
}

/// Writes a statue, with progress.
pub(crate) fn write_statue(path: &Path, options: &StatueOptions, console: &Console) -> Result<Written, CliError> {
    generate(path, console, |out, progress| gigalod_synth::write_statue(*options, out, progress))
}

fn replicate(args: &ReplicateArgs, console: &Console) -> Result<Written, CliError> {
    files::check_output(&args.output, &[&args.scan])?;
    let scan = read_scan(&args.scan)?;
    let options = ReplicaOptions { triangles: args.triangles, seed: args.seed, order: args.order.into() };
    generate(&args.output, console, |out, progress| write_replicas(&scan, options, out, progress))
}

fn generate(
    path: &Path,
    console: &Console,
    make: impl FnOnce(&mut dyn Write, &mut dyn FnMut(u64, u64)) -> Result<Written, SynthError>,
) -> Result<Written, CliError> {
    let work = console.work(&path.file_name().unwrap_or_default().to_string_lossy());
    work.begin("plan", 0);
    let mut begun = false;
    let mut progress = |done: u64, total: u64| {
        if total > 0 && !begun {
            begun = true;
            work.begin("generate", total);
        }
        if begun {
            work.at(done);
        }
    };
    let mut written = None;
    files::write_atomically(path, |out| {
        written = Some(make(out, &mut progress).map_err(|error| match error {
            SynthError::Io { source } => CliError::write(path, &source),
            error => CliError::in_file(path, error),
        })?);
        Ok(())
    })?;
    Ok(written.expect("set when writing succeeded"))
}

fn read_scan(path: &Path) -> Result<Scan, CliError> {
    let mut stream = files::open_model(path)?;
    let all = read_all(&mut *stream, &mut |_, _| {}).map_err(|error| CliError::import(path, &error))?;
    let colors = all.vertices.colors;
    Ok(Scan {
        positions: all.vertices.positions.iter().map(|position| position.as_vec3().to_array()).collect(),
        triangles: all.triangles,
        colors: (!colors.is_empty()).then_some(colors),
    })
}

fn path(args: &PathArgs) -> Result<(u64, usize), CliError> {
    files::check_output(&args.output, &[&args.around])?;
    let model = files::open_built(&args.around)?;
    let kind = match args.kind {
        PathKindArg::Orbit => PathKind::Orbit,
        PathKindArg::Approach => PathKind::Approach,
        PathKindArg::Walk => PathKind::Walk,
        PathKindArg::SuddenTurn => PathKind::SuddenTurn,
    };
    let options = PathOptions { seconds: args.seconds, seed: args.seed };
    let made = camera_path(kind, &model.bounds(), model.up(), options);
    let bytes = path_file::write(&args.output, &made)?;
    Ok((bytes, made.frames.len()))
}
