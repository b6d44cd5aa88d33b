//! Is a mesh closed and consistently oriented, with its outside outside?
//!
//! Edges stream by once; nothing is kept but three numbers. Each directed edge adds a pseudo-random 64-bit number that depends on
//! its two vertices, and its opposite subtracts the same number: the sum is zero when every edge is passed as often one way as
//! the other, and for any other mesh with probability 2⁻⁶⁴ a hit. The enclosed volume must be positive, by more than rounding.

/// Collects triangles, anywhere in any order; ask [`Orientation::is_closed`] at the end.
#[derive(Default)]
pub(crate) struct Orientation {
    balance: u64,
    six_volumes: f64,
    /// Sum of the absolute volumes.
    volumes: f64,
}

/// Volumes are measured in `f32`; what sums to less than this share of their absolute values may be nothing.
const ROUNDING: f64 = 1e-5;

impl Orientation {
    /// Adds a triangle by its vertex numbers, and six times the volume of the tetrahedron that it makes with a fixed point near the
    /// mesh.
    pub(crate) fn add(&mut self, [a, b, c]: [u32; 3], six_volumes: f32) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let weight = mix(u64::from(from.min(to)) << 32 | u64::from(from.max(to)));
            // A degenerate triangle's edge from a vertex to itself is its own opposite.
            let signed = if from < to { weight } else { weight.wrapping_neg() };
            self.balance = self.balance.wrapping_add(if from == to { 0 } else { signed });
        }
        self.six_volumes += f64::from(six_volumes);
        self.volumes += f64::from(six_volumes.abs());
    }

    /// Adds what another has collected.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.balance = self.balance.wrapping_add(other.balance);
        self.six_volumes += other.six_volumes;
        self.volumes += other.volumes;
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.balance == 0 && self.six_volumes > self.volumes * ROUNDING
    }
}

/// SplitMix64's finaliser (Steele et al., OOPSLA 2014).
fn mix(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    fn closed(triangles: &[[u32; 3]]) -> bool {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mut orientation = Orientation::default();
        for triangle in triangles {
            let [a, b, c] = triangle.map(|v| corners[v as usize]);
            orientation.add(*triangle, a.dot(b.cross(c)));
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
