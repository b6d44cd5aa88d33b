//! Why there is no output.

use gigalod_import::ImportError;
use std::io;
use std::path::PathBuf;

/// Why a model could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The input is wrong.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// Nothing to show.
    #[error("no triangles and no points, expected at least one")]
    Nothing,
    /// Points have no surface.
    #[error("no triangles, expected at least one; points become splats")]
    NoTriangles,
    /// Refused for [`Options::only_suited`](crate::Options::only_suited).
    #[error("materials colour the triangles, which splats can sample")]
    Painted,
    /// Local space is `f32`.
    #[error("the model is {extent:e} units wide, expected at most 1e30")]
    TooWide {
        /// Longest edge of the bounds.
        extent: f64,
    },
    /// A temporary file could not be written or read back.
    #[error("could not use temporary files: {0}")]
    Scratch(#[source] io::Error),
    /// Two builds of one output.
    #[error("another build is working in {}", .folder.display())]
    Busy {
        /// Where.
        folder: PathBuf,
    },
    /// What is to be continued is not what was begun.
    #[error("the build in {} was {what}: expected {expected}, found {found}; remove the folder or run without --resume", .folder.display())]
    OtherBuild {
        /// Where.
        folder: PathBuf,
        /// The kind of difference, as "of another input".
        what: &'static str,
        /// As it was begun.
        expected: String,
        /// As it is to be continued.
        found: String,
    },
    /// What no plane can separate has to be sorted in memory.
    #[error("{vertices} vertices in one place, expected at most {most} within this budget")]
    Crowd {
        /// In one place.
        vertices: u64,
        /// That the budget has room for.
        most: u64,
    },
    /// A picture has to be decoded in memory.
    #[error("{picture} needs {needed} bytes to be decoded, expected at most {most} within this budget")]
    LargePicture {
        /// As the model names it.
        picture: String,
        /// Bytes that it needs.
        needed: u64,
        /// Bytes that the budget has room for.
        most: u64,
    },
    /// The spacing that was asked for is too small for the model.
    #[error("about {samples:e} samples at a spacing of {spacing}, expected fewer than 2^31")]
    TooFine {
        /// As it was asked for.
        spacing: f64,
        /// That would be needed.
        samples: f64,
    },
    /// More than the format's numbers can count.
    #[error("{found} vertices, expected fewer than 2^31")]
    TooManyVertices {
        /// Referenced vertices.
        found: u64,
    },
    /// The output could not be written.
    #[error("could not write the output: {0}")]
    Output(#[source] io::Error),
    /// The machine refused threads.
    #[error("could not start worker threads: {0}")]
    Threads(String),
}
