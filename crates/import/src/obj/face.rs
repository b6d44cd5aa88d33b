//! A line `f`: its corners.

use crate::{CornerBatch, ImportError, Place, error::shown, text::words};

/// How many there are of what corners name, where the line stands.
pub(super) struct Counts {
    pub(super) vertices: u64,
    pub(super) tex_coords: u64,
    pub(super) normals: u64,
}

/// A corner: a vertex, perhaps yet to come, and a texture coordinate or [`CornerBatch::NONE`], perhaps yet to come.
pub(super) type Corner = [u32; 2];

/// Parses what follows `f`.
pub(super) fn parse(line: &[u8], counts: &Counts, corners: &mut Vec<Corner>, place: &Place) -> Result<(), ImportError> {
    corners.clear();
    for word in words(line) {
        let mut parts = word.split(|&byte| byte == b'/');
        let vertex = parts.next().unwrap_or_default();
        let vertex = number(vertex, counts.vertices, "vertex", word, place)?;
        let tex_coord = match parts.next() {
            None | Some(b"") => CornerBatch::NONE,
            Some(tex_coord) => number(tex_coord, counts.tex_coords, "texture coordinate", word, place)?,
        };
        match parts.next() {
            None | Some(b"") => {}
            Some(normal) => {
                number(normal, counts.normals, "normal", word, place)?;
            }
        }
        if parts.next().is_some() {
            return Err(ImportError::malformed("a corner `v/vt/vn`", quoted(word), place.clone()));
        }
        corners.push([vertex, tex_coord]);
    }
    if corners.is_empty() {
        return Err(ImportError::malformed("the corners of a face after `f`", "none", place.clone()));
    }
    Ok(())
}

fn quoted(word: &[u8]) -> String {
    format!("`{}`", shown(word))
}

/// A number from 1, or one that counts back from `count`: as one from 0.
#[inline]
fn number(digits: &[u8], count: u64, what: &str, word: &[u8], place: &Place) -> Result<u32, ImportError> {
    let (negative, digits) = match digits {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    let mut value = 0u64;
    for &byte in digits {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            return Err(ImportError::malformed("a corner `v/vt/vn`", quoted(word), place.clone()));
        }
        value = (value * 10 + u64::from(digit)).min(1 << 40);
    }
    if digits.is_empty() {
        return Err(ImportError::malformed("a corner `v/vt/vn`", quoted(word), place.clone()));
    }
    let from_zero = if negative { count.checked_sub(value).filter(|_| value > 0) } else { value.checked_sub(1) };
    match from_zero {
        Some(index) if index < u64::from(u32::MAX) => Ok(index as u32),
        _ => Err(out_of_range(what, count, &shown(word), place.clone())),
    }
}

/// The error of a number that names nothing.
pub(super) fn out_of_range(what: &str, count: u64, found: &str, place: Place) -> ImportError {
    let expected = match count {
        0 => format!("no {what}, of which there are none"),
        _ => format!("a {what} number from 1 to {count}, or from -{count} to -1"),
    };
    ImportError::malformed(expected, format!("`{found}`"), place)
}
