//! A page of nodes: on disk, and as it is traversed.
//!
//! On disk (codec 0, *raw*): `u32` number of groups g; ⌈g/4⌉ bytes with the size of each group less one in 2 bits, lowest
//! bits first; the nodes as `u32`; with colours, one `u16` (5-6-5) for each node. In memory: the groups one after the other,
//! each followed by a pointer word unless all its nodes are leaves, exactly as in the paper's figure 2b.
//!
//! What always holds after decoding, even of hostile bytes: a pointer leads forwards (to a later page, or a later word of
//! the same page), and the family there ends within its page. What cannot be seen from one page is whether a node announces
//! as many children as the group has that its pointer leads to; where that is a lie, a traversal can take a node for a
//! pointer, so it must count what it visits.

use super::codec;
use super::node::Node;
use super::skeleton::{PageId, PageRecord, Skeleton};
use crate::FormatError;

/// Most nodes a page may hold: about 32 KiB raw. Larger pages mean fewer records in the skeleton, smaller ones less that is
/// read in vain at the borders of what is looked at.
pub const MAX_NODES: usize = 8192;

/// Nodes and colours as stored.
pub const CODEC_RAW: u8 = 0;
/// Entropy-coded under the file's model: [`codec`].
pub const CODEC_ENTROPY: u8 = 1;

/// Index of a word (node or pointer) in a decoded page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct WordIndex(pub u16);

/// What is written: groups in breadth-first order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PageContents {
    /// Nodes in each group: 2–4; 1 for the root's.
    pub group_sizes: Vec<u8>,
    /// All nodes, group by group.
    pub nodes: Vec<Node>,
    /// 5-6-5, one for each node, or empty.
    pub colors: Vec<u16>,
}

/// Where a pointer leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FamilyStart {
    /// Page of the family.
    pub page: PageId,
    /// Its first word there.
    pub word: WordIndex,
}

/// A decoded page.
#[derive(Clone, Debug)]
pub struct Page {
    /// Nodes, and after each group with grandchildren a pointer.
    words: Vec<u32>,
    /// 5-6-5 at the index of each node's word; empty without colours.
    colors: Vec<u16>,
    /// Pointers count pages from here.
    first_child_page: PageId,
    nodes: u16,
}

impl PageContents {
    /// Empties it, keeping its buffers.
    pub fn clear(&mut self) {
        self.group_sizes.clear();
        self.nodes.clear();
        self.colors.clear();
    }

    /// Length of [`PageContents::encode`].
    pub fn raw_bytes(&self) -> usize {
        4 + self.group_sizes.len().div_ceil(4) + self.nodes.len() * 4 + self.colors.len() * 2
    }

