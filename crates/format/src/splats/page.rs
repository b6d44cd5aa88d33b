//! A page of nodes as it is traversed: the groups one after the other, each followed by a pointer word unless all its nodes are
//! leaves, exactly as in the paper's figure 2b.
//!
//! In: a page's bytes, or its [`PageContents`]. Out: words, and where families begin.
//! What always holds after decoding, even of hostile bytes: a pointer leads forwards (to a later page, or a later family of
//! the same page), to a family that there is. What cannot be seen from one page is whether a node announces as many children
//! as the group has that its pointer leads to; where that is a lie, a traversal can take a node for a pointer, so it must count
//! what it visits.

use super::contents::PageContents;
use super::links::{Cursors, FamilyPlace, MAX_RUNS};
use super::skeleton::{PageId, PageRecord, Skeleton};
use crate::FormatError;

/// Most nodes a page may hold: about 32 KiB raw. Larger pages mean fewer records in the skeleton, smaller ones less that is
/// read in vain at the borders of what is looked at.
pub const MAX_NODES: usize = 8192;
/// Most families of a page: they have two nodes at least, but for the root's. A pointer has 12 bits for their number.
pub const MAX_FAMILIES: usize = MAX_NODES / 2;

/// Nodes, colours and links as they are.
pub const CODEC_RAW: u8 = 0;
/// Entropy-coded under the file's model: [`super::codec`].
pub const CODEC_ENTROPY: u8 = 1;

/// Index of a word (node or pointer) in a decoded page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct WordIndex(pub u16);

/// A decoded page.
#[derive(Clone, Debug)]
pub struct Page {
    /// Nodes, and after each group with grandchildren a pointer: `run << 28 | pages from the run's first << 12 | family`.
    words: Vec<u32>,
    /// 5-6-5 at the index of each node's word; empty without colours.
    colors: Vec<u16>,
    /// Word at which each family begins.
    families: Vec<u16>,
    /// The first page of each run.
    run_pages: [PageId; MAX_RUNS],
    nodes: u16,
}

impl Page {
    /// Decodes the bytes of `page` and puts the pointers in.
    ///
    /// # Errors
    /// [`FormatError::Invalid`]: expected and found.
    pub fn decode(bytes: &[u8], skeleton: &Skeleton, page: PageId) -> Result<Self, FormatError> {
        let contents = PageContents::decode(bytes, skeleton, page)?;
        Self::link(&contents, skeleton, page)
    }

    /// Puts the pointers in.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where a link leads nowhere or backwards, or counts are not the record's.
    pub fn link(contents: &PageContents, skeleton: &Skeleton, page: PageId) -> Result<Self, FormatError> {
        let invalid = |problem: String| FormatError::invalid(format!("page {page}"), problem);
        contents.check_sums(page)?;
        let record = skeleton.record(page);
        for (what, found, expected) in [
            ("families", contents.family_groups.len(), record.families),
            ("nodes", contents.nodes.len(), record.nodes),
            ("nodes and pointers", contents.words(), record.words),
        ] {
            if found != usize::from(expected) {
                return Err(invalid(format!("{found} {what}, expected {expected}")));
            }
        }
        let Some(mut cursors) = Cursors::new(&contents.runs, skeleton) else {
            return Err(invalid(format!("{} runs, expected at most 16 that begin at families", contents.runs.len())));
        };
        let mut run_pages = [PageId(0); MAX_RUNS];
        for (run_page, run) in run_pages.iter_mut().zip(&contents.runs) {
            *run_page = run.page;
        }

        let mut words = Vec::with_capacity(usize::from(record.words));
        let mut families = Vec::with_capacity(usize::from(record.families));
        let (mut nodes, mut sizes) = (&contents.nodes[..], contents.group_sizes.iter());
        let mut links = contents.links.iter();
        for groups in &contents.family_groups {
            let family = families.len();
            families.push(words.len() as u16);
            for size in sizes.by_ref().take(usize::from(*groups)) {
                let (group, rest) = nodes.split_at(usize::from(*size));
                nodes = rest;
                let mut tree = 0;
                for node in group {
                    words.push(node.0);
                    tree |= node.0;
                }
                // A node is inner where it announces children, as in `Node::is_leaf`.
                if tree & 6 == 0 {
                    continue;
                }
                let Some(link) = links.next() else {
                    return Err(invalid(format!("{} links, expected more", contents.links.len())));
                };
                let here = FamilyPlace { page, family: family as u16 };
                match cursors.next(*link, skeleton) {
                    Some((place, pages)) if place > here => {
                        words.push(u32::from(link.run) << 28 | u32::from(pages) << 12 | u32::from(place.family));
                    }
                    found => {
                        let place = found.map(|(place, _)| format!("family {} of page {}", place.family, place.page));
                        return Err(invalid(format!(
                            "the family below family {family}, by run {} and skip {}, is {}, expected a later one",
                            link.run,
                            link.skip,
                            place.as_deref().unwrap_or("none")
                        )));
                    }
                }
            }
        }
        let left = links.count();
        if left > 0 {
            return Err(invalid(format!("{} links, expected {left} fewer", contents.links.len())));
        }
        let colors = if contents.colors.is_empty() { Vec::new() } else { spread(contents) };
        Ok(Self { words, colors, families, run_pages, nodes: record.nodes })
    }

