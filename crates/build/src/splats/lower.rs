//! Top-down quantisation of a tree: each node's sphere becomes a code relative to its parent's *decoded* sphere. Then the families
//! are put into the order of the file: by size of sphere, coarse first.
//!
//! Kept nodes and the root's decoded sphere go in; [`Lowered`] nodes come out. A family's *bucket* is the size of the largest
//! decoded sphere among the nodes that it refines, in quarters of an octave, counted from 0 at the model's root downwards. As no
//! decoded sphere is larger than its parent's, a family's bucket is never below that of the family it hangs from.
//!
//! A leaf that would be too large becomes two, as `lone.rs` says.
//!
//! What always holds: buckets do not fall; within a bucket families keep the order of the tree, so each lies after the group it
//! hangs from. A decoded sphere encloses all true leaves below its node.

use super::below::{Below, Stack};
pub(super) use super::family::Family;
use super::kept::KeptTree;
use super::lone::{self, Usual};
use gigalod_format::splats::Node;
use gigalod_geom::Sphere;
use gigalod_geom::quantise::sphere;

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
    /// Decoded spheres of all nodes that came in, in their order, and of those that were put in behind; the number of each one's first
    /// child, or 0.
    pub(super) decoded: Vec<Sphere>,
    pub(super) first_children: Vec<u32>,
    /// Leaves that repeat another one.
    pub(super) copies: u64,
    /// On top: where each node that came in stands among `nodes`.
    places: Vec<u32>,
}

/// Where a tree stands in the model.
pub(super) enum Place<'a> {
    /// On top; for each node the chunk whose root it is, or none. A chunk of a single leaf has nothing below: none, too.
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
    /// Of each of its groups.
    first_nodes: [u32; 4],
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

