//! One operation: an edge's ends become one vertex, if its error is proved; else nothing changes.
//!
//! In: which end goes, which stays, and where that moves. Out: a verdict. What always holds: until [`Work::do_it`] the surface is as it
//! was, and by then each face that changes has a bound within the limit, of its distance and of how far what looks alike has moved.

use super::super::looks::{FaceLook, Looks};
use super::super::overlay::{Border, MOST_VERTICES, Verdict};
use super::super::patch::{Face, total};
use super::super::surface::Surface;
use super::{HOPELESS_LOOK, Operation, Work, up};
use glam::DVec3;
use std::cmp::Reverse;

/// Edges longer than so many times the limit are not tried where nothing can be laid flat.
const COVERED_LENGTH: f64 = 0.7;
/// Faces around both ends of an edge that are covered at most.
const MOST_COVERED: usize = 48;

/// Not in the overlay.
const NO_NAME: u8 = u8::MAX;

/// Buffers of one operation.
#[derive(Default)]
pub(super) struct Star {
    /// Faces around the vertex that vanishes, and around the other.
    of_gone: Vec<u32>,
    of_kept: Vec<u32>,
    /// Vertices of the overlay.
    names: Vec<u32>,
    /// Of all vertices: the place in `names`, or [`NO_NAME`].
    name_of: Vec<u8>,
    /// Other ends of the edges of what stays.
    ring: Vec<u32>,
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
    pub(super) fn new(vertices: usize) -> Self {
        Self { name_of: vec![NO_NAME; vertices], ..Self::default() }
    }

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

impl Work {
    pub(super) fn is_short(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|vertex| self.surface.vertices[vertex as usize].at);
        (a - b).length() <= COVERED_LENGTH * self.limit.error
    }

    /// Does an operation that is no exchange of discs, or none that can be laid flat, if it is proved.
    pub(super) fn try_covered(&mut self, operation: Operation) -> bool {
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
    pub(super) fn try_one(&mut self, operation: Operation) -> Verdict {
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

    /// Fills the overlay with both sides; false where they are no discs, one would be glued to itself, or it is not worth a try.
    fn lay_out(&mut self, operation: &Operation) -> bool {
        let Operation { gone, kept, moved } = *operation;
        let Self { surface, overlay, star, .. } = self;
        let Star { of_gone, of_kept, names, name_of, old, changed, .. } = star;
        names.iter().for_each(|vertex| name_of[*vertex as usize] = NO_NAME);
        for list in [&mut *of_gone, of_kept, old, changed, names] {
            list.clear();
        }
        surface.around(gone, of_gone);
        surface.around(kept, of_kept);
        overlay.clear();
        let most = HOPELESS_LOOK * self.limit.error;
        let is_hopeless = |face: &u32| f64::from(surface.faces[*face as usize].app) > most;
        if of_gone.iter().any(is_hopeless) || moved.is_some() && of_kept.iter().any(is_hopeless) {
            return false;
        }
        old.extend_from_slice(of_gone);
        if moved.is_some() {
            old.extend(of_kept.iter().filter(|face| !surface.faces[**face as usize].corners.contains(&gone)));
        }
        if old.len() > MOST_VERTICES - 4 {
            return false;
        }
        let mut name = |vertex: u32| {
            let name = &mut name_of[vertex as usize];
            if *name == NO_NAME && names.len() < MOST_VERTICES - 1 {
                *name = names.len() as u8;
                names.push(vertex);
            }
            Some(*name).filter(|name| *name != NO_NAME)
        };
        // Name 0 is what vanishes, 1 is what stays; where that moves, it vanishes as well, and the last name is where to.
        const KEPT: u8 = 1;
        for end in [gone, kept] {
            name(end);
        }
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
        let around = |center: u8| {
            let faces = overlay.old.iter().filter(|face| face.contains(&center));
            faces.flatten().fold(0u64, |names, name| names | 1 << name)
        };
        let (around_gone, mut around_kept) = (around(0), around(1));
        if !is_moved {
            for face in &star.of_kept {
                let names = surface.faces[*face as usize].corners.map(|corner| star.name_of[corner as usize]);
                names.iter().filter(|name| **name != NO_NAME).for_each(|name| around_kept |= 1 << name);
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
        star.ring.clear();
        for face in &star.of_kept {
            for corner in surface.faces[*face as usize].corners {
                if corner != vertex && !star.ring.contains(&corner) {
                    star.ring.push(corner);
                }
            }
        }
        for at in 0..self.star.ring.len() {
            let other = self.star.ring[at];
            if let Some(candidate) = self.candidate([vertex.min(other), vertex.max(other)]) {
                self.queue.push(Reverse(candidate));
            }
        }
    }
}
