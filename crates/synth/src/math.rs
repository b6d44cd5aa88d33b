//! Small algebra on `f32` that gives the same bits on every machine.
//!
//! Only `+ - * /`, square roots and comparisons, which IEEE 754 fixes; what needs more calls `libm`.

use glam::Vec3;

/// 0 below `from`, 1 above `to`, smooth (C1) between. `from` may be the larger: then it falls.
pub(crate) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// `a` at 0, `b` at 1.
pub(crate) fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The largest whole number not above `x`; `|x|` below 2³¹. A call-free `floor` for the inner loops.
pub(crate) fn floor_i32(x: f32) -> i32 {
    let truncated = x as i32;
    truncated - i32::from((truncated as f32) > x)
}

/// Cosine of `turns` whole turns, by a polynomial; error below 2e-4, C1. Fast enough for every vertex.
pub(crate) fn cos_turns(turns: f32) -> f32 {
    // Fold to a quarter: x in [-0.5, 0.5] -> cos = 1 - 2 sin², with sin(πx) by an odd polynomial.
    let x = turns - floor_i32(turns + 0.5) as f32;
    let x2 = x * x;
    // sin(πx) on [-0.5, 0.5].
    let s = x * (std::f32::consts::PI - x2 * (5.167_708 - x2 * (2.549_965 - x2 * 0.589_0)));
    1.0 - 2.0 * s * s
}

/// Smooth minimum of two distances: rounded over about `k` where they meet.
///
/// # Source
/// Quilez, *Smooth minimum*, 2013 (quadratic variant).
pub(crate) fn smin(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

/// Smooth maximum, the mirror image of [`smin`]. `smax(a, -b, k)` carves `b` out of `a`.
pub(crate) fn smax(a: f32, b: f32, k: f32) -> f32 {
    -smin(-a, -b, k)
}

/// Distance to an ellipsoid around the origin; exact to first order near its surface.
pub(crate) fn ellipsoid(p: Vec3, radii: Vec3) -> f32 {
    let scaled = p / radii;
    let k0 = scaled.length();
    let k1 = (scaled / radii).length();
    if k1 > 1e-9 { k0 * (k0 - 1.0) / k1 } else { -radii.min_element() }
}

/// Distance to a rod from `a` to `b` whose radius goes from `radius_a` to `radius_b`.
pub(crate) fn rod(p: Vec3, a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> f32 {
    let (pa, ba) = (p - a, b - a);
    let share = (pa.dot(ba) / ba.length_squared()).clamp(0.0, 1.0);
    (pa - ba * share).length() - mix(radius_a, radius_b, share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_by_polynomial_is_close_to_the_real_one() {
        for step in -4000..4000 {
            let turns = step as f32 * 0.001;
            let expected = libm::cos(f64::from(turns) * std::f64::consts::TAU) as f32;
            assert!((cos_turns(turns) - expected).abs() < 1e-3, "{turns}: {} {expected}", cos_turns(turns));
        }
    }

    #[test]
    fn floor_agrees_with_the_standard_one() {
        for x in [-2.5_f32, -2.0, -0.1, -0.0, 0.0, 0.9, 1.0, 12345.6] {
            assert_eq!(floor_i32(x), x.floor() as i32, "{x}");
        }
    }
}
