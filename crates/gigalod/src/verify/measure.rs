//! The decoded spheres of a file against the mesh they stand for.
//!
//! * Each vertex' true sphere (largest bounding sphere of the triangles around it, computed here anew) must be enclosed by
//!   every decoded sphere on some path from the root to a leaf.
//!   Of a model whose large triangles were diced, samples all over the triangles stand for that and the next two.
//! * Each triangle's normal must lie in every cone on such a path for each of its corners, or culling could hide its front.
//! * Each sample of the surface must lie in some leaf's decoded sphere.
//! * No point of a decoded sphere may be farther from the surface than the node's stored error, twice its radius.

use super::sampled::{Sampled, count_points, count_unsampled};
use super::structure::SplatTree;
use gigalod_format::splats::Node;
use gigalod_geom::quantise::{cone, normal};
use gigalod_geom::sphere::triangle_bounding_radius;
use gigalod_import::{Batch, VertexBatch};
use gigalod_reference::mesh::MeshError;
use gigalod_reference::{Bvh, Mesh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Distances in model units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Largest distance found of points on the leaves' spheres from the surface. The other way it is 0: what of the surface lies
    /// in no leaf counts as a violation.
    pub hausdorff: f64,
    /// Root mean square of the distances of points on those spheres from the surface; where there are more than a quarter of a
    /// million, of so many, spread evenly over the file.
    pub rms: f64,
    /// Largest ratio of a node's distance, bounded from above, to its stored error; at most 1 in a sound file.
    pub worst_ratio: f64,
    /// Vertices whose sphere is not enclosed, corners whose triangle's normal is in no cone, samples that are not covered, and
    /// nodes beyond their stored error. Of a point cloud: points whose least sphere is not enclosed or whose own normal is in no
    /// cone, and such nodes.
    pub violations: u64,
}

/// The judge's mesh of a whole model.
///
/// # Errors
/// Where the judge cannot take it: coordinates beyond its range, say.
pub fn mesh_of(model: Batch) -> Result<Mesh, MeshError> {
    let VertexBatch { positions, normals, colors } = model.vertices;
    let normals = (!normals.is_empty()).then_some(normals);
    Mesh::new(positions, normals, (!colors.is_empty()).then_some(colors), model.triangles)
}

/// Points of a unit sphere at which leaves are measured.
const DIRECTIONS: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

/// What [`against`] has to look at: nodes, vertices and triangles, these twice; of a model that was diced nodes and points all over
/// its triangles.
pub fn steps(tree: &SplatTree, mesh: &Mesh, sampled: Option<&Sampled>) -> u64 {
    let of_mesh = match sampled {
        Some(sampled) => count_points(mesh, sampled),
        None => (mesh.positions().len() + 2 * mesh.triangles().len()) as u64,
    };
    tree.nodes.len() as u64 + of_mesh
}

/// Measures. `origin` is that of the file's local space, in model space; `sampled` says how the model was diced, if it was. `at` is told from time to time, by any thread, how many
/// of the [`steps`] are done.
pub fn against(
    tree: &SplatTree,
    origin: DVec3,
    mesh: &Mesh,
    sampled: Option<&Sampled>,
    at: &(dyn Fn(u64) + Sync),
) -> Measured {
    let steps = Steps::new(at);
    let bvh = Bvh::build(mesh);
    let violations = match sampled {
        Some(sampled) => count_unsampled(tree, origin, mesh, sampled, &steps),
        None => {
            count_unenclosed_vertices(tree, origin, mesh, &steps)
                + count_uncovered_samples(tree, origin, mesh, &steps)
                + count_hidden_fronts(tree, origin, mesh, &steps)
        }
    };
    let distance = |point: DVec3| bvh.nearest_point(point).map_or(f64::INFINITY, |nearest| nearest.distance);
    nodes_against(tree, origin, &distance, &steps, violations)
}

/// Leaves whose distances are all measured, for their mean.
const MEANT_LEAVES: usize = 1 << 18;

/// Measures all nodes by how far a point of model space is from the original. `violations` is what was found before.
pub(super) fn nodes_against(
    tree: &SplatTree,
    origin: DVec3,
    distance: &(impl Fn(DVec3) -> f64 + Sync),
    steps: &Steps<'_>,
    violations: u64,
) -> Measured {
    let leaves = tree.nodes.iter().filter(|node| node.children == 0).count();
    let stride = leaves.div_ceil(MEANT_LEAVES).max(1);
    // The largest distance so far: a ball that cannot reach farther is not asked. Bits of numbers that are not negative have their order.
    let farthest = AtomicU64::new(0);
    let per_node: Vec<NodeDistances> = tree
        .nodes
        .par_iter()
        .enumerate()
        .map(|(number, node)| {
            let center = origin + node.sphere.center.as_dvec3();
            let radius = f64::from(node.sphere.radius);
            // A point of the ball is at most a radius farther away than its centre.
            let bound = distance(center) + radius;
            let stored = 2.0 * radius;
            steps.step();
            // A node without a size stands for triangles without one, and lies on them.
            let ratio = if bound > 0.0 { bound / stored } else { 0.0 };
            let mut out = NodeDistances { ratio, ..Default::default() };
            let is_meant = number.is_multiple_of(stride);
            let may_be_farthest = bound > f64::from_bits(farthest.load(Ordering::Relaxed));
            if node.children == 0 && (is_meant || may_be_farthest) {
                let at = DIRECTIONS.map(|direction| distance(center + direction.as_dvec3() * radius));
                out.farthest = at.into_iter().fold(0.0, f64::max);
                farthest.fetch_max(out.farthest.to_bits(), Ordering::Relaxed);
                if is_meant {
                    out.squares = at.iter().map(|at| at * at).sum();
                    out.directions = at.len() as u32;
                }
            }
            out
        })
        .collect();
    let measured: u64 = per_node.iter().map(|node| u64::from(node.directions)).sum();
    // In order, so that the sum does not depend on the number of threads.
    let squares: f64 = per_node.iter().map(|node| node.squares).sum();
    let beyond = per_node.iter().filter(|node| node.ratio > 1.0 + 1e-6).count() as u64;
    Measured {
        hausdorff: per_node.iter().map(|node| node.farthest).fold(0.0, f64::max),
        rms: (squares / measured.max(1) as f64).sqrt(),
        worst_ratio: per_node.iter().map(|node| node.ratio).fold(0.0, f64::max),
        violations: violations + beyond,
    }
}

