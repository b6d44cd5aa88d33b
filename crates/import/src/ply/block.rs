//! The fast path: many simple items of a binary file at a time.
//!
//! In: the window of the input. Out: vertices or triangles at the end of a batch, and how many items and bytes they took.
//!
//! What always holds: only whole, correct items are taken. At the first that is cut off by the end of the window, or wrong in
//! any way, it stops; the slow path then reads that one, and it alone reports errors. A test holds the two to the same result.

use super::{
    corners::Topology,
    header::{Element, Shape},
    plan::Content,
    scalar::{ByteOrder, Scalar},
    vertex::Rows,
};
use crate::Batch;

/// Layout of the items of an element that can be read in blocks.
pub(super) enum Block {
    /// Items without lists: each has this many bytes, at least 1.
    Rows { stride: usize },
    /// Faces whose corners are a `list uchar int` or `list uchar uint`, and that have no other list.
    Faces {
        /// Bytes of an item before the list.
        before: usize,
        /// Bytes of an item after the list.
        after: usize,
        /// Vertex numbers, taken as unsigned, are below this; for `int`, that refuses negative ones as well.
        limit: u32,
    },
}

/// What [`Block::take`] has used up of its window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Taken {
    pub(super) bytes: usize,
    pub(super) items: u64,
}

impl Block {
    /// The layout of an element, if it is simple enough.
    pub(super) fn of(element: &Element, content: &Content, vertex_count: u64) -> Option<Self> {
        let bytes = |properties: std::ops::Range<usize>| -> usize {
            element.properties[properties].iter().map(|property| property.least_bytes()).sum()
        };
        let all = 0..element.properties.len();
        let is_list = |&index: &usize| matches!(element.properties[index].shape, Shape::List { .. });
        let mut lists = all.clone().filter(is_list);
        match (lists.next(), lists.next(), content) {
            (None, ..) if !all.is_empty() => Some(Self::Rows { stride: bytes(all) }),
            (Some(only), None, &Content::Corners { topology: Topology::Fan, .. }) => {
                let most = match element.properties[only].shape {
                    Shape::List { length: Scalar::U8, value: Scalar::I32 } => i32::MAX as u64 + 1,
                    Shape::List { length: Scalar::U8, value: Scalar::U32 } => u32::MAX.into(),
                    _ => return None,
                };
                let limit = vertex_count.min(most) as u32;
                Some(Self::Faces { before: bytes(0..only), after: bytes(only + 1..all.end), limit })
            }
            _ => None,
        }
    }

    /// Takes items from the start of `window`, at most `left`, until the batch is full. The batch has room.
    pub(super) fn take(
        &self,
        content: &Content,
        order: ByteOrder,
        window: &[u8],
        left: u64,
        batch: &mut Batch,
    ) -> Taken {
        match (self, order) {
            (&Self::Rows { stride }, _) => {
                let mut count = left.min((window.len() / stride) as u64) as usize;
                if let Content::Vertices(channels) = content {
                    let vertices = &mut batch.vertices;
                    count = count.min(Batch::TARGET - vertices.positions.len());
                    count = channels.push_rows(Rows { bytes: &window[..count * stride], stride, order }, vertices);
                }
                Taken { bytes: count * stride, items: count as u64 }
            }
            (&Self::Faces { before, after, limit }, ByteOrder::Little) => {
                faces([before, after], limit, u32::from_le_bytes, window, left, &mut batch.triangles)
            }
            (&Self::Faces { before, after, limit }, ByteOrder::Big) => {
                faces([before, after], limit, u32::from_be_bytes, window, left, &mut batch.triangles)
            }
        }
    }
}

/// Takes faces; compiled for each byte order. The last polygon may pass [`Batch::TARGET`] by its 255 corners.
fn faces(
    [before, after]: [usize; 2],
    limit: u32,
    vertex_number: impl Fn([u8; 4]) -> u32,
    window: &[u8],
    left: u64,
    triangles: &mut Vec<[u32; 3]>,
) -> Taken {
    let mut taken = Taken::default();
    while taken.items < left && triangles.len() < Batch::TARGET {
        let Some((&length, list)) = window.get(taken.bytes + before..).and_then(<[u8]>::split_first) else {
            break;
        };
        let list_bytes = 4 * usize::from(length);
        if list.len() < list_bytes + after {
            break;
        }
        let (corners, _) = list[..list_bytes].as_chunks::<4>();
        match *corners {
            [a, b, c] => {
                let triangle = [a, b, c].map(&vertex_number);
                if triangle.iter().any(|&corner| corner >= limit) {
                    break;
                }
                triangles.push(triangle);
            }
            _ if corners.iter().any(|&corner| vertex_number(corner) >= limit) => break,
            [first, ref others @ ..] => triangles
                .extend(others.array_windows().map(|&[previous, next]| [first, previous, next].map(&vertex_number))),
            [] => {}
        }
        taken.bytes += before + 1 + list_bytes + after;
        taken.items += 1;
    }
    taken
}

