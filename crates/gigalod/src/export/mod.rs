//! From a `.glod` file back to a model that other programs read: PLY, OBJ or GLB, at a chosen error.
//!
//! In: an open file. Out: the triangles and points of one cut through its hierarchy, written from front to back; the whole is never in
//! memory. Start at [`hybrid()`]; `format` has the three formats.

mod format;
mod hybrid;
mod merge;
mod splats;

pub use format::Format;
pub use hybrid::hybrid;
pub use splats::splats;

use gigalod_format::FormatError;
use std::io;

/// How much was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Vertices of triangles.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Points that no triangle uses.
    pub points: u64,
}

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The file is damaged.
    #[error(transparent)]
    Damaged(#[from] FormatError),
    /// It is damaged, in the words of who checked it.
    #[error("{0}")]
    Unsound(String),
    /// The format has no room for so much.
    #[error("{found} {what}, {format} has room for at most {most}")]
    TooMuch {
        /// Vertices, or bytes.
        what: &'static str,
        /// How many.
        found: u64,
        /// What is allowed.
        most: u64,
        /// In words.
        format: &'static str,
    },
    /// Writing failed.
    #[error(transparent)]
    Output(#[from] io::Error),
}
