//! Opening and writing files.

use super::error::CliError;
use gigalod_build::{FileIdentity, SideLog};
use gigalod_format::{Container, FileStore, FormatError};
use gigalod_import::{ByteSource, ModelStream, SideFiles, Stamp};
use gigalod_runtime::ModelFile;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Component, Path};
use std::sync::Arc;

/// Opens a raw model.
pub(crate) fn open_model(path: &Path) -> Result<Box<dyn ModelStream>, CliError> {
    Ok(open_input(path, &SideLog::default())?.0)
}

/// Opens a raw model, and says which it is; `side` is told of the files that it names.
pub(crate) fn open_input(path: &Path, side: &SideLog) -> Result<(Box<dyn ModelStream>, FileIdentity), CliError> {
    let wrong = |error: io::Error| CliError::in_file(path, error);
    let file = open(path)?;
    expect_raw(path)?;
    let identity = FileIdentity::of(path, &file).map_err(wrong)?;
    let watched = file.try_clone().map_err(wrong)?;
    let ask = Box::new(move || stamp(&watched));
    let stream = gigalod_import::open_watched(Box::new(file), side_files(path, side), ask)
        .map_err(|error| CliError::import(path, &error))?;
    Ok((stream, identity))
}

/// What changes when a file is written to.
pub(crate) fn stamp(file: &File) -> io::Result<Stamp> {
    let metadata = file.metadata()?;
    Ok(Stamp { bytes: metadata.len(), modified: metadata.modified()? })
}

/// Opens files that a model names: only those in its folder and below, since a model may come from anywhere. `side` is told of them.
pub(crate) fn side_files(path: &Path, side: &SideLog) -> Box<dyn SideFiles> {
    let side = side.clone();
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    Box::new(move |name: &str| -> io::Result<Box<dyn ByteSource>> {
        // Programs for Windows write its separators.
        let name = name.replace('\\', "/");
        let is_below =
            Path::new(&name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if !is_below {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "not in the folder of the model"));
        }
        let path = folder.join(name);
        side.note(&path);
        if !std::fs::metadata(&path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
        }
        Ok(Box::new(File::open(path)?))
    })
}

/// Opens a `.glod` file.
pub(crate) fn open_container(path: &Path) -> Result<Container, CliError> {
    expect_regular(path)?;
    let store = FileStore::open(path).map_err(|error| CliError::in_file(path, error))?;
    Container::open(Arc::new(store)).map_err(|error| {
        let wrong = CliError::format(path, &error);
        match error {
            FormatError::Magic { .. } => wrong.hint("is it a model? gigalod build makes a .glod file of it"),
            _ => wrong,
        }
    })
}

/// Opens a `.glod` file for drawing, of whichever kind it is.
pub(crate) fn open_built(path: &Path) -> Result<ModelFile, CliError> {
    ModelFile::open(open_container(path)?).map_err(|error| CliError::format(path, &error))
}

/// True when the file begins as a `.glod` file does; anything else is taken for a raw model.
pub(crate) fn is_container(path: &Path) -> Result<bool, CliError> {
    Ok(begins_as_container(path)? || path.extension().is_some_and(|extension| extension == "glod"))
}

fn begins_as_container(path: &Path) -> Result<bool, CliError> {
    let mut start = Vec::new();
    open(path)?
        .take(gigalod_format::MAGIC.len() as u64)
        .read_to_end(&mut start)
        .map_err(|error| CliError::in_file(path, error))?;
    Ok(start == gigalod_format::MAGIC)
}

/// Refuses what was built already.
pub(crate) fn expect_raw(path: &Path) -> Result<(), CliError> {
    if begins_as_container(path)? {
        let wrong = CliError::in_file(path, "already a .glod file, expected a model to build one from");
        return Err(wrong.hint("render and view take it as it is"));
    }
    Ok(())
}

/// Opens a regular file for reading.
pub(crate) fn open(path: &Path) -> Result<File, CliError> {
    expect_regular(path)?;
    File::open(path).map_err(|error| CliError::in_file(path, error))
}

/// Asked before a file is opened: to open a pipe that nobody writes to would never end.
fn expect_regular(path: &Path) -> Result<(), CliError> {
    let metadata = std::fs::metadata(path).map_err(|error| CliError::in_file(path, error))?;
    if metadata.is_dir() {
        let wrong = CliError::in_file(path, "a folder, expected a file");
        return Err(wrong.hint("`gigalod build` makes one model of all that are in a folder"));
    }
    if metadata.is_file() { Ok(()) } else { Err(CliError::in_file(path, "not a regular file")) }
}

/// Refuses an output that would take the place of one of `inputs`, or of a device or pipe. Folders are refused when it comes
/// to writing.
pub(crate) fn check_output(output: &Path, inputs: &[&Path]) -> Result<(), CliError> {
    if output.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Err(CliError::in_file(output, "the name of a folder, expected that of a file"));
    }
    if output == Path::new("-") {
        let wrong = CliError::in_file(output, "standard output is no place for it, expected the name of a file");
        return Err(wrong.hint("a file of that name is ./-"));
    }
    let Ok(metadata) = std::fs::metadata(output) else { return Ok(()) };
    if !metadata.is_file() && !metadata.is_dir() {
        return Err(CliError::in_file(output, "not a regular file: it would be replaced"));
    }
    let output_is = output.canonicalize().ok();
    let is_same = |input: &Path| output_is.is_some() && input.canonicalize().ok() == output_is;
    if inputs.iter().any(|input| is_same(input)) {
        return Err(CliError::in_file(output, "input and output are the same file"));
    }
    Ok(())
}

/// Writes a file that appears under its name only when `write` is done with it.
pub(crate) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let wrong = |error: io::Error| CliError::write(path, &error);
    let output = gigalod_build::Output::create(path).map_err(wrong)?;
    let mut buffered = io::BufWriter::with_capacity(1 << 20, output.file());
    write(&mut buffered)?;
    buffered.flush().map_err(wrong)?;
    drop(buffered);
    output.publish().map_err(wrong)
}

/// Refuses names that promise another format than PNG.
pub(crate) fn check_png_name(path: &Path) -> Result<(), CliError> {
    match path.extension() {
        Some(extension) if !extension.eq_ignore_ascii_case("png") => {
            Err(CliError::in_file(path, "pictures are written as PNG, expected a name that ends in .png"))
        }
        _ => Ok(()),
    }
}

/// Writes an 8-bit sRGB picture with alpha.
pub(crate) fn write_png(path: &Path, size: gigalod_geom::ImageSize, rgba: &[u8]) -> Result<(), CliError> {
    write_atomically(path, |out| {
        let mut encoder = png::Encoder::new(out, size.width, size.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let wrong = |error: png::EncodingError| CliError::in_file(path, format!("could not write: {error}"));
        let mut writer = encoder.write_header().map_err(wrong)?;
        writer.write_image_data(rgba).map_err(wrong)?;
        writer.finish().map_err(wrong)
    })
}
