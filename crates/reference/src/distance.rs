//! How far two surfaces are apart, measured from points scattered over them.
//!
//! Takes two meshes; returns largest, root-mean-square and mean distance, one way or both ways. The distance of each point is
//! exact; the largest over the points is a lower bound of the true (Hausdorff) one, which more points approach. Deterministic:
//! points follow a fixed sequence, sums a fixed order.

use crate::{Bvh, Mesh};
use glam::DVec3;
use rayon::prelude::*;

/// How densely points are scattered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Points over the whole surface, shared among the triangles by area.
    pub points: u64,
    /// Points on every triangle at least, however small.
    pub min_per_triangle: u32,
}

impl Default for Sampling {
    /// A million points, and one on every triangle: the vertices are measured besides.
    fn default() -> Self {
        Self { points: 1_000_000, min_per_triangle: 1 }
    }
}

/// Distances from one surface to another, in model units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Largest, over points and vertices.
    pub max: f64,
    /// The point where the largest was found.
    pub farthest: DVec3,
    /// Root of the area-weighted mean square.
    pub rms: f64,
    /// Area-weighted mean.
    pub mean: f64,
    /// Points measured, vertices included.
    pub points: u64,
}

/// Distances both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoSided {
    /// From the first surface to the second.
    pub forward: Distances,
    /// From the second to the first.
    pub backward: Distances,
}

impl TwoSided {
    /// The measured Hausdorff distance: the larger of both largest.
    pub fn hausdorff(&self) -> f64 {
        self.forward.max.max(self.backward.max)
    }

    /// The larger of both root-mean-square distances.
    pub fn rms(&self) -> f64 {
        self.forward.rms.max(self.backward.rms)
    }
}

/// Distances between two surfaces, both ways; `None` where one of them has no triangles.
pub fn two_sided(a: &Bvh, b: &Bvh, sampling: Sampling) -> Option<TwoSided> {
    Some(TwoSided { forward: one_sided(a.mesh(), b, sampling)?, backward: one_sided(b.mesh(), a, sampling)? })
}

/// Distances from points of `from` to the surface of `to`; `None` where one of them has no triangles.
///
/// Every vertex of a triangle is measured too, for the largest distance only: between flat surfaces it often sits there.
pub fn one_sided(from: &Mesh, to: &Bvh, sampling: Sampling) -> Option<Distances> {
    if from.triangles().is_empty() || to.mesh().triangles().is_empty() {
        return None;
    }
    let distance = |point: DVec3| to.nearest_point(point).expect("a mesh with triangles has a nearest point").distance;
    let at_vertices = referenced_vertices(from)
        .par_chunks(CHUNK)
        .map(|vertices| {
            vertices.iter().fold(Sums::default(), |mut sums, &vertex| {
                let point = from.positions()[vertex as usize];
                sums.add(point, distance(point), 0.0);
                sums
            })
        })
        .collect::<Vec<_>>();
    let quotas = point_quotas(from, sampling);
    let inside = quotas
        .par_chunks(CHUNK)
        .map(|quotas| {
            quotas.iter().fold(Sums::default(), |mut sums, quota| {
                for barycentrics in triangle_sequence(quota.points) {
                    let point = from.point(quota.triangle, barycentrics);
                    sums.add(point, distance(point), quota.area / f64::from(quota.points));
                }
                sums
            })
        })
        .collect::<Vec<_>>();
    // In the order of the mesh, so that the sums do not depend on who finished first.
    let sums = at_vertices.into_iter().chain(inside).fold(Sums::default(), Sums::then);
    let weight = if sums.weight > 0.0 { sums.weight } else { 1.0 };
    Some(Distances {
        max: sums.max,
        farthest: sums.farthest,
        rms: (sums.squared / weight).sqrt(),
        mean: sums.distance / weight,
        points: sums.points,
    })
}

/// Triangles or vertices that one task measures: large enough to be worth a task, and fixed, so that sums are too.
const CHUNK: usize = 1024;

