//! Closes the cracks between patches that were simplified apart, and holes that are narrower than the error.
//!
//! In: a patch with borders, and the largest error that its faces may have. Out: the same surface, where borders that lie so close to each
//! other are one: first vertex by vertex, then each vertex that is left goes into the edge that it lies at. What is moved for that adds to
//! the errors of its faces: a face whose corner moves maps to itself, and no point of it goes farther than the corner.
//!
//! Source: the vertex-vertex and vertex-edge contractions of Borodin, Gumhold, Guthe & Klein, *High-quality simplification with
//! generalized pair contractions*, GraphiCon 2003.

use super::edges::{self, Side};
use super::patch::{Face, Patch};
use super::simplify::up;
use super::weld::PlaceHasher;
use glam::DVec3;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

type Hashed<K, V> = HashMap<K, V, BuildHasherDefault<PlaceHasher>>;

/// Borders this much of the limit apart are closed.
const REACH: f64 = 0.6;
/// Vertices become one where they are nearer to each other than this share of the border edges at either.
const NEAR: f64 = 0.4;
/// What lies so near to the end of an edge is not put into it.
const END_SHARE: f64 = 0.02;

/// A border edge, in the direction of its face.
#[derive(Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    face: u32,
    is_open: bool,
}

/// Closes what is narrow enough.
pub(super) fn zip(patch: &mut Patch, limit: f64) {
    let edges = borders(patch.vertices.len(), &patch.faces);
    if edges.is_empty() {
        return;
    }
    merge(patch, &edges, limit);
    insert(patch, limit);
}

/// Edges of one face, in order of the faces.
fn borders(vertices: usize, faces: &[Face]) -> Vec<Edge> {
    let numbered = faces.iter().enumerate().map(|(number, face)| (number as u32, face.corners));
    let sides = edges::sides(vertices, numbered);
    let mut single: Vec<Side> = edges::by_edge(&sides).filter(|same| same.len() == 1).map(|same| same[0]).collect();
    single.sort_unstable_by_key(|side| (side.face, side.first));
    let edge = |side: &Side| {
        let corners = faces[side.face as usize].corners;
        let first = side.first as usize;
        Edge { ends: [corners[first], corners[(first + 1) % 3]], face: side.face, is_open: true }
    };
    single.iter().map(edge).collect()
}

/// Things by the cell of a grid that they lie in.
struct Grid {
    cell: f64,
    things: Hashed<[i64; 3], Vec<u32>>,
}

impl Grid {
    fn new(cell: f64) -> Self {
        Self { cell, things: Hashed::default() }
    }

    fn key(&self, at: DVec3) -> [i64; 3] {
        (at / self.cell).floor().to_array().map(|x| x as i64)
    }

    fn put(&mut self, at: DVec3, thing: u32) {
        let key = self.key(at);
        let things = self.things.entry(key).or_default();
        if things.last() != Some(&thing) {
            things.push(thing);
        }
    }

    /// Puts an edge into the cells that it passes.
    fn put_edge(&mut self, a: DVec3, b: DVec3, thing: u32) {
        let steps = ((b - a).length() / self.cell * 2.0).ceil().min(1e4) as u32;
        (0..=steps).for_each(|step| self.put(a.lerp(b, f64::from(step) / f64::from(steps.max(1))), thing));
    }

    /// All that lies in or beside the cell of a place.
    fn near(&self, at: DVec3, out: &mut Vec<u32>) {
        out.clear();
        let [x, y, z] = self.key(at);
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    if let Some(things) = self.things.get(&[x + dx, y + dy, z + dz]) {
                        out.extend_from_slice(things);
                    }
                }
            }
        }
    }
}

