//! What the symbols of families and links depend on; for coder and decoder alike.

use super::super::links::{SKIP_CONTEXTS, SKIP_ESCAPE};
use super::model::first;

/// Contexts of families and links.
#[derive(Default)]
pub(super) struct Contexts {
    /// Groups less one of the family before.
    groups: u32,
    run: u32,
    /// Context of the next skip in each run.
    skips: [u32; 16],
}

impl Contexts {
    /// Symbol: 4 · (groups of a family − 1) + (groups of the next one − 1).
    pub(super) fn family(&self) -> u32 {
        first::FAMILY + self.groups
    }

    pub(super) fn set_family(&mut self, pair: u32) {
        self.groups = pair & 3;
    }

    pub(super) fn run(&self) -> u32 {
        first::RUN + self.run
    }

    pub(super) fn skip(&self, run: u32) -> u32 {
        first::SKIP + self.skips[run as usize & 15]
    }

    pub(super) fn set_link(&mut self, run: u32, skip: u32) {
        self.run = run;
        // None, one, few, many.
        let class = u32::from(skip > 0) + u32::from(skip > 1) + u32::from(skip >= u32::from(SKIP_ESCAPE));
        self.skips[run as usize & 15] = class;
    }
}

const _: () = assert!(SKIP_CONTEXTS == 4);
