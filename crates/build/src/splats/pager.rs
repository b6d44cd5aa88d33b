//! Packs families into pages, in breadth-first order, and remembers where each page's first family went.

use gigalod_format::LevelSummary;
use gigalod_format::splats::page::{CODEC_RAW, MAX_NODES};
use gigalod_format::splats::{Node, PageContents, PageId, PageRecord, WordIndex};
use std::collections::VecDeque;

/// A walk through all families, and what it found.
#[derive(Default)]
pub(super) struct Pager {
    /// Pages that are complete and have not been taken away.
    pub(super) full: Vec<PageContents>,
    /// Figures of all levels; `bytes` is still to come.
    pub(super) levels: Vec<LevelSummary>,
    /// For each page the nodes it holds of each level.
    pub(super) nodes_of_levels: Vec<Vec<(usize, u64)>>,
    pub(super) nodes: u64,
    pub(super) leaves: u64,

    contents: PageContents,
    /// Nodes and pointers in `contents`.
    words: u16,
    /// Families number themselves by their turn.
    begun: u64,
    announced: u64,
    /// `contents` has a family below it.
    has_claim: bool,
    /// Pages whose first family is still to come, in its order.
    claims: VecDeque<(u64, usize)>,
    /// Where each page's first family begins, the page in work included.
    first_children: Vec<(PageId, WordIndex)>,
    records: Vec<PageRecord>,
}

impl Pager {
    /// The groups of a family of so many nodes follow.
    pub(super) fn begin_family(&mut self, nodes: usize) {
        if self.contents.nodes.len() + nodes > MAX_NODES {
            self.end_page();
        }
        let here = (PageId(self.records.len() as u32), WordIndex(self.words));
        self.first_children.resize(self.records.len() + 1, (PageId(0), WordIndex(0)));
        while let Some((_, page)) = self.claims.pop_front_if(|(family, _)| *family == self.begun) {
            self.first_children[page] = here;
        }
        self.begun += 1;
    }

    /// A group of siblings on `level`, with their colours or none. `radius` is the largest of their spheres.
    pub(super) fn push_group(&mut self, nodes: &[Node], colors: &[u16], level: usize, radius: f32) {
        let leaves = nodes.iter().filter(|node| node.is_leaf()).count();
        let has_family = leaves < nodes.len();
        if has_family {
            // The root's own family is number 0.
            self.announced += 1;
            if !self.has_claim {
                self.has_claim = true;
                self.claims.push_back((self.announced, self.records.len()));
            }
        }
        self.words += nodes.len() as u16 + u16::from(has_family);
        self.contents.group_sizes.push(nodes.len() as u8);
        self.contents.nodes.extend_from_slice(nodes);
        self.contents.colors.extend_from_slice(colors);

        if self.levels.len() == level {
            let level = level as u32;
            self.levels.push(LevelSummary { level, nodes: 0, triangles: 0, points: 0, bytes: 0, max_error: 0.0 });
        }
        let summary = &mut self.levels[level];
        summary.nodes += nodes.len() as u64;
        summary.points += nodes.len() as u64;
        // error_geo = (1 + k) times the radius; k = 1, round.
        summary.max_error = summary.max_error.max(2.0 * f64::from(radius));
        self.nodes += nodes.len() as u64;
        self.leaves += leaves as u64;
        if self.nodes_of_levels.len() == self.records.len() {
            self.nodes_of_levels.push(Vec::new());
        }
        let here = self.nodes_of_levels.last_mut().expect("pushed above");
        match here.last_mut() {
            Some((last, count)) if *last == level => *count += nodes.len() as u64,
            _ => here.push((level, nodes.len() as u64)),
        }
    }

    /// The page is full, or the walk is over.
    pub(super) fn end_page(&mut self) {
        self.records.push(PageRecord {
            bytes: 0,
            checksum: 0,
            first_child_page: PageId(0),
            first_child_word: WordIndex(0),
            nodes: self.contents.nodes.len() as u16,
            words: self.words,
            codec: CODEC_RAW,
        });
        self.has_claim = false;
        self.words = 0;
        self.full.push(std::mem::take(&mut self.contents));
    }

    /// Records of all pages; `bytes`, `checksum` and `codec` are still to come.
    pub(super) fn records(&self) -> Vec<PageRecord> {
        let with_children = |(record, children): (&PageRecord, &(PageId, WordIndex))| PageRecord {
            first_child_page: children.0,
            first_child_word: children.1,
            ..*record
        };
        self.records.iter().zip(&self.first_children).map(with_children).collect()
    }
}
