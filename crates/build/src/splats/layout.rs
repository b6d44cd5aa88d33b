//! Breadth-first layout: families of nodes, level by level across all chunks, packed into pages.
//!
//! The same walk is taken twice: once to find out how many pages there are and how often each symbol occurs, once to write.

use super::chunk::packed_color;
use super::contract::ChildList;
use super::pager::Pager;
use super::quantise::Quantised;
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_format::splats::codec::{self, Model, Statistics};
use gigalod_format::splats::page::{CODEC_ENTROPY, CODEC_RAW};
use gigalod_format::splats::{Node, PageContents, PageRecord, Skeleton};
use gigalod_format::{Kind, LevelSummary, Writer};
use rayon::prelude::*;
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

/// Pages that are coded side by side.
const PAGES_AT_ONCE: usize = 32;

/// Writes all pages.
pub(super) fn write<'a>(
    quantised: &Quantised,
    colors: &Spool<u16>,
    file: &'a File,
    phases: &Phases<'_>,
) -> io::Result<Written<'a>> {
    let tree = Tree::of(quantised, colors);
    phases.begin("count", tree.node_count());
    let mut statistics = Statistics::default();
    let mut raw_bytes = 0;
    let pager = tree.walk(phases, |pages| {
        let counted = pages
            .par_iter()
            .fold(Statistics::default, |mut statistics, page| {
                codec::count(page, &mut statistics);
                statistics
            })
            .reduce(Statistics::default, |mut sum, statistics| {
                sum.add(&statistics);
                sum
            });
        statistics.add(&counted);
        raw_bytes += pages.iter().map(|page| page.raw_bytes() as u64).sum::<u64>();
        Ok(())
    })?;
    let model = Model::of(&statistics);
    // A small file's model may cost more than it saves.
    let model = (raw_bytes > 4 * model.to_bytes().len() as u64).then_some(model);
    let (mut records, mut levels) = (pager.records(), pager.levels);
    let pointers: u64 = records.iter().map(|page| u64::from(page.words - page.nodes)).sum();

    phases.begin("write", tree.node_count());
    let skeleton_bytes = Skeleton::encoded_bytes(records.len() as u64, model.as_ref());
    let mut writer = Writer::new(BufWriter::with_capacity(1 << 20, file), Kind::Splats, skeleton_bytes)?;
    let mut number = 0;
    tree.walk(phases, |pages| {
        let coded: Vec<(u8, Vec<u8>)> = pages.par_iter().map(|page| code(page, model.as_ref())).collect();
        for (codec, bytes) in coded {
            let record: &mut PageRecord = &mut records[number];
            record.bytes = bytes.len() as u32;
            record.checksum = gigalod_format::checksum(&bytes);
            record.codec = codec;
            for (level, count) in &pager.nodes_of_levels[number] {
                levels[*level].bytes += bytes.len() as u64 * count / u64::from(record.nodes);
            }
            writer.page(&bytes)?;
            number += 1;
        }
        Ok(())
    })?;
    let (nodes, leaves) = (pager.nodes, pager.leaves);
    Ok(Written { writer, pages: records, model, nodes, leaves, levels, raw_bytes: raw_bytes + pointers * 2 })
}

/// A page by the codec that makes it smaller.
fn code(page: &PageContents, model: Option<&Model>) -> (u8, Vec<u8>) {
    let coded = model.map(|model| codec::encode(page, model)).filter(|bytes| bytes.len() < page.raw_bytes());
    coded.map_or_else(|| (CODEC_RAW, page.encode()), |bytes| (CODEC_ENTROPY, bytes))
}

/// All nodes, to be walked level by level.
struct Tree<'a> {
    quantised: &'a Quantised,
    colors: &'a Spool<u16>,
    /// Where each chunk's nodes begin.
    starts: Vec<u64>,
    /// Which chunk a unit of the tree on top is.
    chunk_of_unit: Vec<u32>,
}

/// Groups that stand next to each other on a level.
#[derive(Clone, Copy)]
enum Run {
    /// One group of the tree on top.
    Top(ChildList),
    /// All groups of a level of a chunk, counted from its root: level 1 is the group of the root's children.
    Chunk { chunk: usize, level: usize },
}

impl<'a> Tree<'a> {
    fn of(quantised: &'a Quantised, colors: &'a Spool<u16>) -> Self {
        let mut chunk_of_unit = vec![0; quantised.top.len()];
        let units = quantised.top.iter().enumerate().filter(|(_, node)| node.units == 1);
        for (chunk, (index, _)) in units.enumerate() {
            chunk_of_unit[index] = chunk as u32;
        }
        let mut start = 0;
        let starts = quantised.levels.iter().map(|levels| {
            let here = start;
            start += levels.iter().map(|(count, _)| u64::from(*count)).sum::<u64>();
            here
        });
        Self { quantised, colors, starts: starts.collect(), chunk_of_unit }
    }

    fn node_count(&self) -> u64 {
        self.quantised.nodes.len()
    }

