//! How large a point's ball has to be, so that a surface sampled as it is around here has no hole.
//!
//! Corners of a point's Voronoi cell in its tangent plane are triangles with two neighbours, those of the Delaunay triangulation.
//! A ball as large as the largest bounding sphere of these is what a vertex of a mesh has: so the balls at a triangle's corners
//! cover it, and triangles cover all that is between points. In the plane neighbours lie in their true distance: a curved surface
//! counts as it is, not as its shadow.
//!
//! At the border of a surface, and around points that belong to none, there are triangles that no gap between samples explains.
//! Those larger than [`FAR`] times the spacing of the nearest neighbours *among each other* do not count. That spacing does
//! not know how far away they are, so an isolated point is as small as what it is nearest to.
//!
//! A triangle that is larger than that spacing shows a surface only where what is around lies in a plane, as between scan lines.
//! Around a lamp post, or in a tree, it does not: there each point only meets its nearest neighbours halfway. The few points of a lamp,
//! with a gap around and the next ones all on one side, are no larger than the lamp.

use super::nearest::{larger, smaller};
use glam::Vec3;

/// Balls larger than so many spacings do not count. Of evenly sampled surfaces none is, of points thrown at random next to none;
/// scan lines that are ten times as far apart as their points are still joined.
const FAR: f32 = 4.0;

/// Neighbours whose distances among each other make the spacing.
const AMONG: usize = 8;

/// What is around lies in a plane if it is off by no more than this, in the mean, of the size that it would give.
const FLAT: f32 = 0.2;
/// Balls that are larger than so many spacings must show that.
const BEYOND: f32 = 2.0;

/// And it is a plane rather than a line if it is at least so wide, in the mean.
const WIDE: f32 = 0.3;
/// So many points are not on a line by chance.
const MANY: usize = 8;

/// A point's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Size {
    pub(super) radius: f32,
    /// More neighbours might show a triangle that counts, or that one which counts is not there.
    pub(super) is_open: bool,
}

/// Corners of a Voronoi cell that are worked on at most; a cell's mean is six.
const MOST_CORNERS: usize = 32;

/// A corner, between the edge before it and the one after.
#[derive(Clone, Copy, Default)]
struct Corner {
    x: f32,
    y: f32,
    /// Which neighbour is across the edge that begins here; −1 for the frame.
    edge: i32,
}

/// The size of a point whose nearest neighbours, nearest first, are at these differences. `is_all`: there are no more.
pub(super) fn size(differences: &[Vec3], squares: &[f32], normal: Vec3, is_all: bool) -> Size {
    let Some(farthest) = squares.last().map(|square| square.sqrt()) else {
        return Size { radius: 0.0, is_open: false };
    };
    let spacing = spacing(differences, squares);
    let far = FAR * spacing;
    let (u, v) = normal.any_orthonormal_pair();
    let frame = 2.0 * far;
    let mut corners = Cell::new(frame);
    for (number, (difference, square)) in differences.iter().zip(squares).enumerate() {
        if square * 0.25 > corners.farthest_square {
            break;
        }
        let (x, y) = (difference.dot(u), difference.dot(v));
        let flat = x * x + y * y;
        // Steeper than 60°: of another layer.
        if flat * 4.0 < *square {
            continue;
        }
        let stretch = (square / flat).sqrt();
        corners.cut(x * stretch, y * stretch, *square * 0.5, number as i32);
    }
    let (mut radius, mut farthest_corner) = (0.0_f32, 0.0_f32);
    let corners = corners.corners();
    let mut before = corners.last().map_or(-1, |corner| corner.edge);
    for corner in corners {
        let distance = (corner.x * corner.x + corner.y * corner.y).sqrt();
        farthest_corner = larger(farthest_corner, smaller(distance, far));
        if before >= 0 && corner.edge >= 0 {
            let triangle = triangle(differences, squares, [before as usize, corner.edge as usize], distance);
            radius = larger(radius, if triangle <= far { triangle } else { 0.0 });
        }
        before = corner.edge;
        if corner.edge >= 0 {
            // Whom it shares an edge with, it meets halfway.
            let halfway = squares[corner.edge as usize].sqrt() * 0.5;
            radius = larger(radius, if halfway <= far { halfway } else { 0.0 });
        }
    }
    // Up to twice the spacing a sharp edge may look like a tree, and has no hole.
    if radius > BEYOND * spacing && !is_flat(differences, squares, normal, radius) {
        radius = 0.0;
    }
    // Where the plane is wrong, as on a thin ridge, neighbours are still met.
    let fourth = squares[squares.len().min(4) - 1].sqrt() * 0.5;
    radius = larger(radius, smaller(fourth, spacing));
    if let Some(cluster) = lone_cluster(differences, squares, normal) {
        radius = smaller(radius, cluster);
    }
    Size { radius, is_open: !is_all && farthest < 2.0 * farthest_corner }
}

