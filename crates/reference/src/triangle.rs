//! One triangle, in `f64`: where a ray meets it, and its point nearest to another.
//!
//! Both answers come as barycentrics, so that attributes can be interpolated. Degenerate triangles are legal: a ray never
//! meets them, a nearest point on them is found as on the segment or point they are.

use glam::{DVec2, DVec3};

/// A half-line. A point on it is `origin + t * direction`, `t > 0`; the direction need not be unit, but not zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts; model space.
    pub origin: DVec3,
    /// Where it goes; its length sets the unit of `t`.
    pub direction: DVec3,
}

/// A ray made ready to meet many triangles without a gap between any two that share an edge.
///
/// The coordinates are permuted and sheared so that the ray runs along +z from the origin; a triangle is then hit where
/// the origin lies inside its projection to the xy-plane, which three signs decide.
///
/// *Watertight, exactly*: a vertex is sheared the same way whichever triangle it is met in, so neighbours see the same
/// rounded points. The sign of an edge function of such points is always right: it compares two rounded products, rounding
/// keeps order, and where they tie the exact remainders decide. So a ray through the inside of a closed mesh, or through
/// any shared edge or vertex, meets at least one triangle.
///
/// # Source
/// Woop, Benthin & Wald, *Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013. Differs: `f64`; a tie is decided by the
/// exact remainders (fused multiply-add) instead of by computing again in wider numbers.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Ray parameter, > 0.
    pub t: f64,
    /// Weights of the corners, each in [0, 1], sum 1.
    pub barycentrics: [f64; 3],
}

impl PreparedRay {
    /// Prepares `ray`.
    pub fn new(ray: &Ray) -> Self {
        let size = ray.direction.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        // The paper swaps x and y for a negative direction to keep the winding; both sides count here, so it may flip.
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let d = ray.direction;
        Self { origin: ray.origin, axes: [x, y, z], shear: DVec3::new(d[x], d[y], 1.0) / d[z] }
    }

    /// Where the ray meets the triangle `[a, b, c]`, from either side; edges and corners included. A triangle seen exactly
    /// edge-on, or without an area, is not met.
    pub fn meet(&self, triangle: [DVec3; 3]) -> Option<RayHit> {
        let [x, y, z] = self.axes;
        let mut depth = [0.0; 3];
        let mut flat = [DVec2::ZERO; 3];
        for corner in 0..3 {
            let from_origin = (triangle[corner] - self.origin).to_array();
            depth[corner] = from_origin[z];
            flat[corner] = DVec2::new(from_origin[x], from_origin[y]) - self.shear.truncate() * from_origin[z];
        }
        let [a, b, c] = flat;
        let (u, v, w) = (edge(b, c), edge(c, a), edge(a, b));
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None;
        }
        let barycentrics = [u / sum, v / sum, w / sum];
        let t = self.shear.z * (barycentrics[0] * depth[0] + barycentrics[1] * depth[1] + barycentrics[2] * depth[2]);
        (t > 0.0).then_some(RayHit { t, barycentrics })
    }
}

/// Twice the signed area of (origin, p, q), with a sign that is always right (short of underflow) and
/// `edge(p, q) == -edge(q, p)`.
#[inline]
fn edge(p: DVec2, q: DVec2) -> f64 {
    let (plus, minus) = (p.x * q.y, p.y * q.x);
    if plus == minus {
        // Equal only after rounding, perhaps: then the difference is that of the two rounding errors.
        return p.x.mul_add(q.y, -plus) - p.y.mul_add(q.x, -minus);
    }
    plus - minus
}