    /// Packs all families into pages, in order; `visit` gets the pages as they are full.
    fn walk(&self, phases: &Phases<'_>, mut visit: impl FnMut(&[PageContents]) -> io::Result<()>) -> io::Result<Pager> {
        let mut pager = Pager::default();
        let mut runs = vec![Run::Top(ChildList::single(0))];
        pager.begin_family(1);
        self.push_top(&ChildList::single(0), 0, &mut pager);
        for level in 1.. {
            let mut next = Vec::new();
            for run in &runs {
                match *run {
                    Run::Top(group) => self.families_below_top(&group, level, &mut pager, &mut next)?,
                    Run::Chunk { chunk, level: inside } => {
                        self.families_below_chunk(chunk, inside, level, &mut pager, &mut next)?;
                    }
                }
                if pager.full.len() >= PAGES_AT_ONCE {
                    visit(&pager.full)?;
                    pager.full.clear();
                    phases.at(pager.nodes);
                }
            }
            if next.is_empty() {
                break;
            }
            runs = next;
        }
        pager.end_page();
        visit(&pager.full)?;
        pager.full.clear();
        Ok(pager)
    }

    /// The family on `level` that hangs from a group of the tree on top.
    fn families_below_top(
        &self,
        group: &ChildList,
        level: usize,
        pager: &mut Pager,
        next: &mut Vec<Run>,
    ) -> io::Result<()> {
        let first_run = next.len();
        let mut nodes_below = 0;
        for index in group.as_slice() {
            let index = *index as usize;
            let (below, run) = if self.quantised.top[index].units == 1 {
                let chunk = self.chunk_of_unit[index] as usize;
                let below = self.quantised.levels[chunk].get(1).map_or(0, |(count, _)| *count as usize);
                (below, Run::Chunk { chunk, level: 1 })
            } else {
                let below = ChildList::of(&self.quantised.top, index);
                (below.as_slice().len(), Run::Top(below))
            };
            if below > 0 {
                nodes_below += below;
                next.push(run);
            }
        }
        if nodes_below == 0 {
            return Ok(());
        }
        pager.begin_family(nodes_below);
        for run in &next[first_run..] {
            match *run {
                Run::Top(group) => self.push_top(&group, level, pager),
                Run::Chunk { chunk, .. } => {
                    let (nodes, colors) = self.level(chunk, 1)?;
                    pager.push_group(&nodes, &colors, level, self.quantised.levels[chunk][1].1);
                }
            }
        }
        Ok(())
    }

    /// The families on `level` that hang from the groups of a chunk's level `inside`.
    fn families_below_chunk(
        &self,
        chunk: usize,
        inside: usize,
        level: usize,
        pager: &mut Pager,
        next: &mut Vec<Run>,
    ) -> io::Result<()> {
        let Some((_, radius)) = self.quantised.levels[chunk].get(inside + 1) else { return Ok(()) };
        let (above, _) = self.level(chunk, inside - 1)?;
        let (groups, _) = self.level(chunk, inside)?;
        let (below, colors) = self.level(chunk, inside + 1)?;
        let count = |node: &Node| usize::from(node.children().count);
        let (mut from_groups, mut from_below) = (0, 0);
        for size in above.iter().map(count).filter(|size| *size > 0) {
            let group = &groups[from_groups..from_groups + size];
            from_groups += size;
            let in_family = group.iter().map(count).sum();
            if in_family == 0 {
                continue;
            }
            pager.begin_family(in_family);
            for size in group.iter().map(count).filter(|size| *size > 0) {
                let range = from_below..from_below + size;
                pager.push_group(&below[range.clone()], colors.get(range).unwrap_or_default(), level, *radius);
                from_below += size;
            }
        }
        next.push(Run::Chunk { chunk, level: inside + 1 });
        Ok(())
    }

    fn push_top(&self, group: &ChildList, level: usize, pager: &mut Pager) {
        let (mut nodes, mut colors, mut radius) = (Vec::new(), Vec::new(), 0.0_f32);
        for index in group.as_slice() {
            let index = *index as usize;
            let node = &self.quantised.top[index];
            nodes.push(self.quantised.top_nodes[index]);
            if self.colors.len() > 0 {
                colors.push(packed_color(node.mean_color));
            }
            radius = radius.max(node.sphere.radius);
        }
        pager.push_group(&nodes, &colors, level, radius);
    }

    /// Nodes of a level of a chunk, and their colours or none.
    fn level(&self, chunk: usize, level: usize) -> io::Result<(Vec<Node>, Vec<u16>)> {
        let levels = &self.quantised.levels[chunk];
        let before: u64 = levels[..level].iter().map(|(count, _)| u64::from(*count)).sum();
        let (start, count) = (self.starts[chunk] + before, levels[level].0 as usize);
        let (mut words, mut colors) = (Vec::new(), Vec::new());
        self.quantised.nodes.read_vec(start, count, &mut words)?;
        if self.colors.len() > 0 {
            self.colors.read_vec(start, count, &mut colors)?;
        }
        Ok((words.into_iter().map(Node).collect(), colors))
    }
}
