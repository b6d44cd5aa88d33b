//! Finds out what a file is, by its content, and opens the reader for it.
//!
//! In: a [`ByteSource`]. Out: a [`ModelStream`] whose header has been read and checked. A new format is one more row of
//! [`FORMATS`].

use crate::{
    ByteSource, ImportError, ModelStream,
    error::{Problem, shown},
    input::Input,
    ply,
};

/// A format that this crate reads.
struct Format {
    name: &'static str,
    /// True when a file that starts with these bytes (at most [`START_BYTES`], fewer in a shorter file) is of this format.
    recognises: fn(&[u8]) -> bool,
    open: fn(Input) -> Result<Box<dyn ModelStream>, ImportError>,
}

const FORMATS: &[Format] = &[Format { name: "PLY", recognises: ply::recognises, open: ply::open }];

/// What a recogniser gets to see.
const START_BYTES: usize = 1024;

/// Opens a model file of any format that is understood, plain or in gzip: today PLY.
///
/// The format is found by content, never by name. Reads as far as the end of the header; `source` is read from its beginning.
///
/// # Errors
/// The file is empty, of no known format, or its header is wrong; the source fails.
pub fn open(source: Box<dyn ByteSource>) -> Result<Box<dyn ModelStream>, ImportError> {
    let mut input = Input::new(source)?;
    input.has(START_BYTES)?;
    let start = &input.window()[..input.window().len().min(START_BYTES)];
    if start.is_empty() {
        return Err(ImportError::new(Problem::Empty, None));
    }
    match FORMATS.iter().find(|format| (format.recognises)(start)) {
        Some(format) => (format.open)(input),
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
