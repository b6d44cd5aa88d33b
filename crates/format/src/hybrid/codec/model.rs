//! Probabilities of a file's symbols. One model serves all pages; it lies in the skeleton, so each page decodes by itself.
//!
//! In: counts, or the bytes of a model. Out: tables.
//! What always holds: each symbol that is legal in a table has a frequency of at least 1 there, so any model codes any page.

use super::lanes::{SCALE_BITS, Slots, Table};
use super::prepare::Prepared;
use super::streams::{FIXED, KEYS, Kind, RARE, SIZES, STREAMS, TABLES, TOKENS, table_of};
use super::values::{SYMBOLS, class_of};
use super::weave;
use crate::FormatError;

/// The symbols that can occur in a table, a bit for each.
fn legal(table: usize) -> u64 {
    let symbols = match table {
        TOKENS => weave::TOKENS as u32,
        RARE => 48,
        KEYS => 49,
        _ => [Kind::Position, Kind::Normal, Kind::Color, Kind::PointNormal, Kind::PointColor][(table - FIXED) / SIZES]
            .symbols(),
    };
    (1 << symbols) - 1
}

/// Occurrences of each symbol in each table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statistics {
    counts: Vec<[u64; SYMBOLS]>,
}

impl Default for Statistics {
    fn default() -> Self {
        Self { counts: vec![[0; SYMBOLS]; TABLES] }
    }
}

impl Statistics {
    /// Counts a page.
    pub fn count(&mut self, page: &Prepared) {
        for (table, symbols) in [(TOKENS, &page.tokens), (KEYS, &page.key_classes)] {
            for symbol in symbols {
                self.counts[table][usize::from(*symbol)] += 1;
            }
        }
        for number in &page.rare {
            self.counts[RARE][usize::from(class_of(*number))] += 1;
        }
        for (kind, numbers) in STREAMS.iter().zip(&page.differences) {
            let table = table_of(*kind, size_of(numbers));
            for number in numbers {
                self.counts[table][usize::from(class_of(*number))] += 1;
            }
        }
    }

    /// Adds what others have counted; the order does not matter.
    pub fn add(&mut self, other: &Self) {
        for (counts, more) in self.counts.iter_mut().zip(&other.counts) {
            for (count, more) in counts.iter_mut().zip(more) {
                *count += more;
            }
        }
    }
}

/// Which of the tables numbers are counted for: two for each power of two of their mean.
fn size_of(numbers: &[u32]) -> usize {
    let sum: u64 = numbers.iter().map(|number| u64::from(*number)).sum();
    let mean = 16 + 16 * sum / (numbers.len() as u64).max(1);
    let top = mean.ilog2();
    (2 * (top - 4) + (mean >> (top - 1) & 1) as u32).min(SIZES as u32 - 1) as usize
}

/// Probabilities of all symbols.
#[derive(Clone, Debug)]
pub struct Model {
    tables: Vec<Table>,
    slots: Vec<Slots>,
}

impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        self.tables == other.tables
    }
}

impl Default for Model {
    /// The one that knows nothing.
    fn default() -> Self {
        Self::of(&Statistics::default())
    }
}

impl Model {
    /// The model that codes what was counted in the fewest bits, and anything else in a few more: a sample of the pages will do.
    pub fn of(statistics: &Statistics) -> Self {
        Self::with((0..TABLES).map(|table| Table::of_counts(&statistics.counts[table], legal(table))).collect())
    }

    fn with(tables: Vec<Table>) -> Self {
        Self { slots: tables.iter().map(Slots::of).collect(), tables }
    }

    pub(super) fn slots(&self, table: usize) -> &Slots {
        &self.slots[table]
    }

    pub(super) fn table(&self, table: usize) -> &Table {
        &self.tables[table]
    }

    /// The size whose table codes these classes in the fewest bits.
    pub(super) fn best_size(&self, kind: Kind, classes: &[u8]) -> usize {
        let mut counts = [0u64; SYMBOLS];
        for class in classes {
            counts[usize::from(*class)] += 1;
        }
        let bits = |size: &usize| {
            let frequencies = self.tables[table_of(kind, *size)].frequencies();
            // In 2^-16 of a bit, by a logarithm of integers: the same on all machines.
            counts.iter().zip(frequencies).filter(|(count, _)| **count > 0).map(|(n, f)| n * bits_of(f)).sum::<u64>()
        };
        (0..SIZES).min_by_key(bits).unwrap_or(0)
    }

    /// The tables in order: see `rans::Table::put_all`.
    pub fn to_bytes(&self) -> Vec<u8> {
        Table::put_all(&self.tables, legal)
    }

    /// Undoes [`Model::to_bytes`].
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where the bytes end early or late, a symbol occurs that cannot, or frequencies do not sum to
    /// 2048.
    pub fn parse(bytes: &[u8]) -> Result<Self, FormatError> {
        Table::take_all(bytes, (TABLES, "table"), legal).map(Self::with)
    }
}

/// Bits of a symbol with this frequency, in 2^-16 of a bit and rounded: the logarithm is linear between powers of two.
fn bits_of(frequency: u16) -> u64 {
    let frequency = u64::from(frequency.max(1));
    let top = frequency.ilog2();
    let fraction = (frequency << 16 >> top) - (1 << 16);
    (u64::from(SCALE_BITS) << 16) - (u64::from(top) << 16) - fraction
}
