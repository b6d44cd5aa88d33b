//! How pages are coded: predictions, and what remains of them under one model of the file.
//!
//! Triangles become steps of a front that grows over them; positions, normals and colours become differences to what is expected by then.
//! All these are streams of symbols, each under one table of the model, and of raw bits. Streams are decoded one after the other, then the
//! page is put together.
//!
//! What always holds: any page decodes to itself, in its own order, under any model; any bytes decode to a page or to an error.
//!
//! Start at [`Prepared`] for writing and `decode` for reading.

mod decode;
mod front;
mod lanes;
mod model;
mod parts;
mod points;
mod predict;
mod prepare;
mod streams;
mod values;
mod weave;

pub use model::{Model, Statistics};
pub use parts::PartBits;
pub use prepare::Prepared;

pub(super) use decode::decode;
pub(super) use weave::borders_of;
