//! Binary bodies: numbers back to back.
//!
//! In: an [`Input`] in the body of a binary file. Out: [`Values`], one by one here or many at a time through `block`.

use super::{
    block::Taken,
    plan::Section,
    scalar::{ByteOrder, Scalar},
    values::{At, Values},
};
use crate::{Batch, ImportError, Place, input::Input};

pub(super) struct Binary {
    order: ByteOrder,
    /// Offset at which the item begins.
    item_offset: u64,
}

impl Binary {
    pub(super) fn new(order: ByteOrder) -> Self {
        Self { order, item_offset: 0 }
    }
}

/// The error of a file that ends where the window does.
fn truncated(input: &Input, at: At<'_>) -> ImportError {
    at.truncated(Place::byte(input.offset() + input.window().len() as u64))
}

impl Values for Binary {
    fn begin_item(&mut self, input: &Input) {
        self.item_offset = input.offset();
    }

    fn end_item(&mut self, _input: &mut Input, _at: At<'_>) -> Result<(), ImportError> {
        Ok(())
    }

    #[inline]
    fn number(&mut self, input: &mut Input, scalar: Scalar, at: At<'_>) -> Result<f64, ImportError> {
        if !input.has(scalar.size())? {
            return Err(truncated(input, at));
        }
        let number = scalar.decode(self.order, input.window());
        input.consume(scalar.size());
        Ok(number)
    }

    fn skip(&mut self, input: &mut Input, scalar: Scalar, count: u64, at: At<'_>) -> Result<(), ImportError> {
        if input.skip(count.saturating_mul(scalar.size() as u64))? { Ok(()) } else { Err(truncated(input, at)) }
    }

    fn read_block(&mut self, input: &mut Input, section: &Section, left: u64, batch: &mut Batch) -> u64 {
        let Some(block) = &section.block else { return 0 };
        let Taken { bytes, items } = block.take(&section.content, self.order, input.window(), left, batch);
        input.consume(bytes);
        items
    }

    fn place(&self) -> Place {
        Place::byte(self.item_offset)
    }
}
