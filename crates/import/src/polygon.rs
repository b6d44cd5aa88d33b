//! From a polygon to triangles, by clipping ears.
//!
//! In: the positions of its corners in order. Out: triangles by corner number, in the polygon's winding, always two fewer than
//! there are corners, so that every corner and every edge of the polygon is one of its triangles'.
//!
//! A simple polygon, convex or not, is covered exactly. One that crosses itself or is not plane is covered somehow: where no
//! ear is left, the next corner is clipped. Work is bounded: after [`TESTS_PER_CORNER`] for each corner, what is left becomes
//! a fan.

use glam::{DVec2, DVec3};

/// A corner is tested against the others at most this often on average. A simple polygon of thousands of corners takes about
/// twice the number of its reflex corners.
const TESTS_PER_CORNER: usize = 2048;

/// Buffers for one polygon after the other.
#[derive(Default)]
pub(crate) struct Clipper {
    points: Vec<DVec2>,
    /// Neighbours of each corner that is left.
    next: Vec<u32>,
    previous: Vec<u32>,
    reflex: Vec<bool>,
}

impl Clipper {
    /// Calls `emit` for each triangle.
    pub(crate) fn triangulate(&mut self, corners: &[DVec3], mut emit: impl FnMut([usize; 3])) {
        let count = corners.len();
        if count < 3 {
            return;
        }
        self.project(corners);
        let is_convex = (0..count)
            .all(|corner| !self.is_reflex_between(corner, (corner + count - 1) % count, (corner + 1) % count));
        // All corners to one side: but a star that winds twice is that, too.
        if count == 3 || is_convex && self.turns_once() {
            (1..count - 1).for_each(|corner| emit([0, corner, corner + 1]));
            return;
        }
        self.next.clear();
        self.next.extend((1..count as u32).chain([0]));
        self.previous.clear();
        self.previous.extend([count as u32 - 1].into_iter().chain(0..count as u32 - 1));
        self.reflex.clear();
        self.reflex.resize(count, false);
        for corner in 0..count {
            self.reflex[corner] = self.is_reflex(corner);
        }
        let mut tests = TESTS_PER_CORNER * count;
        let (mut left, mut corner, mut refused) = (count, 0, 0);
        while left > 3 {
            if tests > 0 && refused < left && !self.is_ear(corner, &mut tests) {
                corner = self.next[corner] as usize;
                refused += 1;
                continue;
            }
            let (before, after) = (self.previous[corner] as usize, self.next[corner] as usize);
            emit([before, corner, after]);
            self.next[before] = after as u32;
            self.previous[after] = before as u32;
            for neighbour in [before, after] {
                self.reflex[neighbour] = self.is_reflex(neighbour);
            }
            (left, refused) = (left - 1, 0);
            // Not the very next, for fewer slivers; but a fan once tests have run out.
            corner = if tests > 0 { self.next[after] as usize } else { after };
        }
        emit([self.previous[corner] as usize, corner, self.next[corner] as usize]);
    }

    /// Into the plane of two axes in which the polygon is largest, so turned that it winds to the left.
    fn project(&mut self, corners: &[DVec3]) {
        let origin = corners[0];
        // Twice the vector area: Newell's normal.
        let mut normal = DVec3::ZERO;
        for (corner, &position) in corners.iter().enumerate() {
            normal += (position - origin).cross(corners[(corner + 1) % corners.len()] - origin);
        }
        let size = normal.abs();
        let drop = if size.z >= size.x && size.z >= size.y { 2 } else { usize::from(size.y >= size.x) };
        let sign = if normal[drop] < 0.0 { -1.0 } else { 1.0 };
        self.points.clear();
        self.points.extend(corners.iter().map(|&position| {
            let from_origin = position - origin;
            DVec2::new(from_origin[(drop + 1) % 3], sign * from_origin[(drop + 2) % 3])
        }));
    }

    /// Twice the area of a triangle, positive to the left.
    fn area(&self, a: usize, b: usize, c: usize) -> f64 {
        (self.points[b] - self.points[a]).perp_dot(self.points[c] - self.points[a])
    }

    fn is_reflex_between(&self, corner: usize, before: usize, after: usize) -> bool {
        self.area(before, corner, after) < 0.0
    }

    fn is_reflex(&self, corner: usize) -> bool {
        self.is_reflex_between(corner, self.previous[corner] as usize, self.next[corner] as usize)
    }

    /// For a polygon that nowhere turns right: true when it turns around once, and not more often.
    fn turns_once(&self) -> bool {
        let count = self.points.len();
        let edge = |corner: usize| self.points[(corner + 1) % count] - self.points[corner];
        let edges = || (0..count).map(edge).filter(|&edge| edge != DVec2::ZERO);
        let Some(first) = edges().next() else { return true };
        // Edges begin to point upwards, coming from below, once a turn.
        let is_upper = |edge: DVec2| edge.y > 0.0 || edge.y == 0.0 && edge.x > 0.0;
        let mut was_upper = is_upper(first);
        let mut turns = 0;
        for edge in edges().skip(1).chain([first]) {
            turns += usize::from(is_upper(edge) && !was_upper);
            was_upper = is_upper(edge);
        }
        turns <= 1
    }

