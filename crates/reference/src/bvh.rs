//! Finds, among all triangles of a mesh, the first that a ray meets and the nearest to a point.
//!
//! Takes a [`Mesh`]; answers as a loop over all triangles would, only sooner. The hierarchy of boxes comes from `obvhs`,
//! in `f32` and normalised to [-1, 1]; both traversals, and all geometry, are our own and in `f64`.
//!
//! Invariant: a box, read in exact arithmetic, reaches beyond its triangles by at least half of `PADDING`. That swallows every
//! rounding of the box tests, so that pruning never loses an answer, for rays and points that start within 10⁸ times the
//! mesh's size. Ties go to the lower triangle index, so the answer does not depend on the shape of the hierarchy.

use crate::Mesh;
use crate::triangle::{PreparedRay, Ray, nearest_on_triangle};
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb as BoxF32;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;
use std::ops::Range;

/// How far a box reaches beyond its triangles, in units of half the mesh's longest side: four steps of `f32` at 1, of which
/// rounding to `f32` may take one back.
const PADDING: f64 = 1.0 / (1u32 << 22) as f64;

/// Triangles per leaf at most, and what a step down costs in triangle tests, as in `obvhs`'s own presets.
const LEAF_TRIANGLES: u32 = 8;
const TRAVERSAL_COST: f32 = 3.0;

/// Triangles that a hierarchy is made of at once: making it takes several times the memory that it keeps.
const MOST_AT_ONCE: u32 = 1 << 23;

/// A bounding volume hierarchy over the triangles of a mesh.
pub struct Bvh<'m> {
    mesh: &'m Mesh,
    nodes: Vec<Bvh2Node>,
    /// Of hierarchies, each of a part of the triangles.
    roots: Vec<u32>,
    /// Triangle indices; a leaf names a range of them.
    triangles: Vec<u32>,
    unit_box: UnitBox,
}

/// The first triangle on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Ray parameter, > 0.
    pub t: f64,
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of its corners.
    pub barycentrics: [f64; 3],
}

/// The point of the surface nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// How far away, in model units.
    pub distance: f64,
    /// Index of the triangle it lies on.
    pub triangle: u32,
    /// Weights of its corners.
    pub barycentrics: [f64; 3],
}

impl<'m> Bvh<'m> {
    /// Builds the hierarchy. A mesh without triangles gives one that nothing meets.
    pub fn build(mesh: &'m Mesh) -> Self {
        Self::with_parts_of(mesh, MOST_AT_ONCE)
    }

    fn with_parts_of(mesh: &'m Mesh, most_at_once: u32) -> Self {
        let unit_box = UnitBox::around(mesh);
        let triangle_count = u32::try_from(mesh.triangles().len()).expect("Mesh::new bounds the number of triangles");
        let mut bvh = Self { mesh, nodes: Vec::new(), roots: Vec::new(), triangles: Vec::new(), unit_box };
        for first in (0..triangle_count).step_by(most_at_once as usize) {
            bvh.add(first..triangle_count.min(first.saturating_add(most_at_once)));
        }
        bvh
    }

    /// Adds a hierarchy of some triangles.
    fn add(&mut self, triangles: Range<u32>) {
        let first = triangles.start;
        let boxes: Vec<BoxF32> =
            triangles.into_par_iter().map(|triangle| self.unit_box.padded_box(self.mesh.corners(triangle))).collect();
        let indices = (0..boxes.len() as u32).collect();
        let mut builder = PlocBuilder::with_capacity(boxes.len());
        let mut hierarchy = builder.build(PlocSearchDistance::Low, &boxes, indices, SortPrecision::U64, 2);
        drop(boxes);
        collapse(&mut hierarchy, LEAF_TRIANGLES, TRAVERSAL_COST);
        let (first_node, first_index) = (self.nodes.len() as u32, self.triangles.len() as u32);
        self.roots.push(first_node);
        self.nodes.extend(hierarchy.nodes.into_iter().map(|mut node| {
            node.first_index += if node.is_leaf() { first_index } else { first_node };
            node
        }));
        self.triangles.extend(hierarchy.primitive_indices.into_iter().map(|triangle| first + triangle));
    }

