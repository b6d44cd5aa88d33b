//! Cuts a triangle into cells no larger than the spacing, and gives each cell a ball that covers it.
//!
//! In: three corners and a spacing. Out: cells, by row and strip. Rows are parallel to the longest edge, equally high; each is cut
//! at right angles into equally wide strips. A row gets narrower upwards on both sides, since the angles at the longest edge are
//! acute, so its lower side is as wide as it.
//!
//! Why a diced triangle has no hole, whatever its neighbours are: it is the union of its rows, a row that of its cells, as
//! neighbouring cells compute their common border from the same numbers; a cell is convex, and its ball, centred in it, reaches
//! its farthest corner. So the triangle lies within the union of its own balls. Nothing hangs on what is across its edges: where a
//! neighbour is cut more finely or not at all, neither leaves anything for the other to cover.

use glam::DVec3;

/// A triangle in its own plane: x along its longest edge, y towards the corner above.
#[derive(Clone, Debug)]
pub(in super::super) struct Grid {
    start: DVec3,
    along: DVec3,
    up: DVec3,
    length: f64,
    height: f64,
    /// Where the corner above is, along the longest edge: from 0 to `length`.
    foot: f64,
    /// Which corners of the triangle start and end the longest edge, and which is above.
    corners: [usize; 3],
    spacing: f64,
    rows: u32,
    /// More than what rounding may have moved anything by.
    slack: f64,
}

/// A cell.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Cell {
    /// In the space of the corners.
    pub(in super::super) center: DVec3,
    /// Of a ball around the centre that covers the cell.
    pub(in super::super) radius: f64,
    /// The rectangle around it, in the triangle's plane; the centre is in its middle.
    pub(in super::super) min: [f64; 2],
    pub(in super::super) max: [f64; 2],
}

impl Grid {
    /// Corners are finite; the spacing is positive.
    pub(in super::super) fn new(points: [DVec3; 3], spacing: f64) -> Self {
        let square = |from: usize| points[from].distance_squared(points[(from + 1) % 3]);
        let first = (0..3).fold(0, |best, edge| if square(edge) > square(best) { edge } else { best });
        let corners = [first, (first + 1) % 3, (first + 2) % 3];
        let [start, end, above] = corners.map(|corner| points[corner]);
        let length = start.distance(end);
        let along = if length > 0.0 { (end - start) / length } else { DVec3::X };
        let to_above = above - start;
        let foot = to_above.dot(along).clamp(0.0, length);
        let across = to_above - along * foot;
        let height = across.length();
        let up = if height > 0.0 { across / height } else { DVec3::ZERO };
        let size = points.iter().fold(DVec3::ZERO, |size, point| size.max(point.abs())).max_element();
        let rows = count_of(height, spacing);
        Self { start, along, up, length, height, foot, corners, spacing, rows, slack: size * 1e-14 }
    }

    pub(in super::super) fn rows(&self) -> u32 {
        self.rows
    }

    /// Cells of a row.
    pub(in super::super) fn strips(&self, row: u32) -> u32 {
        let [left, right] = self.ends(f64::from(row) / f64::from(self.rows));
        count_of(right - left, self.spacing)
    }

    /// All cells.
    pub(in super::super) fn cells(&self) -> u64 {
        (0..self.rows).map(|row| u64::from(self.strips(row))).sum()
    }

    /// Where a line at a share of the height enters and leaves the triangle.
    fn ends(&self, share: f64) -> [f64; 2] {
        [self.foot * share, self.length + (self.foot - self.length) * share]
    }

    pub(in super::super) fn cell(&self, row: u32, strip: u32) -> Cell {
        let rows = f64::from(self.rows);
        let (low, high) = (f64::from(row) / rows, f64::from(row + 1) / rows);
        let [left, right] = self.ends(low);
        let [upper_left, upper_right] = self.ends(high);
        let strips = f64::from(count_of(right - left, self.spacing));
        let x_at = |strip: u32| left + (right - left) * (f64::from(strip) / strips);
        let (from, to) = (x_at(strip), x_at(strip + 1));
        // How far the row reaches up at x, as a share of the row.
        let top = |x: f64| {
            let on_left = if x < upper_left { (x - left) / (upper_left - left) } else { 1.0 };
            let on_right = if x > upper_right { (right - x) / (right - upper_right) } else { 1.0 };
            on_left.min(on_right).clamp(0.0, 1.0)
        };
        let y_at = |share: f64| self.height * (low + (high - low) * share);
        // Where the upper border bends, within the cell.
        let bends = [upper_left.clamp(from, to), upper_right.clamp(from, to)];
        let highest = [from, to, bends[0], bends[1]].into_iter().map(top).fold(0.0, f64::max);
        let (min, max) = ([from, y_at(0.0)], [to, y_at(highest)]);
        let [x, y] = [(min[0] + max[0]) * 0.5, (min[1] + max[1]) * 0.5];
        let reach = |at: f64, share: f64| (at - x) * (at - x) + (y_at(share) - y) * (y_at(share) - y);
        let lower = reach(from, 0.0).max(reach(to, 0.0));
        let square = [from, to, bends[0], bends[1]].into_iter().map(|at| reach(at, top(at))).fold(lower, f64::max);
        Cell { center: self.at(x, y), radius: square.sqrt() * (1.0 + 1e-12) + self.slack, min, max }
    }