/// Gaps are so many times as wide as what they are around.
const GAP: f32 = 3.0;

/// How far the mean of directions is from the centre where all are on one side: at a straight border it is 0.64.
const ONE_SIDE: f32 = 0.8;

/// Points of a lone cluster at most; and as many of those beyond the gap are asked where they are.
const CLUSTER: usize = 8;

/// How far the others of a few points are that are far from everything else, if the point is one of such.
fn lone_cluster(differences: &[Vec3], squares: &[f32], normal: Vec3) -> Option<f32> {
    let is_gap = |at: &usize| squares[*at] > squares[*at - 1] * (GAP * GAP);
    // The widest of what is near.
    let inside = (1..squares.len().min(CLUSTER)).rev().find(is_gap)?;
    let beyond = &differences[inside..differences.len().min(inside + CLUSTER)];
    let mean: Vec3 = beyond.iter().map(|difference| difference.normalize_or_zero()).sum::<Vec3>() / beyond.len() as f32;
    let is_lone = mean.length() > ONE_SIDE && !is_flat(differences, squares, normal, squares[inside].sqrt());
    is_lone.then(|| squares[inside - 1].sqrt())
}

/// True where neighbours that touch a ball of this size fill the plane across `normal`.
fn is_flat(differences: &[Vec3], squares: &[f32], normal: Vec3, radius: f32) -> bool {
    let near = squares.iter().take_while(|square| **square <= 4.0 * radius * radius).count();
    let (u, v) = normal.any_orthonormal_pair();
    let [mut off, mut uu, mut uv, mut vv] = [0.0_f32; 4];
    for difference in &differences[..near] {
        let (x, y, z) = (difference.dot(u), difference.dot(v), difference.dot(normal));
        (off, uu, uv, vv) = (off + z * z, uu + x * x, uv + x * y, vv + y * y);
    }
    // The lesser eigenvalue: how wide it is across the direction in which it is widest.
    let across = (uu + vv) * 0.5 - ((uu - vv) * (uu - vv) * 0.25 + uv * uv).sqrt();
    let unit = radius * radius * near as f32;
    off <= FLAT * FLAT * unit && (near < MANY || across >= WIDE * WIDE * unit)
}

/// Radius of the bounding sphere of the triangle that a point makes with two neighbours: half its longest edge where the angle
/// opposite is 90° or more, else that of the circle through them, whose centre is so far away.
fn triangle(differences: &[Vec3], squares: &[f32], [one, other]: [usize; 2], distance: f32) -> f32 {
    let (a, b, c) = (squares[one], squares[other], differences[one].distance_squared(differences[other]));
    let longest = larger(larger(a, b), c);
    if a + b + c - longest <= longest {
        return longest.sqrt() * 0.5;
    }
    // No more than that of an equilateral one with this edge.
    smaller(distance, longest.sqrt() * 0.577_350_3)
}

/// How far the nearest neighbours are from each other: the median of each one's distance to its third. Pairs that all but coincide
/// do not make it small, nor do two groups far apart make it large.
fn spacing(differences: &[Vec3], squares: &[f32]) -> f32 {
    let count = differences.len().min(AMONG);
    if count < 4 {
        return squares[0].sqrt();
    }
    // All at once, beside each other: the least three of each, and itself at zero.
    let lane = |axis: usize| -> [f32; AMONG] { std::array::from_fn(|at| differences[at.min(count - 1)][axis]) };
    let (x, y, z) = (lane(0), lane(1), lane(2));
    let mut least = [[f32::INFINITY; AMONG]; 4];
    for other in &differences[..count] {
        for at in 0..AMONG {
            let (x, y, z) = (x[at] - other.x, y[at] - other.y, z[at] - other.z);
            let mut square = x * x + y * y + z * z;
            for least in &mut least {
                let before = least[at];
                least[at] = if square < before { square } else { before };
                square = if square < before { before } else { square };
            }
        }
    }
    let thirds = &mut least[3][..count];
    thirds.sort_unstable_by(f32::total_cmp);
    thirds[count / 2].sqrt()
}

