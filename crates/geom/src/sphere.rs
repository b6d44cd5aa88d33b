//! Bounding spheres in local space.

use glam::{DVec3, Vec3};

/// A ball: everything within `radius` of `center`. Local space unless a name says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius, ≥ 0.
    pub radius: f32,
}

impl Sphere {
    /// True when `inner` lies inside this ball. Decided in `f64` on the values as they are, so neither a rounding of the
    /// caller's nor a tolerance hides in the answer.
    pub fn encloses(&self, inner: &Sphere) -> bool {
        let reach = f64::from(self.radius) - f64::from(inner.radius);
        reach >= 0.0 && (self.center.as_dvec3() - inner.center.as_dvec3()).length_squared() <= reach * reach
    }

    /// True when what `a` and `b` have in common lies inside this ball. Decided in `f64`; where rounding could matter, false.
    pub fn encloses_common(&self, a: &Sphere, b: &Sphere) -> bool {
        let at = self.center.as_dvec3();
        let ball = |ball: &Sphere| (ball.center.as_dvec3() - at, f64::from(ball.radius));
        let ((ca, ra), (cb, rb)) = (ball(a), ball(b));
        // The farthest point of one ball, seen from this one's centre, if the other holds it; else a point where both meet.
        let farthest = |c: DVec3, r: f64| c + c.normalize_or(DVec3::X) * r;
        let (far_a, far_b) = (farthest(ca, ra), farthest(cb, rb));
        let reach = if (far_a - cb).length_squared() <= rb * rb {
            far_a.length()
        } else if (far_b - ca).length_squared() <= ra * ra {
            far_b.length()
        } else {
            let between = cb - ca;
            let apart = between.length();
            let axis = between / apart;
            let along = (apart * apart + ra * ra - rb * rb) / (2.0 * apart);
            let ring = (ra * ra - along * along).max(0.0).sqrt();
            let middle = ca + axis * along;
            let height = middle.dot(axis);
            let out = (middle - axis * height).length() + ring;
            (height * height + out * out).sqrt()
        };
        reach <= f64::from(self.radius) * (1.0 - 1e-9)
    }
}

/// The smallest `f32` that is not below `value`.
pub fn round_up(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) < value { nearest.next_up() } else { nearest }
}

/// Radius of the smallest ball around a triangle: half the longest edge where the angle opposite is 90° or more, else the
/// circumscribed radius. Zero-area triangles, slivers and single points included.
pub fn triangle_bounding_radius([a, b, c]: [DVec3; 3]) -> f64 {
    let mut edges = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
    edges.sort_by(f64::total_cmp);
    let [short, middle, long] = edges;
    if short + middle <= long {
        return long.sqrt() * 0.5;
    }
    let twice_area = (b - a).cross(c - a).length();
    let circumscribed = (short * middle).sqrt() * long.sqrt() / (2.0 * twice_area);
    // An acute triangle's circumscribed radius is at most 1/√3 of its longest edge; the bound catches a cancelled area.
    if circumscribed.is_finite() { circumscribed.min(long.sqrt() * 0.577_350_27) } else { long.sqrt() * 0.577_350_27 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spheres() -> impl Strategy<Value = Sphere> {
        (prop::array::uniform3(-1e3f32..1e3), 0f32..100.0)
            .prop_map(|(center, radius)| Sphere { center: Vec3::from_array(center), radius })
    }

    proptest! {
        #[test]
        fn what_two_balls_have_in_common_is_enclosed(
            a in spheres(), towards in prop::array::uniform3(-1f32..1.0), apart in 0f32..1.2, ratio in 0.3f32..1.5,
            at in prop::array::uniform3(-1f32..1.0), size in 0.2f32..1.5, point in prop::array::uniform3(-1f64..1.0),
        ) {
            let b = Sphere {
                center: a.center + Vec3::from_array(towards).normalize_or_zero() * a.radius * apart,
                radius: a.radius * ratio,
            };
            let ball = Sphere { center: a.center + Vec3::from_array(at) * a.radius * 0.5, radius: a.radius * size };
            let point = a.center.as_dvec3() + DVec3::from_array(point) * f64::from(a.radius);
            let holds = |ball: &Sphere| (point - ball.center.as_dvec3()).length() <= f64::from(ball.radius);
            if ball.encloses_common(&a, &b) && holds(&a) && holds(&b) {
                prop_assert!(holds(&ball));
            }
            // Whoever encloses one of them encloses what they have in common.
            let wide = Sphere { radius: (a.center.distance(ball.center) + a.radius) * 1.001, ..ball };
            prop_assert!(a.radius == 0.0 || wide.encloses_common(&a, &b));
        }

        #[test]
        fn balls_of_the_bounding_radius_at_the_corners_cover_a_triangle(
            corners in prop::array::uniform3(prop::array::uniform3(-1f64..1.0)), u in 0f64..1.0, v in 0f64..1.0,
        ) {
            let corners = corners.map(DVec3::from_array);
            let radius = triangle_bounding_radius(corners);
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let inside = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let nearest = corners.iter().map(|c| (*c - inside).length()).fold(f64::INFINITY, f64::min);
            prop_assert!(nearest <= radius * (1.0 + 1e-9), "{nearest} {radius}");
        }
    }

    #[test]
    fn degenerate_triangles_have_the_radius_of_their_longest_edge() {
        let p = DVec3::new(1e6, 2e6, 3e6);
        assert_eq!(triangle_bounding_radius([p; 3]), 0.0);
        assert_eq!(triangle_bounding_radius([p, p, p + DVec3::X]), 0.5);
        assert_eq!(triangle_bounding_radius([DVec3::ZERO, DVec3::X, DVec3::X * 3.0]), 1.5);
    }
}
