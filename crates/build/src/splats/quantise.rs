//! Top-down quantisation of the whole model: first the tree on top, then all chunks, each by itself.
//!
//! [`Chunks`] go in; [`Quantised`] trees come out, in the order of the file as far as one tree goes.

use super::divide::Chunks;
use super::kept::KeptTree;
use super::lone::Usual;
use super::lower::{self, Family, Link, Lowered, Place, Run};
use super::plan::MemoryPlan;
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_format::splats::Node;
use gigalod_geom::Sphere;
use gigalod_geom::sphere::round_up;
use rayon::prelude::*;
use std::io;

/// All trees in their final form.
pub(super) struct Quantised {
    /// The model's root.
    pub(super) root: Sphere,
    pub(super) top: Lowered,
    /// Of all chunks, one after the other.
    pub(super) nodes: Spool<u32>,
    /// 5-6-5, for each node, or empty.
    pub(super) colors: Spool<u16>,
    pub(super) families: Spool<Family>,
    /// Numbers of families in the same chunk.
    pub(super) links: Spool<u32>,
    /// The runs of each chunk.
    pub(super) runs: Vec<Vec<Run>>,
    /// Number of leaves, and how many of them repeat another one.
    pub(super) leaves: u64,
    pub(super) copies: u64,
    /// Number of nodes on each level, and the largest decoded radius there.
    pub(super) levels: Vec<(u64, f32)>,
    /// How far decoded descendants reach from a node's centre, in units of its radius; the largest of all nodes, ≥ 1.
    pub(super) overhang: f32,
}

/// Chunks that are quantised side by side.
const CHUNKS_AT_ONCE: usize = 8;

pub(super) fn top_down(mut chunks: Chunks, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> io::Result<Quantised> {
    phases.begin("quantise", chunks.kept.len());
    let mut top_tree = std::mem::take(&mut chunks.top);
    let root = top_tree.nodes[0].sphere();
    let mut chunk_of = vec![None; top_tree.nodes.len()];
    for (chunk, node) in top_tree.unit_nodes.iter().enumerate() {
        // Of a single leaf nothing lies elsewhere.
        chunk_of[*node as usize] = (chunks.sizes[chunk] > 1).then_some(chunk as u32);
    }
    let usual = Usual::of(chunks.mean_radius, root.radius);
    let top = lower::lower(&mut top_tree, &root, &usual, &Place::Top(&chunk_of));
    let mut out = Quantised {
        root,
        nodes: Spool::new(&plan.place())?,
        colors: Spool::new(&plan.place())?,
        families: Spool::new(&plan.place())?,
        links: Spool::new(&plan.place())?,
        runs: Vec::with_capacity(chunks.sizes.len()),
        levels: top.levels.clone(),
        leaves: count_leaves(&top.nodes),
        copies: top.copies,
        overhang: 1.0,
        top,
    };
    out.nodes.expect(chunks.kept.len());
    out.colors.expect(chunks.colors.len());
    let root_levels = root_levels(&out.top, &top_tree);

    let mut start = 0;
    let starts: Vec<u64> = chunks
        .sizes
        .iter()
        .map(|size| {
            start += u64::from(*size);
            start - u64::from(*size)
        })
        .collect();
    let (mut overhang, mut reaches) = (1.0_f64, Vec::with_capacity(starts.len()));
    let mut done = 0;
    for batch in (0..starts.len()).collect::<Vec<_>>().chunks(CHUNKS_AT_ONCE) {
        let lowered = batch
            .par_iter()
            .map(|chunk| {
                let (start, size) = (starts[*chunk], chunks.sizes[*chunk] as usize);
                let mut tree = KeptTree::default();
                chunks.kept.read_vec(start, size, &mut tree.nodes)?;
                if chunks.colors.len() > 0 {
                    chunks.colors.read_vec(start, size, &mut tree.colors)?;
                }
                let node = top_tree.unit_nodes[*chunk] as usize;
                let place = Place::Chunk { level: root_levels[*chunk], model_radius: root.radius };
                let lowered = lower::lower(&mut tree, &out.top.decoded[node], &usual, &place);
                let reach = lowered.reach(&tree, |_| None);
                let group = 1..=usize::from(tree.nodes[0].children().count);
                let all_leaves: Vec<bool> = tree.nodes[group].iter().map(|node| node.children().all_leaves).collect();
                Ok((lowered, reach, all_leaves))
            })
            .collect::<io::Result<Vec<_>>>()?;
        for (chunk, (lowered, (reach, chunk_overhang), all_leaves)) in batch.iter().zip(lowered) {
            // The top has written these, whose children the chunk may have taken apart.
            let first = out.top.first_children[top_tree.unit_nodes[*chunk] as usize] as usize;
            for (node, all_leaves) in (first..).zip(all_leaves) {
                if !all_leaves && top_tree.nodes[node].children().all_leaves {
                    out.top.not_all_leaves(node);
                }
            }
            overhang = overhang.max(chunk_overhang);
            reaches.push(reach);
            out.push(lowered, usize::from(root_levels[*chunk]))?;
            done += u64::from(chunks.sizes[*chunk]);
        }
        phases.at(done);
    }
    let reach_of = |node: usize| chunk_of.get(node).copied().flatten().map(|chunk| reaches[chunk as usize]);
    let (_, top_overhang) = out.top.reach(&top_tree, reach_of);
    // The sum of rounded distances, rounded outwards once more.
    out.overhang = round_up(overhang.max(top_overhang) * (1.0 + 1e-6));
    Ok(out)
}

impl Quantised {
    fn push(&mut self, lowered: Lowered, level: usize) -> io::Result<()> {
        self.nodes.push(&lowered.nodes)?;
        self.leaves += count_leaves(&lowered.nodes);
        self.copies += lowered.copies;
        self.colors.push(&lowered.colors)?;
        self.families.push(&lowered.families)?;
        let links: Vec<u32> = lowered
            .links
            .iter()
            .map(|link| match link {
                Link::Own(family) | Link::Chunk(family) => *family,
            })
            .collect();
        self.links.push(&links)?;
        self.runs.push(lowered.runs);
        for (at, (count, radius)) in lowered.levels.into_iter().enumerate() {
            let at = level + at;
            if self.levels.len() <= at {
                self.levels.resize(at + 1, (0, 0.0));
            }
            self.levels[at].0 += count;
            self.levels[at].1 = self.levels[at].1.max(radius);
        }
        Ok(())
    }
}

fn count_leaves(nodes: &[u32]) -> u64 {
    nodes.iter().filter(|node| Node(**node).is_leaf()).count() as u64
}

/// Levels of the chunks' roots.
fn root_levels(top: &Lowered, tree: &KeptTree) -> Vec<u16> {
    let mut levels = vec![0_u16; tree.nodes.len()];
    for at in 0..tree.nodes.len() {
        let first = top.first_children[at] as usize;
        if first > 0 {
            let below = first..first + usize::from(tree.nodes[at].children().count);
            let level = levels[at] + 1;
            levels[below].fill(level);
        }
    }
    tree.unit_nodes.iter().map(|node| levels[*node as usize]).collect()
}
