//! The order of the file: all families of the coarsest bucket, those of the tree on top first, then chunk by chunk; then those of
//! the next bucket. So a prefix of the file is the whole model down to some size of sphere.
//!
//! [`Quantised`] trees go in; where each family lies, and then any page, come out. Families are numbered in the order of the file,
//! so links are known before pages are: one walk over all families finds where pages end ([`Layout::of`]); after it pages are
//! made independently, side by side ([`Layout::page`]).

use super::lower::{Family, Link, Run};
use super::quantise::Quantised;
use gigalod_format::splats::page::{CODEC_RAW, MAX_NODES};
use gigalod_format::splats::{FamilyPlace, Linker, Node, PageContents, PageId, PageRecord};
use std::io;

/// A run of families, and where it begins: in the file, and in its tree.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    /// A chunk, or `None` for the tree on top.
    chunk: Option<u32>,
    run: Run,
    number: u64,
    first_family: u32,
    first_node: u32,
    first_link: u32,
}

/// Where a page begins: in which stretch, how far into its tree, and at which number of the file.
#[derive(Clone, Copy, Debug)]
struct PageStart {
    stretch: u32,
    family: u32,
    node: u32,
    link: u32,
    number: u64,
}

/// Where everything lies.
pub(super) struct Layout<'a> {
    quantised: &'a Quantised,
    stretches: Vec<Stretch>,
    starts: Vec<PageStart>,
    /// Of all pages; `bytes`, `checksum` and `codec` are still to come.
    pub(super) records: Vec<PageRecord>,
    /// Groups of each page.
    pub(super) groups: Vec<u16>,
    /// Levels that each page has nodes of, and how many.
    pub(super) levels: Vec<Vec<(u16, u32)>>,
    /// First number in the file of each stretch of the tree on top and of each chunk, by the first family of the tree in it.
    numbers: Vec<Vec<(u32, u64)>>,
    /// Where each chunk's families, nodes and links begin among those of all chunks.
    firsts: Vec<[u64; 3]>,
}

/// Buffers that are used again.
#[derive(Default)]
struct Scratch {
    families: Vec<Family>,
    nodes: Vec<u32>,
    colors: Vec<u16>,
    links: Vec<u32>,
    targets: Vec<u64>,
}

impl<'a> Layout<'a> {
    /// Packs all families into pages.
    pub(super) fn of(quantised: &'a Quantised) -> io::Result<Self> {
        let mut stretches = Vec::new();
        place_runs(None, &quantised.top.runs, &mut stretches);
        let (mut firsts, mut first) = (Vec::with_capacity(quantised.runs.len()), [0u64; 3]);
        for (chunk, runs) in quantised.runs.iter().enumerate() {
            firsts.push(first);
            let counts = place_runs(Some(chunk as u32), runs, &mut stretches);
            first = std::array::from_fn(|which| first[which] + counts[which]);
        }
        // Stable: the tree on top, then chunks in their order.
        stretches.sort_by_key(|stretch| stretch.run.bucket);
        let mut numbers = vec![Vec::new(); quantised.runs.len() + 1];
        let mut number = 0;
        for stretch in &mut stretches {
            stretch.number = number;
            numbers[stretch.chunk.map_or(0, |chunk| chunk as usize + 1)].push((stretch.first_family, number));
            number += u64::from(stretch.run.families);
        }
        let mut layout = Self {
            quantised,
            stretches,
            starts: vec![],
            records: vec![],
            groups: vec![],
            levels: vec![],
            numbers,
            firsts,
        };
        layout.pack()?;
        Ok(layout)
    }

    /// Finds where pages end: before the family with which they would be too large, or have links to too many places.
    fn pack(&mut self) -> io::Result<()> {
        let mut scratch = Scratch::default();
        let (mut linker, mut links) = (Linker::default(), Vec::new());
        for at in 0..self.stretches.len() {
            let stretch = self.stretches[at];
            let (mut node, mut link) = (stretch.first_node, stretch.first_link);
            self.read_links(&stretch, 0, stretch.run.families, stretch.run.links, stretch.first_link, &mut scratch)?;
            let mut targets = &scratch.targets[..];
            for (nth, family) in scratch.families.iter().enumerate() {
                let nodes = family.nodes();
                let below;
                (below, targets) = targets.split_at(usize::from(family.links));
                let has_room = self.records.last().is_some_and(|page| usize::from(page.nodes) + nodes <= MAX_NODES);
                if !has_room || !linker.push(below.iter().copied(), &mut links) {
                    linker.clear();
                    links.clear();
                    self.starts.push(PageStart {
                        stretch: at as u32,
                        family: stretch.first_family + nth as u32,
                        node,
                        link,
                        number: stretch.number + nth as u64,
                    });
                    self.records.push(PageRecord {
                        bytes: 0,
                        checksum: 0,
                        nodes: 0,
                        words: 0,
                        families: 0,
                        codec: CODEC_RAW,
                    });
                    self.groups.push(0);
                    self.levels.push(Vec::new());
                    let begun = linker.push(below.iter().copied(), &mut links);
                    debug_assert!(begun, "an empty page takes any family");
                }
                let page = self.records.len() - 1;
                let (record, levels) = (&mut self.records[page], &mut self.levels[page]);
                self.groups[page] += family.group_count() as u16;
                record.nodes += nodes as u16;
                record.words += nodes as u16 + family.links;
                record.families += 1;
                match levels.iter_mut().find(|(level, _)| *level == family.level) {
                    Some((_, count)) => *count += nodes as u32,
                    None => levels.push((family.level, nodes as u32)),
                }
                node += nodes as u32;
                link += u32::from(family.links);
            }
        }
        Ok(())
    }

