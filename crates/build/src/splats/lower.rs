//! Top-down quantisation of a tree: each node's sphere becomes a code relative to its parent's *decoded* sphere. Then the families
//! are put into the order of the file: by size of sphere, coarse first.
//!
//! Kept nodes and the root's decoded sphere go in; [`Lowered`] nodes come out. A family's *bucket* is the size of the largest
//! decoded sphere among the nodes that it refines, in quarters of an octave, counted from 0 at the model's root downwards. As no
//! decoded sphere is larger than its parent's, a family's bucket is never below that of the family it hangs from.
//!
//! What always holds: buckets do not fall; within a bucket families keep the order of the tree, so each lies after the group it
//! hangs from. A decoded sphere encloses all true leaves below its node.

use super::below::{Below, Stack};
use super::kept::KeptTree;
use bytemuck::{Pod, Zeroable};
use gigalod_geom::Sphere;
use gigalod_geom::quantise::sphere;

/// The groups that hang from the nodes of one group.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Family {
    /// Nodes of each of its up to four groups, four bits each, lowest first.
    sizes: u16,
    /// Distance from the model's root.
    pub(super) level: u16,
    /// How many of its groups have a family themselves.
    pub(super) links: u16,
}

impl Family {
    fn push_group(&mut self, nodes: usize) {
        self.sizes |= (nodes as u16) << (4 * self.group_count());
    }

    pub(super) fn group_count(&self) -> usize {
        (16 - self.sizes.leading_zeros() as usize).div_ceil(4)
    }

    /// Nodes of each group.
    pub(super) fn groups(&self) -> impl Iterator<Item = u8> {
        let sizes = self.sizes;
        (0..self.group_count()).map(move |group| (sizes >> (4 * group) & 15) as u8)
    }

    pub(super) fn nodes(&self) -> usize {
        self.groups().map(usize::from).sum()
    }
}

/// Families of one bucket, next to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) bucket: u16,
    pub(super) families: u32,
    pub(super) nodes: u32,
    pub(super) links: u32,
}

/// Which family hangs from a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Link {
    /// The one of this number in the same tree.
    Own(u32),
    /// The first one of a chunk.
    Chunk(u32),
}

/// A tree in its final form. Everything is in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Lowered {
    pub(super) nodes: Vec<u32>,
    /// 5-6-5, one for each node, or empty.
    pub(super) colors: Vec<u16>,
    pub(super) families: Vec<Family>,
    /// For each group that has a family.
    pub(super) links: Vec<Link>,
    pub(super) runs: Vec<Run>,
    /// For each level of the model, from the first that has any: number of nodes, and the largest decoded radius.
    pub(super) levels: Vec<(u64, f32)>,
    /// Decoded spheres of all nodes that came in, in their order, and the number of each one's first child, or 0.
    pub(super) decoded: Vec<Sphere>,
    pub(super) first_children: Vec<u32>,
}

/// Where a tree stands in the model.
pub(super) enum Place<'a> {
    /// On top; for each node the chunk whose root it is, or none.
    Top(&'a [Option<u32>]),
    /// Below: the level of its root, and the radius of the model's root. The root and its children are the top's to write.
    Chunk { level: u16, model_radius: f32 },
}

/// Bucket of a radius: the highest bits of an `f32` are its logarithm, in quarters of an octave.
fn bucket(model_radius: f32, radius: f32) -> u16 {
    let quarters = |radius: f32| radius.to_bits() >> 21;
    quarters(model_radius).saturating_sub(quarters(radius)) as u16
}

/// A family on its way.
struct Draft {
    family: Family,
    bucket: u16,
    first_node: u32,
    links: [Option<Link>; 4],
}

/// A group whose family is still to come.
#[derive(Clone, Copy)]
struct Group {
    first_node: u32,
    nodes: u8,
    level: u16,
    /// The family it belongs to, and its place there; none for the children of a chunk's root.
    family: Option<(u32, u8)>,
    /// Whose first group it is: the family that hangs from it lies in that chunk.
    chunk: Option<u32>,
}