/// A convex polygon around the origin.
struct Cell {
    corners: [Corner; MOST_CORNERS],
    /// Those before the last cut.
    before: [Corner; MOST_CORNERS],
    len: usize,
    farthest_square: f32,
}

impl Cell {
    fn new(half: f32) -> Self {
        let corners = [Corner::default(); MOST_CORNERS];
        let mut cell = Self { corners, before: corners, len: 4, farthest_square: 2.0 * half * half };
        for (corner, (x, y)) in
            cell.corners.iter_mut().zip([(half, half), (-half, half), (-half, -half), (half, -half)])
        {
            *corner = Corner { x, y, edge: -1 };
        }
        cell
    }

    fn corners(&self) -> &[Corner] {
        &self.corners[..self.len]
    }

    /// Keeps what is no farther than `most` along (x, y).
    fn cut(&mut self, x: f32, y: f32, most: f32, edge: i32) {
        let beyond = |corner: &Corner| corner.x * x + corner.y * y - most;
        if self.len + 1 >= MOST_CORNERS || !self.corners().iter().any(|corner| beyond(corner) > 0.0) {
            return;
        }
        let count = self.len;
        self.before[..count].copy_from_slice(&self.corners[..count]);
        self.len = 0;
        self.farthest_square = 0.0;
        for at in 0..count {
            let (corner, next) = (&self.before[at], &self.before[if at + 1 == count { 0 } else { at + 1 }]);
            let (corner, next) = (*corner, *next);
            let (here, there) = (beyond(&corner), beyond(&next));
            let crossing = |edge| {
                let share = here / (here - there);
                Corner { x: corner.x + (next.x - corner.x) * share, y: corner.y + (next.y - corner.y) * share, edge }
            };
            if here <= 0.0 {
                self.push(corner);
                if there > 0.0 {
                    self.push(crossing(edge));
                }
            } else if there <= 0.0 {
                self.push(crossing(corner.edge));
            }
        }
    }