    /// The bytes of a raw page.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.raw_bytes());
        out.extend((self.group_sizes.len() as u32).to_le_bytes());
        out.extend(
            self.group_sizes
                .chunks(4)
                .map(|sizes| sizes.iter().enumerate().fold(0u8, |byte, (at, size)| byte | (size - 1) << (2 * at))),
        );
        out.extend(self.nodes.iter().flat_map(|node| node.0.to_le_bytes()));
        out.extend(self.colors.iter().flat_map(|color| color.to_le_bytes()));
        out
    }

    /// The bytes of a page as they stand in a file, by whatever codec its record names.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where they make no page of as many nodes as the record says.
    pub fn decode(bytes: &[u8], skeleton: &Skeleton, page: PageId) -> Result<Self, FormatError> {
        let (record, has_colors) = (skeleton.record(page), skeleton.root().has_colors);
        match (record.codec, skeleton.model()) {
            (CODEC_RAW, _) => Self::decode_raw(bytes, record, has_colors, page),
            (CODEC_ENTROPY, Some(model)) => codec::decode(bytes, model, record, has_colors, page),
            (CODEC_ENTROPY, None) => {
                Err(FormatError::invalid(format!("page {page}"), "codec 1, but the file has no model"))
            }
            (codec, _) => Err(FormatError::invalid(format!("page {page}"), format!("codec {codec}, expected 0 or 1"))),
        }
    }

    /// Undoes [`PageContents::encode`].
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where sizes do not add up.
    pub fn decode_raw(bytes: &[u8], record: &PageRecord, has_colors: bool, page: PageId) -> Result<Self, FormatError> {
        let invalid = |problem: String| FormatError::invalid(format!("page {page}"), problem);
        let nodes = usize::from(record.nodes);
        let Some((group_count, rest)) = bytes.split_first_chunk() else {
            return Err(invalid(format!("{} bytes, expected at least 4", bytes.len())));
        };
        let group_count = u32::from_le_bytes(*group_count) as usize;
        let size_bytes = group_count.div_ceil(4);
        let expected = size_bytes + nodes * if has_colors { 6 } else { 4 };
        if group_count > nodes || rest.len() != expected {
            let found = rest.len();
            return Err(invalid(format!(
                "{found} bytes for {nodes} nodes in {group_count} groups, expected {expected}"
            )));
        }
        let (sizes, rest) = rest.split_at(size_bytes);
        let (words, colors) = rest.split_at(nodes * 4);
        let group_sizes: Vec<u8> = (0..group_count).map(|at| (sizes[at / 4] >> (2 * (at % 4)) & 3) + 1).collect();
        let in_groups: usize = group_sizes.iter().map(|size| usize::from(*size)).sum();
        if in_groups != nodes {
            return Err(invalid(format!("groups of {in_groups} nodes in all, expected {nodes}")));
        }
        let nodes = words.chunks_exact(4).map(|w| Node(u32::from_le_bytes([w[0], w[1], w[2], w[3]]))).collect();
        let colors = colors.chunks_exact(2).map(|c| u16::from_le_bytes([c[0], c[1]])).collect();
        Ok(Self { group_sizes, nodes, colors })
    }
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

    /// Puts the pointers in: families follow each other from the record's `first_child` on, page after page.
    fn link(contents: &PageContents, skeleton: &Skeleton, page: PageId) -> Result<Self, FormatError> {
        let invalid = |problem: String| FormatError::invalid(format!("page {page}"), problem);
        let record = skeleton.record(page);
        let mut words = Vec::with_capacity(usize::from(record.words));
        let mut colors = Vec::with_capacity(if contents.colors.is_empty() { 0 } else { usize::from(record.words) });
        let mut family = FamilyStart { page: record.first_child_page, word: record.first_child_word };
        let mut at = 0;
        for size in &contents.group_sizes {
            let group = at..at + usize::from(*size);
            at = group.end;
            let group_word = words.len();
            words.extend(contents.nodes[group.clone()].iter().map(|node| node.0));
            if !contents.colors.is_empty() {
                colors.extend(&contents.colors[group.clone()]);
            }
            let family_words: u32 = contents.nodes[group].iter().map(|node| node.children().words()).sum();
            if family_words == 0 {
                continue;
            }
            let room = u32::from(skeleton.pages().get(family.page.0 as usize).map_or(0, |record| record.words));
            let end = u32::from(family.word.0) + family_words;
            if end > room {
                return Err(invalid(format!("a family ends at word {end} of page {}, which has {room}", family.page)));
            }
            let pointer_word = words.len();
            let forwards = family.page > page || (family.page == page && usize::from(family.word.0) > pointer_word);
            let delta = u16::try_from(family.page.0 - record.first_child_page.0);
            let (true, Ok(delta)) = (forwards, delta) else {
                return Err(invalid(format!(
                    "the family of word {group_word} lies at word {} of page {}, expected a later one",
                    family.word.0, family.page
                )));
            };
            words.push(u32::from(delta) << 16 | u32::from(family.word.0));
            if !colors.is_empty() {
                colors.push(0);
            }
            family = if end == room {
                FamilyStart { page: PageId(family.page.0 + 1), word: WordIndex(0) }
            } else {
                FamilyStart { page: family.page, word: WordIndex(end as u16) }
            };
        }
        if words.len() != usize::from(record.words) {
            return Err(invalid(format!("{} nodes and pointers, expected {}", words.len(), record.words)));
        }
        Ok(Self { words, colors, first_child_page: record.first_child_page, nodes: record.nodes })
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

    /// Where the pointer in `word` leads. Anywhere, also backwards and beyond the last page, where `word` is no pointer but a
    /// node, as hostile tree bits can make a traversal believe.
    pub fn family(&self, word: u32) -> FamilyStart {
        FamilyStart { page: PageId(self.first_child_page.0.saturating_add(word >> 16)), word: WordIndex(word as u16) }
    }

    /// Bytes that it takes in memory.
    pub fn resident_bytes(&self) -> usize {
        size_of::<Self>() + self.words.capacity() * 4 + self.colors.capacity() * 2
    }
}

/// Checks what a record claims by itself.
pub(super) fn check_record(record: &PageRecord, number: u64, page_count: u64) -> Result<(), FormatError> {
    let nodes = usize::from(record.nodes);
    let pointers = usize::from(record.words).checked_sub(nodes);
    // A raw page is the longest: 4 bytes of count, a quarter of a byte and 6 bytes for each node.
    let most_bytes = 4 + nodes * 7;
    let good = (1..=MAX_NODES).contains(&nodes)
        && pointers.is_some_and(|pointers| pointers <= nodes)
        && record.bytes as usize <= most_bytes
        && u64::from(record.first_child_page.0) < page_count;
    if good {
        return Ok(());
    }
    Err(FormatError::invalid(
        format!("the record of page {number}"),
        format!(
            "{} bytes, {} nodes, {} words, first child in page {}; expected 1–{MAX_NODES} nodes, up to twice as many words, at most {most_bytes} bytes, {page_count} pages",
            record.bytes, record.nodes, record.words, record.first_child_page
        ),
    ))
}