/// Running sums over measured points.
#[derive(Clone, Copy)]
struct Sums {
    max: f64,
    farthest: DVec3,
    squared: f64,
    distance: f64,
    weight: f64,
    points: u64,
}

impl Default for Sums {
    fn default() -> Self {
        Self { max: -1.0, farthest: DVec3::ZERO, squared: 0.0, distance: 0.0, weight: 0.0, points: 0 }
    }
}

impl Sums {
    fn add(&mut self, point: DVec3, distance: f64, weight: f64) {
        *self = self.then(Self {
            max: distance,
            farthest: point,
            squared: weight * distance * distance,
            distance: weight * distance,
            weight,
            points: 1,
        });
    }

    fn then(self, later: Self) -> Self {
        let larger = if later.max > self.max { later } else { self };
        Self {
            max: larger.max,
            farthest: larger.farthest,
            squared: self.squared + later.squared,
            distance: self.distance + later.distance,
            weight: self.weight + later.weight,
            points: self.points + later.points,
        }
    }
}

fn referenced_vertices(mesh: &Mesh) -> Vec<u32> {
    let mut referenced = vec![false; mesh.positions().len()];
    mesh.triangles().as_flattened().iter().for_each(|&vertex| referenced[vertex as usize] = true);
    (0..referenced.len() as u32).filter(|&vertex| referenced[vertex as usize]).collect()
}

/// How many points one triangle gets.
struct Quota {
    triangle: u32,
    area: f64,
    points: u32,
}

/// Shares the points among the triangles by area, each getting what the running total leaves to it, so that many small
/// triangles together get their due; then raises each to the minimum.
fn point_quotas(mesh: &Mesh, sampling: Sampling) -> Vec<Quota> {
    let areas: Vec<f64> = (0..mesh.triangles().len() as u32)
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            (b - a).cross(c - a).length() * 0.5
        })
        .collect();
    let total: f64 = areas.iter().sum();
    let points_per_area = if total > 0.0 { sampling.points as f64 / total } else { 0.0 };
    let (mut area_so_far, mut points_so_far) = (0.0, 0u64);
    areas
        .into_iter()
        .zip(0..)
        .map(|(area, triangle)| {
            area_so_far += area;
            let due = (area_so_far * points_per_area) as u64;
            let points = u32::try_from(due - points_so_far).unwrap_or(u32::MAX);
            points_so_far = due;
            Quota { triangle, area, points: points.max(sampling.min_per_triangle) }
        })
        .collect()
}

