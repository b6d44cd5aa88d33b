//! Why a model could not be read, and where in the file.
//!
//! In: what a reader expected and what it found. Out: one line without the file's name, which the caller knows and adds:
//! `error: FILE: what is wrong (where)`, that is [`ImportError`]'s `Display` after the name; or [`ImportError::what`] and
//! [`ImportError::place`] apart, for a JSON report.
//!
//! What always holds: messages are one line of printable text, and bounded, whatever bytes the file has.

use crate::Stamp;
use std::{fmt, io};

/// The first thing that is wrong with a file. One word wide, so that returning a result costs nothing in the inner loops.
#[derive(Debug)]
pub struct ImportError(Box<Report>);

#[derive(Debug)]
struct Report {
    problem: Problem,
    place: Option<Place>,
    file: Option<String>,
}

/// What is wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Not a single byte, after unpacking.
    #[error("expected a model, found an empty file")]
    Empty,
    /// No reader recognises the first bytes, shown escaped.
    #[error("expected {understood}, found a file that starts with `{start}`")]
    UnknownFormat {
        /// The formats that would be understood.
        understood: String,
        /// The first bytes, escaped.
        start: String,
    },
    /// The file breaks the rules of its format, or a limit of this reader.
    #[error("expected {expected}, found {found}")]
    Malformed {
        /// What the format asks for here.
        expected: String,
        /// What is there.
        found: String,
    },
    /// An interrupted copy, or a header that promises more than there is.
    #[error("the file ends before {before}")]
    Truncated {
        /// What is missing, as a clause: `vertex 17 of 437645 is complete`.
        before: String,
    },
    /// A corner that names no vertex.
    #[error("expected a vertex number below {vertex_count}, found {index}")]
    IndexOutOfRange {
        /// As in the file; perhaps negative.
        index: f64,
        /// How many vertices the file declares.
        vertex_count: u64,
    },
    /// A vertex at infinity, or nowhere.
    #[error("expected a finite position, found ({}, {}, {})", .position[0], .position[1], .position[2])]
    NotFinite {
        /// x, y and z as in the file.
        position: [f64; 3],
    },
    /// The compressed data is damaged: it cannot be unpacked, or its checksum differs.
    #[error("expected sound gzip data, found damage: {reason}")]
    Gzip {
        /// The unpacker's words.
        reason: String,
    },
    /// Somebody wrote to the file.
    #[error("changed while it was read (expected {expected}, found {found})")]
    Changed {
        /// As it was when it was opened.
        expected: Stamp,
        /// As it is now.
        found: Stamp,
    },
    /// One of several files is not like those before it.
    #[error("expected {expected} as in {first}, found {found}")]
    Differs {
        /// In what.
        what: Shared,
        /// What those before have.
        expected: String,
        /// The first that has it.
        first: String,
        /// What this one has.
        found: String,
    },
    /// The source of the bytes failed; the file itself may be good.
    #[error("expected to read on, found an input error: {source}")]
    Io {
        /// What the source said.
        source: io::Error,
    },
}

/// What several files that are one model have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shared {
    /// All are meshes, or all are point clouds.
    Kind,
    /// The direction of the sky.
    Up,
    /// What a length of 1 is.
    Unit,
    /// What coordinates mean on the Earth.
    ReferenceSystem,
}

/// Where in a file; displays as `line 12`, `line 12, face 3`, `byte 3041` or `byte 3041, face 17`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Counted in the unpacked data when the file is compressed.
    pub position: Position,
    /// The item being read there, when it is in one.
    pub item: Option<Item>,
}

/// A point in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Line of text, from 1: in headers and in text formats.
    Line(u64),
    /// Offset in bytes, from 0: in binary formats. With an [`Item`], where that item begins.
    Byte(u64),
}

/// One of the things that a file lists, such as `face 17`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// The file's word for the kind of thing, escaped.
    pub element: String,
    /// Its number, from 0.
    pub index: u64,
}

impl ImportError {
    pub(crate) fn new(problem: Problem, place: Option<Place>) -> Self {
        Self(Box::new(Report { problem, place, file: None }))
    }

    /// Of a material without a texture.
    pub(crate) fn no_picture(material: u32) -> Self {
        let source = io::Error::new(io::ErrorKind::NotFound, format!("material {material} has no picture"));
        Self::new(Problem::Io { source }, None)
    }

    pub(crate) fn malformed(expected: impl Into<String>, found: impl Into<String>, place: Place) -> Self {
        Self::new(Problem::Malformed { expected: expected.into(), found: found.into() }, Some(place))
    }

    pub(crate) fn truncated(before: impl Into<String>, place: Place) -> Self {
        Self::new(Problem::Truncated { before: before.into() }, Some(place))
    }

    /// Says which of several files it is of; the innermost word counts.
    pub(crate) fn of_file(mut self, name: &str) -> Self {
        self.0.file.get_or_insert_with(|| name.to_owned());
        self
    }

    /// Which of several files it is of, by the name that [`Part`](crate::Part) has for it; none of a model in one file, whose
    /// name the caller knows.
    pub fn file(&self) -> Option<&str> {
        self.0.file.as_deref()
    }

    /// What is wrong, without where: its `Display` is the message.
    pub fn what(&self) -> &Problem {
        &self.0.problem
    }

    /// Where, unless the file as a whole is wrong.
    pub fn place(&self) -> Option<&Place> {
        self.0.place.as_ref()
    }
}

impl From<io::Error> for ImportError {
    fn from(source: io::Error) -> Self {
        Self::new(Problem::Io { source }, None)
    }
}

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.problem)?;
        match &self.0.place {
            Some(place) => write!(f, " ({place})"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for ImportError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        std::error::Error::source(&self.0.problem)
    }
}

impl Place {
    pub(crate) fn line(number: u64) -> Self {
        Self { position: Position::Line(number), item: None }
    }

    pub(crate) fn byte(offset: u64) -> Self {
        Self { position: Position::Byte(offset), item: None }
    }

    pub(crate) fn of_item(self, element: &str, index: u64) -> Self {
        Self { item: Some(Item { element: shown(element.as_bytes()), index }), ..self }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.position {
            Position::Line(number) => write!(f, "line {number}")?,
            Position::Byte(offset) => write!(f, "byte {offset}")?,
        }
        match &self.item {
            Some(Item { element, index }) => write!(f, ", {element} {index}"),
            None => Ok(()),
        }
    }
}

/// Bytes of a file as they may appear in a message: escaped, and cut after the first few.
pub(crate) fn shown(bytes: &[u8]) -> String {
    const MOST: usize = 48;
    let more = if bytes.len() > MOST { "…" } else { "" };
    format!("{}{more}", bytes[..bytes.len().min(MOST)].escape_ascii())
}

/// What a library says is wrong, as part of a message: one line, not too long.
pub(crate) fn said(error: impl fmt::Display) -> String {
    const MOST: usize = 200;
    let words = error.to_string();
    let mut line: String = words.chars().take(MOST).map(|it| if it.is_control() { ' ' } else { it }).collect();
    if line.len() < words.len() {
        line.push('…');
    }
    line
}
