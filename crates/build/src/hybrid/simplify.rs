//! Makes a patch as coarse as its error allows.
//!
//! In: a patch, and the largest error that its faces may have. Out: a patch with fewer faces, whose errors say what they are.
//!
//! Edges collapse in order of their quadrics; an operation is done only if [`Overlay`](super::overlay) proves that the error of each
//! face that changes stays within the limit, and if what there was still looks alike ([`looks`](super::looks)). So quality and proof are
//! separate. Everything is decided by numbers of vertices and bits of costs: the same patch gives the same one.

mod operation;

use super::cover::Cover;
use super::looks::Looks;
use super::overlay::{Overlay, Verdict};
use super::patch::{Patch, Vertex};
use super::quadric::Quadric;
use super::surface::Surface;
use glam::DVec3;
use operation::Star;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
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
/// Passes over all edges; each takes what the one before it made possible.
const MOST_PASSES: usize = 3;
/// A pass that gains less than this share is the last.
const LEAST_GAIN: f64 = 0.02;

/// Simplifies; what cannot be done within the limit is not done.
pub(super) fn simplify(patch: Patch, limit: Limit) -> Patch {
    let mut work = Work::new(patch, limit);
    for _ in 0..MOST_PASSES {
        let before = work.surface.left;
        work.pass();
        if ((before - work.surface.left) as f64) < LEAST_GAIN * before as f64 {
            break;
        }
    }
    work.surface.into_patch()
}

/// An edge that may collapse.
type Candidate = Reverse<(u64, u32, u32, u32, u32)>;

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
    /// Counts operations.
    clock: u32,
    /// When a face of a vertex last changed.
    changed: Vec<u32>,
    /// When edges were last tried in vain.
    failed: HashMap<u64, u32, BuildHasherDefault<EdgeHasher>>,
    /// Vertices that the patch had, and their errors of appearance.
    bases: Vec<Option<f32>>,
    looks: Looks,
    queue: BinaryHeap<Candidate>,
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
    fn new(patch: Patch, limit: Limit) -> Self {
        let anchor = patch.vertices.first().map_or(DVec3::ZERO, |vertex| vertex.at);
        let surface = Surface::new(patch);
        let (vertices, faces) = (surface.vertices.len(), surface.faces.len());
        let mut work = Self {
            limit,
            quadrics: vec![Quadric::default(); vertices],
            anchor,
            on_border: vec![false; vertices],
            stamps: vec![0; vertices],
            clock: 0,
            changed: vec![0; vertices],
            failed: HashMap::default(),
            bases: vec![Some(0.0); vertices],
            looks: Looks::new(faces),
            queue: BinaryHeap::new(),
            overlay: Overlay::default(),
            cover: Cover::default(),
            star: Star::default(),
            surface,
        };
        work.weigh();
        work
    }

    /// Quadrics, borders, and errors of appearance at vertices.
    fn weigh(&mut self) {
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
        for ([a, b], faces, face) in edges_of(surface) {
            if faces == 2 {
                continue;
            }
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

    /// Tries all edges, and those that change on the way.
    fn pass(&mut self) {
        self.queue.clear();
        let candidates: Vec<Candidate> =
            edges_of(&self.surface).into_iter().filter_map(|([a, b], ..)| self.candidate(a, b)).collect();
        self.queue = BinaryHeap::from(candidates);
        while let Some(Reverse((_, a, b, stamp_a, stamp_b))) = self.queue.pop() {
            if self.stamps[a as usize] == stamp_a && self.stamps[b as usize] == stamp_b {
                self.collapse(a, b);
            }
        }
    }

    /// None where it is not worth a try: for its cost, or because nothing has changed since it failed.
    fn candidate(&self, a: u32, b: u32) -> Option<Candidate> {
        let failed = self.failed.get(&(u64::from(a) << 32 | u64::from(b)));
        if failed.is_some_and(|clock| self.changed[a as usize].max(self.changed[b as usize]) <= *clock) {
            return None;
        }
        let cost = self.best(a, b).1;
        let area = self.quadrics[a as usize].area + self.quadrics[b as usize].area;
        if cost > area * (HOPELESS * self.limit.error).powi(2) {
            return None;
        }
        let [p, q] = [a, b].map(|vertex| self.surface.vertices[vertex as usize].at);
        let order = cost + LENGTH_WEIGHT * area * (p - q).length_squared();
        Some(Reverse((order.to_bits(), a, b, self.stamps[a as usize], self.stamps[b as usize])))
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
            self.failed.insert(u64::from(a) << 32 | u64::from(b), self.clock);
        }
    }
}

/// Rounded up.
pub(super) fn up(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) < value { rounded.next_up() } else { rounded }
}

/// All edges in order, with the number of their faces, and one of these.
pub(super) fn edges_of(surface: &Surface) -> Vec<([u32; 2], u32, u32)> {
    let mut all: Vec<(u64, u32)> = Vec::with_capacity(surface.left * 3);
    for (number, face) in surface.faces.iter().enumerate() {
        if surface.is_there(number as u32) {
            let [a, b, c] = face.corners;
            for [p, q] in [[a, b], [b, c], [c, a]] {
                all.push((u64::from(p.min(q)) << 32 | u64::from(p.max(q)), number as u32));
            }
        }
    }
    all.sort_unstable();
    all.chunk_by(|a, b| a.0 == b.0)
        .map(|same| ([(same[0].0 >> 32) as u32, same[0].0 as u32], same.len() as u32, same[0].1))
        .collect()
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
