//! Where a triangle is measured: on a grid that cuts it into equal parts, corners and edges included.

use glam::DVec3;

/// At least so many parts along each edge: ten points a triangle.
pub(super) const LEAST_PARTS: u32 = 3;
/// At most so many.
const MOST_PARTS: f64 = 16.0;

/// Parts along the edges of a triangle, so that points are at most two lengths of `error` apart, as far as [`MOST_PARTS`] allow.
pub(super) fn parts(corners: [DVec3; 3], error: f64) -> u32 {
    let [a, b, c] = corners;
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    // Where the error is 0 this is infinite, or not a number where all corners are one point.
    let wanted = (longest / (2.0 * error)).ceil();
    if wanted > f64::from(LEAST_PARTS) { wanted.min(MOST_PARTS) as u32 } else { LEAST_PARTS }
}

/// Weights of the corners at each point, and the point's share of the triangle's area: each of the equal parts shares its own among
/// its corners.
pub(super) fn grid(parts: u32) -> impl Iterator<Item = ([f64; 3], f64)> {
    (0..=parts).flat_map(move |i| {
        (0..=parts - i).map(move |j| {
            let weights = [i, j, parts - i - j];
            let parts_around = match weights.iter().filter(|weight| **weight == 0).count() {
                0 => 6.0,
                1 => 3.0,
                _ => 1.0,
            };
            let of_all = f64::from(parts).powi(2) * 3.0;
            (weights.map(|weight| f64::from(weight) / f64::from(parts)), parts_around / of_all)
        })
    })
}

/// The point of a triangle with these weights.
pub(super) fn point([a, b, c]: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
    a + (b - a) * weights[1] + (c - a) * weights[2]
}

/// Mean of the corners, and how far the farthest corner is from it.
pub(super) fn ball(corners: [DVec3; 3]) -> (DVec3, f64) {
    let [a, b, c] = corners;
    let middle = a + ((b - a) + (c - a)) / 3.0;
    (middle, middle.distance(a).max(middle.distance(b)).max(middle.distance(c)))
}

pub(super) fn area([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length() * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_the_whole_and_points_to_its_middle() {
        for parts in [1, 3, 4, 16] {
            let all: Vec<_> = grid(parts).collect();
            assert_eq!(all.len() as u32, (parts + 1) * (parts + 2) / 2);
            let sum = all.iter().map(|(_, share)| share).sum::<f64>();
            let first = all.iter().map(|(weights, share)| weights[0] * share).sum::<f64>();
            assert!((sum - 1.0).abs() < 1e-12 && (first - 1.0 / 3.0).abs() < 1e-12, "{parts}: {sum} {first}");
        }
    }

    #[test]
    fn triangles_without_a_size_have_their_ten_points_too() {
        let [a, b] = [DVec3::splat(3.0), DVec3::new(7.0, 3.0, 3.0)];
        assert_eq!([parts([a; 3], 0.0), parts([a; 3], 1.0), parts([a, b, b], 1.0)], [LEAST_PARTS; 3]);
        assert_eq!([parts([a, b, b], 0.25), parts([a, b, b], 0.0)], [8, 16]);
        assert!(grid(3).all(|(weights, _)| point([a; 3], weights) == a));
    }
}
