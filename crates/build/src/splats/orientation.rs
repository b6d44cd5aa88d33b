//! Is a mesh closed and consistently oriented, with its outside outside?
//!
//! Edges stream by once; nothing is kept but 192 bits. Each directed edge adds a pseudo-random 128-bit number that depends on
//! its two vertices, and its opposite subtracts the same number: the sum is zero when every edge is passed as often one way as
//! the other, and for any other mesh with probability 2⁻¹²⁸ a hit. The enclosed volume must be positive.

use glam::DVec3;

/// Collects triangles, anywhere in any order; ask [`Orientation::is_closed`] at the end.
#[derive(Default)]
pub(super) struct Orientation {
    balance: u128,
    six_volumes: f64,
}

impl Orientation {
    /// Adds a triangle by its vertex numbers and corners, the latter relative to a fixed point near the mesh.
    pub(super) fn add(&mut self, vertices: [u32; 3], [a, b, c]: [DVec3; 3]) {
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (from, to) = (vertices[from], vertices[to]);
            let weight = mix(u64::from(from.min(to)) << 32 | u64::from(from.max(to)));
            // A degenerate triangle's edge from a vertex to itself is its own opposite.
            match from.cmp(&to) {
                std::cmp::Ordering::Less => self.balance = self.balance.wrapping_add(weight),
                std::cmp::Ordering::Equal => {}
                std::cmp::Ordering::Greater => self.balance = self.balance.wrapping_sub(weight),
            }
        }
        self.six_volumes += a.dot(b.cross(c));
    }

    /// Adds what another has collected.
    pub(super) fn merge(&mut self, other: &Self) {
        self.balance = self.balance.wrapping_add(other.balance);
        self.six_volumes += other.six_volumes;
    }

    pub(super) fn is_closed(&self) -> bool {
        self.balance == 0 && self.six_volumes > 0.0
    }
}

/// Two rounds of SplitMix64's finaliser (Steele et al., OOPSLA 2014) with different increments.
fn mix(key: u64) -> u128 {
    let half = |increment: u64| {
        let mut z = key.wrapping_add(increment);
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    };
    u128::from(half(0x9e37_79b9_7f4a_7c15)) << 64 | u128::from(half(half(0x2545_f491_4f6c_dd1d)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    fn closed(triangles: &[[u32; 3]]) -> bool {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let mut orientation = Orientation::default();
        for triangle in triangles {
            orientation.add(*triangle, triangle.map(|v| corners[v as usize]));
        }
        orientation.is_closed()
    }

    #[test]
    fn only_a_closed_outward_surface_is_closed() {
        assert!(closed(&TETRAHEDRON));
        assert!(!closed(&TETRAHEDRON[..3]), "open");
        assert!(!closed(&TETRAHEDRON.map(|[a, b, c]| [a, c, b])), "inside out");
        let mut one_turned = TETRAHEDRON;
        one_turned[2].swap(0, 1);
        assert!(!closed(&one_turned), "one triangle turned");
        assert!(closed(&[&TETRAHEDRON[..], &[[3, 3, 1], [2, 2, 2]]].concat()), "degenerate triangles change nothing");
    }
}
