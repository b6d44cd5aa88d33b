//! Model files as bounded-memory streams.
//!
//! Bytes go in ([`ByteSource`]; this crate opens no file), batches of vertices and triangles come out ([`ModelStream`]), in
//! whatever order the file has them: memory stays bounded by the batch, not by the model. Start at [`open()`]. A stream of
//! vertices without triangles is a point cloud.
//!
//! What always holds, whatever the bytes: positions are finite; every triangle index is below the stream's number of
//! vertices; polygons and strips arrive as triangles; an error names where in the file it is, what was expected and what was
//! found; no input panics, hangs, or makes a reader allocate more than a few batches.
#![forbid(unsafe_code)]

mod batch;
pub mod e57;
mod error;
pub mod gltf;
mod input;
pub mod las;
mod many;
mod number;
pub mod obj;
pub mod off;
mod open;
pub mod pcd;
pub mod ply;
mod polygon;
mod positions;
mod reference;
mod side;
pub mod stl;
mod text;
mod watch;
mod weld;
pub mod xyz;

pub use batch::{Attributes, Batch, CornerBatch, Mapping, Material, Texture, VertexBatch, Wrap, read_all};
pub use error::{ImportError, Item, Place, Position, Problem, Shared};
pub use many::{OpenPart, Part, Together, open_all};
pub use open::{format_of, open, open_with};
pub use reference::ReferenceSystem;
pub use side::{NoSideFiles, SideFiles};
pub use watch::{AskStamp, Stamp, open_watched, open_watched_since, utc};

use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use std::io::{Read, Seek};

/// Where a reader gets its bytes: a file, a buffer in memory, later a range reader over HTTP.
pub trait ByteSource: Read + Seek + Send {}
impl<T: Read + Seek + Send> ByteSource for T {}

/// One model, read front to back.
pub trait ModelStream: Send {
    /// What the vertices carry besides positions; known before the first batch.
    fn attributes(&self) -> Attributes;

    /// The file format's convention for the sky.
    fn up_axis(&self) -> UpAxis {
        UpAxis::Y
    }

    /// What a length of 1 is, where the file or its format says so; known before the first batch. Of coordinates on a map, the
    /// unit of the horizontal ones.
    fn unit(&self) -> Option<LengthUnit> {
        None
    }

    /// What the coordinates mean on the Earth, where the file says so; known before the first batch.
    fn reference_system(&self) -> Option<&ReferenceSystem> {
        None
    }

    /// Materials that triangles of the batches so far have named, by number; there may be more after the next batch.
    fn materials(&self) -> &[Material] {
        &[]
    }

    /// The file of a material's texture, PNG or JPEG, by the material's number and what [`ModelStream::materials`] says of it; to be
    /// asked for after the last batch.
    ///
    /// # Errors
    /// There is no such picture, or its file cannot be had.
    fn open_picture(&mut self, material: u32, _texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        Err(ImportError::no_picture(material))
    }

    /// Number of vertices, where the file says so before they come. Checked against what comes.
    fn declared_vertices(&self) -> Option<u64> {
        None
    }

    /// Number of faces (polygons, not triangles), where the file says so before they come.
    fn declared_faces(&self) -> Option<u64> {
        None
    }

    /// Replaces the contents of `batch` by the next vertices and/or triangles; returns false, with an empty batch, after the
    /// last. Vertices are numbered in the order in which they come; a triangle may come before its vertices.
    ///
    /// # Errors
    /// The first thing that is wrong with the file; the stream is not to be used after it.
    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError>;

    /// Bytes of the source consumed so far and in all, for progress bars (compressed bytes of a compressed file).
    fn bytes_consumed(&self) -> (u64, u64);
}
