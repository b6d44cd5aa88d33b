//! How large a ball appears on the screen, and how far a point moves on it: what level-of-detail decisions and reported errors share.
//!
//! The silhouette of a ball under perspective is an ellipse whose long axis points away from the picture's middle. With the
//! eye at the origin, depth z of the centre along the view, distance d of the centre from the eye and radius r, that long
//! axis is `2 f r √(d² − r²) / (z² − r²)` pixels, f being the focal length in pixels: it follows from the slopes
//! tan(θ ± asin(r/d)) of the two tangents in the plane through the viewing axis. It is exact, so a splat of that diameter
//! covers the ball wherever on the screen it lies.
//!
//! A point that moves by e moves within the ball of radius e around it. It gets farthest on the screen at the outer end of that ball's
//! silhouette: `f (tan(θ + asin(e/d)) − tan θ) = f e (√(d² − e²) + e tan θ) / (z² − e²)` pixels. That grows with the slope tan θ and
//! shrinks with the depth z, so the largest slope and the smallest depth of a region bound it for all points there.

/// Long axis of the silhouette, in pixels. `+inf` where the ball reaches the plane of the eye.
///
/// `depth` is measured along the viewing axis, `distance_squared` is to the ball's centre.
pub fn diameter_px(depth: f32, distance_squared: f32, radius: f32, focal_px: f32) -> f32 {
    if radius <= 0.0 {
        return 0.0;
    }
    if depth <= radius {
        return f32::INFINITY;
    }
    // (z − r)(z + r) keeps the digits that z² − r² would lose.
    let gap = (depth - radius) * (depth + radius);
    2.0 * focal_px * radius * (distance_squared - radius * radius).max(0.0).sqrt() / gap
}

/// `diameter_px(…) > threshold_px`, without the square root and the division.
pub fn exceeds_px(depth: f32, distance_squared: f32, radius: f32, focal_px: f32, threshold_px: f32) -> bool {
    if radius <= 0.0 {
        return false;
    }
    if depth <= radius {
        return threshold_px < f32::INFINITY;
    }
    let gap = (depth - radius) * (depth + radius) * threshold_px;
    let reach = 2.0 * focal_px * radius;
    reach * reach * (distance_squared - radius * radius) > gap * gap
}

/// How far on the screen a point may move that moves by `length` in space, in pixels. `+inf` where it may reach the plane of the eye.
///
/// `depth` of the point along the viewing axis is at least this; `slope`, its distance from that axis divided by its depth, is at
/// most this.
pub fn shift_px(slope: f64, depth: f64, length: f64, focal_px: f64) -> f64 {
    if length <= 0.0 {
        return 0.0;
    }
    let gap = (depth - length) * (depth + length);
    // Not where something is not a number either.
    if !(depth > 0.0 && gap > 0.0 && slope < f64::INFINITY) {
        return f64::INFINITY;
    }
    let tangent = depth.mul_add(depth, (depth * slope).powi(2)) - length * length;
    focal_px * length * (tangent.max(0.0).sqrt() + length * slope) / gap
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, ImageSize};
    use glam::DVec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_point_of_a_ball_projects_outside_its_diameter(
            x in -1.0f64..1.0, y in -0.6f64..0.6, z in 0.5f64..4.0, share in 0.01f64..0.9,
            a in -1.0f64..1.0, b in 0.0f64..std::f64::consts::TAU,
        ) {
            let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0, ImageSize { width: 800, height: 600 });
            let center = DVec3::new(x * z, y * z, z);
            let radius = z * share;
            let ring = (1.0 - a * a).sqrt();
            let offset = DVec3::new(ring * b.cos(), ring * b.sin(), a) * radius;
            let opposite = camera.pixel_of_view_point(center - offset);
            let diameter = diameter_px(z as f32, center.length_squared() as f32, radius as f32, camera.focal_px() as f32);
            let apart = (camera.pixel_of_view_point(center + offset) - opposite).length();
            prop_assert!(apart <= f64::from(diameter) * (1.0 + 1e-4), "{apart} {diameter}");
        }

        #[test]
        fn no_point_of_a_region_shifts_farther_than_its_bound(
            slope in 0.0f64..1.2, share_of_slope in 0.0f64..1.0, turn in 0.0f64..std::f64::consts::TAU,
            depth in 0.5f64..4.0, farther in 0.0f64..3.0, share in 0.0f64..0.98, share_of_length in 0.0f64..1.0,
            a in -1.0f64..1.0, b in 0.0f64..std::f64::consts::TAU,
        ) {
            let size = ImageSize { width: 800, height: 600 };
            let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0, size);
            let (at, length) = (slope * share_of_slope, depth * share);
            let point = DVec3::new(at * turn.cos(), at * turn.sin(), 1.0) * (depth + farther);
            let ring = (1.0 - a * a).sqrt();
            let moved = point + DVec3::new(ring * b.cos(), ring * b.sin(), a) * (length * share_of_length);
            let apart = (camera.pixel_of_view_point(moved) - camera.pixel_of_view_point(point)).length();
            let bound = shift_px(slope, depth, length, camera.focal_px());
            prop_assert!(apart <= bound * (1.0 + 1e-9), "{apart} {bound}");
        }

        #[test]
        fn the_bound_of_a_shift_is_reached(
            slope in 0.0f64..1.2, depth in 0.5f64..4.0, share in 0.001f64..0.9,
        ) {
            let length = depth * share;
            // Towards the outer tangent of the ball, in the plane through the viewing axis.
            let angle = libm::atan(slope) + libm::asin(length / (depth * (1.0 + slope * slope).sqrt()));
            let apart = 900.0 * (libm::tan(angle) - slope);
            let bound = shift_px(slope, depth, length, 900.0);
            prop_assert!((apart / bound - 1.0).abs() < 1e-6, "{apart} {bound}");
        }

        #[test]
        fn the_quick_comparison_agrees(z in 0.1f32..10.0, side in 0f32..2.0, r in 0f32..0.05, px in 0.3f32..20.0) {
            let distance_squared = z * z * (1.0 + side * side);
            let exact = diameter_px(z, distance_squared, r, 900.0);
            prop_assume!((exact - px).abs() > px * 1e-4);
            prop_assert_eq!(exceeds_px(z, distance_squared, r, 900.0, px), exact > px);
        }
    }

    #[test]
    fn what_may_reach_the_eye_or_is_no_number_may_shift_without_bound() {
        for (slope, depth, length) in [(0.0, 1.0, 1.0), (0.0, -1.0, 0.5), (f64::INFINITY, 1.0, 0.5)] {
            assert_eq!(shift_px(slope, depth, length, 900.0), f64::INFINITY);
        }
        for (slope, depth, length) in [(f64::NAN, 1.0, 0.5), (0.0, f64::NAN, 0.5), (0.0, 1.0, f64::NAN)] {
            assert_eq!(shift_px(slope, depth, length, 900.0), f64::INFINITY);
        }
        assert_eq!(shift_px(0.5, 0.0, 0.0, 900.0), 0.0, "what does not move does not shift");
    }

    #[test]
    fn a_ball_around_the_eye_is_larger_than_any_threshold() {
        assert_eq!(diameter_px(0.5, 0.25, 1.0, 900.0), f32::INFINITY);
        assert!(exceeds_px(-3.0, 9.0, 1.0, 900.0, 1e30));
        assert!(!exceeds_px(-3.0, 9.0, 1.0, 900.0, f32::INFINITY));
        assert_eq!(diameter_px(0.0, 0.0, 0.0, 900.0), 0.0);
    }
}
