//! Why there is no output.

use gigalod_import::ImportError;
use std::io;

/// Why a model could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The input is wrong.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// Nothing to show.
    #[error("no triangles, expected at least one ({vertices} vertices without a face)")]
    NoTriangles {
        /// Vertices read.
        vertices: u64,
    },
    /// Local space is `f32`.
    #[error("the model is {extent:e} units wide, expected at most 1e30")]
    TooWide {
        /// Longest edge of the bounds.
        extent: f64,
    },
    /// The budget does not suffice.
    #[error("{elements} need {needed} of memory, the budget is {budget}")]
    OverBudget {
        /// What was read when it became clear.
        elements: String,
        /// In bytes, readable.
        needed: String,
        /// In bytes, readable.
        budget: String,
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