/// The first `count` points of a sequence that fills a triangle evenly at any length: the first is the centroid, the next
/// three those of the outer quarters, and so on.
///
/// # Source
/// Basu & Owen, *Low Discrepancy Constructions in the Triangle*, SIAM J. Numerical Analysis 53(2), 2015, §3: the base-4
/// digits of the index choose a quarter each, the least significant digit the largest.
fn triangle_sequence(count: u32) -> impl Iterator<Item = [f64; 3]> {
    (0..count).map(|index| {
        let mut corners = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut digits = index;
        while digits > 0 {
            let [a, b, c] = corners;
            let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
            corners = match digits % 4 {
                0 => [bc, ca, ab],
                1 => [a, ab, ca],
                2 => [ab, b, bc],
                _ => [ca, bc, c],
            };
            digits /= 4;
        }
        ((corners[0] + corners[1] + corners[2]) / 3.0).to_array()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    const COARSE: Sampling = Sampling { points: 20_000, min_per_triangle: 2 };

    #[test]
    fn parallel_squares_are_as_far_apart_as_they_are() {
        let a = fixtures::soup(&fixtures::rectangle([0.0, 0.0], [1.0, 1.0], 0.0));
        let b = fixtures::soup(&fixtures::rectangle([-1.0, -1.0], [2.0, 2.0], 0.25));
        let (a, b) = (Bvh::build(&a), Bvh::build(&b));
        let measured = two_sided(&a, &b, COARSE).unwrap();
        let forward = measured.forward;
        assert_eq!((forward.max, forward.mean), (0.25, 0.25));
        assert!((forward.rms - 0.25).abs() < 1e-12);
        // The other way, the corners of the larger square are farthest.
        let corner = (2.0 + 0.0625f64).sqrt();
        assert!((measured.backward.max - corner).abs() < 1e-12);
        assert_eq!(measured.hausdorff(), measured.backward.max);
    }

    #[test]
    fn spheres_of_two_radii_are_their_difference_apart_whatever_the_offset() {
        for center in [DVec3::ZERO, DVec3::splat(1e6)] {
            let sphere = fixtures::icosphere(4, center);
            let grown = sphere.positions().iter().map(|p| center + (*p - center) * 1.5).collect();
            let grown = Mesh::new(grown, None, None, sphere.triangles().to_vec()).unwrap();
            let measured = two_sided(&Bvh::build(&sphere), &Bvh::build(&grown), COARSE).unwrap();
            for way in [measured.forward, measured.backward] {
                assert!((way.mean - 0.5).abs() < 5e-3 && (way.rms - 0.5).abs() < 5e-3, "{way:?}");
                assert!(way.max >= way.rms && way.max < 0.503, "{way:?}");
                assert!(way.points >= 20_000);
            }
        }
    }

    #[test]
    fn a_distance_that_grows_evenly_has_the_mean_and_rms_of_a_ramp() {
        // From a square that leans up to its far side: distances 0 to 1 above a large plane.
        let [a, b] = fixtures::rectangle([0.0, 0.0], [1.0, 1.0], 0.0)[..] else { unreachable!() };
        let lean = |triangle: [DVec3; 3]| triangle.map(|p| DVec3::new(p.x, p.y, p.x));
        let plane = fixtures::soup(&fixtures::rectangle([-5.0, -5.0], [5.0, 5.0], 0.0));
        let measured = one_sided(&fixtures::soup(&[lean(a), lean(b)]), &Bvh::build(&plane), COARSE).unwrap();
        assert!(
            (measured.mean - 0.5).abs() < 1e-3 && (measured.rms - (1f64 / 3.0).sqrt()).abs() < 1e-3,
            "{measured:?}"
        );
        assert_eq!((measured.max, measured.farthest.x), (1.0, 1.0));
    }

    #[test]
    fn degenerate_triangles_are_measured_and_weigh_nothing() {
        let plane = fixtures::soup(&fixtures::rectangle([-5.0, -5.0], [5.0, 5.0], 0.0));
        let spike = [DVec3::ZERO, DVec3::Z * 3.0, DVec3::Z];
        let flat = fixtures::rectangle([0.0, 0.0], [1.0, 1.0], 0.0);
        let measured = one_sided(&fixtures::soup(&[flat[0], spike]), &Bvh::build(&plane), COARSE).unwrap();
        assert!(measured.max == 3.0 && measured.rms < 1e-12, "{measured:?}");
        let nothing = Mesh::new(vec![], None, None, vec![]).unwrap();
        assert_eq!(one_sided(&nothing, &Bvh::build(&plane), COARSE), None);
        assert_eq!(one_sided(&plane, &Bvh::build(&nothing), COARSE), None);
    }

    #[test]
    fn sequence_fills_the_triangle_evenly() {
        // 4^5 points fall one each into the 4^5 equal parts, so their mean is the centroid and each corner gets its share.
        let points: Vec<[f64; 3]> = triangle_sequence(1024).collect();
        let mean = points.iter().map(|p| p[0]).sum::<f64>() / 1024.0;
        assert!((mean - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(points.iter().filter(|p| p[0] > 0.5).count(), 256);
        assert!(points.iter().all(|p| p.iter().all(|w| *w > 0.0) && (p.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    }
}
