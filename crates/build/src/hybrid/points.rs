//! Points: what becomes of pieces of surface that are smaller than the error.
//!
//! Two ways lead there. For good: a component of which nothing is farther from its middle than the error allows becomes a point, and
//! points that are so close to each other become one; else a heap of small things could never get coarser. For one node only: triangles
//! so small that their corners cover them as well are left to their corners, half as many points as triangles. The patch keeps the
//! triangles, so the node above may go back to them.
//!
//! What always holds: the `geo` of a point for good bounds how far away anything is that it stands for. Where corners take a face's place,
//! each is as near to the original as the face was, and each point of the face is within half the node's spacing of one of them, so
//! discs as wide as the spacing cover it. Such a face has room for that: its error and half the spacing together are within the node's.
//!
//! Source: the hybrid paper, section 3.2. Differs: it replaces a triangle by up to six points of a grid, which move; corners stay where they
//! are and are shared, half as many as triangles. Its points may be as wide as two errors, on top of their own; ours claim no more than
//! triangles do.

use super::patch::{Face, Patch, Spot, Vertex, total};
use super::simplify::up;
use super::weld::PlaceHasher;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// Edge of the cubes within which points become one, as a share of the limit: nothing moves by half the limit.
const CUBE: f64 = 0.28;
/// How far from its nearest corner a point of a face may be, in parts of the error, to choose from for each node: wider points take
/// larger triangles' place, and leave less room for errors of their own.
const REACHES: [f64; 5] = [0.5, 0.4, 0.3, 0.2, 0.1];
/// A corner becomes a point where so many of its triangles are small enough; a few alone would be more points than triangles.
const LEAST_AROUND: u32 = 4;

/// Components that are small enough become points, and points that are close become one.
pub(super) fn shrink(patch: &mut Patch, limit: f64) {
    let small = components(patch, limit);
    if !small.is_empty() {
        let mut is_gone = vec![false; patch.faces.len()];
        for (spot, faces) in small {
            patch.spots.push(spot);
            faces.iter().for_each(|face| is_gone[*face as usize] = true);
        }
        let mut gone = is_gone.into_iter();
        patch.faces.retain(|_| gone.next() == Some(false));
        patch.compact();
    }
    merge(&mut patch.spots, limit);
}

/// Components that fit into the limit, as points, with their faces.
fn components(patch: &Patch, limit: f64) -> Vec<(Spot, Vec<u32>)> {
    let mut above: Vec<u32> = (0..patch.vertices.len() as u32).collect();
    fn root(above: &mut [u32], mut at: u32) -> u32 {
        while above[at as usize] != at {
            above[at as usize] = above[above[at as usize] as usize];
            at = above[at as usize];
        }
        at
    }
    for face in &patch.faces {
        let [a, b, c] = face.corners.map(|corner| root(&mut above, corner));
        let least = a.min(b).min(c);
        [a, b, c].iter().for_each(|corner| above[*corner as usize] = least);
    }
    // Faces by component, in order.
    let mut faces: Vec<(u32, u32)> = patch
        .faces
        .iter()
        .enumerate()
        .map(|(number, face)| (root(&mut above, face.corners[0]), number as u32))
        .collect();
    faces.sort_unstable();
    let mut small = Vec::new();
    for component in faces.chunk_by(|a, b| a.0 == b.0) {
        let corners = || component.iter().flat_map(|(_, face)| patch.faces[*face as usize].corners);
        let at = |vertex: u32| patch.vertices[vertex as usize].at;
        let first = at(patch.faces[component[0].1 as usize].corners[0]);
        // Most are larger, which a look at a few corners tells.
        if corners().take(30).any(|corner| (at(corner) - first).length() > 2.0 * limit) {
            continue;
        }
        let count = (3 * component.len()) as f64;
        let middle = corners().map(at).sum::<DVec3>() / count;
        let reach = corners().fold(0.0f64, |most, corner| most.max((at(corner) - middle).length()));
        let held = component.iter().map(|(_, face)| patch.faces[*face as usize]);
        let (geo, app) = held.fold((0.0f32, 0.0f32), |(geo, app), face| (geo.max(face.geo), app.max(face.app)));
        let geo = up(f64::from(geo) + reach * (1.0 + 1e-9));
        // It is drawn as wide as it was.
        if f64::from(total(geo, app)) + reach > limit {
            continue;
        }
        let looks = corners().map(|corner| &patch.vertices[corner as usize]);
        let normal: Vec3 = looks.clone().map(|vertex| vertex.normal).sum();
        let color: Vec3 = looks.map(|vertex| vertex.color).sum::<Vec3>() / count as f32;
        let was = patch.vertices[patch.faces[component[0].1 as usize].corners[0] as usize].normal;
        let vertex = Vertex { at: middle, normal: normal.try_normalize().unwrap_or(was), color };
        let spot = Spot { vertex, geo, app, reach: up(reach), unused: 0 };
        small.push((spot, component.iter().map(|(_, face)| *face).collect()));
    }
    small
}

