//! What a page holds, and its plain bytes (codec 0, *raw*).
//!
//! ```text
//! u16 groups │ u8 runs │ u8 – │ runs: u32 page, u16 family │ group sizes − 1, 2 bits │ groups of families − 1, 2 bits
//! │ nodes: u32 │ colours: u16, if any │ links: u16 = run << 12 | skip
//! ```
//! What always holds: contents decode to themselves; hostile bytes to contents whose counts agree with each other and with
//! the record, or to an error.

use super::codec;
use super::links::{FamilyPlace, Link, MAX_RUNS};
use super::node::Node;
use super::page::{CODEC_ENTROPY, CODEC_RAW};
use super::skeleton::{PageId, PageRecord, Skeleton};
use crate::FormatError;
use crate::bytes::Fields;

/// Bytes of a raw page before its runs.
const HEAD_BYTES: usize = 4;
/// Bytes of a run.
pub(super) const RUN_BYTES: usize = 6;

/// What is written: families of groups, and where those lie that hang from them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PageContents {
    /// Nodes in each group: 2–4; 1 for the root's.
    pub group_sizes: Vec<u8>,
    /// All nodes, group by group.
    pub nodes: Vec<Node>,
    /// 5-6-5, one for each node, or empty.
    pub colors: Vec<u16>,
    /// Groups in each family, 1–4.
    pub family_groups: Vec<u8>,
    /// Where the cursors of links start; at most 16.
    pub runs: Vec<FamilyPlace>,
    /// One for each group of which at least one node has children, in order.
    pub links: Vec<Link>,
}

impl PageContents {
    /// Empties it, keeping its buffers.
    pub fn clear(&mut self) {
        self.group_sizes.clear();
        self.nodes.clear();
        self.colors.clear();
        self.family_groups.clear();
        self.runs.clear();
        self.links.clear();
    }

    /// Nodes and pointers of the decoded page.
    pub fn words(&self) -> usize {
        self.nodes.len() + self.links.len()
    }

    /// Length of [`PageContents::encode`].
    pub fn raw_bytes(&self) -> usize {
        let groups = self.group_sizes.len().div_ceil(4) + self.family_groups.len().div_ceil(4);
        let nodes = self.nodes.len() * 4 + self.colors.len() * 2;
        HEAD_BYTES + self.runs.len() * RUN_BYTES + groups + nodes + self.links.len() * 2
    }

    /// The bytes of a raw page.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.raw_bytes());
        out.extend((self.group_sizes.len() as u16).to_le_bytes());
        out.extend([self.runs.len() as u8, 0]);
        put_runs(&self.runs, &mut out);
        for sizes in [&self.group_sizes, &self.family_groups] {
            out.extend(
                sizes
                    .chunks(4)
                    .map(|sizes| sizes.iter().enumerate().fold(0u8, |byte, (at, size)| byte | (size - 1) << (2 * at))),
            );
        }
        out.extend(self.nodes.iter().flat_map(|node| node.0.to_le_bytes()));
        out.extend(self.colors.iter().flat_map(|color| color.to_le_bytes()));
        out.extend(self.links.iter().flat_map(|link| (u16::from(link.run) << 12 | link.skip).to_le_bytes()));
        out
    }

    /// The bytes of a page as they stand in a file, by whatever codec its record names.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where they make no page of as many nodes and families as the record says.
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
        let (nodes, families) = (usize::from(record.nodes), usize::from(record.families));
        let Some(links) = usize::from(record.words).checked_sub(nodes) else {
            return Err(invalid(format!("{nodes} nodes, but {} words", record.words)));
        };
        let Some((head, rest)) = bytes.split_first_chunk::<HEAD_BYTES>() else {
            return Err(invalid(format!("{} bytes, expected at least 4", bytes.len())));
        };
        let mut head = Fields(head);
        let (groups, runs) = (usize::from(head.u16()), usize::from(head.u8()));
        let parts = [
            runs * RUN_BYTES,
            groups.div_ceil(4),
            families.div_ceil(4),
            nodes * 4,
            nodes * 2 * usize::from(has_colors),
        ];
        let expected: usize = parts.iter().sum::<usize>() + links * 2;
        if groups > nodes || runs > MAX_RUNS || rest.len() != expected {
            let found = rest.len();
            return Err(invalid(format!(
                "{found} bytes for {nodes} nodes in {groups} groups with {runs} runs, expected {expected}"
            )));
        }
        let mut rest = rest;
        let [runs, sizes, family_groups, words, colors] = parts.map(|bytes| {
            let (part, after) = rest.split_at(bytes);
            rest = after;
            part
        });
        let quarters = |bytes: &[u8], count| (0..count).map(|at| (bytes[at / 4] >> (2 * (at % 4)) & 3) + 1).collect();
        let halves =
            |bytes: &[u8]| -> Vec<u16> { bytes.as_chunks().0.iter().copied().map(u16::from_le_bytes).collect() };
        let contents = Self {
            group_sizes: quarters(sizes, groups),
            nodes: words.as_chunks().0.iter().map(|bytes| Node(u32::from_le_bytes(*bytes))).collect(),
            colors: halves(colors),
            family_groups: quarters(family_groups, families),
            runs: take_runs(runs),
            links: halves(rest).iter().map(|bits| Link { run: (bits >> 12) as u8, skip: bits & 0xFFF }).collect(),
        };
        contents.check_sums(page)?;
        Ok(contents)
    }

    /// That groups have as many nodes, and families as many groups, as there are.
    pub(super) fn check_sums(&self, page: PageId) -> Result<(), FormatError> {
        let sum = |sizes: &[u8]| sizes.iter().map(|size| usize::from(*size)).sum::<usize>();
        for (sizes, what, parts, expected) in [
            (&self.group_sizes, "groups", "nodes", self.nodes.len()),
            (&self.family_groups, "families", "groups", self.group_sizes.len()),
        ] {
            let found = sum(sizes);
            if found != expected {
                let problem = format!("{what} of {found} {parts} in all, expected {expected}");
                return Err(FormatError::invalid(format!("page {page}"), problem));
            }
        }
        Ok(())
    }
}

/// The bytes of runs, as both codecs have them.
pub(super) fn put_runs(runs: &[FamilyPlace], out: &mut Vec<u8>) {
    for run in runs {
        out.extend(run.page.0.to_le_bytes());
        out.extend(run.family.to_le_bytes());
    }
}

/// Undoes [`put_runs`].
pub(super) fn take_runs(bytes: &[u8]) -> Vec<FamilyPlace> {
    let run = |bytes: &[u8; RUN_BYTES]| {
        let mut fields = Fields(bytes);
        FamilyPlace { page: PageId(fields.u32()), family: fields.u16() }
    };
    bytes.as_chunks().0.iter().map(run).collect()
}