/// Barycentrics of the point of the triangle `[a, b, c]` nearest to `point`, and the squared distance.
///
/// Measures the candidates (nearest on each edge, and the projection to the plane where that falls inside) and takes the
/// nearest, so even for needles and zero areas, where deciding between regions is at the mercy of rounding, the answer is
/// a point of the triangle at the distance claimed.
///
/// # Source
/// Ericson, *Real-Time Collision Detection*, 2005, §5.1.5. Differs: all regions are tried instead of one being chosen.
pub fn nearest_on_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> ([f64; 3], f64) {
    // Relative to the point: far from the origin only the difference matters.
    let (a, b, c) = (a - point, b - point, c - point);
    let along = |from: DVec3, to: DVec3| {
        let edge = to - from;
        let length_squared = edge.length_squared();
        if length_squared > 0.0 { (-from.dot(edge) / length_squared).clamp(0.0, 1.0) } else { 0.0 }
    };
    let (ab, bc, ca) = (along(a, b), along(b, c), along(c, a));
    let mut best = ([1.0 - ab, ab, 0.0], a.lerp(b, ab).length_squared());
    let mut offer = |barycentrics: [f64; 3], distance_squared: f64| {
        if distance_squared < best.1 {
            best = (barycentrics, distance_squared);
        }
    };
    offer([0.0, 1.0 - bc, bc], b.lerp(c, bc).length_squared());
    offer([ca, 0.0, 1.0 - ca], c.lerp(a, ca).length_squared());

    let normal = (b - a).cross(c - a);
    let weights = [b.cross(c).dot(normal), c.cross(a).dot(normal), a.cross(b).dot(normal)];
    if weights.iter().all(|&weight| weight > 0.0) {
        let sum: f64 = weights.iter().sum();
        let inside = weights.map(|weight| weight / sum);
        offer(inside, (a + (b - a) * inside[1] + (c - a) * inside[2]).length_squared());
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ericson's choice of one region, for comparison.
    fn nearest_by_region(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let (d1, d2) = (ab.dot(ap), ac.dot(ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return a;
        }
        let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
        if d3 >= 0.0 && d4 <= d3 {
            return b;
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return a + ab * (d1 / (d1 - d3));
        }
        let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
        if d6 >= 0.0 && d5 <= d6 {
            return c;
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return a + ac * (d2 / (d2 - d6));
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
        }
        a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))
    }

    fn points() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1f64..1.0).prop_map(DVec3::from_array)
    }

    proptest! {
        #[test]
        fn nearest_point_is_ericsons(p in points(), corners in prop::array::uniform3(points())) {
            let [a, b, c] = corners;
            let (bary, squared) = nearest_on_triangle(p, corners);
            let nearest = a * bary[0] + b * bary[1] + c * bary[2];
            prop_assert!((nearest - nearest_by_region(p, corners)).length() < 1e-7);
            prop_assert!(((nearest - p).length_squared() - squared).abs() < 1e-12);
            prop_assert!(bary.iter().all(|w| (0.0..=1.0).contains(w)));
        }

        #[test]
        fn ray_meets_the_point_it_was_aimed_at(o in points(), corners in prop::array::uniform3(points()),
            u in 0.01f64..0.49, v in 0.01f64..0.49) {
            let [a, b, c] = corners;
            prop_assume!((b - a).cross(c - a).length() > 1e-3);
            let target = a * (1.0 - u - v) + b * u + c * v;
            prop_assume!(((b - a).cross(c - a).normalize().dot(o - a)).abs() > 1e-3);
            let hit = PreparedRay::new(&Ray { origin: o, direction: (target - o) * 0.5 }).meet(corners).unwrap();
            prop_assert!((hit.t - 2.0).abs() < 1e-9, "{hit:?}");
            prop_assert!((hit.barycentrics[1] - u).abs() < 1e-9 && (hit.barycentrics[2] - v).abs() < 1e-9);
            // Not behind.
            let away = PreparedRay::new(&Ray { origin: o, direction: o - target }).meet(corners);
            prop_assert_eq!(away, None);
        }

        #[test]
        fn edge_function_is_antisymmetric_and_sees_what_rounding_hides(
            x in -1f64..1.0, y in -1f64..1.0, scale in 0.1f64..10.0) {
            let p = DVec2::new(x, y);
            let q = p * scale;
            prop_assert_eq!(edge(p, q), -edge(q, p));
            prop_assert_eq!(edge(p, p), 0.0);
        }
    }

    #[test]
    fn zero_area_is_a_segment_or_a_point_to_a_distance_and_nothing_to_a_ray() {
        let segment = [DVec3::ZERO, DVec3::X, DVec3::X * 4.0];
        assert_eq!(nearest_on_triangle(DVec3::new(3.0, 2.0, 0.0), segment).1, 4.0);
        let dot = [DVec3::ONE; 3];
        assert_eq!(nearest_on_triangle(DVec3::ZERO, dot).1, 3.0);
        for triangle in [segment, dot] {
            let ray = Ray { origin: DVec3::splat(2.0), direction: triangle[2] - DVec3::splat(2.0) };
            assert_eq!(PreparedRay::new(&ray).meet(triangle), None);
        }
    }
}