#[cfg(test)]
mod tests {
    use crate::{
        Batch, ImportError, ModelStream,
        input::Input,
        ply::{binary::Binary, header, plan::Body, scalar::ByteOrder, stream::PlyStream},
    };
    use std::io::Cursor;

    /// Everything that a file gives, and the error at its end, if any.
    type Outcome = (Vec<[u64; 3]>, Vec<[u32; 3]>, Vec<[u8; 3]>, Vec<[u32; 3]>, Option<String>);

    fn outcome(bytes: &[u8], order: ByteOrder, with_blocks: bool) -> Outcome {
        let mut input = Input::new(Box::new(Cursor::new(bytes.to_vec()))).expect("memory does not fail");
        input.has(1024).expect("memory does not fail"); // As `open` does, to recognise the format.
        let header = header::read(&mut input).expect("the header is good");
        let mut body = Body::new(header.elements, header.last_line).expect("the header is good");
        for section in &mut body.sections {
            assert!(section.block.is_some(), "{} has no fast path", section.element.name);
            section.block.take_if(|_| !with_blocks);
        }
        let mut stream = PlyStream::new(input, body, Binary::new(order));
        let (mut all, mut batch) = (Outcome::default(), Batch::default());
        let mut next = || -> Result<bool, ImportError> {
            let more = stream.next(&mut batch)?;
            all.0.extend(batch.vertices.positions.iter().map(|p| p.to_array().map(f64::to_bits)));
            all.1.extend(batch.vertices.normals.iter().map(|n| n.to_array().map(f32::to_bits)));
            all.2.extend(&batch.vertices.colors);
            all.3.extend(&batch.triangles);
            Ok(more)
        };
        let end = loop {
            match next() {
                Ok(true) => {}
                Ok(false) => break None,
                Err(error) => break Some(error.to_string()),
            }
        };
        all.4 = end;
        all
    }

    const HEADER: &str = "element camera 3\nproperty double view\nproperty char flag\n\
        element vertex 30000\nproperty float y\nproperty uchar red\nproperty uchar green\nproperty double x\n\
        property float z\nproperty ushort blue\nproperty float nx\nproperty float ny\nproperty double nz\n\
        element face 20000\nproperty short group\nproperty list uchar int vertex_indices\nproperty float quality\n\
        end_header\n";

    /// A good file of two megabytes, from a linear congruential generator.
    fn file(order: ByteOrder) -> Vec<u8> {
        let mut state = 1_u32;
        let mut random = move |end: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % end
        };
        let name = if order == ByteOrder::Little { "little" } else { "big" };
        let mut bytes = format!("ply\nformat binary_{name}_endian 1.0\n{HEADER}").into_bytes();
        bytes.extend([1; 3 * 9]);
        // Bytes of vertices are 16 to 63: numbers of either order are finite then.
        bytes.extend((0..30_000 * 36).map(|_| 16 + random(48) as u8));
        for _ in 0..20_000 {
            let corners = if random(4) > 0 { 3 } else { random(256) >> random(8) };
            bytes.extend([0, 0, corners as u8]);
            for _ in 0..corners {
                let corner = random(30_000);
                bytes.extend(if order == ByteOrder::Little { corner.to_le_bytes() } else { corner.to_be_bytes() });
            }
            bytes.extend([0; 4]);
        }
        bytes
    }

    #[test]
    fn the_fast_path_gives_what_the_slow_one_does_for_good_and_bad_files() {
        for order in [ByteOrder::Little, ByteOrder::Big] {
            let good = file(order);
            let body = good.len() - good.windows(11).position(|word| word == b"end_header\n").expect("written") - 11;
            let whole = outcome(&good, order, true);
            assert!((whole.0.len(), whole.4.as_ref()) == (30_000, None), "{:?}", whole.4);
            assert!(whole == outcome(&good, order, false));
            for number in 1..12 {
                let mut damaged = good.clone();
                let at = good.len() - body * number / 12;
                match number % 3 {
                    0 => damaged.truncate(at),
                    1 => damaged[at..at + 16].fill(255),
                    _ => damaged[at] ^= 1,
                }
                let (fast, slow) = (outcome(&damaged, order, true), outcome(&damaged, order, false));
                assert_eq!(fast.4, slow.4, "{order:?}, damage {number}");
                // What the last batch held is lost with an error, and the two cut batches differently.
                if fast.4.is_none() {
                    assert!(fast == slow, "{order:?}, damage {number}");
                }
            }
        }
    }
}