/// Counts what is done, and tells now and then.
pub(super) struct Steps<'a> {
    done: AtomicU64,
    at: &'a (dyn Fn(u64) + Sync),
}

impl<'a> Steps<'a> {
    pub(super) fn new(at: &'a (dyn Fn(u64) + Sync)) -> Self {
        Self { done: AtomicU64::new(0), at }
    }

    pub(super) fn step(&self) {
        const OFTEN: u64 = 1 << 12;
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if done.is_multiple_of(OFTEN) {
            (self.at)(done);
        }
    }
}

#[derive(Clone, Copy, Default)]
struct NodeDistances {
    ratio: f64,
    farthest: f64,
    /// Sum over so many directions.
    squares: f64,
    directions: u32,
}

/// Number of vertices whose true sphere no path of decoded spheres encloses.
fn count_unenclosed_vertices(tree: &SplatTree, origin: DVec3, mesh: &Mesh, steps: &Steps<'_>) -> u64 {
    let mut radii = vec![-1.0_f64; mesh.positions().len()];
    for triangle in mesh.triangles() {
        let radius = triangle_bounding_radius(triangle.map(|vertex| mesh.positions()[vertex as usize]));
        for vertex in triangle {
            let known = &mut radii[*vertex as usize];
            *known = known.max(radius);
        }
    }
    let missing = |(vertex, radius): (usize, &f64)| {
        steps.step();
        *radius >= 0.0 && !has_enclosing_path(tree, mesh.positions()[vertex] - origin, *radius)
    };
    radii.par_iter().enumerate().filter(|(vertex, radius)| missing((*vertex, radius))).count() as u64
}

/// Number of triangles' corners whose normal no path of spheres and cones holds.
fn count_hidden_fronts(tree: &SplatTree, origin: DVec3, mesh: &Mesh, steps: &Steps<'_>) -> u64 {
    let is_hidden = |triangle: &[u32; 3]| {
        steps.step();
        let corners = triangle.map(|vertex| mesh.positions()[vertex as usize]);
        // Triangles without an area have no front.
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize()?;
        let radius = triangle_bounding_radius(corners);
        let hidden = |corner: &&DVec3| !has_path(tree, **corner - origin, radius, Some(normal));
        Some(corners.iter().filter(hidden).count() as u64)
    };
    mesh.triangles().par_iter().filter_map(is_hidden).sum()
}

/// Number of surface samples (corners, middles of edges, barycentre of each triangle) outside all leaves.
fn count_uncovered_samples(tree: &SplatTree, origin: DVec3, mesh: &Mesh, steps: &Steps<'_>) -> u64 {
    mesh.triangles()
        .par_iter()
        .map(|triangle| {
            steps.step();
            let [a, b, c] = triangle.map(|vertex| mesh.positions()[vertex as usize] - origin);
            let samples = [a, b, c, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5, (a + b + c) / 3.0];
            // An edge's middle may lie on the very border of two spheres: leave rounding its due.
            let slack = 1e-12 * (a.abs() + b.abs() + c.abs()).max_element();
            samples.iter().filter(|sample| !has_enclosing_path(tree, **sample, -slack)).count() as u64
        })
        .sum()
}

/// True when a path from the root to a leaf encloses the ball all the way; local space.
pub(super) fn has_enclosing_path(tree: &SplatTree, center: DVec3, radius: f64) -> bool {
    has_path(tree, center, radius, None)
}

/// True when the spheres of a path from the root to a leaf enclose the ball all the way, and its cones hold `normal`, if any.
pub(super) fn has_path(tree: &SplatTree, center: DVec3, radius: f64, normal: Option<DVec3>) -> bool {
    let mut stack = vec![0u32];
    while let Some(index) = stack.pop() {
        let node = &tree.nodes[index as usize];
        let reach = f64::from(node.sphere.radius) - radius;
        if reach < 0.0 || (node.sphere.center.as_dvec3() - center).length_squared() > reach * reach {
            continue;
        }
        if normal.is_some_and(|normal| !cone_holds(node.node, normal)) {
            continue;
        }
        if node.children == 0 {
            return true;
        }
        stack.extend(node.first_child..node.first_child + u32::from(node.children));
    }
    false
}

/// True when a unit vector lies in the node's cone, within a hundred-thousandth.
fn cone_holds(node: Node, direction: DVec3) -> bool {
    let cosine = normal::decode(node.normal()).as_dvec3().dot(direction);
    cosine >= f64::from(cone::cosine(node.cone())) - 1e-5
}