    /// True when the triangle at a corner is to the left and holds no other corner.
    fn is_ear(&self, corner: usize, tests: &mut usize) -> bool {
        let (before, after) = (self.previous[corner] as usize, self.next[corner] as usize);
        let area = self.area(before, corner, after);
        if area < 0.0 {
            return false;
        }
        let ends = [before, corner, after].map(|corner| self.points[corner]);
        if area == 0.0 {
            // A corner on a straight edge, or the tip of a spike: nothing can be inside. But a straight edge is clipped only
            // when it must be, or its triangle takes the edge from one with an area.
            return ends[0] == ends[1] || ends[1] == ends[2] || (ends[0] - ends[1]).dot(ends[2] - ends[1]) > 0.0;
        }
        let (low, high) = (ends[0].min(ends[1]).min(ends[2]), ends[0].max(ends[1]).max(ends[2]));
        let mut other = self.next[after] as usize;
        while other != before {
            *tests = tests.saturating_sub(1);
            let point = self.points[other];
            // Only a corner that turns right can be the foremost inside.
            if self.reflex[other]
                && point.cmpge(low).all()
                && point.cmple(high).all()
                && !ends.contains(&point)
                && self.area(before, corner, other) >= 0.0
                && self.area(corner, after, other) >= 0.0
                && self.area(after, before, other) >= 0.0
            {
                return false;
            }
            other = self.next[other] as usize;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of a polygon in the plane z = 0, turned into all positions that a projection can meet.
    fn triangles(points: &[[f64; 2]]) -> Vec<[usize; 3]> {
        let mut clipper = Clipper::default();
        let places: [fn(f64, f64) -> DVec3; 4] = [
            |x, y| DVec3::new(x, y, 0.0),
            |x, y| DVec3::new(x, -y, 3.0),
            |x, y| DVec3::new(0.5, x, y),
            |x, y| DVec3::new(y, 7.0, x),
        ];
        let lists: Vec<Vec<_>> = places
            .iter()
            .map(|place| {
                let corners: Vec<_> = points.iter().map(|&[x, y]| place(x, y)).collect();
                let mut list = Vec::new();
                clipper.triangulate(&corners, |triangle| list.push(triangle));
                list
            })
            .collect();
        assert!(lists.windows(2).all(|pair| pair[0] == pair[1]), "{lists:?}");
        lists[0].clone()
    }

    fn area(points: &[[f64; 2]], corners: &[usize]) -> f64 {
        let sum: f64 = (0..corners.len())
            .map(|at| {
                let ([ax, ay], [bx, by]) = (points[corners[at]], points[corners[(at + 1) % corners.len()]]);
                ax * by - ay * bx
            })
            .sum();
        sum / 2.0
    }

    /// Triangles all wind as the polygon does and cover its area: so none lies outside, and no two overlap.
    fn assert_covered(points: &[[f64; 2]]) {
        let all: Vec<_> = (0..points.len()).collect();
        let whole = area(points, &all);
        let triangles = triangles(points);
        assert_eq!(triangles.len(), points.len() - 2);
        let mut sum = 0.0;
        for triangle in &triangles {
            let part = area(points, triangle);
            assert!(part * whole >= 0.0, "{triangle:?} is turned over");
            sum += part;
        }
        assert!((sum - whole).abs() < 1e-9 * whole.abs(), "{sum} of {whole}");
    }

    #[test]
    fn simple_polygons_are_covered_exactly() {
        assert_covered(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        // An arrow: its fan from corner 0 would lie outside.
        assert_covered(&[[0.0, 0.0], [2.0, 2.0], [0.0, 4.0], [1.0, 2.0]]);
        assert_covered(&[[1.0, 2.0], [0.0, 0.0], [2.0, 2.0], [0.0, 4.0]]);
        // A comb, with corners on straight edges.
        let mut comb = vec![[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]];
        for tooth in (0..10).rev() {
            let x = f64::from(tooth);
            comb.extend([[x + 0.9, 5.0], [x + 0.5, 5.0], [x + 0.1, 5.0], [x, 1.0]]);
        }
        assert_covered(&comb);
        comb.reverse();
        assert_covered(&comb);
        // A spiral.
        let arm = |from: f64, radius: f64| {
            (0..200).map(move |step| {
                let angle = f64::from(step) * 0.1 + from;
                [angle.cos() * (radius + f64::from(step) * 0.1), angle.sin() * (radius + f64::from(step) * 0.1)]
            })
        };
        let spiral: Vec<_> = arm(0.0, 2.0).chain(arm(0.0, 2.3).collect::<Vec<_>>().into_iter().rev()).collect();
        assert_covered(&spiral);
        // Two squares, one in the other, joined by a slit: a hole as most programs write it.
        assert_covered(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]);
    }

    #[test]
    fn random_stars_are_covered_exactly() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1u32 << 31)
        };
        for count in 4..200 {
            let star: Vec<_> = (0..count)
                .map(|corner| {
                    let angle = f64::from(corner) / f64::from(count) * std::f64::consts::TAU;
                    let radius = 0.1 + random();
                    [angle.cos() * radius, angle.sin() * radius]
                })
                .collect();
            assert_covered(&star);
        }
    }

    #[test]
    fn what_is_no_polygon_still_gives_two_triangles_fewer_than_corners() {
        for points in [
            &[[0.0; 2]; 7][..],
            &[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]],
            &[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]],
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        ] {
            let mut clipper = Clipper::default();
            let corners: Vec<_> = points.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
            let mut count = 0;
            clipper.triangulate(&corners, |_| count += 1);
            assert_eq!(count, points.len() - 2);
        }
    }

    #[test]
    fn the_work_for_a_hostile_polygon_is_bounded() {
        // A zigzag that crosses itself everywhere: without a bound, billions of tests.
        let corners: Vec<_> = (0..20_000)
            .map(|corner| DVec3::new(f64::from(corner * 7919 % 20_011), f64::from(corner * 104_729 % 20_021), 0.0))
            .collect();
        let mut count = 0;
        Clipper::default().triangulate(&corners, |_| count += 1);
        assert_eq!(count, corners.len() - 2);
    }
}
