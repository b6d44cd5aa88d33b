//! From the corners of a polygon or strip, one after the other, to triangles.
//!
//! In: vertex numbers. Out: at most one triangle for each. Nothing is collected, so a polygon of any size takes two numbers.

/// How corners make triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topology {
    /// `a b c d …` are `abc acd …`.
    Fan,
    /// `a b c d …` are `abc cbd cde …`; triangles with a repeated corner only steer the strip and are dropped.
    Strip,
}

/// The corners that the next triangle shares with those before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corners {
    pair: [u32; 2],
    /// Since the start, or the last restart.
    seen: u64,
}

impl Corners {
    /// Adds a corner and returns the triangle that it completes.
    #[inline]
    pub(super) fn add(&mut self, topology: Topology, corner: u32) -> Option<[u32; 3]> {
        let [a, b] = self.pair;
        let seen = self.seen;
        self.seen += 1;
        if seen == 0 {
            self.pair[0] = corner;
            return None;
        }
        let turned = seen % 2 == 1;
        self.pair = match topology {
            Topology::Strip if seen > 1 => [b, corner],
            _ => [a, corner],
        };
        match topology {
            _ if seen == 1 => None,
            Topology::Fan => Some([a, b, corner]),
            Topology::Strip if a == b || b == corner || a == corner => None,
            Topology::Strip if turned => Some([b, a, corner]),
            Topology::Strip => Some([a, b, corner]),
        }
    }

    /// Starts over.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(topology: Topology, corners: &[u32]) -> Vec<[u32; 3]> {
        let mut state = Corners::default();
        corners.iter().filter_map(|&corner| state.add(topology, corner)).collect()
    }

    #[test]
    fn a_polygon_becomes_a_fan_around_its_first_corner() {
        assert_eq!(triangles(Topology::Fan, &[9, 1]), [[0; 3]; 0]);
        assert_eq!(triangles(Topology::Fan, &[9, 1, 2, 3, 4]), [[9, 1, 2], [9, 2, 3], [9, 3, 4]]);
        assert_eq!(triangles(Topology::Fan, &[5, 5, 6]), [[5, 5, 6]], "the builder decides about degenerate ones");
    }

    #[test]
    fn a_strip_turns_every_second_triangle_and_drops_the_degenerate() {
        assert_eq!(triangles(Topology::Strip, &[0, 1, 2, 3, 4]), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        // A doubled corner turns the corner without a restart; the winding follows the position in the strip.
        assert_eq!(triangles(Topology::Strip, &[0, 1, 2, 2, 3, 4]), [[0, 1, 2], [3, 2, 4]]);
    }
}
