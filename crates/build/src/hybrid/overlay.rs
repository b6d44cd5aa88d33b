//! How far a small piece of surface is from what takes its place, as a proof.
//!
//! In: the faces around one or two vertices that vanish, with the errors that they carry, and the fan of faces that shall stand
//! in their place, around an apex. Out: for each new face a bound of the distance between its points and what they stand for. None where
//! there is no proof.
//!
//! The proof: both pieces, projected along a common normal, tile the same polygon, so points above each other correspond, and
//! none is left out on either side. Laid over each other, the two triangulations cut the polygon into cells; in a cell both surfaces are
//! flat, so their distance along the normal is largest at a corner of the cell. Corners are vertices, or crossings of an edge of either
//! side. What corresponds to a point may itself be off by the error of its face; distances add (triangle inequality).
//!
//! At a border the polygons differ by the triangle between the old border and the new one. Its points are moved across, no farther
//! than it is high, and then to the edge above or below.
//!
//! Source: the overlay is that of Cohen, Manocha & Olano, *Simplifying polygonal models using successive mappings*, Visualization 1997,
//! section 4. Differs: errors are carried by faces and not summed over the whole mesh; heights, not distances, are compared.

use glam::{DVec2, DVec3};

/// Most vertices of a piece.
pub(super) const MOST_VERTICES: usize = 64;
/// New faces are no steeper against the common normal than this cosine: else the surface folds, or nearly.
const LEAST_COSINE: f64 = 0.2;
/// Of a length; what is so little outside is inside.
const EPSILON: f64 = 1e-9;
/// More than all roundings of this file together, as a share.
const ROUNDING: f64 = 1e-6;

/// No second face at an edge.
const NONE: u8 = u8::MAX;

/// Where the border runs: from `before` over `gone` to the apex, and then straight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Border {
    pub(super) before: u8,
    pub(super) gone: u8,
}

/// What an overlay says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Within the limit, as far as was looked.
    Good,
    /// Beyond the limit.
    TooFar,
    /// Nothing can be said.
    Unproved,
}

/// Old and new faces of a piece. Reused, so that nothing is allocated.
#[derive(Debug, Default)]
pub(super) struct Overlay {
    /// Of all vertices of both sides.
    pub(super) at: Vec<DVec3>,
    pub(super) old: Vec<[u8; 3]>,
    /// Errors that old faces carry.
    pub(super) old_geo: Vec<f32>,
    /// Apex first.
    pub(super) new: Vec<[u8; 3]>,
    /// Vertices of the old side that vanish.
    pub(super) gone: Vec<u8>,
    pub(super) apex: u8,
    /// True where the apex is a vertex of the old side's rim, which keeps its place.
    pub(super) apex_is_old: bool,
    pub(super) border: Option<Border>,
    /// Bounds for new faces.
    pub(super) geo: Vec<f64>,
    /// Of all vertices, across and along the common normal.
    flat: Vec<DVec2>,
    height: Vec<f64>,
    farthest: f64,
    across: (DVec3, DVec3),
    old_planes: Vec<Plane>,
    new_planes: Vec<Plane>,
    old_edges: Vec<Edge>,
    new_edges: Vec<Edge>,
}

/// Height over the polygon: that at a vertex, and how it changes.
#[derive(Clone, Copy, Debug, Default)]
struct Plane {
    from: DVec2,
    height: f64,
    slope: DVec2,
}

impl Plane {
    fn at(&self, flat: DVec2) -> f64 {
        self.height + self.slope.dot(flat - self.from)
    }
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    ends: [u8; 2],
    faces: [u8; 2],
}

fn cross(a: DVec2, b: DVec2) -> f64 {
    a.x * b.y - a.y * b.x
}

impl Overlay {
    pub(super) fn clear(&mut self) {
        self.at.clear();
        self.old.clear();
        self.old_geo.clear();
        self.new.clear();
        self.gone.clear();
        self.border = None;
    }

    /// The first half of the proof, which most operations fail that will: `geo` is what vertices say.
    pub(super) fn begin(&mut self, limit: f64) -> Verdict {
        if !self.project() || !self.fans_out() {
            return Verdict::Unproved;
        }
        self.geo.clear();
        self.geo.resize(self.new.len(), 0.0);
        match self.vertices() {
            Some(farthest) => {
                self.farthest = farthest;
                self.verdict(limit)
            }
            None => Verdict::Unproved,
        }
    }

    /// The other half, after [`Overlay::begin`]: `geo` bounds each new face.
    pub(super) fn finish(&mut self, limit: f64) -> Verdict {
        edges(&self.old, |vertex| self.gone.contains(&vertex), &mut self.old_edges);
        edges(&self.new, |vertex| vertex == self.apex, &mut self.new_edges);
        let Some(farthest) = self.crossings() else { return Verdict::Unproved };
        if let Some(border) = self.border {
            self.across(border, farthest.max(self.farthest));
        }
        for geo in &mut self.geo {
            *geo += *geo * ROUNDING;
        }
        self.verdict(limit)
    }