    /// Nodes and pointers.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// 5-6-5 colours at the indices of the nodes' words; empty without colours.
    pub fn colors(&self) -> &[u16] {
        &self.colors
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        usize::from(self.nodes)
    }

    /// Number of families.
    pub fn family_count(&self) -> usize {
        self.families.len()
    }

    /// Where the pointer in `word` leads. Anywhere, also backwards and beyond the last page, where `word` is no pointer but a
    /// node, as hostile tree bits can make a traversal believe.
    #[inline]
    pub fn family(&self, word: u32) -> FamilyPlace {
        let first = self.run_pages[(word >> 28) as usize];
        FamilyPlace { page: PageId(first.0.saturating_add(word >> 12 & 0xFFFF)), family: (word & 0xFFF) as u16 }
    }

    /// Where a family begins; `None` where the page has no such.
    #[inline]
    pub fn family_word(&self, family: u16) -> Option<WordIndex> {
        self.families.get(usize::from(family)).map(|word| WordIndex(*word))
    }

    /// Bytes that it takes in memory.
    pub fn resident_bytes(&self) -> usize {
        size_of::<Self>() + self.words.capacity() * 4 + (self.colors.capacity() + self.families.capacity()) * 2
    }
}

/// Colours at the indices of their nodes' words: 0 where pointers are.
fn spread(contents: &PageContents) -> Vec<u16> {
    let mut out = Vec::with_capacity(contents.words());
    let mut at = 0;
    for size in &contents.group_sizes {
        let group = at..at + usize::from(*size);
        at = group.end;
        out.extend(contents.colors.get(group.clone()).unwrap_or_default());
        if contents.nodes[group].iter().any(|node| !node.is_leaf()) {
            out.push(0);
        }
    }
    out
}

/// Checks what a record claims by itself.
pub(super) fn check_record(record: &PageRecord, number: u64) -> Result<(), FormatError> {
    let nodes = usize::from(record.nodes);
    let pointers = usize::from(record.words).checked_sub(nodes);
    // A raw page is the longest: 4 bytes, 16 runs of 6, and 8½ for each node: 6 for itself, 2 for a link, two quarters.
    let most_bytes = 104 + nodes * 9;
    let most_families = nodes.min(MAX_FAMILIES);
    let good = (1..=MAX_NODES).contains(&nodes)
        && pointers.is_some_and(|pointers| pointers <= nodes)
        && (1..=most_families).contains(&usize::from(record.families))
        && record.bytes as usize <= most_bytes;
    if good {
        return Ok(());
    }
    Err(FormatError::invalid(
        format!("the record of page {number}"),
        format!(
            "{} bytes, {} nodes, {} words, {} families; expected 1–{MAX_NODES} nodes, up to twice as many words, 1–{most_families} families, at most {most_bytes} bytes",
            record.bytes, record.nodes, record.words, record.families
        ),
    ))
}
