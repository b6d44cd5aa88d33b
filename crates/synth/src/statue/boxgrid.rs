//! The closed mesh under a statue: the surface of a box of `a` × `b` × `c` cells, two triangles per square.
//!
//! Takes a wanted number of triangles; gives, for any vertex number, its place on the box, and for any triangle number,
//! its three vertices, both without tables. Vertices on edges and corners of the box are shared.
//!
//! Numbers run from the bottom up: the bottom lid row by row, then ring by ring around the sides, then the top lid. A
//! triangle's vertices are at most one row or ring apart.
//!
//! Always holds: every directed edge occurs once and so does its opposite (closed, oriented outwards).

/// A box, by its numbers of cells along x, z and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BoxGrid {
    /// Cells along x.
    a: u64,
    /// Cells along z.
    b: u64,
    /// Cells along y.
    c: u64,
}

impl BoxGrid {
    /// The nearly cubic box whose triangles are nearest to `triangles`; at least 12.
    ///
    /// `weights` are the wished-for relative numbers of cells along x, z and y.
    pub(crate) fn nearest(triangles: u64, weights: [f64; 3]) -> Self {
        let [wa, wb, wc] = weights;
        let squares = triangles as f64 / 4.0;
        let unit = (squares / (wa * wb + wb * wc + wc * wa)).sqrt();
        let mut best = (f64::INFINITY, Self { a: 1, b: 1, c: 1 });
        let around = |weight: f64| {
            let middle = (weight * unit) as u64;
            middle.saturating_sub(6).max(1)..=middle + 6
        };
        for a in around(wa) {
            for c in around(wc) {
                // ab + bc + ca = squares, solved for b, and both whole numbers next to it.
                let b = ((squares - (a * c) as f64) / (a + c) as f64).max(1.0) as u64;
                for b in [b, b + 1] {
                    let grid = Self { a, b, c };
                    let off = (grid.triangles() as f64 - triangles as f64).abs() / triangles.max(1) as f64;
                    let shape = |cells: u64, weight: f64| (cells as f64 - weight * unit).abs() / (weight * unit);
                    // Among counts within 0.4 % the shape decides.
                    let cost = off + 1e4 * (off - 0.004).max(0.0) + shape(a, wa) + shape(b, wb) + shape(c, wc);
                    if cost < best.0 {
                        best = (cost, grid);
                    }
                }
            }
        }
        best.1
    }

    /// Triangles on all six sides.
    pub(crate) fn triangles(&self) -> u64 {
        4 * (self.a * self.b + self.b * self.c + self.c * self.a)
    }

    /// Vertices, each counted once.
    pub(crate) fn vertices(&self) -> u64 {
        self.triangles() / 2 + 2
    }

    /// Cells along x, z and y.
    pub(crate) fn cells(&self) -> [u64; 3] {
        [self.a, self.b, self.c]
    }

    fn lid(&self) -> u64 {
        (self.a + 1) * (self.b + 1)
    }

    fn ring(&self) -> u64 {
        2 * (self.a + self.b)
    }

    /// Where on a ring its `step`-th vertex lies, as (x, z); counter-clockwise seen from above, from (0, b) along the
    /// front (+z) first.
    fn ring_place(&self, step: u64) -> [u64; 2] {
        let (a, b) = (self.a, self.b);
        if step < a {
            [step, b]
        } else if step < a + b {
            [a, b - (step - a)]
        } else if step < 2 * a + b {
            [a - (step - a - b), 0]
        } else {
            [0, step - 2 * a - b]
        }
    }

    /// Place on the box of a vertex: cells from the corner of least coordinates, along x, z, y.
    pub(crate) fn place(&self, vertex: u64) -> [u64; 3] {
        let lid = self.lid();
        let below_top = lid + (self.c - 1) * self.ring();
        if vertex < lid {
            [vertex % (self.a + 1), vertex / (self.a + 1), 0]
        } else if vertex < below_top {
            let (layer, step) = ((vertex - lid) / self.ring(), (vertex - lid) % self.ring());
            let [x, z] = self.ring_place(step);
            [x, z, layer + 1]
        } else {
            let vertex = vertex - below_top;
            [vertex % (self.a + 1), vertex / (self.a + 1), self.c]
        }
    }

    /// Number of the vertex that is the `step`-th (modulo the ring) on the ring at height `layer`.
    fn ring_vertex(&self, layer: u64, step: u64) -> u64 {
        let step = step % self.ring();
        if layer == 0 || layer == self.c {
            let [x, z] = self.ring_place(step);
            self.lid_vertex(layer, x, z)
        } else {
            self.lid() + (layer - 1) * self.ring() + step
        }
    }

