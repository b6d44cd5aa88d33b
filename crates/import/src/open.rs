//! Finds out what a file is, by its content, and opens the reader for it.
//!
//! In: a [`ByteSource`]. Out: a [`ModelStream`] whose header has been read and checked. A new format is one more row of
//! [`FORMATS`].

use crate::{
    ByteSource, ImportError, ModelStream, NoSideFiles, SideFiles, e57,
    error::{Problem, shown},
    gltf,
    input::Input,
    las, obj, off, pcd, ply, stl, xyz,
};

/// What comes of opening a file.
type Opened = Result<Box<dyn ModelStream>, ImportError>;

/// A format that this crate reads.
struct Format {
    name: &'static str,
    /// True when a file that starts with these bytes (at most [`START_BYTES`], fewer in a shorter file), and has so many if
    /// that is known, is of this format. Earlier rows are asked first.
    recognises: fn(&[u8], Option<u64>) -> bool,
    open: fn(Input, Box<dyn SideFiles>) -> Opened,
}

const FORMATS: &[Format] = &[
    Format { name: "PLY", recognises: |start, _| ply::recognises(start), open: |input, _| ply::open(input) },
    Format { name: "glTF", recognises: |start, _| gltf::recognises(start), open: gltf::open },
    Format { name: "LAS", recognises: |start, _| las::recognises(start), open: |input, _| las::open(input) },
    Format { name: "E57", recognises: |start, _| e57::recognises(start), open: |input, _| e57::open(input) },
    Format { name: "PCD", recognises: |start, _| pcd::recognises(start), open: |input, _| pcd::open(input) },
    Format { name: "OFF", recognises: |start, _| off::recognises(start), open: |input, _| off::open(input) },
    Format { name: "STL", recognises: stl::recognises, open: |input, _| stl::open(input) },
    Format { name: "OBJ", recognises: |start, _| obj::recognises(start), open: obj::open },
    Format { name: "XYZ or PTS", recognises: |start, _| xyz::recognises(start), open: |input, _| xyz::open(input) },
];

/// What a recogniser gets to see. Comments may come first in a text file.
pub(crate) const START_BYTES: usize = 64 << 10;

/// Opens a model file of any format that is understood, plain or in gzip.
///
/// The format is found by content, never by name. Reads as far as the end of the header; `source` is read from its beginning.
/// What the model says is in other files stays unknown; [`open_with`] is told where to find them.
///
/// # Errors
/// The file is empty, of no known format, or its header is wrong; the source fails.
pub fn open(source: Box<dyn ByteSource>) -> Result<Box<dyn ModelStream>, ImportError> {
    open_with(source, Box::new(NoSideFiles))
}

/// Name of the format that a file seems to be of, by its first bytes, plain or in gzip; none where it is no model. Nothing else of
/// the file is looked at: it may still be broken.
///
/// # Errors
/// The source fails, or what is packed cannot be unpacked.
pub fn format_of(source: Box<dyn ByteSource>) -> Result<Option<&'static str>, ImportError> {
    let mut input = Input::new(source)?;
    input.has(START_BYTES)?;
    let start = &input.window()[..input.window().len().min(START_BYTES)];
    Ok(find(start, input.known_bytes()).map(|(format, _)| format.name))
}

/// The format of a file that starts so, and how many bytes stand before it: the mark with which some programs begin UTF-8.
fn find(start: &[u8], bytes: Option<u64>) -> Option<(&'static Format, usize)> {
    let find = |start: &[u8]| FORMATS.iter().find(|format| (format.recognises)(start, bytes));
    match (find(start), start.strip_prefix(b"\xef\xbb\xbf")) {
        (Some(format), _) => Some((format, 0)),
        (None, Some(after)) => find(after).map(|format| (format, start.len() - after.len())),
        (None, None) => None,
    }
}

/// As [`open`], for a model that may name other files: materials of OBJ, buffers of glTF.
///
/// # Errors
/// As there; and a file without which there is no model cannot be had.
pub fn open_with(source: Box<dyn ByteSource>, side: Box<dyn SideFiles>) -> Result<Box<dyn ModelStream>, ImportError> {
    let mut input = Input::new(source)?;
    input.has(START_BYTES)?;
    let start = &input.window()[..input.window().len().min(START_BYTES)];
    if start.is_empty() {
        return Err(ImportError::new(Problem::Empty, None));
    }
    match find(start, input.known_bytes()) {
        Some((format, mark_bytes)) => {
            input.consume(mark_bytes);
            (format.open)(input, side)
        }
        None => {
            let names: Vec<_> = FORMATS.iter().map(|format| format.name).collect();
            let understood = format!("a model in a known format ({}; plain or in gzip)", names.join(", "));
            Err(ImportError::new(
                Problem::UnknownFormat { understood, start: shown(&start[..start.len().min(16)]) },
                None,
            ))
        }
    }
}
