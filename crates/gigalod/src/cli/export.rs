//! `gigalod export`.

use super::args::ExportArgs;
use super::error::{CliError, Outcome};
use super::files;
use super::parse::readable_bytes;
use super::progress::Console;
use super::synth::SynthReport;
use gigalod::export::{self, ExportError, Format, Written};
use gigalod_format::Kind;
use gigalod_format::hybrid::HybridFile;
use gigalod_format::splats::SplatFile;
use std::path::Path;
use std::time::Instant;

pub(crate) fn run(args: &ExportArgs, console: &Console) -> Result<Outcome, CliError> {
    let begun = Instant::now();
    let format = format_of(&args.output)?;
    files::check_output(&args.output, &[&args.file])?;
    let container = files::open_container(&args.file)?;
    let wrong = |error| CliError::format(&args.file, &error);
    let work = console.work(&args.output.file_name().unwrap_or_default().to_string_lossy());
    let mut written = Written::default();
    files::write_atomically(&args.output, |out| {
        let exported = match container.kind() {
            Kind::Splats => {
                let file = SplatFile::open(container).map_err(wrong)?;
                export::splats(&file, args.error, format, &work, out)
            }
            Kind::Hybrid => {
                let file = HybridFile::open(container).map_err(wrong)?;
                export::hybrid(&file, args.error, format, &work, out)
            }
            kind => {
                let what = format!("a {} file, which export does not know", kind.name());
                return Err(CliError::in_file(&args.file, what));
            }
        };
        written = exported.map_err(|error| match error {
            ExportError::Output(error) => CliError::write(&args.output, &error),
            error @ ExportError::TooMuch { .. } => CliError::in_file(&args.output, error)
                .hint("a larger --error leaves less; PLY has room for any number of triangles"),
            error => CliError::in_file(&args.file, error),
        })?;
        Ok(())
    })?;
    work.finish();
    let bytes = std::fs::metadata(&args.output).map_err(|error| CliError::in_file(&args.output, error))?.len();
    let Written { vertices, triangles, points } = written;
    let json = SynthReport {
        output: args.output.display().to_string(),
        bytes,
        triangles,
        vertices,
        points,
        seconds: begun.elapsed().as_secs_f64(),
    };
    let text = format!(
        "{}: {triangles} triangles, {vertices} vertices, {points} points, {}, in {:.1} s\n",
        args.output.display(),
        readable_bytes(bytes),
        json.seconds
    );
    Ok(Outcome::new(&json, text))
}

/// Which format a name promises.
fn format_of(path: &Path) -> Result<Format, CliError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    Format::of_extension(&extension)
        .ok_or_else(|| CliError::in_file(path, "expected a name that ends in .ply, .obj or .glb"))
}
