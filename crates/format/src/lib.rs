//! The `.glod` container, and the stores it is read from. `docs/format.md` is the specification.
//!
//! Start at [`Container::open`]; a representation's own part is in the module of its name ([`splats`]).
//!
//! What always holds: nothing here trusts a byte. Sizes are checked against the file before anything is allocated, every
//! section and page has a checksum, and an error names the place, what was expected and what was found. Little-endian,
//! 64-bit offsets. This crate writes to what it is given and opens nothing but through a [`PageStore`].
#![forbid(unsafe_code)]

mod bytes;
mod container;
mod error;
pub mod hybrid;
mod metadata;
mod rans;
pub mod splats;
pub mod store;

pub use container::{Container, HEADER_BYTES, Kind, MAGIC, Section, VERSION, Writer, checksum};
pub use error::FormatError;
pub use metadata::{Bounds, Dicing, InputCounts, LevelSummary, Metadata, ReferenceSystem};
pub use store::{FileStore, MemoryStore, PageStore};