/// Points that lie in one cube of a grid become their mean, where their errors have room for it.
fn merge(spots: &mut Vec<Spot>, limit: f64) {
    if spots.is_empty() {
        return;
    }
    let cube = CUBE * limit;
    let mut first: HashMap<[i64; 3], u32, BuildHasherDefault<PlaceHasher>> = HashMap::default();
    let mut together: Vec<Vec<Spot>> = Vec::new();
    for spot in spots.iter() {
        let key = (spot.vertex.at / cube).floor().to_array().map(|x| x as i64);
        let group = *first.entry(key).or_insert_with(|| {
            together.push(Vec::new());
            together.len() as u32 - 1
        });
        together[group as usize].push(*spot);
    }
    spots.clear();
    for group in together {
        let count = group.len() as f64;
        let middle = group.iter().map(|spot| spot.vertex.at).sum::<DVec3>() / count;
        let moved = |spot: &Spot, most: f32| up(f64::from(most) + (spot.vertex.at - middle).length() * (1.0 + 1e-9));
        let geo = group.iter().fold(0.0f32, |most, spot| most.max(moved(spot, spot.geo)));
        let app = group.iter().fold(0.0f32, |most, spot| most.max(spot.app));
        let reach = group.iter().fold(0.0f32, |most, spot| most.max(moved(spot, spot.reach)));
        if group.len() == 1 || f64::from(total(geo, app)) + f64::from(reach) > limit {
            spots.extend(group);
            continue;
        }
        let normal: Vec3 = group.iter().map(|spot| spot.vertex.normal).sum();
        let normal = normal.try_normalize().unwrap_or(group[0].vertex.normal);
        let color = group.iter().map(|spot| spot.vertex.color).sum::<Vec3>() / count as f32;
        spots.push(Spot { vertex: Vertex { at: middle, normal, color }, geo, app, reach, unused: 0 });
    }
}

/// What of a patch is drawn as points in this node.
#[derive(Default)]
pub(super) struct Small {
    /// For each face whose corners take its place, the largest distance of its points to the nearest of them.
    pub(super) reaches: Vec<Option<f64>>,
    /// For each vertex, whether it is a point.
    pub(super) is_point: Vec<bool>,
    /// The largest of these distances.
    pub(super) reach: f64,
}

impl Small {
    /// `error` is the node's largest; by `moved` a vertex is moved when it is rounded.
    pub(super) fn of(patch: &Patch, error: f64, moved: impl Fn(u32) -> f64) -> Self {
        // How far a face's points are from their nearest corner at most, and what its corners are off.
        let tell = |face: &Face| {
            let [a, b, c] = face.corners.map(|corner| patch.vertices[corner as usize].at);
            let longest = (a - b).length_squared().max((b - c).length_squared()).max((c - a).length_squared());
            let moved = face.corners.map(&moved).into_iter().fold(0.0, f64::max);
            // No point of a triangle is farther from its nearest corner than of a regular one with this edge.
            ((longest / 3.0).sqrt() + moved, f64::from(total(up(f64::from(face.geo) + moved), face.app)))
        };
        let told: Vec<(f64, f64)> = patch.faces.iter().map(tell).collect();
        let fits = |most: f64| move |(reach, own): &(f64, f64)| *reach <= most && own + most <= error;
        let count = |most: f64| told.iter().filter(|face| fits(most)(face)).count();
        // The first of those with the most faces.
        let most = REACHES.map(|part| part * error).into_iter().rev().max_by_key(|most| count(*most));
        let fits = fits(most.expect("there are some"));
        let reaches = told.iter().map(|face| fits(face).then_some(face.0)).collect();
        let mut small = Self { reaches, ..Self::default() };
        let mut around = vec![0u32; patch.vertices.len()];
        for (face, _) in patch.faces.iter().zip(&small.reaches).filter(|(_, reach)| reach.is_some()) {
            face.corners.iter().for_each(|corner| around[*corner as usize] += 1);
        }
        small.is_point = vec![false; patch.vertices.len()];
        for (face, reach) in patch.faces.iter().zip(&mut small.reaches) {
            *reach = reach.filter(|_| face.corners.iter().all(|corner| around[*corner as usize] >= LEAST_AROUND));
            if let Some(reach) = *reach {
                face.corners.iter().for_each(|corner| small.is_point[*corner as usize] = true);
                small.reach = small.reach.max(reach);
            }
        }
        small
    }
}
