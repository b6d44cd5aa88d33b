//! What can be wrong with a `.glod` file.

use std::io;

/// Why a container, its skeleton or a page could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// Not a `.glod` file at all.
    #[error("not a .glod file: it begins with {found}, expected {expected}")]
    Magic {
        /// First bytes of the file, escaped; "nothing" of an empty one.
        found: String,
        /// The magic, escaped.
        expected: String,
    },
    /// Written by a newer program.
    #[error("format version {found} (this program reads version {expected})")]
    Version {
        /// In the file.
        found: u32,
        /// Ours.
        expected: u32,
    },
    /// A feature bit this program does not know.
    #[error("the file needs {name}, which this program does not know")]
    Feature {
        /// Name or number of the lowest unknown bit.
        name: String,
    },
    /// A representation this program does not know, or not the one asked for.
    #[error("the file holds {found}, expected {expected}")]
    Kind {
        /// In the file.
        found: String,
        /// What is understood here.
        expected: String,
    },
    /// An interrupted copy, most likely.
    #[error("{what} ends at byte {end} but the file has {file_bytes}")]
    Truncated {
        /// Which part of the file.
        what: String,
        /// Where that part ends.
        end: u64,
        /// Length of the file.
        file_bytes: u64,
    },
    /// Bytes changed after they were written.
    #[error("{what} has checksum {found:#010x}, expected {expected:#010x}")]
    Checksum {
        /// Which part of the file.
        what: String,
        /// As written beside it.
        expected: u32,
        /// Of the bytes as they are.
        found: u32,
    },
    /// The checksum is right, but the contents contradict themselves: a writer's bug, or somebody's trick.
    #[error("{what}: {problem}")]
    Invalid {
        /// Which part of the file.
        what: String,
        /// Expected and found.
        problem: String,
    },
    /// The store failed.
    #[error("could not read {what}: {source}")]
    Io {
        /// Which part of the file.
        what: String,
        /// As the system says it.
        #[source]
        source: io::Error,
    },
}

impl FormatError {
    pub(crate) fn invalid(what: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), problem: problem.into() }
    }
}