    fn verdict(&self, limit: f64) -> Verdict {
        if self.geo.iter().any(|geo| *geo > limit) { Verdict::TooFar } else { Verdict::Good }
    }

    /// Projects everything; false where either side is not a piece of a height field.
    fn project(&mut self) -> bool {
        let Self { at, old, new, flat, height, old_planes, new_planes, across, .. } = self;
        let area = |face: &[u8; 3]| {
            let [a, b, c] = face.map(|vertex| at[usize::from(vertex)]);
            (b - a).cross(c - a)
        };
        let sum: DVec3 = old.iter().map(area).sum();
        let Some(normal) = sum.try_normalize() else { return false };
        *across = normal.any_orthonormal_pair();
        let origin = at[usize::from(self.apex)];
        flat.clear();
        height.clear();
        for point in at.iter() {
            let from = *point - origin;
            flat.push(DVec2::new(from.dot(across.0), from.dot(across.1)));
            height.push(from.dot(normal));
        }
        for (faces, planes, least_cosine) in [(&*old, old_planes, 0.01), (&*new, new_planes, LEAST_COSINE)] {
            planes.clear();
            for face in faces {
                let [a, b, c] = face.map(usize::from);
                let (u, v) = (flat[b] - flat[a], flat[c] - flat[a]);
                let doubled = cross(u, v);
                if doubled <= least_cosine * area(face).length() || doubled <= 0.0 {
                    return false;
                }
                let (up, vp) = (height[b] - height[a], height[c] - height[a]);
                let slope = DVec2::new(up * v.y - vp * u.y, vp * u.x - up * v.x) / doubled;
                planes.push(Plane { from: flat[a], height: height[a], slope });
            }
        }
        true
    }

    /// True where the new faces turn around the apex at most once: with that all else is one-to-one.
    fn fans_out(&self) -> bool {
        let apex = self.flat[usize::from(self.apex)];
        let crossed = self.new.iter().filter(|face| {
            let [b, c] = [face[1], face[2]].map(|vertex| self.flat[usize::from(vertex)] - apex);
            b.y < 0.0 && c.y >= 0.0 && cross(b, c) > 0.0
        });
        let crossed = crossed.count();
        if self.border.is_none() && !self.apex_is_old { crossed == 1 } else { crossed <= 1 }
    }

    fn raise(geo: &mut [f64], new: usize, bound: f64) {
        if geo[new] < bound {
            geo[new] = bound;
        }
    }

    /// Corners of cells that are vertices of either side; returns the largest distance.
    fn vertices(&mut self) -> Option<f64> {
        let mut farthest = 0.0f64;
        for gone in &self.gone {
            let (flat, height) = (self.flat[usize::from(*gone)], self.height[usize::from(*gone)]);
            let carried = carried(&self.old, &self.old_geo, *gone);
            let mut is_inside = false;
            for (number, plane) in self.new_planes.iter().enumerate() {
                if contains(&self.flat, &self.new[number], flat) {
                    is_inside = true;
                    let distance = (plane.at(flat) - height).abs();
                    farthest = farthest.max(distance);
                    Self::raise(&mut self.geo, number, distance + carried);
                }
            }
            if !is_inside && self.border.is_none() {
                return None;
            }
        }
        if self.apex_is_old {
            return Some(farthest);
        }
        let apex = usize::from(self.apex);
        let mut bound = -1.0f64;
        for (number, plane) in self.old_planes.iter().enumerate() {
            if contains(&self.flat, &self.old[number], self.flat[apex]) {
                let distance = (plane.at(self.flat[apex]) - self.height[apex]).abs();
                farthest = farthest.max(distance);
                bound = bound.max(distance + f64::from(self.old_geo[number]));
            }
        }
        if bound < 0.0 {
            return None;
        }
        (0..self.new.len()).for_each(|new| Self::raise(&mut self.geo, new, bound));
        Some(farthest)
    }

