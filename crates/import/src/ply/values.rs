//! The body of a file as a sequence of numbers, whatever their encoding.
//!
//! [`Values`] is what text and binary bodies have in common: `stream` is written once, against it, and compiled for each.

use super::{
    header::{Element, Property},
    plan::Section,
    scalar::Scalar,
};
use crate::{Batch, ImportError, Place, error::shown, input::Input};

/// Which value of the file is being read, for messages.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub(super) element: &'a Element,
    /// Number of the item within the element.
    pub(super) item: u64,
    pub(super) property: &'a Property,
}

/// Reads the numbers of a body in order. The input stands between two of them.
pub(super) trait Values: Send {
    /// To be called before the first value of an item.
    fn begin_item(&mut self, input: &Input);

    /// To be called after the last value of an item.
    fn end_item(&mut self, input: &mut Input, at: At<'_>) -> Result<(), ImportError>;

    /// The next number, of type `scalar`.
    fn number(&mut self, input: &mut Input, scalar: Scalar, at: At<'_>) -> Result<f64, ImportError>;

    /// Steps over `count` numbers of type `scalar`, in constant memory.
    fn skip(&mut self, input: &mut Input, scalar: Scalar, count: u64, at: At<'_>) -> Result<(), ImportError>;

    /// Reads as many whole items as is quick and leaves the rest to the caller; returns how many, at most `left`.
    fn read_block(&mut self, _input: &mut Input, _section: &Section, _left: u64, _batch: &mut Batch) -> u64 {
        0
    }

    /// Where the item, or in text the value, that was read last is.
    fn place(&self) -> Place;
}

impl At<'_> {
    /// `place`, with the name and number of this item.
    pub(super) fn place(self, place: Place) -> Place {
        place.of_item(&self.element.name, self.item)
    }

    /// The file ends within this item, or before it.
    pub(super) fn truncated(self, place: Place) -> ImportError {
        let Element { name, count, .. } = self.element;
        ImportError::truncated(format!("{} {} of {count} is complete", shown(name.as_bytes()), self.item), place)
    }
}
