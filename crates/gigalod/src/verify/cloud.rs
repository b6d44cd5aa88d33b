//! The decoded spheres of a file against the point cloud they stand for.
//!
//! How large a point's sphere is, is the builder's choice; what any choice must give it is measured here anew:
//!
//! * Each point's *least sphere* must be enclosed by every decoded sphere on some path from the root to a leaf. It reaches halfway to
//!   the nearest other place; where that is farther than most places around there are from each other, only half as far as these
//!   are, and no farther than a few times what all but one of a hundred reach.
//! * A normal that the file has for a point must lie in every cone on such a path.
//! * No point of a decoded sphere may be farther from the cloud than the node's stored error, twice its radius.

use super::measure::{Measured, Steps, has_path, nodes_against};
use super::nearest::Nearest;
use super::structure::SplatTree;
use gigalod_import::VertexBatch;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Places around a point that are asked how far they are from each other.
const AROUND: usize = 8;

/// Nothing has to reach farther than so many times what all but one of a hundred points reach.
const MOST_TIMES: f64 = 2.0;

/// What [`against_points`] has to look at: nodes, and points three times.
pub fn steps_of_points(tree: &SplatTree, cloud: &VertexBatch) -> u64 {
    (tree.nodes.len() + 3 * cloud.positions.len()) as u64
}

/// Measures; as [`against`](super::against) does with a mesh.
pub fn against_points(tree: &SplatTree, origin: DVec3, cloud: &VertexBatch, at: &(dyn Fn(u64) + Sync)) -> Measured {
    let steps = Steps::new(at);
    let nearest = Nearest::of(cloud.positions.clone());
    let least = least_radii(&cloud.positions, &nearest, &steps);
    let violations = (0..cloud.positions.len())
        .into_par_iter()
        .filter(|point| {
            steps.step();
            let center = cloud.positions[*point] - origin;
            // The builder knows points to seven digits of how far they are from the origin.
            let radius = least[*point] * (1.0 - 1e-5) - center.abs().max_element() * 5e-7;
            let own = cloud.normals.get(*point).and_then(|normal: &Vec3| normal.as_dvec3().try_normalize());
            !has_path(tree, center, radius.max(0.0), None)
                || own.is_some_and(|own| !has_path(tree, center, 0.0, Some(own)))
        })
        .count() as u64;
    let distance =
        |point: DVec3| nearest.nearest(point, 1, false).first().map_or(f64::INFINITY, |(square, _)| square.sqrt());
    nodes_against(tree, origin, &distance, &steps, violations)
}

/// Radius of each point's least sphere.
fn least_radii(points: &[DVec3], nearest: &Nearest, steps: &Steps<'_>) -> Vec<f64> {
    let to_nearest = |point: DVec3| nearest.nearest(point, 1, true).first().map_or(0.0, |(square, _)| square.sqrt());
    let mut radii: Vec<f64> = points
        .par_iter()
        .map(|point| {
            steps.step();
            let around = nearest.nearest(*point, AROUND, true);
            let mut apart: Vec<f64> = around.iter().map(|(_, other)| to_nearest(*other)).collect();
            apart.sort_unstable_by(f64::total_cmp);
            steps.step();
            let own = around.first().map_or(0.0, |(square, _)| square.sqrt());
            own.min(apart.get(apart.len() / 2).copied().unwrap_or(0.0)) * 0.5
        })
        .collect();
    let mut sorted = radii.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let most = sorted.get((sorted.len() * 99 / 100).min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0);
    radii.iter_mut().for_each(|radius| *radius = radius.min(most * MOST_TIMES));
    radii
}