    /// Reads families of a stretch, from its `skip`-th on, and the numbers in the file of those below them.
    fn read_links(
        &self,
        stretch: &Stretch,
        skip: u32,
        families: u32,
        links: u32,
        first_link: u32,
        scratch: &mut Scratch,
    ) -> io::Result<()> {
        let (first, count) = ((stretch.first_family + skip) as usize, families as usize);
        let (first_link, links) = (first_link as usize, links as usize);
        scratch.targets.clear();
        let Some(chunk) = stretch.chunk else {
            let top = &self.quantised.top;
            scratch.families.clear();
            scratch.families.extend_from_slice(&top.families[first..first + count]);
            scratch.targets.extend(top.links[first_link..first_link + links].iter().map(|link| match link {
                Link::Own(family) => number_of(&self.numbers[0], *family),
                Link::Chunk(chunk) => number_of(&self.numbers[*chunk as usize + 1], 0),
            }));
            return Ok(());
        };
        let [family_start, _, link_start] = self.firsts[chunk as usize];
        self.quantised.families.read_vec(family_start + first as u64, count, &mut scratch.families)?;
        self.quantised.links.read_vec(link_start + first_link as u64, links, &mut scratch.links)?;
        let numbers = &self.numbers[chunk as usize + 1];
        scratch.targets.extend(scratch.links.iter().map(|family| number_of(numbers, *family)));
        Ok(())
    }

    /// Makes a page.
    pub(super) fn page(&self, page: PageId) -> io::Result<PageContents> {
        let record = &self.records[page.0 as usize];
        let mut contents = PageContents::default();
        contents.nodes.reserve_exact(usize::from(record.nodes));
        let (mut linker, mut scratch) = (Linker::default(), Scratch::default());
        let mut start = self.starts[page.0 as usize];
        let mut left = u32::from(record.families);
        let mut links_left = u32::from(record.words - record.nodes);
        while left > 0 {
            let stretch = &self.stretches[start.stretch as usize];
            let skip = start.family - stretch.first_family;
            let families = left.min(stretch.run.families - skip);
            let links = links_left.min(stretch.run.links - (start.link - stretch.first_link));
            self.read_links(stretch, skip, families, links, start.link, &mut scratch)?;
            let (mut nodes, mut targets) = (0, &scratch.targets[..]);
            for family in &scratch.families {
                contents.family_groups.push(family.group_count() as u8);
                contents.group_sizes.extend(family.groups());
                nodes += family.nodes();
                let below;
                (below, targets) = targets.split_at(usize::from(family.links));
                let fits = linker.push(below.iter().copied(), &mut contents.links);
                debug_assert!(fits, "it fitted when pages were packed");
            }
            self.read_nodes(stretch.chunk, start.node as usize, nodes, &mut contents, &mut scratch)?;
            left -= families;
            links_left -= scratch.families.iter().map(|family| u32::from(family.links)).sum::<u32>();
            start.stretch += 1;
            if let Some(next) = self.stretches.get(start.stretch as usize) {
                (start.family, start.node, start.link) = (next.first_family, next.first_node, next.first_link);
            }
        }
        contents.runs.extend(linker.starts().iter().map(|number| self.place(*number)));
        Ok(contents)
    }

    fn read_nodes(
        &self,
        chunk: Option<u32>,
        first: usize,
        count: usize,
        contents: &mut PageContents,
        scratch: &mut Scratch,
    ) -> io::Result<()> {
        let Some(chunk) = chunk else {
            let top = &self.quantised.top;
            contents.nodes.extend(top.nodes[first..first + count].iter().map(|node| Node(*node)));
            contents.colors.extend_from_slice(top.colors.get(first..first + count).unwrap_or_default());
            return Ok(());
        };
        let start = self.firsts[chunk as usize][1] + first as u64;
        self.quantised.nodes.read_vec(start, count, &mut scratch.nodes)?;
        contents.nodes.extend(scratch.nodes.iter().map(|node| Node(*node)));
        if self.quantised.colors.len() > 0 {
            self.quantised.colors.read_vec(start, count, &mut scratch.colors)?;
            contents.colors.extend_from_slice(&scratch.colors);
        }
        Ok(())
    }

    /// Where the family of a number lies.
    fn place(&self, number: u64) -> FamilyPlace {
        let page = self.starts.partition_point(|start| start.number <= number) - 1;
        FamilyPlace { page: PageId(page as u32), family: (number - self.starts[page].number) as u16 }
    }
}

/// Number in the file of a tree's family, by where the tree's stretches begin.
fn number_of(numbers: &[(u32, u64)], family: u32) -> u64 {
    let (first, number) = numbers[numbers.partition_point(|(first, _)| *first <= family) - 1];
    number + u64::from(family - first)
}

/// Appends the runs of a tree; returns how many families, nodes and links they have.
fn place_runs(chunk: Option<u32>, runs: &[Run], out: &mut Vec<Stretch>) -> [u64; 3] {
    let [mut first_family, mut first_node, mut first_link] = [0; 3];
    for run in runs {
        out.push(Stretch { chunk, run: *run, number: 0, first_family, first_node, first_link });
        first_family += run.families;
        first_node += run.nodes;
        first_link += run.links;
    }
    [first_family, first_node, first_link].map(u64::from)
}