/// Lowers a tree under the decoded sphere of its root.
pub(super) fn lower(tree: &KeptTree, root: &Sphere, place: &Place<'_>) -> Lowered {
    let (first_level, model_radius) = match place {
        Place::Top(_) => (0, root.radius),
        Place::Chunk { level, model_radius } => (*level, *model_radius),
    };
    let mut work = Lowering {
        tree,
        codes: Vec::with_capacity(tree.nodes.len()),
        decoded: Vec::with_capacity(tree.nodes.len()),
        first_children: Vec::new(),
        below: Stack::default(),
        drafts: Vec::with_capacity(tree.nodes.len() / 8 + 1),
        stack: Vec::new(),
        levels: Vec::new(),
        first_level,
        model_radius,
    };
    work.codes.push(sphere::SELF);
    work.decoded.push(*root);
    match place {
        Place::Top(chunks) => {
            work.first_children.resize(tree.nodes.len(), 0);
            work.count(0, root.radius);
            let mut family = Family::default();
            family.push_group(1);
            work.drafts.push(Draft { family, bucket: 0, first_node: 0, links: [None; 4] });
            work.stack.push(Group { first_node: 0, nodes: 1, level: 0, family: Some((0, 0)), chunk: None });
            work.descend(chunks);
        }
        Place::Chunk { level, .. } => {
            // The root's children were encoded with the tree on top; here for what lies below them.
            let nodes = tree.nodes[0].children().count;
            work.first_children = tree.first_children();
            for _ in 0..nodes {
                work.encode_within(0);
            }
            if nodes > 0 {
                let level = level + 1;
                work.stack.push(Group { first_node: 1, nodes, level, family: None, chunk: None });
            }
            work.descend(&[]);
        }
    }
    work.sorted()
}

struct Lowering<'a> {
    tree: &'a KeptTree,
    codes: Vec<u16>,
    decoded: Vec<Sphere>,
    first_children: Vec<u32>,
    below: Stack,
    drafts: Vec<Draft>,
    stack: Vec<Group>,
    levels: Vec<(u64, f32)>,
    first_level: u16,
    model_radius: f32,
}