    /// Corners of cells that are crossings of edges; returns the largest distance.
    fn crossings(&mut self) -> Option<f64> {
        let mut farthest = 0.0f64;
        for new in &self.new_edges {
            let [a, b] = new.ends.map(usize::from);
            let (from, along) = (self.flat[a], self.flat[b] - self.flat[a]);
            for old in &self.old_edges {
                let [p, q] = old.ends.map(usize::from);
                if p == a || p == b || q == a || q == b {
                    continue;
                }
                let (start, step) = (self.flat[p], self.flat[q] - self.flat[p]);
                let turn = cross(along, step);
                let gap = start - from;
                let (on_new, on_old) = (cross(gap, step), cross(gap, along));
                // Both shares, times `turn`, from 0 to it.
                let inside = |share: f64| {
                    let share = if turn < 0.0 { -share } else { share };
                    let slack = EPSILON * turn.abs();
                    share >= -slack && share <= turn.abs() + slack
                };
                if turn == 0.0 || !inside(on_new) || !inside(on_old) {
                    continue;
                }
                let (s, t) = (on_new / turn, on_old / turn);
                let above = self.height[a] + s * (self.height[b] - self.height[a]);
                let below = self.height[p] + t * (self.height[q] - self.height[p]);
                let distance = (above - below).abs();
                farthest = farthest.max(distance);
                let carried = f64::from(self.old_geo[usize::from(old.faces[0])]);
                let carried = match old.faces[1] {
                    NONE => carried,
                    other => carried.max(f64::from(self.old_geo[usize::from(other)])),
                };
                for face in new.faces.iter().filter(|face| **face != NONE) {
                    Self::raise(&mut self.geo, usize::from(*face), distance + carried);
                }
            }
        }
        farthest.is_finite().then_some(farthest)
    }

    /// What lies between the old border and the new one.
    fn across(&mut self, border: Border, farthest: f64) {
        let at = |vertex: u8| self.flat[usize::from(vertex)];
        let (before, gone, apex) = (at(border.before), at(border.gone), at(self.apex));
        let (along, out) = (apex - before, gone - before);
        let share = (out.dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let moved = (out - along * share).length();
        let slopes = self.old_planes.iter().chain(&self.new_planes).map(|plane| plane.slope.length());
        let steepest = slopes.fold(0.0, f64::max);
        let height = farthest + steepest * moved;
        let distance = (moved * moved + height * height).sqrt();
        let carried = self.old_geo.iter().fold(0.0f32, |most, geo| most.max(*geo));
        let bound = distance + f64::from(carried);
        (0..self.new.len()).for_each(|new| Self::raise(&mut self.geo, new, bound));
    }

    /// The new face that a point of the old side lies above or below, and its shares of the corners; the nearest one where it lies in none.
    pub(super) fn locate(&self, at: DVec3) -> (usize, [f64; 3]) {
        let from = at - self.at[usize::from(self.apex)];
        let flat = DVec2::new(from.dot(self.across.0), from.dot(self.across.1));
        let mut best = (f64::NEG_INFINITY, 0, [1.0, 0.0, 0.0]);
        for (number, face) in self.new.iter().enumerate() {
            let [a, b, c] = face.map(|vertex| self.flat[usize::from(vertex)]);
            let whole = cross(b - a, c - a);
            let shares = [cross(b - flat, c - flat), cross(c - flat, a - flat), cross(a - flat, b - flat)];
            let shares = shares.map(|share| share / whole);
            let least = shares[0].min(shares[1]).min(shares[2]);
            if least > best.0 {
                best = (least, number, shares);
                if least >= 0.0 {
                    break;
                }
            }
        }
        let [a, b, c] = best.2.map(|share| share.max(0.0));
        let sum = a + b + c;
        (best.1, [a / sum, b / sum, c / sum])
    }
}

/// Largest error of the faces at a vertex.
fn carried(faces: &[[u8; 3]], geo: &[f32], vertex: u8) -> f64 {
    let at_vertex = faces.iter().zip(geo).filter(|(face, _)| face.contains(&vertex));
    f64::from(at_vertex.fold(0.0f32, |most, (_, geo)| most.max(*geo)))
}

/// Borders belong to a triangle.
fn contains(flat: &[DVec2], face: &[u8; 3], point: DVec2) -> bool {
    let [a, b, c] = face.map(|vertex| flat[usize::from(vertex)]);
    let slack = -EPSILON * cross(b - a, c - a);
    cross(b - a, point - a) >= slack && cross(c - b, point - b) >= slack && cross(a - c, point - c) >= slack
}

/// Edges with an end that is asked for, and their one or two faces.
fn edges(faces: &[[u8; 3]], wanted: impl Fn(u8) -> bool, out: &mut Vec<Edge>) {
    out.clear();
    for (number, face) in faces.iter().enumerate() {
        for [a, b] in [[face[0], face[1]], [face[1], face[2]], [face[2], face[0]]] {
            if !wanted(a) && !wanted(b) {
                continue;
            }
            let ends = [a.min(b), a.max(b)];
            match out.iter_mut().find(|edge| edge.ends == ends) {
                Some(edge) => edge.faces[1] = number as u8,
                None => out.push(Edge { ends, faces: [number as u8, NONE] }),
            }
        }
    }
}