/// Vertices of borders that are nearest to each other become one.
fn merge(patch: &mut Patch, edges: &[Edge], limit: f64) {
    let reach = REACH * limit;
    let Patch { vertices, faces, .. } = patch;
    // The shortest border edge at each vertex; infinite inside.
    let mut shortest = vec![f64::INFINITY; vertices.len()];
    for Edge { ends: [a, b], .. } in edges {
        let length = (vertices[*a as usize].at - vertices[*b as usize].at).length();
        for vertex in [a, b] {
            shortest[*vertex as usize] = shortest[*vertex as usize].min(length);
        }
    }
    // Two of one face would flatten it, and with it perhaps the last of a small shell.
    let mut joined: Hashed<u64, ()> = Hashed::default();
    for Face { corners: [a, b, c], .. } in faces.iter() {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            if shortest[*p as usize].is_finite() && shortest[*q as usize].is_finite() {
                joined.insert(u64::from(*p.min(q)) << 32 | u64::from(*p.max(q)), ());
            }
        }
    }
    let mut grid = Grid::new(reach);
    let on_border: Vec<u32> = (0..vertices.len() as u32).filter(|v| shortest[*v as usize].is_finite()).collect();
    on_border.iter().for_each(|vertex| grid.put(vertices[*vertex as usize].at, *vertex));
    let mut near = Vec::new();
    let mut nearest = |vertex: u32| {
        let at = vertices[vertex as usize].at;
        grid.near(at, &mut near);
        let distance = |other: &u32| (vertices[*other as usize].at - at).length_squared();
        let others = near.iter().copied().filter(|other| *other != vertex);
        others.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
    };
    let chosen: Vec<Option<u32>> = on_border.iter().map(|vertex| nearest(*vertex)).collect();
    let mut moved = vec![0.0f64; vertices.len()];
    let mut names: Vec<u32> = (0..vertices.len() as u32).collect();
    let most = most_errors(vertices.len(), faces);
    for (a, b) in on_border.iter().zip(&chosen) {
        let Some(b) = *b else { continue };
        // Both chose each other; once.
        if *a > b || on_border.binary_search(&b).ok().and_then(|at| chosen[at]) != Some(*a) {
            continue;
        }
        let (one, other) = (vertices[*a as usize], vertices[b as usize]);
        let half = (one.at - other.at).length() * 0.5;
        let is_near = 2.0 * half <= NEAR * shortest[*a as usize].min(shortest[b as usize]);
        let are_joined = joined.contains_key(&(u64::from(*a) << 32 | u64::from(b)));
        if are_joined
            || !is_near
            || 2.0 * half > reach
            || f64::from(most[*a as usize].max(most[b as usize])) + half > limit
        {
            continue;
        }
        names[b as usize] = *a;
        let both = &mut vertices[*a as usize];
        both.at = (one.at + other.at) * 0.5;
        both.normal = (one.normal + other.normal).try_normalize().unwrap_or(one.normal);
        both.color = (one.color + other.color) * 0.5;
        moved[*a as usize] = half * (1.0 + 1e-9);
    }
    for face in faces.iter_mut() {
        face.corners = face.corners.map(|corner| names[corner as usize]);
        let farthest = face.corners.iter().fold(0.0f64, |most, corner| most.max(moved[*corner as usize]));
        if farthest > 0.0 {
            face.geo = up(f64::from(face.geo) + farthest);
        }
    }
}

/// Largest error of the faces at each vertex.
fn most_errors(vertices: usize, faces: &[Face]) -> Vec<f32> {
    let mut most = vec![0.0f32; vertices];
    for face in faces {
        for corner in face.corners {
            most[corner as usize] = most[corner as usize].max(face.total());
        }
    }
    most
}

/// Border vertices go into the border edges that they lie at.
fn insert(patch: &mut Patch, limit: f64) {
    let reach = REACH * limit;
    let mut edges = borders(patch.vertices.len(), &patch.faces);
    let Patch { vertices, faces, .. } = patch;
    let length = |edge: &Edge| (vertices[edge.ends[0] as usize].at - vertices[edge.ends[1] as usize].at).length();
    let mean = edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64;
    let mut grid = Grid::new(reach.max(mean));
    let mut known: Hashed<u64, u32> = Hashed::default();
    let key = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let mut on_border: Vec<u32> = Vec::new();
    for (number, edge) in edges.iter().enumerate() {
        let [a, b] = edge.ends;
        grid.put_edge(vertices[a as usize].at, vertices[b as usize].at, number as u32);
        known.insert(key(a, b), number as u32);
        on_border.extend([a, b]);
    }
    on_border.sort_unstable();
    on_border.dedup();
    let mut near = Vec::new();
    for vertex in on_border {
        let at = vertices[vertex as usize].at;
        grid.near(at, &mut near);
        let mut best: Option<(f64, u32, f64)> = None;
        for number in &near {
            let Edge { ends: [a, b], face, is_open } = edges[*number as usize];
            if !is_open || a == vertex || b == vertex || faces[face as usize].corners.contains(&vertex) {
                continue;
            }
            let (from, to) = (vertices[a as usize].at, vertices[b as usize].at);
            let along = to - from;
            let share = (at - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
            if !(END_SHARE..=1.0 - END_SHARE).contains(&share) {
                continue;
            }
            let distance = (from + along * share - at).length();
            let error = f64::from(faces[face as usize].total()) + distance;
            if distance <= reach && error <= limit && best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, *number, share));
            }
        }
        let Some((distance, number, _)) = best else { continue };
        let Edge { ends: [a, b], face, .. } = edges[number as usize];
        let old = &mut faces[face as usize];
        let third = old.corners.into_iter().find(|corner| *corner != a && *corner != b).expect("no face is degenerate");
        old.geo = up(f64::from(old.geo) + distance * (1.0 + 1e-9));
        old.corners = [a, vertex, third];
        let split = Face { corners: [vertex, b, third], ..*old };
        let new_face = faces.len() as u32;
        faces.push(split);
        edges[number as usize].is_open = false;
        known.remove(&key(a, b));
        if let Some(other) = known.get(&key(b, third)) {
            edges[*other as usize].face = new_face;
        }
        for (ends, face) in [([a, vertex], face), ([vertex, b], new_face)] {
            // The other side of it may be waiting.
            if let Some(other) = known.remove(&key(ends[1], ends[0])) {
                edges[other as usize].is_open = false;
                continue;
            }
            let number = edges.len() as u32;
            edges.push(Edge { ends, face, is_open: true });
            grid.put_edge(vertices[ends[0] as usize].at, vertices[ends[1] as usize].at, number);
            known.insert(key(ends[0], ends[1]), number);
        }
    }
}