impl Lowering<'_> {
    fn count(&mut self, level: u16, radius: f32) {
        let at = usize::from(level - self.first_level);
        if self.levels.len() <= at {
            self.levels.resize(at + 1, (0, 0.0));
        }
        let (count, widest) = &mut self.levels[at];
        *count += 1;
        *widest = widest.max(radius);
    }

    /// Encodes the next node of a chunk, whose parent is known, against the leaves below it.
    fn encode(&mut self, parent: usize) -> f32 {
        let at = self.codes.len();
        let kept = &self.tree.nodes[at];
        let parent = &self.decoded[parent];
        let (code, ball) = if kept.children().count == 0 {
            sphere::encode(parent, &kept.sphere())
        } else {
            Below::new(&self.tree.nodes, &self.first_children).encode(at as u32, parent, &mut self.below)
        };
        self.codes.push(code);
        self.decoded.push(ball);
        ball.radius
    }

    /// Encodes the next node, whose parent is known and whose leaves are elsewhere, against its true ball.
    fn encode_within(&mut self, parent: usize) -> f32 {
        let kept = &self.tree.nodes[self.codes.len()];
        let true_parent = self.tree.nodes[parent].sphere();
        let (code, ball) = sphere::encode_within(&self.decoded[parent], &true_parent, &kept.sphere());
        self.codes.push(code);
        self.decoded.push(ball);
        ball.radius
    }

    /// Family by family, as the nodes come.
    fn descend(&mut self, chunks: &[Option<u32>]) {
        let is_top = !chunks.is_empty();
        while let Some(group) = self.stack.pop() {
            let first = group.first_node as usize;
            let tree = self.tree;
            let inner = |at: &usize| tree.nodes[*at].children().count > 0;
            let parents = || (first..first + usize::from(group.nodes)).filter(inner);
            if parents().next().is_none() {
                continue;
            }
            if let Some(chunk) = group.chunk {
                self.link(&group, Link::Chunk(chunk));
                continue;
            }
            let number = self.drafts.len() as u32;
            self.link(&group, Link::Own(number));
            let widest = parents().fold(0.0_f32, |widest, at| widest.max(self.decoded[at].radius));
            let level = group.level + 1;
            let mut draft = Draft {
                family: Family { level, ..Family::default() },
                bucket: bucket(self.model_radius, widest),
                first_node: self.codes.len() as u32,
                links: [None; 4],
            };
            let first_group = self.stack.len();
            for (place, parent) in parents().enumerate() {
                let nodes = tree.nodes[parent].children().count;
                let first_node = self.codes.len() as u32;
                self.first_children[parent] = first_node;
                for _ in 0..nodes {
                    let radius = if is_top { self.encode_within(parent) } else { self.encode(parent) };
                    self.count(level, radius);
                }
                draft.family.push_group(usize::from(nodes));
                let chunk = chunks.get(parent).copied().flatten();
                self.stack.push(Group { first_node, nodes, level, family: Some((number, place as u8)), chunk });
            }
            self.drafts.push(draft);
            self.stack[first_group..].reverse();
        }
        debug_assert_eq!(self.codes.len(), self.tree.nodes.len(), "every node belongs to a family");
    }

    fn link(&mut self, group: &Group, link: Link) {
        if let Some((family, place)) = group.family {
            let draft = &mut self.drafts[family as usize];
            draft.family.links += 1;
            draft.links[usize::from(place)] = Some(link);
        }
    }

    /// Families by bucket.
    fn sorted(self) -> Lowered {
        let mut order: Vec<u32> = (0..self.drafts.len() as u32).collect();
        order.sort_by_key(|at| self.drafts[*at as usize].bucket);
        let mut number_of = vec![0; order.len()];
        for (number, at) in order.iter().enumerate() {
            number_of[*at as usize] = number as u32;
        }
        let mut out = Lowered {
            nodes: Vec::with_capacity(self.codes.len()),
            colors: Vec::with_capacity(self.tree.colors.len()),
            families: Vec::with_capacity(order.len()),
            links: Vec::with_capacity(order.len()),
            levels: self.levels,
            ..Lowered::default()
        };
        for at in order {
            let Draft { family, bucket, first_node, links } = &self.drafts[at as usize];
            let range = *first_node as usize..*first_node as usize + family.nodes();
            out.nodes.extend(range.clone().map(|node| self.tree.nodes[node].pack(self.codes[node]).0));
            out.colors.extend(self.tree.colors.get(range.clone()).unwrap_or_default());
            out.families.push(*family);
            out.links.extend(links.iter().flatten().map(|link| match link {
                Link::Own(family) => Link::Own(number_of[*family as usize]),
                chunk @ Link::Chunk(_) => *chunk,
            }));
            let more = Run { bucket: *bucket, families: 1, nodes: range.len() as u32, links: u32::from(family.links) };
            match out.runs.last_mut().filter(|run| run.bucket == more.bucket) {
                Some(run) => {
                    run.families += 1;
                    run.nodes += more.nodes;
                    run.links += more.links;
                }
                None => out.runs.push(more),
            }
        }
        out.decoded = self.decoded;
        out.first_children = self.first_children;
        out
    }
}

impl Lowered {
    /// How far decoded spheres reach from the root's centre, and the largest such reach of all nodes, in units of their radius;
    /// ≥ 1. `given` is what is known of nodes whose descendants are elsewhere.
    pub(super) fn reach(&self, tree: &KeptTree, given: impl Fn(usize) -> Option<f64>) -> (f64, f64) {
        // Backwards: children before parents.
        let mut reach: Vec<f64> = self.decoded.iter().map(|ball| f64::from(ball.radius)).collect();
        let mut overhang = 1.0_f64;
        for at in (0..reach.len()).rev() {
            let ball = &self.decoded[at];
            if let Some(given) = given(at) {
                reach[at] = reach[at].max(given);
            }
            let first = self.first_children[at] as usize;
            if first > 0 {
                for child in first..first + usize::from(tree.nodes[at].children().count) {
                    let apart = f64::from(self.decoded[child].center.distance(ball.center));
                    reach[at] = reach[at].max(apart + reach[child]);
                }
            }
            if ball.radius > 0.0 {
                overhang = overhang.max(reach[at] / f64::from(ball.radius));
            }
        }
        (reach[0], overhang)
    }
}