    /// The mesh it was built over.
    pub fn mesh(&self) -> &'m Mesh {
        self.mesh
    }

    /// The first point of the surface along `ray`, seen from either side. No ray slips between triangles that share an edge:
    /// see [`PreparedRay`].
    pub fn first_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.trace(ray, Want::First)
    }

    /// True when `ray` meets the surface anywhere: the same answer as [`first_hit`](Self::first_hit), sooner.
    pub fn is_hit(&self, ray: &Ray) -> bool {
        self.trace(ray, Want::Any).is_some()
    }

    fn trace(&self, ray: &Ray, want: Want) -> Option<SurfaceHit> {
        let prepared = PreparedRay::new(ray);
        let slabs = Slabs {
            origin: self.unit_box.of_point(ray.origin),
            inverse: (ray.direction * self.unit_box.scale).recip(),
        };
        let mut best: Option<SurfaceHit> = None;
        self.visit(
            f64::INFINITY,
            |node| slabs.entry(node),
            |triangle| {
                if let Some(hit) = prepared.meet(self.mesh.corners(triangle))
                    && self.mesh.is_there(triangle, hit.barycentrics)
                    && best.is_none_or(|best| (hit.t, triangle) < (best.t, best.triangle))
                {
                    best = Some(SurfaceHit { t: hit.t, triangle, barycentrics: hit.barycentrics });
                }
                match (best, want) {
                    (Some(_), Want::Any) => f64::NEG_INFINITY,
                    (Some(best), Want::First) => best.t,
                    (None, _) => f64::INFINITY,
                }
            },
        );
        best
    }

    /// The point of the surface nearest to `point`; `None` only where there are no triangles.
    pub fn nearest_point(&self, point: DVec3) -> Option<NearestPoint> {
        self.near_point(point, None, 0.0)
    }

    /// Any point of the surface that is nearer to `point` than `enough`, or else the nearest; `None` only where there are no
    /// triangles. The same answer sooner where `first` is the index of a triangle nearby.
    pub fn near_point(&self, point: DVec3, first: Option<u32>, enough: f64) -> Option<NearestPoint> {
        let in_box = self.unit_box.of_point(point);
        let mut best: Option<NearestPoint> = None;
        let mut best_squared = f64::INFINITY;
        // Powers of two, so that comparing in unit-box space rounds nothing.
        let scale_squared = self.unit_box.scale * self.unit_box.scale;
        let enough_squared = enough * enough;
        let mut look = |triangle: u32| {
            let (barycentrics, squared) = nearest_on_triangle(point, self.mesh.corners(triangle));
            if best.is_none_or(|best| (squared, triangle) < (best_squared, best.triangle)) {
                best_squared = squared;
                best = Some(NearestPoint { distance: squared.sqrt(), triangle, barycentrics });
            }
            if best_squared < enough_squared { f64::NEG_INFINITY } else { best_squared * scale_squared }
        };
        let bound = first.map_or(f64::INFINITY, &mut look);
        self.visit(bound, |node| Some(distance_squared_to_box(in_box, node)), look);
        best
    }

    /// Branch and bound, nearest boxes first. `entry` is a lower bound of what a box can hold, `None` to skip it; `visit`
    /// looks at one triangle and returns the bound that a box must not exceed from now on; `bound` is that to begin with.
    fn visit(&self, mut bound: f64, entry: impl Fn(&BoxF32) -> Option<f64>, mut visit: impl FnMut(u32) -> f64) {
        let mut open: Vec<(f64, u32)> = Vec::with_capacity(64);
        open.extend(self.roots.iter().filter_map(|root| Some((entry(self.nodes[*root as usize].aabb())?, *root))));
        open.sort_unstable_by(|(a, _), (b, _)| b.total_cmp(a));
        while let Some((at, index)) = open.pop() {
            if at > bound {
                continue;
            }
            let node = &self.nodes[index as usize];
            let first = node.first_index;
            if node.is_leaf() {
                for &triangle in &self.triangles[first as usize..(first + node.prim_count) as usize] {
                    bound = visit(triangle);
                }
                continue;
            }
            let child = |index: u32| entry(self.nodes[index as usize].aabb()).filter(|&at| at <= bound);
            match (child(first), child(first + 1)) {
                (Some(left), Some(right)) if left <= right => open.extend([(right, first + 1), (left, first)]),
                (Some(left), Some(right)) => open.extend([(left, first), (right, first + 1)]),
                (Some(left), None) => open.push((left, first)),
                (None, Some(right)) => open.push((right, first + 1)),
                (None, None) => {}
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Want {
    First,
    Any,
}

/// The map from model space to a box of [-1, 1] or less around the mesh, where `f32` has the same resolution for every mesh.
struct UnitBox {
    center: DVec3,
    /// A power of two: scaling rounds nothing.
    scale: f64,
}

impl UnitBox {
    fn around(mesh: &Mesh) -> Self {
        let bounds = mesh.bounds();
        if bounds.is_empty() {
            return Self { center: DVec3::ZERO, scale: 1.0 };
        }
        let half_side = bounds.extent().max_element() * 0.5;
        // A single point may have any scale.
        let exponent = if half_side > 0.0 { libm::ilogb(half_side) + 1 } else { 0 };
        Self { center: bounds.center(), scale: libm::ldexp(1.0, -exponent) }
    }

    fn of_point(&self, point: DVec3) -> DVec3 {
        (point - self.center) * self.scale
    }

    fn padded_box(&self, corners: [DVec3; 3]) -> BoxF32 {
        let [a, b, c] = corners.map(|corner| self.of_point(corner));
        let (min, max) = (a.min(b).min(c) - PADDING, a.max(b).max(c) + PADDING);
        BoxF32::new(Vec3A::from(min.as_vec3()), Vec3A::from(max.as_vec3()))
    }
}

/// A ray, in the unit box, as it is needed to meet boxes.
struct Slabs {
    origin: DVec3,
    inverse: DVec3,
}

impl Slabs {
    /// Ray parameter where the ray enters the box, at least 0; `None` where it misses.
    fn entry(&self, node: &BoxF32) -> Option<f64> {
        // A ray parallel to a slab gives ±inf, or NaN on the slab's very plane: the padding keeps all triangles off that
        // plane, so whatever comes of the NaN is right.
        let to_min = (node.min.as_dvec3() - self.origin) * self.inverse;
        let to_max = (node.max.as_dvec3() - self.origin) * self.inverse;
        let near = to_min.min(to_max).max_element().max(0.0);
        let far = to_min.max(to_max).min_element();
        (near <= far).then_some(near)
    }
}

fn distance_squared_to_box(point: DVec3, node: &BoxF32) -> f64 {
    let outside = (node.min.as_dvec3() - point).max(point - node.max.as_dvec3()).max(DVec3::ZERO);
    outside.length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use proptest::prelude::*;

    fn first_hit_by_brute_force(mesh: &Mesh, ray: &Ray) -> Option<(f64, u32)> {
        let prepared = PreparedRay::new(ray);
        (0..mesh.triangles().len() as u32)
            .filter_map(|triangle| prepared.meet(mesh.corners(triangle)).map(|hit| (hit.t, triangle)))
            .min_by(|a, b| a.partial_cmp(b).unwrap())
    }

    fn nearest_by_brute_force(mesh: &Mesh, point: DVec3) -> Option<(f64, u32)> {
        (0..mesh.triangles().len() as u32)
            .map(|triangle| (nearest_on_triangle(point, mesh.corners(triangle)).1, triangle))
            .min_by(|a, b| a.partial_cmp(b).unwrap())
    }

    fn coordinates() -> impl Strategy<Value = DVec3> {
        // Whole numbers make shared planes, parallel rays and degenerate triangles likely.
        prop::array::uniform3(prop_oneof![-2f64..2.0, (-2i32..=2).prop_map(f64::from)]).prop_map(DVec3::from_array)
    }

    fn triangle_soup() -> impl Strategy<Value = Mesh> {
        let far = prop_oneof![Just(0.0), Just(1e6), Just(-3e7)];
        let size = prop_oneof![Just(1.0), Just(1e-4), Just(1e9)];
        (prop::collection::vec(coordinates(), 3..60), far, size).prop_map(|(points, far, size)| {
            let positions: Vec<DVec3> = points.iter().map(|p| (*p + far) * size).collect();
            let count = positions.len() as u32;
            let triangles = (0..count * 2).map(|i| [i % count, i * 7 % count, (i * 3 + 1) % count]).collect();
            Mesh::new(positions, None, None, triangles).unwrap()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn first_hit_is_that_of_brute_force(
            mesh in triangle_soup(), most_at_once in 7u32..200,
            rays in prop::collection::vec((coordinates(), coordinates()), 20)) {
            let bvh = Bvh::with_parts_of(&mesh, most_at_once);
            let (center, size) = (mesh.bounds().center(), mesh.bounds().extent().max_element() * 0.25);
            for (from, direction) in rays {
                let ray = Ray { origin: center + from * size, direction };
                prop_assume!(direction != DVec3::ZERO);
                let hit = bvh.first_hit(&ray).map(|hit| (hit.t, hit.triangle));
                prop_assert_eq!(hit, first_hit_by_brute_force(&mesh, &ray));
                prop_assert_eq!(bvh.is_hit(&ray), hit.is_some());
            }
        }

        #[test]
        fn nearest_point_is_that_of_brute_force(
            mesh in triangle_soup(), most_at_once in 7u32..200, points in prop::collection::vec(coordinates(), 20)) {
            let bvh = Bvh::with_parts_of(&mesh, most_at_once);
            let (center, size) = (mesh.bounds().center(), mesh.bounds().extent().max_element() * 0.5);
            let mut first = 0;
            for point in points.iter().map(|point| center + *point * size) {
                let nearest = bvh.nearest_point(point).unwrap();
                let (squared, triangle) = nearest_by_brute_force(&mesh, point).unwrap();
                prop_assert_eq!((nearest.distance, nearest.triangle), (squared.sqrt(), triangle));
                // From whatever triangle, and with less to look for.
                prop_assert_eq!(bvh.near_point(point, Some(first), 0.0), Some(nearest));
                let near = bvh.near_point(point, Some(first), size).unwrap();
                let alone = nearest_on_triangle(point, mesh.corners(near.triangle)).1.sqrt();
                prop_assert!(near.distance == alone && (near.distance < size || near == nearest), "{:?}", near);
                first = triangle;
            }
        }
    }

    #[test]
    fn no_ray_slips_through_an_edge_or_vertex_of_a_closed_mesh() {
        for offset in [DVec3::ZERO, DVec3::new(1e6, -2e6, 3e6)] {
            let mesh = fixtures::icosphere(3, offset);
            let bvh = Bvh::build(&mesh);
            let inside = fixtures::hash_points(16, 0.5);
            let slipped: usize = (0..mesh.triangles().len() as u32)
                .into_par_iter()
                .map(|triangle| {
                    let [a, b, c] = mesh.corners(triangle);
                    let along = (0..32).map(|step| f64::from(step) / 31.0);
                    let aims = along.flat_map(|s| [a.lerp(b, s), b.lerp(c, s), c.lerp(a, s)]);
                    aims.flat_map(|aim| inside.iter().map(move |from| (aim, offset + *from)))
                        .filter(|&(aim, origin)| {
                            // Out from the inside, and in from the outside through the same point.
                            let (out, back) = (aim - origin, origin - aim);
                            !bvh.is_hit(&Ray { origin, direction: out })
                                || !bvh.is_hit(&Ray { origin: aim + out, direction: back })
                        })
                        .count()
                })
                .sum();
            assert_eq!(slipped, 0, "rays slipped through the sphere at {offset}");
        }
    }

    #[test]
    fn no_ray_slips_through_a_cube_where_edge_functions_vanish() {
        // Short binary fractions: rays pass through edges, diagonals and corners exactly.
        let cube = fixtures::cube(DVec3::ZERO);
        let bvh = Bvh::build(&cube);
        let steps = || (0..=8).map(|step| f64::from(step) / 8.0);
        let grid = || steps().flat_map(|u| steps().map(move |v| (u, v)));
        let aims = grid().flat_map(|(u, v)| {
            [[u, v, 0.0], [u, v, 1.0], [u, 0.0, v], [u, 1.0, v], [0.0, u, v], [1.0, u, v]].map(DVec3::from_array)
        });
        for aim in aims {
            for origin in [DVec3::splat(0.5), DVec3::new(0.25, 0.5, 0.75), DVec3::new(0.125, 0.5, 0.5)] {
                let t = bvh.first_hit(&Ray { origin, direction: aim - origin }).map(|hit| hit.t);
                assert!(t.is_some_and(|t| (t - 1.0).abs() < 1e-12), "{t:?} from {origin} to {aim}");
            }
        }
    }

    #[test]
    fn nothing_a_point_and_a_thousand_equal_triangles_are_meshes_too() {
        let nothing = Mesh::new(vec![], None, None, vec![]).unwrap();
        let ray = Ray { origin: DVec3::new(0.2, 0.2, 5.0), direction: DVec3::NEG_Z };
        assert_eq!(Bvh::build(&nothing).first_hit(&ray), None);
        assert_eq!(Bvh::build(&nothing).nearest_point(DVec3::ZERO), None);

        let dot = Mesh::new(vec![DVec3::splat(3.0)], None, None, vec![[0; 3]]).unwrap();
        assert_eq!(Bvh::build(&dot).nearest_point(DVec3::new(3.0, 3.0, 5.0)).unwrap().distance, 2.0);

        let equal = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], None, None, vec![[0, 1, 2]; 1000]).unwrap();
        assert_eq!(Bvh::build(&equal).first_hit(&ray).map(|hit| (hit.t, hit.triangle)), Some((5.0, 0)));
    }
}