    fn lid_vertex(&self, layer: u64, x: u64, z: u64) -> u64 {
        let first = if layer == 0 { 0 } else { self.lid() + (self.c - 1) * self.ring() };
        first + z * (self.a + 1) + x
    }

    /// The vertices of a triangle, counter-clockwise seen from outside.
    pub(crate) fn triangle(&self, triangle: u64) -> [u32; 3] {
        let (square, second) = (triangle / 2, triangle % 2 == 1);
        let lid_squares = self.a * self.b;
        let side_squares = self.ring() * self.c;
        let [v0, v1, v2, v3] = if square < lid_squares {
            // Seen from below, x to the right means z upwards.
            self.lid_square(0, square, [[0, 0], [1, 0], [1, 1], [0, 1]])
        } else if square < lid_squares + side_squares {
            let square = square - lid_squares;
            let (layer, step) = (square / self.ring(), square % self.ring());
            [(layer, step), (layer, step + 1), (layer + 1, step + 1), (layer + 1, step)]
                .map(|(layer, step)| self.ring_vertex(layer, step))
        } else {
            self.lid_square(self.c, square - lid_squares - side_squares, [[0, 0], [0, 1], [1, 1], [1, 0]])
        }
        .map(|vertex| vertex as u32);
        // Alternating diagonals: no direction is favoured.
        match (square % 2 == 0, second) {
            (true, false) => [v0, v1, v2],
            (true, true) => [v0, v2, v3],
            (false, false) => [v0, v1, v3],
            (false, true) => [v1, v2, v3],
        }
    }

    fn lid_square(&self, layer: u64, square: u64, corners: [[u64; 2]; 4]) -> [u64; 4] {
        let (x, z) = (square % self.a, square / self.a);
        corners.map(|[dx, dz]| self.lid_vertex(layer, x + dx, z + dz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_directed_edge_occurs_once_with_its_opposite() {
        for (a, b, c) in [(1, 1, 1), (2, 1, 1), (1, 3, 2), (4, 3, 5), (1, 1, 6), (7, 5, 1)] {
            let grid = BoxGrid { a, b, c };
            let mut edges = HashSet::new();
            for triangle in 0..grid.triangles() {
                let [i, j, k] = grid.triangle(triangle);
                for edge in [(i, j), (j, k), (k, i)] {
                    assert!(edges.insert(edge), "{edge:?} twice in {grid:?}");
                }
            }
            assert!(edges.iter().all(|&(i, j)| edges.contains(&(j, i))), "{grid:?} is open");
            let used: HashSet<_> = edges.iter().map(|edge| edge.0).collect();
            assert_eq!(used.len() as u64, grid.vertices());
        }
    }

    #[test]
    fn every_vertex_has_its_own_place_on_the_surface() {
        let grid = BoxGrid { a: 4, b: 3, c: 5 };
        let places: HashSet<_> = (0..grid.vertices()).map(|vertex| grid.place(vertex)).collect();
        assert_eq!(places.len() as u64, grid.vertices());
        for [x, z, y] in places {
            assert!(x <= 4 && z <= 3 && y <= 5);
            assert!(x == 0 || x == 4 || z == 0 || z == 3 || y == 0 || y == 5);
        }
    }

    #[test]
    fn triangles_of_the_box_face_outwards() {
        let grid = BoxGrid { a: 3, b: 2, c: 4 };
        let mut volume_6 = 0.0;
        for triangle in 0..grid.triangles() {
            let [p, q, r] = grid.triangle(triangle).map(|vertex| {
                let [x, z, y] = grid.place(u64::from(vertex));
                glam::DVec3::new(x as f64, y as f64, z as f64)
            });
            volume_6 += p.dot(q.cross(r));
        }
        assert_eq!(volume_6, 6.0 * 24.0);
    }

    #[test]
    fn the_count_is_met_within_one_percent_from_a_thousand_to_billions() {
        let mut n = 1_000_u64;
        while n < 4_000_000_000 {
            for weights in [[1.0, 1.0, 1.0], [1.1, 0.9, 1.3]] {
                let found = BoxGrid::nearest(n, weights).triangles();
                assert!((found as f64 / n as f64 - 1.0).abs() < 0.01, "{n}: {found}");
            }
            n = n * 21 / 20 + 7;
        }
        for n in [0, 1, 12, 13, 20, 50, 100, 500] {
            let found = BoxGrid::nearest(n, [1.0; 3]).triangles();
            assert!(found >= 12 && found.abs_diff(n) <= 12.max(n / 20), "{n}: {found}");
        }
    }
}