    fn at(&self, x: f64, y: f64) -> DVec3 {
        self.start + self.along * x + self.up * y
    }

    /// Weights of the triangle's corners at a place of its plane.
    pub(in super::super) fn weights(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let above = if self.height > 0.0 { y / self.height } else { 0.0 };
        let end = if self.length > 0.0 { (x - self.foot * above) / self.length } else { 0.0 };
        let mut weights = [0.0; 3];
        for (corner, weight) in self.corners.into_iter().zip([1.0 - end - above, end, above]) {
            weights[corner] = weight;
        }
        weights
    }

    /// How what is linear in the triangle, given at its corners, grows along x and along y.
    pub(in super::super) fn gradient(&self, values: [[f64; 2]; 3]) -> [[f64; 2]; 2] {
        let [start, end, above] = self.corners.map(|corner| values[corner]);
        let along =
            std::array::from_fn(|axis| if self.length > 0.0 { (end[axis] - start[axis]) / self.length } else { 0.0 });
        let up = std::array::from_fn(|axis| {
            let below: f64 = start[axis] + along[axis] * self.foot;
            if self.height > 0.0 { (above[axis] - below) / self.height } else { 0.0 }
        });
        [along, up]
    }
}

/// Parts of a length, none longer than the spacing.
fn count_of(length: f64, spacing: f64) -> u32 {
    // Casting saturates; so many cells are never asked for.
    ((length / spacing).ceil() as u32).clamp(1, u32::MAX - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cells(grid: &Grid) -> Vec<Cell> {
        (0..grid.rows()).flat_map(|row| (0..grid.strips(row)).map(move |strip| grid.cell(row, strip))).collect()
    }

    proptest! {
        #[test]
        fn every_point_of_a_triangle_lies_within_its_balls_and_no_ball_is_larger_than_a_square(
            corners in prop::array::uniform3(prop::array::uniform3(-1f64..1.0)),
            thin in 0i32..12, exponent in -9i32..9, offset in -1e3f64..1e3, spacing in 0.01f64..3.0,
            samples in prop::collection::vec((0f64..1.0, 0f64..1.0), 200),
        ) {
            let (unit, thin) = (libm::exp10(f64::from(exponent)), libm::exp10(-f64::from(thin)));
            let [a, b, c] = corners.map(|[x, y, z]| {
                DVec3::new(x + offset, 0.7 * x + y * thin, z * thin - 0.4 * x) * unit
            });
            let spacing = spacing * unit;
            let grid = Grid::new([a, b, c], spacing);
            let all = cells(&grid);
            prop_assert_eq!(all.len() as u64, grid.cells());
            // Half the diagonal of a square, but for what rounding needs far from the origin.
            let most = spacing * std::f64::consts::FRAC_1_SQRT_2 * (1.0 + 1e-9) + 2e-11 * unit;
            prop_assert!(all.iter().all(|cell| cell.radius <= most));
            // Corners, edges, and within.
            let edges = samples.iter().take(60).map(|(u, _)| (*u, 0.0)).chain(samples.iter().take(60).map(|(u, _)| (*u, 1.0 - u)));
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].into_iter().chain(edges).chain(samples.iter().copied()) {
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let point = a + (b - a) * u + (c - a) * v;
                prop_assert!(all.iter().any(|cell| cell.center.distance(point) <= cell.radius), "{point}");
            }
            for cell in &all {
                let weights = grid.weights([(cell.min[0] + cell.max[0]) * 0.5, (cell.min[1] + cell.max[1]) * 0.5]);
                let [wa, wb, wc] = weights;
                prop_assert!(weights.iter().all(|weight| *weight > -1e-9), "the centre is in the triangle");
                prop_assert!((a * wa + b * wb + c * wc).distance(cell.center) < 1e-11 * unit.max(offset.abs() * unit));
            }
        }
    }

    #[test]
    fn cells_are_about_as_many_as_squares_of_the_spacing_fit() {
        let square = [DVec3::ZERO, DVec3::X * 100.0, DVec3::Y * 100.0];
        let count = Grid::new(square, 1.0).cells();
        assert!((5000..5400).contains(&count), "{count}");
        // A needle is a row, a point a cell.
        assert_eq!(Grid::new([DVec3::ZERO, DVec3::X * 100.0, DVec3::new(50.0, 1e-3, 0.0)], 1.0).cells(), 100);
        assert_eq!(Grid::new([DVec3::ONE; 3], 1.0).cells(), 1);
    }
}
