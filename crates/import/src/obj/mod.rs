//! Wavefront OBJ, with its materials.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Lines** end in LF, CR LF or a lone CR (then all do); a backslash at the end joins a line with the next. `#` begins a
//!   comment. A joined line has less than 256 KiB. Text may be UTF-8 or, with a byte order mark, UTF-16.
//! * **Vertices** are `v x y z`, with what follows: nothing, a weight (ignored), or a colour, `r g b`, from 0 to 1, or to 255
//!   where any of the three is above 1. Whether there are colours is decided by the vertices in the first 64 KiB; a vertex
//!   without one is then white, and a colour that is not finite black. A position that is not finite is an error.
//! * **Faces** are `f` with corners `v`, `v/vt`, `v//vn` or `v/vt/vn`; numbers from 1, or negative ones that count back from
//!   the line. Polygons of more than three corners are triangulated by clipping ears, right for concave ones; their vertices
//!   must come before them. Triangles may come before their vertices. One or two corners make no triangle, none is an error.
//!   `fo` is an old word for `f`.
//! * **Texture coordinates** are streamed as they come; corners name them. Normals (`vn`) are left to the builder, which takes
//!   them from the faces: those of corners are read only to check that they are numbers.
//! * **Materials**: `usemtl` names; from `mtllib`, where the file can be had, `Kd` and `map_Kd`; `map_d` where it names the same
//!   picture, whose opacity then cuts leaves out. A library that is missing or wrong changes nothing but looks, so it is not an
//!   error: then materials have names only. `mtllib` comes before its use.
//! * **Everything else** (groups, smoothing, lines, points, curves) is skipped; so are unknown words.

mod face;
mod material;
mod stream;

use crate::{
    ImportError, ModelStream, SideFiles,
    input::Input,
    text::{self, words},
};

/// Words that begin the lines of an OBJ file.
const KEYWORDS: [&[u8]; 14] =
    [b"v", b"vn", b"vt", b"vp", b"f", b"fo", b"o", b"g", b"s", b"l", b"p", b"mtllib", b"usemtl", b"usemap"];

/// True for text whose first line that is not blank or a comment begins with a word of OBJ.
pub(crate) fn recognises(start: &[u8]) -> bool {
    let line_end = if start.contains(&b'\n') { b'\n' } else { b'\r' };
    let mut lines = start.split(|&byte| byte == line_end);
    match lines.find_map(text::word) {
        Some((word, _)) => KEYWORDS.contains(&word),
        None => false,
    }
}

/// True where a vertex of the beginning of a file has a colour.
fn has_colors(start: &[u8], line_end: u8) -> bool {
    start.split(|&byte| byte == line_end).any(|line| {
        let mut words = words(line);
        words.next() == Some(b"v") && words.filter_map(crate::number::parse).count() >= 6
    })
}

/// Opens a file that is [recognised](recognises).
pub(crate) fn open(input: Input, side: Box<dyn SideFiles>) -> Result<Box<dyn ModelStream>, ImportError> {
    Ok(Box::new(stream::ObjStream::new(input, side)))
}
