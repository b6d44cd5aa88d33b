//! Makes a patch as coarse as its error allows.
//!
//! In: a patch, and the largest error that its faces may have. Out: a patch with fewer faces, whose errors say what they are.
//!
//! Edges collapse in order of their quadrics; an operation is done only if [`Overlay`](super::overlay) proves that the error of each
//! face that changes stays within the limit, and if what there was still looks alike ([`looks`](super::looks)). So quality and proof are
//! separate. Everything is decided by numbers of vertices and bits of costs: the same patch gives the same one.

mod operation;

use super::cover::Cover;
use super::edges::{self, Side};
use super::looks::Looks;
use super::overlay::{Overlay, Verdict};
use super::patch::{Patch, Vertex};
use super::quadric::Quadric;
use super::surface::Surface;
use glam::DVec3;
use operation::Star;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

/// What a result may be off by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// For the total error of a face; model units.
    pub(super) error: f64,
    /// Whether appearance counts.
    pub(super) keeps_looks: bool,
}

/// Weight of planes that hold borders in place, compared to faces.
const BORDER_WEIGHT: f64 = 2.0;
/// Weight of an edge's middle while its best place is looked for, so that flat places have one.
const PLACE_WEIGHT: f64 = 1e-5;
/// Weight of an edge's length in the order of operations: of those that cost nothing, short edges go first.
const LENGTH_WEIGHT: f64 = 1e-7;
/// Operations are not tried whose quadric says that planes are so many times the limit away, in the mean of squares.
const HOPELESS: f64 = 1.0;
/// Nor those at faces whose error of appearance is so much of the limit: of ten, one would succeed, and others do in its place.
const HOPELESS_LOOK: f64 = 0.9;

/// Simplifies; what cannot be done within the limit is not done.
pub(super) fn simplify(patch: Patch, limit: Limit) -> Patch {
    let surface = Surface::new(patch);
    let sides = edges::sides(surface.vertices.len(), surface.there());
    let mut work = Work::new(surface, limit);
    work.weigh(&sides);
    work.try_all(&sides);
    work.surface.into_patch()
}

/// An edge that may collapse, and when: from the top, 32 bits each, the first bits of its cost as `f64`, its ends, and the sum of their stamps.
/// One number, since most of what happens to them is that two are compared.
type Candidate = u128;

struct Work {
    surface: Surface,
    limit: Limit,
    quadrics: Vec<Quadric>,
    /// All quadrics are relative to it.
    anchor: DVec3,
    /// False for vertices with a closed fan of faces.
    on_border: Vec<bool>,
    /// Counts changes of a vertex.
    stamps: Vec<u32>,
    /// Edges that were tried in vain, which are not tried again: of 50 that are, one succeeds.
    failed: HashSet<u64, BuildHasherDefault<EdgeHasher>>,
    /// Vertices that the patch had, and their errors of appearance.
    bases: Vec<Option<f32>>,
    looks: Looks,
    /// Of edges that have changed.
    queue: BinaryHeap<Reverse<Candidate>>,
    overlay: Overlay,
    cover: Cover,
    star: Star,
}

/// What becomes of an edge's ends.
#[derive(Clone, Copy)]
struct Operation {
    gone: u32,
    kept: u32,
    /// What the kept one becomes; none where it stays as it is.
    moved: Option<Vertex>,
}

impl Work {
    fn new(surface: Surface, limit: Limit) -> Self {
        let anchor = surface.vertices.first().map_or(DVec3::ZERO, |vertex| vertex.at);
        let (vertices, faces) = (surface.vertices.len(), surface.faces.len());
        Self {
            limit,
            quadrics: vec![Quadric::default(); vertices],
            anchor,
            on_border: vec![false; vertices],
            stamps: vec![0; vertices],
            failed: HashSet::default(),
            bases: vec![Some(0.0); vertices],
            looks: Looks::new(faces),
            queue: BinaryHeap::new(),
            overlay: Overlay::default(),
            cover: Cover::default(),
            star: Star::new(vertices),
            surface,
        }
    }

    /// Quadrics, borders, and errors of appearance at vertices.
    fn weigh(&mut self, sides: &[Side]) {
        let Self { surface, quadrics, anchor, on_border, bases, .. } = self;
        for (number, face) in surface.faces.iter().enumerate() {
            if !surface.is_there(number as u32) {
                continue;
            }
            let at = face.corners.map(|corner| surface.vertices[corner as usize].at - *anchor);
            let doubled = (at[1] - at[0]).cross(at[2] - at[0]);
            let area = 0.5 * doubled.length();
            let plane = doubled.try_normalize().map(|normal| Quadric::plane(normal, at[0], area));
            for corner in face.corners {
                let sum = quadrics[corner as usize];
                let mut sum = plane.map_or(sum, |plane| sum.plus(&plane));
                sum.area += area;
                quadrics[corner as usize] = sum;
                let base = &mut bases[corner as usize];
                *base = base.map(|base: f32| base.max(face.app));
            }
        }
        for same in edges::by_edge(sides).filter(|same| same.len() != 2) {
            let Side { ends: [a, b], face, .. } = same[0];
            on_border[a as usize] = true;
            on_border[b as usize] = true;
            let [p, q] = [a, b].map(|vertex| surface.vertices[vertex as usize].at - *anchor);
            let at = surface.faces[face as usize].corners.map(|corner| surface.vertices[corner as usize].at - *anchor);
            let normal = (at[1] - at[0]).cross(at[2] - at[0]);
            if let Some(upright) = normal.cross(q - p).try_normalize() {
                let plane = Quadric::plane(upright, p, BORDER_WEIGHT * (q - p).length_squared());
                for vertex in [a, b] {
                    quadrics[vertex as usize] = quadrics[vertex as usize].plus(&plane);
                }
            }
        }
    }

