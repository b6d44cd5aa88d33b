//! Breadth-first layout: families of nodes, level by level, packed into pages, and written.

use super::contract::ChildList;
use super::tree::Binary;
use crate::progress::Phases;
use gigalod_format::splats::codec::{self, Model, Statistics};
use gigalod_format::splats::page::{CODEC_ENTROPY, CODEC_RAW, MAX_NODES};
use gigalod_format::splats::{Children, Node, PageContents, PageId, PageRecord, Skeleton, WordIndex};
use gigalod_format::{Kind, LevelSummary, Writer};
use gigalod_geom::color::{rgb565_of_srgb8, srgb8_of_linear};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, BufWriter};

pub(super) struct Written<'a> {
    pub(super) writer: Writer<BufWriter<&'a File>>,
    pub(super) pages: Vec<PageRecord>,
    pub(super) model: Option<Model>,
    pub(super) nodes: u64,
    pub(super) leaves: u64,
    pub(super) levels: Vec<LevelSummary>,
    /// All pages before entropy coding, and for each pointer the 16 bits of an offset from its page's first family, although
    /// the file leaves pointers out.
    pub(super) raw_bytes: u64,
}

/// Writes all pages of the quantised tree.
pub(super) fn write<'a>(
    nodes: &[Binary],
    has_colors: bool,
    file: &'a File,
    phases: &Phases<'_>,
) -> io::Result<Written<'a>> {
    let mut pager = Pager::default();
    // The groups that hang from one group, in breadth-first order; families number themselves by their turn.
    let mut families = VecDeque::from([(vec![ChildList::single(0)], 0)]);
    let mut announced = 1;
    while let Some((family, level)) = families.pop_front() {
        pager.begin_family(family.iter().map(|group| group.as_slice().len()).sum());
        for group in family {
            let below: Vec<ChildList> = group
                .as_slice()
                .iter()
                .map(|index| ChildList::of(nodes, *index as usize))
                .filter(|children| !children.as_slice().is_empty())
                .collect();
            pager.push_group(nodes, group, level, has_colors, (!below.is_empty()).then_some(announced));
            if !below.is_empty() {
                families.push_back((below, level + 1));
                announced += 1;
            }
        }
        phases.at(pager.nodes);
    }
    let Pager { finished, mut records, mut levels, nodes, leaves, nodes_of_levels, .. } = pager.finish();
    let pointers: u64 = records.iter().map(|page| u64::from(page.words - page.nodes)).sum();
    let raw_bytes: u64 = finished.iter().map(|page| page.raw_bytes() as u64).sum::<u64>() + pointers * 2;

    let (model, coded) = code(&finished);
    let skeleton_bytes = Skeleton::encoded_bytes(records.len() as u64, model.as_ref());
    let mut writer = Writer::new(BufWriter::with_capacity(1 << 20, file), Kind::Splats, skeleton_bytes)?;
    for ((record, (codec, bytes)), nodes_of_level) in records.iter_mut().zip(coded).zip(nodes_of_levels) {
        record.bytes = bytes.len() as u32;
        record.checksum = gigalod_format::checksum(&bytes);
        record.codec = codec;
        for (level, count) in nodes_of_level {
            levels[level].bytes += bytes.len() as u64 * count / u64::from(record.nodes);
        }
        writer.page(&bytes)?;
    }
    Ok(Written { writer, pages: records, model, nodes, leaves, levels, raw_bytes })
}

/// Bytes of all pages, each by the codec that makes it smaller, and the model; none where it would not pay for itself.
fn code(pages: &[PageContents]) -> (Option<Model>, Vec<(u8, Vec<u8>)>) {
    let statistics = pages
        .par_iter()
        .fold(Statistics::default, |mut statistics, page| {
            codec::count(page, &mut statistics);
            statistics
        })
        .reduce(Statistics::default, |mut sum, statistics| {
            sum.add(&statistics);
            sum
        });
    let model = Model::of(&statistics);
    let coded: Vec<(u8, Vec<u8>)> = pages
        .par_iter()
        .map(|page| {
            let bytes = codec::encode(page, &model);
            if bytes.len() < page.raw_bytes() { (CODEC_ENTROPY, bytes) } else { (CODEC_RAW, page.encode()) }
        })
        .collect();
    let saved: usize = pages.iter().zip(&coded).map(|(page, (_, bytes))| page.raw_bytes() - bytes.len()).sum();
    if saved > model.to_bytes().len() {
        (Some(model), coded)
    } else {
        (None, pages.iter().map(|page| (CODEC_RAW, page.encode())).collect())
    }
}

