//! The plane through neighbours: the direction in which they spread least.
//!
//! Differences to neighbours go in, with the square of each one's length; a unit normal comes out, of either side. Near
//! neighbours count more: the fit is then to the surface here, and does not round off edges.

use glam::{DVec3, Vec3};

/// What the farthest neighbour counts, of 1 for one that is nowhere else.
const FARTHEST: f32 = 0.25;

/// Normal of the plane that fits the origin and the differences best, in the sense of least squares weighted by nearness. Where
/// all are on a line, some direction across; where all are here, y.
pub(super) fn normal(differences: &[Vec3], squares: &[f32]) -> Vec3 {
    let farthest = squares.last().copied().unwrap_or(0.0);
    if farthest <= 0.0 {
        return Vec3::Y;
    }
    let (per_square, unit) = ((1.0 - FARTHEST) / farthest, 1.0 / farthest.sqrt());
    let mut weight = 1.0;
    let mut sum = Vec3::ZERO;
    // xx, xy, xz, yy, yz, zz.
    let mut products = [0.0_f32; 6];
    for (difference, square) in differences.iter().zip(squares) {
        let own = 1.0 - square * per_square;
        let at = *difference * unit;
        weight += own;
        let weighted = at * own;
        sum += weighted;
        products[0] += weighted.x * at.x;
        products[1] += weighted.x * at.y;
        products[2] += weighted.x * at.z;
        products[3] += weighted.y * at.y;
        products[4] += weighted.y * at.z;
        products[5] += weighted.z * at.z;
    }
    let (mean, weight) = (sum.as_dvec3() / f64::from(weight), f64::from(weight));
    let mut covariance = products.map(|value| f64::from(value) / weight);
    for (value, minus) in covariance.iter_mut().zip([
        mean.x * mean.x,
        mean.x * mean.y,
        mean.x * mean.z,
        mean.y * mean.y,
        mean.y * mean.z,
        mean.z * mean.z,
    ]) {
        *value -= minus;
    }
    least(covariance).as_vec3()
}

/// The unit eigenvector of the least eigenvalue of a symmetric matrix without negative ones.
fn least([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> DVec3 {
    let trace = xx + yy + zz;
    let minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
    let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    // Newton's method from below the least root of λ³ − trace λ² + minors λ − determinant: all roots are real, so each step
    // ends below it, too.
    let mut root = 0.0;
    for _ in 0..12 {
        let value = ((root - trace) * root + minors) * root - determinant;
        let slope = (3.0 * root - 2.0 * trace) * root + minors;
        let step = if slope > 0.0 { -value / slope } else { 0.0 };
        root += step.max(0.0);
        if step <= trace * 1e-14 {
            break;
        }
    }
    // Rows of what is left are across the eigenvector.
    let rows = [DVec3::new(xx - root, xy, xz), DVec3::new(xy, yy - root, yz), DVec3::new(xz, yz, zz - root)];
    let crosses = [rows[0].cross(rows[1]), rows[1].cross(rows[2]), rows[2].cross(rows[0])];
    let longest = crosses.into_iter().fold(DVec3::ZERO, |longest, cross| {
        if cross.length_squared() > longest.length_squared() { cross } else { longest }
    });
    // Two least ones, as on a line: what is left has one direction, and all across will do.
    if longest.length_squared() > trace.powi(4) * 1e-24 {
        return longest.normalize();
    }
    let line = rows
        .into_iter()
        .fold(DVec3::ZERO, |longest, row| if row.length_squared() > longest.length_squared() { row } else { longest });
    line.try_normalize().map_or(DVec3::Y, |line| line.any_orthonormal_vector())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fitted(mut differences: Vec<Vec3>) -> Vec3 {
        differences.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let squares: Vec<f32> = differences.iter().map(|d| d.length_squared()).collect();
        normal(&differences, &squares)
    }

    proptest! {
        #[test]
        fn points_of_a_plane_have_its_normal(
            along in prop::collection::vec(prop::array::uniform2(-1f32..1.0), 8..30),
            n in prop::array::uniform3(-1f32..1.0), size in prop_oneof![Just(1.0f32), Just(1e-6), Just(1e-12)],
        ) {
            let n = Vec3::from_array(n).try_normalize().unwrap_or(Vec3::Z);
            let (u, v) = n.any_orthonormal_pair();
            let points: Vec<Vec3> = along.iter().map(|[a, b]| (u * *a + v * *b) * size).collect();
            let found = fitted(points);
            prop_assert!(found.dot(n).abs() > 0.9999, "{found} {n}");
            prop_assert!((found.length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn lines_have_a_normal_across_and_single_points_have_one() {
        let line = Vec3::new(1.0, 2.0, -1.0);
        let found = fitted((1..9).map(|i| line * i as f32).collect());
        assert!(found.dot(line).abs() < 1e-3 && (found.length() - 1.0).abs() < 1e-5, "{found}");
        assert_eq!(fitted(vec![]), Vec3::Y);
        let one = fitted(vec![Vec3::X]);
        assert!(one.dot(Vec3::X).abs() < 1e-3 && one.is_finite());
    }

    #[test]
    fn noise_moves_a_normal_little() {
        let points = (0..16).map(|i| {
            let (x, y) = ((i % 4) as f32 - 1.6, (i / 4) as f32 - 1.4);
            Vec3::new(x, y, if i % 3 == 0 { 0.05 } else { -0.03 })
        });
        assert!(fitted(points.collect()).z.abs() > 0.998);
    }
}
