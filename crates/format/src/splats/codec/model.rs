//! Which table codes which symbol: the contexts of a page's fields, and their probabilities in one file.
//!
//! One model serves all pages of a file; it lies in the skeleton, so each page decodes by itself. The contexts are part of the
//! format: `docs/format.md` lists them in this order. In: counts, or the bytes of a model. Out: tables.
//!
//! What always holds: each symbol that is legal in a context has a frequency of at least 1 there, so any model codes any page;
//! one that is not legal has none, so a decoder never sees it.

use super::lister::Symbol;
use super::rans::{ROW, Slots, Table};
use crate::FormatError;

/// The first context of each field; each field's contexts are numbered from there.
pub(super) mod first {
    /// Tree bits, and whether the node is the last of its group. By place in the group and whether the node before is inner
    /// (7), and the cone before.
    pub(crate) const KIND: u32 = 0;
    /// Cone, and how the normal's face lies to the one before. By leaf or inner, first of its group or not, the cone before, and
    /// which border of its face the guess is near. 24 symbols, so each has two numbers.
    pub(crate) const CONE_AND_FACE: u32 = KIND + 7 * 4;
    /// How far column and row of the normal are from their guesses, in classes. By cone, first of its group or not, and whether
    /// the face is that of the node before. Up to 46 symbols, so each has three numbers.
    pub(crate) const CLASSES: u32 = CONE_AND_FACE + 2 * 2 * 4 * 5 * 2;
    /// Edge of the sphere's sub-cube less one. By leaf or not, and the edge before it in the group (0 for none).
    pub(crate) const EDGE: u32 = CLASSES + 4 * 2 * 2 * 3;
    /// Corner on the first axis along the surface. By edge, and where the siblings before lie on that axis.
    pub(crate) const ALONG_1: u32 = EDGE + 2 * 14;
    /// Corner on the second axis along the surface. By edge, where the siblings lie, and how far out the first axis is.
    pub(crate) const ALONG_2: u32 = ALONG_1 + 13 * 6;
    /// Corner across the surface, as a difference from the tangent plane. By edge, and leaf or not.
    pub(crate) const ACROSS: u32 = ALONG_2 + 13 * 6 * 3;
    /// Green, as a difference. By first of its group or not.
    pub(crate) const GREEN: u32 = ACROSS + 13 * 2;
    /// Red, as a difference. By size of green's.
    pub(crate) const RED: u32 = GREEN + 2;
    /// Blue, as a difference. By size of green's.
    pub(crate) const BLUE: u32 = RED + 4;
    /// Groups of two families. By the groups of the family before.
    pub(crate) const FAMILY: u32 = BLUE + 4;
    /// Run of a link. By the run of the link before.
    pub(crate) const RUN: u32 = FAMILY + 4;
    /// Families that a link skips.
    pub(crate) const SKIP: u32 = RUN + 16;
    /// How many there are.
    pub(crate) const END: u32 = SKIP + crate::splats::links::SKIP_CONTEXTS;
}

/// Number of contexts.
pub(super) const STORED: usize = first::END as usize;
/// A power of two from the number of contexts on: what arrays have, so that masked indices need no check.
pub(super) const CONTEXTS: usize = 1024;
const _: () = assert!(STORED < CONTEXTS);

/// The symbols that can occur in a context, a bit for each; none where a number is not the first of its context.
pub(super) fn legal(context: usize) -> u64 {
    let below = |symbols: usize| (1u64 << symbols) - 1;
    // By edge, 14 less the edge; `each` contexts an edge.
    let corners = |from: u32, each: usize| below(13 - (context - from as usize) / each);
    match context as u32 {
        // The last node of four is the last. There are no single children.
        first::KIND..first::CONE_AND_FACE => (if context / 4 < 5 { 0xFFFF } else { 0xAAAA }) & !0b1100,
        first::CONE_AND_FACE..first::CLASSES => {
            if (context as u32 - first::CONE_AND_FACE).is_multiple_of(2) {
                below(24)
            } else {
                0
            }
        }
        // Six classes of columns, times six of rows.
        first::CLASSES..first::EDGE => {
            if (context as u32 - first::CLASSES).is_multiple_of(3) {
                0x3F3F_3F3F_3F3F
            } else {
                0
            }
        }
        first::EDGE..first::ALONG_1 => below(13),
        first::ALONG_1..first::ALONG_2 => corners(first::ALONG_1, 6),
        first::ALONG_2..first::ACROSS => corners(first::ALONG_2, 18),
        first::ACROSS..first::GREEN => corners(first::ACROSS, 2),
        _ => below(16),
    }
}

/// Occurrences of each symbol in each context.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statistics {
    /// By 16 · context + symbol.
    counts: Vec<u64>,
}

impl Default for Statistics {
    fn default() -> Self {
        Self { counts: vec![0; CONTEXTS * ROW] }
    }
}

impl Statistics {
    #[inline(always)]
    pub(super) fn count(&mut self, symbol: Symbol) {
        if let Some(count) = self.counts.get_mut(usize::from(symbol.0)) {
            *count += 1;
        }
    }

    /// Adds what others have counted; the order does not matter.
    pub fn add(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(&other.counts) {
            *count += more;
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
    /// The model that codes what was counted in the fewest bits, and anything else in a few more: a sample of the pages will do.
    pub fn of(statistics: &Statistics) -> Self {
        let table = |context| {
            let counts =
                statistics.counts[context * ROW..].first_chunk().expect("there are more numbers than contexts");
            Table::of_counts(counts, legal(context))
        };
        Self::with((0..STORED).map(table).collect())
    }

    fn with(tables: Vec<Table>) -> Self {
        Self { slots: Slots::of(&tables), tables }
    }

    pub(super) fn slots(&self) -> &Slots {
        &self.slots
    }

    pub(super) fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// The tables of all contexts, in order: see `rans::Table::put_all`.
    pub fn to_bytes(&self) -> Vec<u8> {
        Table::put_all(&self.tables, legal)
    }

    /// Undoes [`Model::to_bytes`].
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where the bytes end early or late, a symbol occurs that cannot, or frequencies do not sum to
    /// 512.
    pub fn parse(bytes: &[u8]) -> Result<Self, FormatError> {
        Table::take_all(bytes, (STORED, "context"), legal).map(Self::with)
    }
}
