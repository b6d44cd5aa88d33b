//! Meshes whose large triangles were diced: is each point of each triangle covered, by splats that show its front?
//!
//! How a triangle was cut is the builder's choice. What any choice must give it is tried here at points spread evenly over each
//! triangle, about one for each square of the spacing, and along its edges, where cells of neighbours meet.

use super::measure::{Steps, has_path};
use super::structure::SplatTree;
use gigalod_import::{Batch, CornerBatch, Material};
use gigalod_reference::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// How a mesh was diced.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    /// Model units.
    pub spacing: f64,
    /// Triangles that an alpha mask may leave out in part, which are not asked; none if it is empty.
    pub masked: Vec<bool>,
}

impl Sampled {
    /// For a whole model and its materials.
    pub fn of(spacing: f64, model: &Batch, materials: &[Material]) -> Self {
        let is_masked = |material: &u32| {
            *material != CornerBatch::NONE
                && materials.get(*material as usize).is_some_and(|material| material.alpha_cutoff.is_some())
        };
        Self { spacing, masked: model.corners.materials.iter().map(is_masked).collect() }
    }
}

/// Most points of a triangle, and of an edge.
const MOST_POINTS: f64 = 65_536.0;
const MOST_EDGE_POINTS: f64 = 1024.0;

/// Number of points that no path of spheres and cones holds.
pub(super) fn count_unsampled(
    tree: &SplatTree,
    origin: DVec3,
    mesh: &Mesh,
    sampled: &Sampled,
    steps: &Steps<'_>,
) -> u64 {
    asked(mesh, sampled)
        .map(|corners| {
            let corners = corners.map(|corner| corner - origin);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).try_normalize();
            let slack = 1e-12 * (a.abs() + b.abs() + c.abs()).max_element();
            let is_missed = |point: &DVec3| {
                steps.step();
                !has_path(tree, *point, -slack, normal)
            };
            points(corners, sampled.spacing).filter(is_missed).count() as u64
        })
        .sum()
}

/// Number of points that [`count_unsampled`] looks at.
pub(super) fn count_points(mesh: &Mesh, sampled: &Sampled) -> u64 {
    let of_triangle = |corners| {
        let ([ab, bc, ca], within) = counts(&corners, sampled.spacing);
        u64::from(ab) + u64::from(bc) + u64::from(ca) + u64::from(within)
    };
    asked(mesh, sampled).map(of_triangle).sum()
}

/// Triangles that are to be covered everywhere.
fn asked(mesh: &Mesh, sampled: &Sampled) -> impl ParallelIterator<Item = [DVec3; 3]> {
    let is_masked = |triangle: usize| sampled.masked.get(triangle).copied().unwrap_or(false);
    let all = mesh.triangles().par_iter().enumerate().filter(move |(triangle, _)| !is_masked(*triangle));
    all.map(|(_, corners)| corners.map(|vertex| mesh.positions()[vertex as usize]))
}

/// How many points there are along each edge, and within.
fn counts([a, b, c]: &[DVec3; 3], spacing: f64) -> ([u32; 3], u32) {
    let edge = |from: &DVec3, to: &DVec3| (from.distance(*to) / spacing).ceil().clamp(1.0, MOST_EDGE_POINTS) as u32;
    let area = (*b - *a).cross(*c - *a).length() * 0.5;
    ([edge(a, b), edge(b, c), edge(c, a)], (area / spacing / spacing).ceil().clamp(4.0, MOST_POINTS) as u32)
}

/// Points of a triangle: along its edges, and within.
fn points([a, b, c]: [DVec3; 3], spacing: f64) -> impl Iterator<Item = DVec3> {
    let ([ab, bc, ca], count) = counts(&[a, b, c], spacing);
    let edge = move |from: DVec3, to: DVec3, count: u32| {
        (0..count).map(move |at| from + (to - from) * (f64::from(at) / f64::from(count)))
    };
    // Of low discrepancy: multiples of the inverses of the plastic number and its square (Roberts 2018).
    let within = (0..count).map(move |at| {
        let [u, v] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3].map(|step| (f64::from(at) + 0.5) * step % 1.0);
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        a + (b - a) * u + (c - a) * v
    });
    edge(a, b, ab).chain(edge(b, c, bc)).chain(edge(c, a, ca)).chain(within)
}