/// Packs families into pages.
#[derive(Default)]
struct Pager {
    contents: PageContents,
    /// Nodes and pointers in `contents`.
    words: u16,
    /// Number of the first family that hangs from `contents`.
    first_family: Option<u64>,
    /// Nodes of `contents` on each level.
    nodes_of_level: Vec<(usize, u64)>,

    /// Pages that are full, with a record, a first family and nodes on each level.
    finished: Vec<PageContents>,
    records: Vec<PageRecord>,
    first_families: Vec<Option<u64>>,
    nodes_of_levels: Vec<Vec<(usize, u64)>>,
    /// Where each family begins.
    starts: Vec<(PageId, WordIndex)>,
    levels: Vec<LevelSummary>,
    nodes: u64,
    leaves: u64,
}

impl Pager {
    fn begin_family(&mut self, nodes: usize) {
        if self.contents.nodes.len() + nodes > MAX_NODES {
            self.end_page();
        }
        self.starts.push((PageId(self.finished.len() as u32), WordIndex(self.words)));
    }

    fn push_group(
        &mut self,
        nodes: &[Binary],
        group: ChildList,
        level: usize,
        has_colors: bool,
        family_below: Option<u64>,
    ) {
        let group = group.as_slice();
        self.contents.group_sizes.push(group.len() as u8);
        self.words += group.len() as u16 + u16::from(family_below.is_some());
        self.first_family = self.first_family.or(family_below);
        if self.levels.len() == level {
            let level = level as u32;
            self.levels.push(LevelSummary { level, nodes: 0, triangles: 0, points: 0, bytes: 0, max_error: 0.0 });
        }
        let summary = &mut self.levels[level];
        for index in group {
            let node = &nodes[*index as usize];
            let packed = Node::pack(node.code, node.normal, node.cone, children(nodes, *index as usize));
            self.contents.nodes.push(packed);
            if has_colors {
                self.contents.colors.push(rgb565_of_srgb8(node.mean_color.to_array().map(srgb8_of_linear)));
            }
            self.leaves += u64::from(packed.is_leaf());
            // error_geo = (1 + k) times the radius; k = 1, round.
            summary.max_error = summary.max_error.max(2.0 * f64::from(node.sphere.radius));
        }
        summary.nodes += group.len() as u64;
        summary.points += group.len() as u64;
        self.nodes += group.len() as u64;
        match self.nodes_of_level.last_mut() {
            Some((last, count)) if *last == level => *count += group.len() as u64,
            _ => self.nodes_of_level.push((level, group.len() as u64)),
        }
    }

    fn end_page(&mut self) {
        self.records.push(PageRecord {
            bytes: 0,
            checksum: 0,
            first_child_page: PageId(0),
            first_child_word: WordIndex(0),
            nodes: self.contents.nodes.len() as u16,
            words: self.words,
            codec: CODEC_RAW,
        });
        self.nodes_of_levels.push(std::mem::take(&mut self.nodes_of_level));
        self.first_families.push(self.first_family.take());
        self.finished.push(std::mem::take(&mut self.contents));
        self.words = 0;
    }

    /// Ends the last page and fills in where each page's first family went.
    fn finish(mut self) -> Self {
        self.end_page();
        for (record, family) in self.records.iter_mut().zip(&self.first_families) {
            if let Some(family) = family {
                (record.first_child_page, record.first_child_word) = self.starts[*family as usize];
            }
        }
        self
    }
}

fn children(nodes: &[Binary], index: usize) -> Children {
    let list = ChildList::of(nodes, index);
    let below = list.as_slice();
    let all_leaves = !below.is_empty() && below.iter().all(|child| nodes[*child as usize].leaves == 1);
    Children { count: below.len() as u8, all_leaves }
}
