//! The nearest places of a cloud, exactly, in `f64`: a k-d tree, one place to a node.

use glam::DVec3;

/// Places where points are, each once, put so that the middle one of any range that the search comes to divides it.
pub(super) struct Nearest {
    points: Vec<DVec3>,
}

impl Nearest {
    pub(super) fn of(mut points: Vec<DVec3>) -> Self {
        points.sort_unstable_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("positions are finite"));
        points.dedup();
        arrange(&mut points, 0);
        Self { points }
    }

    /// Squares of the distances of the nearest `count` places, and these places, nearest first; `at` itself is none of them where
    /// `others` is true.
    pub(super) fn nearest(&self, at: DVec3, count: usize, others: bool) -> Vec<(f64, DVec3)> {
        let mut found = Vec::with_capacity(count + 1);
        search(&self.points, 0, at, count, others, &mut found);
        found
    }
}

fn arrange(points: &mut [DVec3], axis: usize) {
    if points.len() < 2 {
        return;
    }
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    let (left, right) = points.split_at_mut(middle);
    arrange(left, (axis + 1) % 3);
    arrange(&mut right[1..], (axis + 1) % 3);
}

fn search(points: &[DVec3], axis: usize, at: DVec3, count: usize, others: bool, found: &mut Vec<(f64, DVec3)>) {
    let Some(&here) = points.get(points.len() / 2) else { return };
    let (left, right) = (&points[..points.len() / 2], &points[points.len() / 2 + 1..]);
    let beyond = at[axis] - here[axis];
    let (near, far) = if beyond < 0.0 { (left, right) } else { (right, left) };
    let next = (axis + 1) % 3;
    search(near, next, at, count, others, found);
    let square = here.distance_squared(at);
    let place = found.partition_point(|(known, _)| *known <= square);
    if place < count && !(others && here == at) {
        found.insert(place, (square, here));
        found.truncate(count);
    }
    if found.len() < count || beyond * beyond <= found[found.len() - 1].0 {
        search(far, next, at, count, others, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_look_at_all_finds_the_same(
            points in prop::collection::vec(prop::array::uniform3((-5i32..5).prop_map(f64::from)), 1..200),
            count in 1usize..12, others in any::<bool>(),
        ) {
            let points: Vec<DVec3> = points.into_iter().map(DVec3::from_array).collect();
            let at = points[0];
            let mut squares: Vec<(f64, [f64; 3])> =
                points.iter().map(|point| (point.distance_squared(at), point.to_array())).collect();
            squares.sort_by(|a, b| a.partial_cmp(b).unwrap());
            squares.dedup();
            squares.retain(|(square, _)| !others || *square > 0.0);
            squares.truncate(count);
            let found = Nearest::of(points).nearest(at, count, others);
            prop_assert!(found.iter().map(|(square, _)| *square).eq(squares.iter().map(|(square, _)| *square)));
        }
    }
}
