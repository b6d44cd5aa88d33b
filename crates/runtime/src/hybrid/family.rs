//! The children of a node, as far as a view needs them: the one place where a cut goes down.

use super::look::{Look, Sight};
use crate::residency::PageTable;
use gigalod_format::hybrid::{NodeId, NodeRecord, Page, Skeleton};

/// Most children of a node.
const MOST: usize = 8;

/// Children of one node that are in sight.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Family {
    seen: [Sight; MOST],
    count: usize,
    /// Children out of sight.
    pub(super) outside: u64,
    /// True where one of those in sight is not resident.
    pub(super) is_missing: bool,
}

/// The tree contradicts itself.
#[derive(Debug)]
pub(super) struct Inconsistent;

impl Family {
    /// Looks at all children of a node; marks those as used that are resident.
    pub(super) fn of(
        node: u32,
        record: &NodeRecord,
        look: &Look<'_>,
        skeleton: &Skeleton,
        (table, frame): (&PageTable<Page>, u32),
    ) -> Result<Self, Inconsistent> {
        let (first, count) = (record.first_child as usize, record.children as usize);
        // Children come after their parents, so no way leads around in circles.
        if first <= node as usize || count > MOST {
            return Err(Inconsistent);
        }
        let records = skeleton.nodes().get(first..first + count).ok_or(Inconsistent)?;
        let mut family = Self::default();
        for (record, child) in records.iter().zip(record.first_child..) {
            match look.see(child, record) {
                Some(sight) => {
                    family.is_missing |= table.used(NodeId(child), frame).is_none();
                    family.seen[family.count] = sight;
                    family.count += 1;
                }
                None => family.outside += 1,
            }
        }
        Ok(family)
    }

    /// Children in sight.
    pub(super) fn seen(&self) -> &[Sight] {
        &self.seen[..self.count]
    }

    /// Number of children, in sight or not.
    pub(super) fn len(&self) -> u64 {
        self.count as u64 + self.outside
    }
}
