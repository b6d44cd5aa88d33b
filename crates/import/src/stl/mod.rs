//! STL, binary and text: a list of triangles.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Vertices**: corners at the same position are joined, so that triangles hang together. The table for that is of bounded
//!   size: a position that comes again more than a quarter million vertices later may become another vertex.
//! * **Binary** files are told by their length, 84 bytes and 50 for each triangle, or by a beginning that makes sense as
//!   triangles: a header that starts with `solid` does not mislead. Normals and attribute bytes are ignored; what follows the
//!   last triangle, too.
//! * **Text** files may have several solids. Normals are ignored. Words are told apart by blanks, lines mean nothing, and
//!   capital letters are as good as small ones.
//! * A position that is not finite is an error.

mod ascii;
mod binary;

use crate::{Attributes, Batch, ImportError, ModelStream, Place, error::Problem, input::Input, weld::Weld};
use gigalod_geom::camera::UpAxis;
use glam::DVec3;

/// Bytes before the first triangle of a binary file.
const HEADER_BYTES: usize = 84;
/// Bytes of a triangle.
const FACET_BYTES: usize = 50;

/// True for the beginning of a file of `bytes` bytes, if that is known.
pub(crate) fn recognises(start: &[u8], bytes: Option<u64>) -> bool {
    binary::recognises(start, bytes) || ascii::recognises(start)
}

/// Opens a file that is [recognised](recognises).
pub(crate) fn open(mut input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    if binary::recognises(&input.window()[..input.window().len().min(crate::open::START_BYTES)], input.known_bytes()) {
        let count = binary::facet_count(input.window()).unwrap_or_default();
        input.consume(HEADER_BYTES);
        Ok(Box::new(binary::BinaryStl::new(input, count)))
    } else {
        Ok(Box::new(ascii::AsciiStl::new(input)))
    }
}

/// From triangles to a batch.
struct Soup {
    weld: Weld,
    facets: u64,
}

impl Soup {
    fn new() -> Self {
        Self { weld: Weld::new(), facets: 0 }
    }

    /// Appends a triangle; `place` is its own.
    #[inline]
    fn push(
        &mut self,
        corners: [[f32; 3]; 3],
        batch: &mut Batch,
        place: impl Fn(u64) -> Place,
    ) -> Result<(), ImportError> {
        let mut triangle = [0; 3];
        for (corner, position) in triangle.iter_mut().zip(corners) {
            if !position.iter().all(|value| value.is_finite()) {
                let problem = Problem::NotFinite { position: position.map(f64::from) };
                return Err(ImportError::new(problem, Some(place(self.facets))));
            }
            let Some((vertex, is_new)) = self.weld.vertex(position) else {
                return Err(ImportError::malformed("fewer than 4294967295 vertices", "more", place(self.facets)));
            };
            if is_new {
                batch.vertices.positions.push(DVec3::from_array(position.map(f64::from)));
            }
            *corner = vertex;
        }
        batch.triangles.push(triangle);
        self.facets += 1;
        Ok(())
    }
}

/// What both kinds of file are to others.
macro_rules! stream {
    ($name:ident, $faces:expr) => {
        impl ModelStream for $name {
            fn attributes(&self) -> Attributes {
                Attributes::default()
            }

            /// As programs for solids have it.
            fn up_axis(&self) -> UpAxis {
                UpAxis::Z
            }

            fn declared_faces(&self) -> Option<u64> {
                let faces: fn(&Self) -> Option<u64> = $faces;
                faces(self)
            }

            fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
                batch.clear();
                while !batch.is_full() && self.read(batch)? {}
                Ok(!batch.is_empty())
            }

            fn bytes_consumed(&self) -> (u64, u64) {
                self.input.progress()
            }
        }
    };
}
use stream;