    /// Tries all edges, and those that there come to be.
    fn try_all(&mut self, sides: &[Side]) {
        let mut first: Vec<Candidate> = edges::by_edge(sides).filter_map(|same| self.candidate(same[0].ends)).collect();
        first.sort_unstable_by_key(|candidate| Reverse(*candidate));
        loop {
            let is_changed_next = match (first.last(), self.queue.peek()) {
                (Some(old), Some(Reverse(changed))) => changed < old,
                (old, _) => old.is_none(),
            };
            let next = if is_changed_next { self.queue.pop().map(|Reverse(next)| next) } else { first.pop() };
            let Some(candidate) = next else { break };
            let (a, b, stamps) = ((candidate >> 64) as u32, (candidate >> 32) as u32, candidate as u32);
            if self.stamp(a, b) == stamps {
                self.collapse(a, b);
            }
        }
    }

    /// Is another one after each change of either.
    fn stamp(&self, a: u32, b: u32) -> u32 {
        self.stamps[a as usize] + self.stamps[b as usize]
    }

    /// None where it is not worth a try: for its cost, or because it has failed.
    fn candidate(&self, [a, b]: [u32; 2]) -> Option<Candidate> {
        if self.failed.contains(&(u64::from(a) << 32 | u64::from(b))) {
            return None;
        }
        let cost = self.best(a, b).1;
        let area = self.quadrics[a as usize].area + self.quadrics[b as usize].area;
        if cost > area * (HOPELESS * self.limit.error).powi(2) {
            return None;
        }
        let [p, q] = [a, b].map(|vertex| self.surface.vertices[vertex as usize].at);
        let order = cost + LENGTH_WEIGHT * area * (p - q).length_squared();
        let [a, b, stamp] = [a, b, self.stamp(a, b)].map(u128::from);
        Some(u128::from(order.to_bits() >> 32) << 96 | a << 64 | b << 32 | stamp)
    }

    /// The best place for an edge to collapse to, and its cost.
    fn best(&self, a: u32, b: u32) -> (Operation, f64) {
        let quadric = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        let at = |vertex: u32| self.surface.vertices[vertex as usize].at - self.anchor;
        let (at_a, at_b) = (at(a), at(b));
        let to = |kept: u32, gone: u32| Operation { gone, kept, moved: None };
        let fixed = [self.on_border[a as usize], self.on_border[b as usize]];
        match fixed {
            [true, false] => return (to(a, b), quadric.at(at_a)),
            [false, true] => return (to(b, a), quadric.at(at_b)),
            _ => {}
        }
        let ends = [quadric.at(at_a), quadric.at(at_b)];
        let middle = (at_a + at_b) * 0.5;
        if fixed == [false, false]
            && let Some(place) = quadric.plus(&Quadric::point(middle, quadric.area * PLACE_WEIGHT)).least()
        {
            let length = (at_b - at_a).length_squared();
            if (place - middle).length_squared() <= length {
                let cost = quadric.at(place);
                if cost <= ends[0].min(ends[1]) * 1.01 {
                    return (Operation { gone: a, kept: b, moved: Some(self.between(a, b, place)) }, cost);
                }
            }
        }
        if ends[0] <= ends[1] { (to(a, b), ends[0]) } else { (to(b, a), ends[1]) }
    }

    /// A vertex at a place, which looks like both by how near they are.
    fn between(&self, a: u32, b: u32, place: DVec3) -> Vertex {
        let [a, b] = [a, b].map(|vertex| &self.surface.vertices[vertex as usize]);
        let at = place + self.anchor;
        let along = b.at - a.at;
        let share = ((at - a.at).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0) as f32;
        let normal = a.normal.lerp(b.normal, share).try_normalize().unwrap_or(a.normal);
        Vertex { at, normal, color: a.color.lerp(b.color, share) }
    }

    fn collapse(&mut self, a: u32, b: u32) {
        let best = self.best(a, b).0;
        let plain = Operation { moved: None, ..best };
        let other = Operation { gone: best.kept, kept: best.gone, moved: None };
        let mut verdict = self.try_one(best);
        if verdict == Verdict::Unproved && best.moved.is_some() {
            verdict = self.try_one(plain);
        }
        if verdict == Verdict::Unproved && self.on_border[a as usize] == self.on_border[b as usize] {
            verdict = self.try_one(other);
        }
        if verdict == Verdict::Unproved && self.is_short(a, b) {
            let operations = [best, plain, other];
            let first = usize::from(best.moved.is_none());
            if operations[first..].iter().any(|operation| self.try_covered(*operation)) {
                verdict = Verdict::Good;
            }
        }
        if verdict != Verdict::Good {
            self.failed.insert(u64::from(a) << 32 | u64::from(b));
        }
    }
}

/// Rounded up.
pub(super) fn up(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) < value { rounded.next_up() } else { rounded }
}

/// Mixes the two numbers of an edge.
#[derive(Default)]
struct EdgeHasher(u64);

impl Hasher for EdgeHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, _: &[u8]) {
        unreachable!("edges are one number")
    }

    fn write_u64(&mut self, edge: u64) {
        let mixed = edge.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ mixed >> 32;
    }
}
