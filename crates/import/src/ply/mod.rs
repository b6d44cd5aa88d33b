//! PLY, the Stanford triangle format: text and binary of either byte order, any elements in any order.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Header.** Lines end in LF, CR LF or a lone CR (then all lines, those of a text body included, do). Blank lines are
//!   skipped. A line has at most 16 KiB, the header 1 MiB, an element 1,024 properties.
//! * **Vertices** are the element `vertex`, which must have the single numbers `x`, `y` and `z`; there are fewer than 2³². A
//!   position that is not finite is an error. Text is read as `f64`, whatever type the header names.
//! * **Normals** are `nx`, `ny`, `nz`, all three or none. One that is not finite, as `f32`, becomes zero: "no normal here".
//! * **Colours** are `red`, `green`, `blue`, or `diffuse_red`…, or `r`, `g`, `b`; all three or none. 8-bit values stay as they
//!   are; wider integers are scaled from 0..maximum of the type to 0..255; `float` and `double` from 0..1. Results are
//!   rounded to the nearest and clamped: what is negative or NaN gives 0. Alpha is ignored.
//! * **Faces** are the list `vertex_indices` or `vertex_index` of the element `face`. Corners `a b c d …` become the fan
//!   `abc acd …`, right for convex polygons; fewer than three corners make no triangle. Repeated corners are passed on.
//! * **Strips** are the same list of the element `tristrips`: −1 starts over, every second triangle is turned around, and
//!   triangles with a repeated corner are dropped.
//! * **Everything else**, elements and properties, is skipped; so is what follows the last element.
//! * **Text values** are separated by blanks. An item (a vertex, a face) starts on a new line. It may go on over several
//!   lines, and then must end where a line ends; an item on one line may be followed by more values, which are ignored. So a
//!   missing value is found in the line after it, rather than shifting the rest of the file. Integers may be written as
//!   `3.0`, and `nan`, `inf`, a leading `+` and the `1.#QNAN` of old Windows programs are numbers too.
//!
//! Inside: `header` parses the header, `plan` decides once per element what its properties mean, `stream` walks the elements,
//! value by value, through `ascii` or `binary`; `block` converts runs of plain binary items much faster, and leaves every odd
//! item, so also every error, to `stream`.

mod ascii;
mod binary;
mod block;
mod corners;
mod header;
mod plan;
mod scalar;
mod stream;
mod values;
mod vertex;

use crate::{ImportError, ModelStream, input::Input};
use ascii::Ascii;
use binary::Binary;
use header::{Encoding, Header};
use plan::Body;
use scalar::ByteOrder;
use stream::PlyStream;

/// True for a file that starts, after blank lines at most, with the word `ply`.
pub(crate) fn recognises(start: &[u8]) -> bool {
    match start.trim_ascii_start() {
        [b'p', b'l', b'y', after, ..] => after.is_ascii_whitespace(),
        other => other == b"ply",
    }
}

/// Reads the header of a file that is [recognised](recognises).
pub(crate) fn open(mut input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    let Header { encoding, elements, line_end, last_line } = header::read(&mut input)?;
    let body = Body::new(elements, last_line)?;
    Ok(match encoding {
        Encoding::Ascii => Box::new(PlyStream::new(input, body, Ascii::new(line_end, last_line + 1))),
        Encoding::BinaryLittleEndian => Box::new(PlyStream::new(input, body, Binary::new(ByteOrder::Little))),
        Encoding::BinaryBigEndian => Box::new(PlyStream::new(input, body, Binary::new(ByteOrder::Big))),
    })
}
