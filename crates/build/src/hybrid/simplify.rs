//! Makes a patch as coarse as its error allows.
//!
//! In: a patch, and the largest error that its faces may have. Out: a patch with fewer faces, whose errors say what they are.
//!
//! Edges collapse in order of their quadrics; an operation is done only if [`Overlay`](super::overlay) proves that the error of each
//! face that changes stays within the limit, and if what there was still looks alike ([`looks`](super::looks)). So quality and proof are
//! separate. Everything is decided by numbers of vertices and bits of costs: the same patch gives the same one.

use super::cover::Cover;
use super::looks::{FaceLook, Looks};
use super::overlay::{Border, MOST_VERTICES, Overlay, Verdict};
use super::patch::{Face, Patch, Vertex, total};
use super::quadric::Quadric;
use super::surface::Surface;
use glam::DVec3;
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
/// Edges longer than so many times the limit are not tried where nothing can be laid flat.
const COVERED_LENGTH: f64 = 3.0;
/// Faces around both ends of an edge that are covered at most.
const MOST_COVERED: usize = 48;
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

/// Buffers of one operation.
#[derive(Default)]
struct Star {
    /// Faces around the vertex that vanishes, and around the other.
    of_gone: Vec<u32>,
    of_kept: Vec<u32>,
    /// Vertices of the overlay.
    names: Vec<u32>,
    /// Faces that change.
    old: Vec<u32>,
    /// Those of them that stay, in the order of the overlay's new ones.
    changed: Vec<u32>,
    /// Faces that stay as they are, but for their errors.
    beside: Vec<u32>,
    looks: Vec<FaceLook>,
    app: Vec<f32>,
    samples: Vec<u32>,
    /// Where samples go: number of the new face.
    places: Vec<(u32, u32)>,
    /// Where vertices go that become samples.
    vertex_places: Vec<(u32, u32)>,
}

impl Star {
    /// Faces around what stays that also have another vertex, by its name.
    fn faces_at_edge(&self, surface: &Surface, other: u8) -> usize {
        let other = self.names[usize::from(other)];
        self.of_kept.iter().filter(|face| surface.faces[**face as usize].corners.contains(&other)).count()
    }
}

