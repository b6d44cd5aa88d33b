//! Groups of siblings: as they wait on a stack, and as they are stored.
//!
//! In: a page table and where a group is. Out: its words, and where the groups below its nodes begin.
//! What always holds: whatever a file says, nothing is read beyond a page, and what contradicts itself is told.

use super::lanes::{Decided, Known};
use super::{Tint, level_color, packed_material};
use crate::residency::PageTable;
use gigalod_format::splats::{Node, Page, PageId, Root, WordIndex};
use glam::Vec4;

/// Siblings still to be visited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// Decoded ball of the parent: x, y, z, radius; local space.
    pub(super) parent: Vec4,
    pub(super) page: PageId,
    /// Smallest diameter of all that is above: with a threshold from there on, the group is not visited.
    pub(super) least_px: f32,
    pub(super) word: WordIndex,
    pub(super) level: u16,
    pub(super) count: u8,
    pub(super) known: Known,
}

/// A group as it is stored.
pub(super) struct Stored<'a> {
    page: &'a Page,
    pub(super) words: [u32; 4],
    /// The word behind the group.
    pointer: Option<u32>,
}

/// Where the children of a group's nodes begin, if their page is there.
pub(super) enum Below {
    /// First word of the first child group.
    At(PageId, WordIndex),
    /// The page is not resident.
    Missing(PageId),
}

/// The tree contradicts itself.
#[derive(Debug)]
pub(super) struct Inconsistent;

impl<'a> Stored<'a> {
    /// Reads a group.
    #[inline(always)]
    pub(super) fn read(table: &'a PageTable<Page>, group: &Group) -> Result<Self, Inconsistent> {
        let page = table.get(group.page).ok_or(Inconsistent)?;
        let (start, count) = (usize::from(group.word.0), usize::from(group.count));
        let rest = page.words().get(start..).ok_or(Inconsistent)?;
        if let Some(words) = rest.first_chunk::<5>() {
            let [a, b, c, d, _] = *words;
            return Ok(Self { page, words: [a, b, c, d], pointer: words.get(count).copied() });
        }
        let mut words = [0; 4];
        words.iter_mut().zip(rest).for_each(|(word, stored)| *word = *stored);
        if rest.len() < count { Err(Inconsistent) } else { Ok(Self { page, words, pointer: rest.get(count).copied() }) }
    }

    /// Lanes of nodes that have children.
    #[inline(always)]
    pub(super) fn inner(&self) -> u32 {
        self.words.iter().enumerate().map(|(lane, word)| u32::from(!Node(*word).is_leaf()) << lane).sum()
    }

    /// Where the children are; marks their page as used in `frame`.
    #[inline(always)]
    pub(super) fn below(&self, table: &PageTable<Page>, frame: u32) -> Result<Below, Inconsistent> {
        let family = self.page.family(self.pointer.ok_or(Inconsistent)?);
        match table.used(family.page, frame) {
            Some(page) => Ok(Below::At(family.page, page.family_word(family.family).ok_or(Inconsistent)?)),
            None => Ok(Below::Missing(family.page)),
        }
    }

    /// Puts the groups below the nodes in `open` on the stack.
    #[inline(always)]
    pub(super) fn push_open(
        &self,
        (page, first): (PageId, WordIndex),
        group: &Group,
        decided: &Decided,
        open: u32,
        stack: &mut Vec<Group>,
    ) {
        let balls = decided.local_balls();
        let diameters = decided.diameter_px.to_array();
        // Backwards, so that the first is visited first.
        let mut word =
            first.0.saturating_add(self.words.iter().map(|word| Node(*word).children().words() as u16).sum());
        for lane in (0..4).rev() {
            let children = Node(self.words[lane]).children();
            word = word.wrapping_sub(children.words() as u16);
            if open >> lane & 1 != 0 {
                stack.push(Group {
                    parent: balls[lane],
                    page,
                    least_px: group.least_px.min(diameters[lane]),
                    word: WordIndex(word),
                    level: group.level.saturating_add(1),
                    count: children.count,
                    known: decided.known_below(lane as u32),
                });
            }
        }
    }

    /// 5-6-5 colours of four nodes.
    #[inline(always)]
    pub(super) fn colors(&self, group: &Group, tint: Tint) -> [u16; 4] {
        if tint == Tint::Level {
            return [level_color(u32::from(group.level)); 4];
        }
        let mut colors = [const { packed_material() }; 4];
        if let Some(rest) = self.page.colors().get(usize::from(group.word.0)..) {
            match rest.first_chunk::<4>() {
                Some(four) => colors = *four,
                None => colors.iter_mut().zip(rest).for_each(|(color, stored)| *color = *stored),
            }
        }
        colors
    }
}

/// Number of lanes in a mask.
#[inline(always)]
pub(super) fn ones(mask: u32) -> u64 {
    // A processor of the baseline has no instruction for it.
    0x4332_3221_3221_2110 >> (mask * 4) & 0xF
}

impl Group {
    /// The root alone.
    pub(super) fn root(root: &Root, known: Known) -> Self {
        Self {
            parent: root.sphere.center.extend(root.sphere.radius),
            page: PageId(0),
            least_px: f32::INFINITY,
            word: WordIndex(0),
            level: 0,
            count: 1,
            known,
        }
    }
}
