//! Which table codes which symbol: the contexts of a page's fields, and their probabilities in one file.
//!
//! One model serves all pages of a file; it lies in the skeleton, so each page decodes by itself. The contexts are part of the
//! format: `docs/format.md` lists them in this order.

use super::rans::{SYMBOLS, Slots, Table};
use crate::FormatError;

/// The first context of each field; each field's contexts are numbered from there.
pub(super) mod first {
    /// Size of a group less one. By the size of the group before (0 at the beginning).
    pub(crate) const GROUP: usize = 0;
    /// Tree bits, and the cone of a leaf. By place in the group (0–3), what the node before it in the group is (none, a leaf,
    /// an inner node), and the cone before.
    pub(crate) const KIND: usize = GROUP + 5;
    /// Cone of an inner node. By the cone before.
    pub(crate) const CONE: usize = KIND + 4 * 3 * 4;
    /// Column of the normal, as a difference. By cone, and first of its group or not.
    pub(crate) const COLUMN: usize = CONE + 4;
    /// Row of the normal, as a difference. By cone, first or not, and size of the column's difference.
    pub(crate) const ROW: usize = COLUMN + 4 * 2;
    /// Edge of the sphere's sub-cube less one. By leaf or not, and the edge before it in the group (0 for none).
    pub(crate) const EDGE: usize = ROW + 4 * 2 * 4;
    /// Corner on the first axis along the surface. By edge, and where the siblings before lie on that axis.
    pub(crate) const ALONG_1: usize = EDGE + 2 * 14;
    /// Corner on the second axis along the surface. By edge, where the siblings lie, and how far out the first axis is.
    pub(crate) const ALONG_2: usize = ALONG_1 + 13 * 6;
    /// Corner across the surface, as a difference from the tangent plane. By edge, and leaf or not.
    pub(crate) const ACROSS: usize = ALONG_2 + 13 * 6 * 3;
    /// Green, as a difference. By first of its group or not.
    pub(crate) const GREEN: usize = ACROSS + 13 * 2;
    /// Red, as a difference. By size of green's.
    pub(crate) const RED: usize = GREEN + 2;
    /// Blue, as a difference. By size of green's.
    pub(crate) const BLUE: usize = RED + 4;
    /// Four bits as they are.
    pub(crate) const PLAIN: usize = BLUE + 4;
}

/// Number of contexts that a file stores; [`first::PLAIN`] comes after them and needs no storing.
pub(super) const STORED: usize = first::PLAIN;

/// Occurrences of each symbol in each context.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statistics {
    counts: Vec<[u64; SYMBOLS]>,
}

impl Default for Statistics {
    fn default() -> Self {
        Self { counts: vec![[0; SYMBOLS]; STORED] }
    }
}

impl Statistics {
    pub(super) fn count(&mut self, context: usize, symbol: u8) {
        if let Some(counts) = self.counts.get_mut(context) {
            counts[usize::from(symbol)] += 1;
        }
    }

    /// Adds what others have counted; the order does not matter.
    pub fn add(&mut self, other: &Self) {
        for (counts, more) in self.counts.iter_mut().flatten().zip(other.counts.as_flattened()) {
            *counts += more;
        }
    }
}

/// Probabilities of all symbols in all contexts.
#[derive(Clone, Debug)]
pub struct Model {
    tables: Vec<Table>,
    slots: Slots,
}

impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        self.tables == other.tables
    }
}

impl Eq for Model {}

impl Model {
    /// The model that codes what was counted in the fewest bits.
    pub fn of(statistics: &Statistics) -> Self {
        Self::with(statistics.counts.iter().map(Table::of_counts).collect())
    }

    fn with(mut tables: Vec<Table>) -> Self {
        tables.push(Table::uniform());
        Self { slots: Slots::of(&tables), tables }
    }

    pub(super) fn slots(&self) -> &Slots {
        &self.slots
    }

    pub(super) fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// For each context a `u16` with a bit for each symbol that occurs, then the frequencies of these but the last, as LEB128.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        for table in &self.tables[..STORED] {
            let frequencies = table.frequencies();
            let present = |symbol: &usize| frequencies[*symbol] > 0;
            let mask = (0..SYMBOLS).filter(present).fold(0u16, |mask, symbol| mask | 1 << symbol);
            out.extend(mask.to_le_bytes());
            let mut left = mask.count_ones();
            for symbol in (0..SYMBOLS).filter(present) {
                left -= 1;
                if left > 0 {
                    let frequency = frequencies[symbol];
                    if frequency >= 128 {
                        out.push(frequency as u8 | 0x80);
                    }
                    out.push(if frequency >= 128 { (frequency >> 7) as u8 } else { frequency as u8 });
                }
            }
        }
        out
    }

    /// Undoes [`Model::to_bytes`].
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where the bytes end early or late, or frequencies do not sum to 1024.
    pub fn parse(bytes: &[u8]) -> Result<Self, FormatError> {
        let mut rest = bytes.iter().copied();
        let mut byte = || {
            rest.next()
                .ok_or_else(|| FormatError::invalid("the model", format!("{} bytes, expected more", bytes.len())))
        };
        let mut tables = Vec::with_capacity(STORED + 1);
        for context in 0..STORED {
            let mask = u16::from_le_bytes([byte()?, byte()?]);
            let mut frequencies = [0u16; SYMBOLS];
            let mut left = u32::from(mask != 0) * super::rans::SCALE;
            for (symbol, frequency) in frequencies.iter_mut().enumerate().filter(|(symbol, _)| mask >> symbol & 1 != 0)
            {
                let is_last = u32::from(mask) >> (symbol + 1) == 0;
                let value = if is_last {
                    left
                } else {
                    let low = u32::from(byte()?);
                    if low < 128 { low } else { low - 128 + (u32::from(byte()?) << 7) }
                };
                if value == 0 || value > left {
                    let problem = format!("context {context} has frequencies that sum to more than 1024, or one of 0");
                    return Err(FormatError::invalid("the model", problem));
                }
                left -= value;
                *frequency = value as u16;
            }
            tables.push(Table::of_frequencies(&frequencies).expect("they were taken from the whole"));
        }
        match rest.count() {
            0 => Ok(Self::with(tables)),
            more => Err(FormatError::invalid("the model", format!("{more} bytes too many"))),
        }
    }
}