/// What proves an operation.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Laid {
    /// The overlay.
    Flat,
    /// The cover.
    Covered,
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

    fn is_short(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|vertex| self.surface.vertices[vertex as usize].at);
        (a - b).length() <= COVERED_LENGTH * self.limit.error
    }

    /// Does an operation that is no exchange of discs, or none that can be laid flat, if it is proved.
    fn try_covered(&mut self, operation: Operation) -> bool {
        let Operation { gone, kept, moved } = operation;
        let Self { surface, cover, star, .. } = self;
        let Star { of_gone, of_kept, old, changed, beside, .. } = star;
        for list in [&mut *of_gone, of_kept, old, changed, beside] {
            list.clear();
        }
        surface.around(gone, of_gone);
        surface.around(kept, of_kept);
        if of_gone.len() + of_kept.len() > MOST_COVERED {
            return false;
        }
        cover.clear();
        let at = |vertex: u32| match moved {
            Some(moved) if vertex == kept || vertex == gone => moved.at,
            _ => surface.vertices[if vertex == gone { kept } else { vertex } as usize].at,
        };
        let others = of_kept.iter().filter(|face| !of_gone.contains(face));
        for face in of_gone.iter().chain(others) {
            let Face { corners, geo, .. } = surface.faces[*face as usize];
            let [has_gone, has_kept] = [gone, kept].map(|vertex| corners.contains(&vertex));
            let before = (corners.map(|corner| surface.vertices[corner as usize].at), f64::from(geo));
            if !has_gone && moved.is_none() {
                cover.beside.push(before);
                beside.push(*face);
                continue;
            }
            cover.old.push(before);
            old.push(*face);
            if !(has_gone && has_kept) {
                cover.new.push((corners.map(at), 0.0));
                changed.push(*face);
            }
        }
        if cover.new.is_empty() {
            return false;
        }
        if self.limit.keeps_looks && !self.look(&operation, Laid::Covered) {
            return false;
        }
        if !self.cover.bound(self.limit.error) {
            return false;
        }
        for (face, (_, geo)) in self.star.beside.iter().zip(&self.cover.beside) {
            let app = self.surface.faces[*face as usize].app;
            if f64::from(total(up(*geo), app)) > self.limit.error {
                return false;
            }
        }
        if self.limit.keeps_looks {
            let star = &self.star;
            let total = self.cover.new.iter().zip(&star.app).map(|((_, geo), app)| total(up(*geo), *app));
            if total.into_iter().any(|total| f64::from(total) > self.limit.error) {
                return false;
            }
        }
        for (face, (_, geo)) in self.star.beside.iter().zip(&self.cover.beside) {
            let face = &mut self.surface.faces[*face as usize];
            face.geo = face.geo.max(up(*geo));
        }
        self.do_it(&operation, Laid::Covered);
        true
    }

    /// Does an operation if it is proved.
    fn try_one(&mut self, operation: Operation) -> Verdict {
        if !self.lay_out(&operation) {
            return Verdict::Unproved;
        }
        if self.overlay.new.is_empty() {
            return if self.cut_ear(&operation) { Verdict::Good } else { Verdict::Unproved };
        }
        let begun = self.overlay.begin(self.limit.error);
        if begun != Verdict::Good {
            return begun;
        }
        if self.limit.keeps_looks && !self.look(&operation, Laid::Flat) {
            return Verdict::TooFar;
        }
        let finished = self.overlay.finish(self.limit.error);
        if finished != Verdict::Good {
            return finished;
        }
        if self.limit.keeps_looks {
            let total = self.overlay.geo.iter().zip(&self.star.app).map(|(geo, app)| total(up(*geo), *app));
            if total.into_iter().any(|total| f64::from(total) > self.limit.error) {
                return Verdict::TooFar;
            }
        }
        self.do_it(&operation, Laid::Flat);
        Verdict::Good
    }

    /// Fills the overlay with both sides; false where they are no discs, or one would be glued to itself.
    fn lay_out(&mut self, operation: &Operation) -> bool {
        let Operation { gone, kept, moved } = *operation;
        let Self { surface, overlay, star, .. } = self;
        let Star { of_gone, of_kept, names, old, changed, .. } = star;
        for list in [&mut *of_gone, of_kept, old, changed, names] {
            list.clear();
        }
        surface.around(gone, of_gone);
        surface.around(kept, of_kept);
        overlay.clear();
        old.extend_from_slice(of_gone);
        if moved.is_some() {
            old.extend(of_kept.iter().filter(|face| !surface.faces[**face as usize].corners.contains(&gone)));
        }
        if old.len() > MOST_VERTICES - 4 {
            return false;
        }
        names.extend([gone, kept]);
        let mut name = |vertex: u32| match names.iter().position(|name| *name == vertex) {
            Some(known) => Some(known as u8),
            None if names.len() < MOST_VERTICES - 1 => {
                names.push(vertex);
                Some(names.len() as u8 - 1)
            }
            None => None,
        };
        // Name 0 is what vanishes, 1 is what stays; where that moves, it vanishes as well, and the last name is where to.
        const KEPT: u8 = 1;
        for face in old.iter() {
            let corners = surface.faces[*face as usize].corners;
            let [Some(a), Some(b), Some(c)] = corners.map(&mut name) else { return false };
            let named = [a, b, c];
            overlay.old.push(named);
            overlay.old_geo.push(surface.faces[*face as usize].geo);
            let (has_gone, has_kept) = (named.contains(&0), named.contains(&KEPT));
            if has_gone && has_kept {
                continue;
            }
            let first = named.iter().position(|name| *name <= KEPT).expect("all faces are around one of them");
            overlay.new.push([KEPT, named[(first + 1) % 3], named[(first + 2) % 3]]);
            changed.push(*face);
        }
        overlay.at.extend(names.iter().map(|name| surface.vertices[*name as usize].at));
        overlay.gone.push(0);
        overlay.apex = KEPT;
        overlay.apex_is_old = moved.is_none();
        if let Some(moved) = moved {
            overlay.gone.push(KEPT);
            overlay.apex = names.len() as u8;
            overlay.at.push(moved.at);
            let apex = overlay.apex;
            overlay.new.iter_mut().for_each(|face| face[0] = apex);
        }
        self.is_disc(moved.is_some())
    }

    /// The rim is one closed chain, or, around a vertex of the border, an open one that begins or ends at what stays; and nothing but
    /// the faces that vanish is around both ends.
    fn is_disc(&mut self, is_moved: bool) -> bool {
        let Self { overlay, star, surface, .. } = self;
        let mut next = [u8::MAX; MOST_VERTICES];
        let mut before = [u8::MAX; MOST_VERTICES];
        let mut links = 0;
        let mut first = u8::MAX;
        let fans: &[[u8; 3]] = if is_moved { &overlay.new } else { &overlay.old };
        for face in fans {
            let center = if is_moved { overlay.apex } else { 0 };
            let at = face.iter().position(|name| *name == center).expect("the fan's own");
            let (a, b) = (face[(at + 1) % 3], face[(at + 2) % 3]);
            if next[usize::from(a)] != u8::MAX || before[usize::from(b)] != u8::MAX {
                return false;
            }
            next[usize::from(a)] = b;
            before[usize::from(b)] = a;
            links += 1;
            first = a;
        }
        if links == 0 {
            return false;
        }
        // Back to the beginning of an open chain.
        let mut start = first;
        for _ in 0..links {
            match before[usize::from(start)] {
                u8::MAX => break,
                earlier => start = earlier,
            }
        }
        let (mut end, mut walked) = (start, 0);
        while next[usize::from(end)] != u8::MAX && walked < links {
            end = next[usize::from(end)];
            walked += 1;
        }
        if walked < links {
            return false;
        }
        let is_closed = next[usize::from(end)] != u8::MAX;
        if is_closed && start != end {
            return false;
        }
        if !is_closed {
            let other = match (start, end) {
                (1, other) | (other, 1) if !is_moved => other,
                _ => return false,
            };
            overlay.border = Some(Border { before: other, gone: 0 });
        }
        // Neighbours of both ends.
        let of_gone = overlay.old.iter().filter(|face| face.contains(&0)).flatten();
        let mut around_gone = 0u64;
        of_gone.for_each(|name| around_gone |= 1 << name);
        let mut around_kept = 0u64;
        for face in &star.of_kept {
            for corner in surface.faces[*face as usize].corners {
                if let Some(name) = star.names.iter().position(|name| *name == corner) {
                    around_kept |= 1 << name;
                }
            }
        }
        let common = around_gone & around_kept & !3;
        match overlay.border {
            None => common.count_ones() == 2,
            // The last edge of a hole closes with its other side.
            Some(Border { before, .. }) if common & 1 << before != 0 => {
                common.count_ones() == 2 && links > 1 && star.faces_at_edge(surface, before) == 1
            }
            Some(_) => common.count_ones() == 1,
        }
    }

    /// The last face at a corner of the border goes; its points move to the edge that another face has.
    fn cut_ear(&mut self, operation: &Operation) -> bool {
        let [ear] = self.star.old[..] else { return false };
        let Self { surface, star, looks, limit, .. } = self;
        let Operation { gone, kept, .. } = *operation;
        let face = surface.faces[ear as usize];
        let third =
            face.corners.into_iter().find(|corner| *corner != gone && *corner != kept).expect("no face is degenerate");
        let holds = |face: &&u32| **face != ear && surface.faces[**face as usize].corners.contains(&third);
        let Some(other) = star.of_kept.iter().find(holds).copied() else { return false };
        let [from, a, b] = [gone, kept, third].map(|vertex| surface.vertices[vertex as usize].at);
        let along = b - a;
        let share = ((from - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let moved = (from - (a + along * share)).length();
        let held = &surface.faces[other as usize];
        let geo = held.geo.max(up(f64::from(face.geo) + moved * (1.0 + 1e-6)));
        if f64::from(total(geo, held.app)) > limit.error {
            return false;
        }
        surface.faces[other as usize].geo = geo;
        surface.remove(ear);
        looks.clear(ear);
        self.clock += 1;
        surface.faces[other as usize].corners.iter().for_each(|corner| self.changed[*corner as usize] = self.clock);
        self.stamps[gone as usize] += 1;
        self.stamps[kept as usize] += 1;
        self.requeue(kept);
        true
    }

    /// Bounds how far what looks alike has moved; false where that is beyond the limit.
    fn look(&mut self, operation: &Operation, laid: Laid) -> bool {
        let Self { surface, overlay, cover, star, looks, limit, bases, .. } = self;
        let Operation { gone, kept, moved } = operation;
        let corner = |vertex: u32| match moved {
            Some(moved) if vertex == *kept || vertex == *gone => moved,
            _ => &surface.vertices[if vertex == *gone { *kept } else { vertex } as usize],
        };
        star.looks.clear();
        star.looks.extend(star.changed.iter().map(|face| {
            let corners = surface.faces[*face as usize].corners;
            // Shares count from the apex where that is flat.
            let first = match laid {
                Laid::Flat => corners.iter().position(|corner| corner == gone || corner == kept).unwrap_or(0),
                Laid::Covered => 0,
            };
            FaceLook::of([0, 1, 2].map(|side| corner(corners[(first + side) % 3])))
        }));
        star.app.clear();
        star.app.resize(star.changed.len(), 0.0);
        star.samples.clear();
        star.old.iter().for_each(|face| looks.on(*face, &mut star.samples));
        star.places.clear();
        star.vertex_places.clear();
        let locate = |at: DVec3| match laid {
            Laid::Flat => overlay.locate(at),
            Laid::Covered => cover.locate(at),
        };
        let geo = |face: usize| match laid {
            Laid::Flat => overlay.geo[face],
            Laid::Covered => cover.new[face].1,
        };
        let passes = |app: f32, face: usize| f64::from(total(geo(face) as f32, app)) <= limit.error;
        for sample in &star.samples {
            let (face, shares) = locate(looks.place(*sample));
            let app = looks.error(*sample, &star.looks[face], shares);
            if !passes(app, face) {
                return false;
            }
            star.app[face] = star.app[face].max(app);
            star.places.push((*sample, face as u32));
        }
        for vanished in [Some(*gone), moved.map(|_| *kept)].into_iter().flatten() {
            let Some(base) = bases[vanished as usize] else { continue };
            let was = &surface.vertices[vanished as usize];
            let (face, shares) = locate(was.at);
            let app = Looks::error_of_vertex(was, base, &star.looks[face], shares);
            if !passes(app, face) {
                return false;
            }
            star.app[face] = star.app[face].max(app);
            star.vertex_places.push((vanished, face as u32));
        }
        // Corners that stay keep what they had when this level began.
        for (app, face) in star.app.iter_mut().zip(&star.changed) {
            for corner in surface.faces[*face as usize].corners {
                if corner != *gone && (corner != *kept || moved.is_none()) {
                    *app = app.max(bases[corner as usize].unwrap_or(0.0));
                }
            }
        }
        true
    }

    fn do_it(&mut self, operation: &Operation, laid: Laid) {
        let Operation { gone, kept, moved } = *operation;
        let Self { surface, overlay, cover, star, looks, bases, quadrics, stamps, .. } = self;
        self.clock += 1;
        for face in &star.old {
            surface.faces[*face as usize].corners.iter().for_each(|corner| self.changed[*corner as usize] = self.clock);
        }
        if self.limit.keeps_looks {
            star.old.iter().for_each(|face| looks.clear(*face));
            for (sample, face) in &star.places {
                looks.put(*sample, star.changed[*face as usize]);
            }
            for (vertex, face) in &star.vertex_places {
                let base = bases[*vertex as usize].expect("only such have places");
                looks.add(surface.vertices[*vertex as usize], base, star.changed[*face as usize]);
            }
        }
        for face in &star.old {
            if !star.changed.contains(face) {
                surface.remove(*face);
            }
        }
        for (number, face) in star.changed.iter().enumerate() {
            let changed = &mut surface.faces[*face as usize];
            changed.geo = up(match laid {
                Laid::Flat => overlay.geo[number],
                Laid::Covered => cover.new[number].1,
            });
            if self.limit.keeps_looks {
                changed.app = star.app[number];
            }
            if changed.corners.contains(&gone) {
                surface.reassign(*face, gone, kept);
            }
        }
        quadrics[kept as usize] = quadrics[kept as usize].plus(&quadrics[gone as usize]);
        if let Some(moved) = moved {
            surface.vertices[kept as usize] = moved;
            bases[kept as usize] = None;
        }
        stamps[gone as usize] += 1;
        stamps[kept as usize] += 1;
        self.requeue(kept);
    }

    /// Edges of a vertex that has changed.
    fn requeue(&mut self, vertex: u32) {
        let Self { surface, star, .. } = self;
        star.of_kept.clear();
        surface.around(vertex, &mut star.of_kept);
        star.names.clear();
        for face in &star.of_kept {
            for corner in surface.faces[*face as usize].corners {
                if corner != vertex && !star.names.contains(&corner) {
                    star.names.push(corner);
                }
            }
        }
        for at in 0..self.star.names.len() {
            let other = self.star.names[at];
            if let Some(candidate) = self.candidate(vertex.min(other), vertex.max(other)) {
                self.queue.push(candidate);
            }
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
