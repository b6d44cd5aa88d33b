//! The header of LAS.
//!
//! What always holds: records are as long as their point format needs at least; the points lie behind the header; a LAZ
//! file's items make up its records.

use super::records::{self, Extent, Records};
use crate::{ImportError, Place, input::Input};

/// Least length of a header, that of LAS 1.0.
const LEAST_HEADER_BYTES: usize = 227;
/// Length of the header of LAS 1.4.
const HEADER_BYTES_1_4: usize = 375;

/// Bytes of a record without extra bytes, and where its colour is, by point format.
const POINT_FORMATS: [(usize, Option<usize>); 11] = [
    (20, None),
    (28, None),
    (26, Some(20)),
    (34, Some(28)),
    (57, None),
    (63, Some(28)),
    (30, None),
    (36, Some(30)),
    (38, Some(30)),
    (59, None),
    (67, Some(30)),
];

pub(super) struct Header {
    /// Below 2³²; declared, perhaps a lie.
    pub(super) point_count: u64,
    pub(super) points_offset: u64,
    pub(super) record_bytes: usize,
    /// Where in a record the colour is.
    pub(super) color_offset: Option<usize>,
    /// Of x, y and z.
    pub(super) scale: [f64; 3],
    pub(super) offset: [f64; 3],
    /// How the points are packed, and what their coordinates mean.
    pub(super) records: Records,
}

impl Header {
    /// The file ends at `offset`, within point `number`.
    pub(super) fn truncated(&self, number: u64, offset: u64) -> ImportError {
        ImportError::truncated(format!("point {number} of {} is complete", self.point_count), Place::byte(offset))
    }
}

/// Reads the header and the variable-length records, as far as they matter.
pub(super) fn read(input: &mut Input) -> Result<Header, ImportError> {
    let ends_early = |input: &Input| {
        ImportError::truncated("the header is complete", Place::byte(input.offset() + input.window().len() as u64))
    };
    if !input.has(LEAST_HEADER_BYTES)? {
        return Err(ends_early(input));
    }
    let header_bytes = usize::from(u16_at(input.window(), 94));
    let is_1_4 = input.window()[24..26] >= [1, 4][..] && header_bytes >= HEADER_BYTES_1_4;
    if header_bytes < LEAST_HEADER_BYTES {
        let expected = format!("a header of at least {LEAST_HEADER_BYTES} bytes");
        return Err(ImportError::malformed(expected, header_bytes.to_string(), Place::byte(94)));
    }
    if !input.has(header_bytes)? {
        return Err(ends_early(input));
    }
    let bytes = input.window();
    let [major, minor] = [bytes[24], bytes[25]];
    if major != 1 || minor > 4 {
        return Err(ImportError::malformed("LAS 1.0 to 1.4", format!("version {major}.{minor}"), Place::byte(24)));
    }
    let (points_offset, vlr_count) = (u64::from(u32_at(bytes, 96)), u32_at(bytes, 100));
    // The two upper bits say that the points are packed.
    let (point_format, is_packed) = (usize::from(bytes[104] & 0x3f), bytes[104] & 0x80 != 0);
    let record_bytes = usize::from(u16_at(bytes, 105));
    let Some(&(least, color_offset)) = POINT_FORMATS.get(point_format) else {
        return Err(ImportError::malformed("a point format from 0 to 10", point_format.to_string(), Place::byte(104)));
    };
    if record_bytes < least {
        let expected = format!("at least {least} bytes for a point of format {point_format}");
        return Err(ImportError::malformed(expected, record_bytes.to_string(), Place::byte(105)));
    }
    if points_offset < header_bytes as u64 {
        let expected = format!("points after the {header_bytes} bytes of the header");
        return Err(ImportError::malformed(expected, points_offset.to_string(), Place::byte(96)));
    }
    let legacy_count = u64::from(u32_at(bytes, 107));
    let point_count = match is_1_4.then(|| u64::from_le_bytes(bytes_at(bytes, 247))) {
        Some(count) if count > 0 => count,
        _ => legacy_count,
    };
    if point_count >= u64::from(u32::MAX) {
        return Err(ImportError::malformed("fewer than 4294967295 points", point_count.to_string(), Place::byte(247)));
    }
    let triple = |at: usize| std::array::from_fn(|axis| f64::from_le_bytes(bytes_at(bytes, at + 8 * axis)));
    let (scale, offset): ([f64; 3], [f64; 3]) = (triple(131), triple(155));
    let late = is_1_4.then(|| (u64::from_le_bytes(bytes_at(bytes, 235)), u32_at(bytes, 243)));
    let extent = Extent { count: vlr_count, points_offset, late };
    input.consume(header_bytes);
    let records = records::read(input, &extent, is_packed.then_some(record_bytes))?;
    Ok(Header { point_count, points_offset, record_bytes, color_offset, scale, offset, records })
}

fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    *bytes[at..].first_chunk().expect("the header is that long")
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes_at(bytes, at))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes_at(bytes, at))
}
