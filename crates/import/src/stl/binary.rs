//! Binary files: a header, the number of triangles, and 50 bytes for each.

use super::{Attributes, Batch, FACET_BYTES, HEADER_BYTES, ImportError, ModelStream, Place, Soup, UpAxis, stream};
use crate::input::Input;

pub(super) struct BinaryStl {
    input: Input,
    soup: Soup,
    /// Declared; perhaps a lie.
    count: u64,
}

/// The number of triangles that a header declares.
pub(super) fn facet_count(start: &[u8]) -> Option<u64> {
    let count = start.get(HEADER_BYTES - 4..HEADER_BYTES)?.first_chunk()?;
    Some(u32::from_le_bytes(*count).into())
}

/// True where the length of the file fits the header, or the first triangles make sense.
pub(super) fn recognises(start: &[u8], bytes: Option<u64>) -> bool {
    let Some(count) = facet_count(start) else { return false };
    if bytes == Some(HEADER_BYTES as u64 + FACET_BYTES as u64 * count) {
        return true;
    }
    let mut facets = start[HEADER_BYTES..].chunks_exact(FACET_BYTES).take(count as usize).peekable();
    facets.peek().is_some() && facets.all(is_plausible)
}

/// True for a facet with a unit or no normal and positions of sane size. Text never looks like that.
fn is_plausible(facet: &[u8]) -> bool {
    let [normal, corners @ ..] = floats(facet);
    let length = normal.iter().map(|value| value * value).sum::<f32>();
    let is_sane = |value: &f32| *value == 0.0 || (1e-30..1e30).contains(&value.abs());
    (length == 0.0 || (0.9..1.1).contains(&length)) && corners.as_flattened().iter().all(is_sane)
}

/// Normal and corners of a facet.
#[inline]
fn floats(facet: &[u8]) -> [[f32; 3]; 4] {
    let (words, _) = facet[..48].as_chunks::<4>();
    std::array::from_fn(|row| std::array::from_fn(|column| f32::from_le_bytes(words[row * 3 + column])))
}

impl BinaryStl {
    /// `input` stands at the first of `count` triangles.
    pub(super) fn new(input: Input, count: u64) -> Self {
        Self { input, soup: Soup::new(), count }
    }

    /// Takes the triangles that are in the window, until the batch is full; false after the last.
    fn read(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        let left = self.count - self.soup.facets;
        if left == 0 {
            self.input.finish()?;
            return Ok(false);
        }
        if !self.input.has(FACET_BYTES)? {
            let end = Place::byte(self.input.offset() + self.input.window().len() as u64);
            let before = format!("facet {} of {} is complete", self.soup.facets, self.count);
            return Err(ImportError::truncated(before, end));
        }
        let offset = self.input.offset();
        let mut taken = 0;
        let most = usize::try_from(left).unwrap_or(usize::MAX);
        for facet in self.input.window().chunks_exact(FACET_BYTES).take(most) {
            let [_, corners @ ..] = floats(facet);
            let place = |number| Place::byte(offset + taken as u64).of_item("facet", number);
            self.soup.push(corners, batch, place)?;
            taken += FACET_BYTES;
            if batch.is_full() {
                break;
            }
        }
        self.input.consume(taken);
        Ok(true)
    }
}

stream!(BinaryStl, |stream| Some(stream.count));