    fn push(&mut self, corner: Corner) {
        self.corners[self.len] = corner;
        self.len += 1;
        self.farthest_square = larger(self.farthest_square, corner.x * corner.x + corner.y * corner.y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sized(others: Vec<Vec3>, most: usize) -> Size {
        sized_across(others, most, Vec3::Z)
    }

    fn sized_across(mut others: Vec<Vec3>, most: usize, normal: Vec3) -> Size {
        others.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let is_all = others.len() <= most;
        others.truncate(most);
        let squares: Vec<f32> = others.iter().map(|d| d.length_squared()).collect();
        size(&others, &squares, normal, is_all)
    }

    fn grid(reach: i32, of: impl Fn(f32, f32) -> Vec3) -> Vec<Vec3> {
        let all = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y)));
        all.filter(|at| *at != (0, 0)).map(|(x, y)| of(x as f32, y as f32)).collect()
    }

    #[test]
    fn points_of_grids_reach_the_corners_of_their_cells() {
        let square = sized(grid(4, |x, y| Vec3::new(x, y, 0.0)), 16);
        assert!((square.radius - 0.5_f32.sqrt()).abs() < 1e-5 && !square.is_open, "{square:?}");
        let hexagonal = sized(grid(4, |x, y| Vec3::new(x + y * 0.5, y * 0.75_f32.sqrt(), 0.0)), 16);
        assert!((hexagonal.radius - (1.0_f32 / 3.0).sqrt()).abs() < 1e-5 && !hexagonal.is_open, "{hexagonal:?}");
        // Scan lines that are far apart take more neighbours to see.
        let lines = grid(40, |x, y| Vec3::new(x, y * 9.0, 0.0));
        assert!(sized(lines.clone(), 16).is_open);
        let seen = sized(lines, 64);
        assert!((seen.radius - (0.25_f32 + 20.25).sqrt()).abs() < 1e-4 && !seen.is_open, "{seen:?}");
    }

    #[test]
    fn borders_end_and_isolated_points_are_as_small_as_what_they_are_near() {
        let border = grid(4, |x, y| Vec3::new(x.abs(), y, 0.0) + Vec3::X * if x < 0.0 { 0.5 } else { 0.0 });
        let border = sized(border.into_iter().filter(|at| at.x >= 0.0 && at.x % 1.0 == 0.0).collect(), 16);
        assert!((border.radius - 0.5_f32.sqrt()).abs() < 1e-5, "{border:?}");
        for away in [20.0, 1000.0] {
            let lost = sized(grid(4, |x, y| Vec3::new(x, y, 0.0) + Vec3::new(away, 3.0, 2.0)), 16);
            assert!(lost.radius <= 2.0, "{away} {lost:?}");
        }
        assert_eq!(sized(vec![], 16).radius, 0.0);
        assert_eq!(sized(vec![Vec3::X], 16).radius, 0.5);
    }

    /// Few points above one another, over a ground that is sampled more densely, and a tree.
    #[test]
    fn points_that_show_no_surface_only_meet_their_nearest_neighbours() {
        let ground = |height: f32| grid(9, move |x, y| Vec3::new(x, y, -height));
        for (height, apart) in [(6.0, 3.0), (9.0, 4.0), (20.0, 6.0)] {
            let mut around = ground(height);
            around.push(Vec3::new(0.1, 0.0, apart));
            around.extend(
                (1..).map(|at| at as f32 * apart).take_while(|at| *at < height).map(|at| Vec3::new(0.0, 0.1, -at)),
            );
            // A lamp post has no plane: any normal may come of it.
            for normal in [Vec3::Z, Vec3::X, Vec3::new(0.6, 0.0, 0.8)] {
                let size = sized_across(around.clone(), 16, normal);
                assert!(size.radius <= apart * 1.5, "{height} {apart} {normal}: {size:?}");
            }
        }
        let mut state = 3u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        for _ in 0..200 {
            // One for each unit of volume: the nearest is 0.55 away in the mean.
            let tree: Vec<Vec3> = (0..512).map(|_| Vec3::new(random(), random(), random()) * 8.0).collect();
            let size = sized(tree, 16);
            assert!(size.radius <= 2.0, "{size:?}");
        }
    }

    #[test]
    fn a_lamp_is_no_larger_than_its_points_are_apart_and_pairs_on_a_surface_are_no_lamp() {
        let lamp = [Vec3::new(0.5, 0.0, 0.1), Vec3::new(0.2, 0.6, 0.0), Vec3::new(-0.3, 0.2, -0.2)];
        for height in [3.0, 10.0, 40.0] {
            let mut around = grid(9, |x, y| Vec3::new(x, y, -height));
            around.extend(lamp);
            for normal in [Vec3::Z, Vec3::X] {
                let size = sized_across(around.clone(), 16, normal);
                assert!(size.radius <= 0.7, "{height} {normal}: {size:?}");
            }
        }
        // Points that all but coincide, as two registered scans have them.
        let mut pairs = grid(4, |x, y| Vec3::new(x, y, 0.0));
        pairs.extend(grid(4, |x, y| Vec3::new(x, y + 0.01, 0.0)));
        pairs.push(Vec3::new(0.0, 0.01, 0.0));
        let size = sized(pairs, 64);
        assert!(size.radius >= 0.7, "{size:?}");
    }

    proptest! {
        /// Whatever is between points is covered: where there is one at random in each square, all; where all are at random, nearly.
        #[test]
        fn scattered_points_cover_what_is_between_them(seed in any::<u64>(), is_even in any::<bool>()) {
            let mut state = seed | 1;
            let mut random = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 40) as f32 / (1 << 24) as f32
            };
            let mut point = |number: i32| {
                let (x, y) = (random(), random());
                let square = Vec3::new((number % 30) as f32, (number / 30) as f32, 0.0);
                if is_even { square + Vec3::new(x, y, 0.0) } else { Vec3::new(x, y, 0.0) * 30.0 }
            };
            let points: Vec<Vec3> = (0..900).map(&mut point).collect();
            let radii: Vec<f32> = points
                .iter()
                .map(|point| {
                    let others = points.iter().filter(|other| *other != point).map(|other| *other - *point);
                    let all: Vec<Vec3> = others.collect();
                    let size = sized(all.clone(), 16);
                    if size.is_open { sized(all, 64).radius } else { size.radius }
                })
                .collect();
            let is_covered =
                |at: Vec3| points.iter().zip(&radii).any(|(point, radius)| point.distance(at) <= radius * 1.0001);
            let sample = |_| Vec3::new(3.0 + random() * 24.0, 3.0 + random() * 24.0, 0.0);
            let uncovered: Vec<Vec3> = (0..500).map(sample).filter(|at| !is_covered(*at)).collect();
            prop_assert!(uncovered.len() <= if is_even { 0 } else { 2 }, "{uncovered:?}");
        }
    }
}