/// Lowers a tree under the decoded sphere of its root. Leaves that are put in stand behind all nodes of the tree then.
pub(super) fn lower(tree: &mut KeptTree, root: &Sphere, usual: &Usual, place: &Place<'_>) -> Lowered {
    let (first_level, model_radius) = match place {
        Place::Top(_) => (0, root.radius),
        Place::Chunk { level, model_radius } => (*level, *model_radius),
    };
    let listed = tree.nodes.len();
    let mut work = Lowering {
        codes: vec![sphere::SELF; listed],
        decoded: vec![*root; listed],
        next: 1,
        listed,
        places_wanted: matches!(place, Place::Top(_)),
        usual: *usual,
        spare: lone::copies_of(listed),
        copies: 0,
        drafts: Vec::with_capacity(listed / 8 + 1),
        tree,
        first_children: Vec::new(),
        below: Stack::default(),
        stack: Vec::new(),
        levels: Vec::new(),
        first_level,
        model_radius,
    };
    match place {
        Place::Top(chunks) => {
            work.first_children.resize(listed, 0);
            work.count(0, root.radius);
            let mut family = Family::default();
            family.push_group(1);
            work.drafts.push(Draft { family, bucket: 0, first_nodes: [0; 4], links: [None; 4] });
            work.stack.push(Group { first_node: 0, nodes: 1, level: 0, family: Some((0, 0)), chunk: None });
            work.descend(chunks);
        }
        Place::Chunk { level, .. } => {
            // The root's children were encoded with the tree on top; here for what lies below them.
            let nodes = work.tree.nodes[0].children().count;
            work.first_children = work.tree.first_children();
            for _ in 0..nodes {
                let at = work.next();
                work.encode_within(at, 0);
                work.take_apart(at, 0, Whose::Shared);
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
    tree: &'a mut KeptTree,
    /// Of all nodes, those to come included.
    codes: Vec<u16>,
    decoded: Vec<Sphere>,
    /// The next one of the tree.
    next: usize,
    /// Nodes that came in; those behind are copies of leaves.
    listed: usize,
    places_wanted: bool,
    usual: Usual,
    /// Leaves that may still be put in.
    spare: usize,
    copies: u64,
    first_children: Vec<u32>,
    below: Stack,
    drafts: Vec<Draft>,
    stack: Vec<Group>,
    levels: Vec<(u64, f32)>,
    first_level: u16,
    model_radius: f32,
}

/// To which tree the children of a leaf belong that is taken apart.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Whose {
    Own,
    /// To this chunk. The tree on top does the same to this leaf, and both must come to the same.
    Shared,
    /// To the chunk below.
    Chunks,
}

impl Lowering<'_> {
    fn next(&mut self) -> usize {
        self.next += 1;
        self.next - 1
    }

    fn count(&mut self, level: u16, radius: f32) {
        let at = usize::from(level - self.first_level);
        if self.levels.len() <= at {
            self.levels.resize(at + 1, (0, 0.0));
        }
        let (count, widest) = &mut self.levels[at];
        *count += 1;
        *widest = widest.max(radius);
    }

    /// Encodes a node of a chunk, whose parent is known, against the leaves below it.
    fn encode(&mut self, at: usize, parent: usize) {
        let kept = &self.tree.nodes[at];
        let parent = &self.decoded[parent];
        (self.codes[at], self.decoded[at]) = if kept.children().count == 0 {
            sphere::encode(parent, &kept.sphere())
        } else {
            Below::new(&self.tree.nodes, &self.first_children).encode(at as u32, parent, &mut self.below)
        };
    }

    /// Encodes a node, whose parent is known and whose leaves are elsewhere, against its true ball.
    fn encode_within(&mut self, at: usize, parent: usize) {
        let kept = &self.tree.nodes[at];
        let true_parent = self.tree.nodes[parent].sphere();
        (self.codes[at], self.decoded[at]) = sphere::encode_within(&self.decoded[parent], &true_parent, &kept.sphere());
    }

    /// Makes an inner node with two leaves of a leaf that is too large for what it stands for.
    fn take_apart(&mut self, at: usize, parent: usize, whose: Whose) {
        let kept = self.tree.nodes[at];
        if kept.children().count > 0 || !self.usual.is_too_large(&kept.sphere(), &self.decoded[at]) {
            return;
        }
        let Some((code, ball)) = lone::with_room(&kept.sphere(), &self.decoded[at], &self.decoded[parent]) else {
            return;
        };
        if whose == Whose::Own {
            let Some(spare) = self.spare.checked_sub(1) else { return };
            self.spare = spare;
        }
        (self.codes[at], self.decoded[at]) = (code, ball);
        self.tree.nodes[at].become_parent_of_two_leaves();
        self.tree.nodes[parent].not_all_leaves();
        if whose == Whose::Chunks {
            return;
        }
        self.first_children[at] = self.tree.nodes.len() as u32;
        self.copies += 1;
        for _ in 0..2 {
            self.tree.nodes.push(kept);
            self.codes.push(sphere::SELF);
            self.decoded.push(self.decoded[at]);
            self.first_children.push(0);
            if let Some(color) = self.tree.colors.get(at).copied() {
                self.tree.colors.push(color);
            }
        }
    }

    /// Family by family, as the nodes come.
    fn descend(&mut self, chunks: &[Option<u32>]) {
        let is_top = !chunks.is_empty();
        while let Some(group) = self.stack.pop() {
            let all = group.first_node as usize..group.first_node as usize + usize::from(group.nodes);
            let widest = all.clone().filter(|at| self.children(*at) > 0).map(|at| self.decoded[at].radius);
            let Some(widest) = widest.reduce(f32::max) else { continue };
            if let Some(chunk) = group.chunk {
                self.link(&group, Link::Chunk(chunk));
                continue;
            }
            let number = self.drafts.len() as u32;
            self.link(&group, Link::Own(number));
            let level = group.level + 1;
            let mut draft = Draft {
                family: Family::on_level(level),
                bucket: bucket(self.model_radius, widest),
                first_nodes: [0; 4],
                links: [None; 4],
            };
            let first_group = self.stack.len();
            let mut place = 0;
            for parent in all {
                let nodes = self.children(parent);
                if nodes == 0 {
                    continue;
                }
                let chunk = chunks.get(parent).copied().flatten();
                let copied = self.first_children[parent] as usize;
                let first_node = if copied >= self.listed { copied } else { self.next };
                self.first_children[parent] = first_node as u32;
                for nth in 0..nodes {
                    let at = if copied >= self.listed { copied + usize::from(nth) } else { self.next() };
                    if is_top {
                        self.encode_within(at, parent)
                    } else {
                        self.encode(at, parent)
                    }
                    self.count(level, self.decoded[at].radius);
                    self.take_apart(at, parent, if chunk.is_some() { Whose::Chunks } else { Whose::Own });
                }
                draft.family.push_group(usize::from(nodes));
                draft.first_nodes[place] = first_node as u32;
                let family = Some((number, place as u8));
                self.stack.push(Group { first_node: first_node as u32, nodes, level, family, chunk });
                place += 1;
            }
            self.drafts.push(draft);
            self.stack[first_group..].reverse();
        }
        debug_assert_eq!(self.next, self.listed, "every node belongs to a family");
    }

    fn children(&self, at: usize) -> u8 {
        self.tree.nodes[at].children().count
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
        let is_top = self.places_wanted;
        out.places.resize(if is_top { self.codes.len() } else { 0 }, 0);
        for at in order {
            let Draft { family, bucket, first_nodes, links } = &self.drafts[at as usize];
            for (first_node, nodes) in first_nodes.iter().zip(family.groups()) {
                let range = *first_node as usize..*first_node as usize + usize::from(nodes);
                for (place, node) in out.places.iter_mut().skip(range.start).take(range.len()).zip(out.nodes.len()..) {
                    *place = node as u32;
                }
                out.nodes.extend(range.clone().map(|node| self.tree.nodes[node].pack(self.codes[node]).0));
                out.colors.extend(self.tree.colors.get(range).unwrap_or_default());
            }
            out.families.push(*family);
            out.links.extend(links.iter().flatten().map(|link| match link {
                Link::Own(family) => Link::Own(number_of[*family as usize]),
                chunk @ Link::Chunk(_) => *chunk,
            }));
            let more =
                Run { bucket: *bucket, families: 1, nodes: family.nodes() as u32, links: u32::from(family.links) };
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
        out.copies = self.copies;
        out
    }
}

impl Lowered {
    /// Says of a node on top that not all of its children, which are a chunk's, are leaves.
    pub(super) fn not_all_leaves(&mut self, node: usize) {
        let word = &mut self.nodes[self.places[node] as usize];
        *word = Node(*word).with_inner_children().0;
    }

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
