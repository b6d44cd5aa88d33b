//! Top-down quantisation: each node's sphere becomes a code relative to its parent's *decoded* sphere, first in the tree on top,
//! then in all chunks, each by itself.

use super::chunk::{self, Kept, Lowered};
use super::contract::ChildList;
use super::divide::Chunks;
use super::plan::MemoryPlan;
use super::tree::Binary;
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_format::splats::Node;
use gigalod_geom::quantise::sphere;
use gigalod_geom::sphere::round_up;
use rayon::prelude::*;
use std::io;

/// All nodes in their final form.
pub(super) struct Quantised {
    /// The tree on top, preorder: spheres decoded, codes set. Its units are the chunks' roots.
    pub(super) top: Vec<Binary>,
    /// Final forms of the tree on top's kept nodes, at their indices; others are meaningless.
    pub(super) top_nodes: Vec<Node>,
    /// Nodes of all chunks, each chunk breadth first; the roots' codes are in `top_nodes`.
    pub(super) nodes: Spool<u32>,
    /// Number of nodes on each level of each chunk, and the largest decoded radius there.
    pub(super) levels: Vec<Vec<(u32, f32)>>,
    /// How far decoded descendants reach from a node's centre, in units of its radius; the largest of all nodes, ≥ 1.
    pub(super) overhang: f32,
}

/// Chunks that are quantised side by side.
const CHUNKS_AT_ONCE: usize = 8;

pub(super) fn top_down(
    chunks: &Chunks,
    mut top: Vec<Binary>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Quantised> {
    phases.begin("quantise", chunks.kept.len());
    top[0].code = sphere::SELF;
    let order = kept_of(&top);
    for index in &order {
        let parent = top[*index].sphere;
        for child in ChildList::of(&top, *index).as_slice() {
            let child = &mut top[*child as usize];
            (child.code, child.sphere) = sphere::encode(&parent, &child.sphere);
        }
    }

    let roots: Vec<&Binary> = top.iter().filter(|node| node.units == 1).collect();
    let mut starts = Vec::with_capacity(chunks.sizes.len());
    let mut nodes = Spool::named(&plan.place(), "nodes")?;
    nodes.expect(chunks.kept.len());
    let (mut levels, mut overhang) = (Vec::with_capacity(roots.len()), 1.0_f64);
    let mut reach = vec![0.0; top.len()];
    let mut start = 0;
    for size in &chunks.sizes {
        starts.push(start);
        start += u64::from(*size);
    }
    let mut reaches = Vec::with_capacity(roots.len());
    for batch in (0..roots.len()).collect::<Vec<_>>().chunks(CHUNKS_AT_ONCE) {
        let lowered = batch
            .par_iter()
            .map(|chunk| {
                let mut kept: Vec<Kept> = Vec::new();
                chunks.kept.read_vec(starts[*chunk], chunks.sizes[*chunk] as usize, &mut kept)?;
                Ok(chunk::lower(&kept, &roots[*chunk].sphere))
            })
            .collect::<io::Result<Vec<Lowered>>>()?;
        for chunk in lowered {
            let words: Vec<u32> = chunk.nodes.iter().map(|node| node.0).collect();
            nodes.push(&words)?;
            overhang = overhang.max(chunk.overhang);
            reaches.push(chunk.reach);
            levels.push(chunk.levels.into_iter().zip(chunk.radii).collect());
        }
        phases.at(nodes.len());
    }

    // Children before parents: how far what hangs from the tree on top reaches.
    let mut reaches = reaches.into_iter();
    for (index, _) in top.iter().enumerate().filter(|(_, node)| node.units == 1) {
        reach[index] = reaches.next().expect("a reach for each chunk");
    }
    for index in order.iter().rev() {
        let parent = &top[*index].sphere;
        reach[*index] = f64::max(reach[*index], f64::from(parent.radius));
        for child in ChildList::of(&top, *index).as_slice() {
            let child = *child as usize;
            let apart = f64::from(top[child].sphere.center.distance(parent.center));
            reach[*index] = f64::max(reach[*index], apart + reach[child]);
        }
        if parent.radius > 0.0 {
            overhang = overhang.max(reach[*index] / f64::from(parent.radius));
        }
    }

    let mut top_nodes = vec![Node::default(); top.len()];
    let mut chunk = 0;
    for (index, node) in top.iter().enumerate() {
        top_nodes[index] = if node.units == 1 {
            // What a chunk's root is like, the chunk knows.
            let mut root = [0];
            nodes.read(starts[chunk], &mut root)?;
            chunk += 1;
            let inside = Node(root[0]);
            Node::pack(node.code, inside.normal(), inside.cone(), inside.children())
        } else {
            Kept::of(&top, index).pack(node.code)
        };
    }
    // The sum of rounded distances, rounded outwards once more.
    let overhang = round_up(overhang * (1.0 + 1e-6));
    Ok(Quantised { top, top_nodes, nodes, levels, overhang })
}

/// Indices of the nodes that were kept, parents before children.
fn kept_of(top: &[Binary]) -> Vec<usize> {
    let mut order = vec![0];
    let mut next = 0;
    while next < order.len() {
        order.extend(ChildList::of(top, order[next]).as_slice().iter().map(|child| *child as usize));
        next += 1;
    }
    order
}
