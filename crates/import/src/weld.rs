//! Joins corners of a soup at the same position, in bounded memory.
//!
//! In: positions of corners in file order. Out: vertex numbers; new positions become vertices.
//!
//! What always holds: two corners get the same vertex only where their positions are equal (0 and −0 are). The other way
//! around it holds for the last quarter million vertices or so: a position that comes again much later becomes another
//! vertex. Programs write neighbours close together, so few are missed.

/// Sets of the table.
const SETS: usize = 1 << 16;
/// Vertices of a set.
const WAYS: usize = 4;

pub(crate) struct Weld {
    /// Position and vertex number plus one, newest first; 0 is an empty entry.
    table: Vec<[Entry; WAYS]>,
    /// Vertices so far.
    count: u64,
}

#[derive(Clone, Copy, Default)]
struct Entry {
    position: [u32; 3],
    vertex: u32,
}

impl Weld {
    pub(crate) fn new() -> Self {
        Self { table: vec![[Entry::default(); WAYS]; SETS], count: 0 }
    }

    /// The vertex at a position, which is finite, and whether it is a new one; none where there would be 2³² − 1.
    #[inline]
    pub(crate) fn vertex(&mut self, position: [f32; 3]) -> Option<(u32, bool)> {
        let key = position.map(|value| (value + 0.0).to_bits());
        let set = &mut self.table[hash(key)];
        if let Some(way) = set.iter().position(|entry| entry.vertex != 0 && entry.position == key) {
            let vertex = set[way].vertex - 1;
            set[..=way].rotate_right(1);
            return Some((vertex, false));
        }
        let vertex = u32::try_from(self.count).ok().filter(|&vertex| vertex < u32::MAX - 1)?;
        self.count += 1;
        set.rotate_right(1);
        set[0] = Entry { position: key, vertex: vertex + 1 };
        Some((vertex, true))
    }
}

fn hash([x, y, z]: [u32; 3]) -> usize {
    let mixed = u64::from(x).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ u64::from(y).wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(21)
        ^ u64::from(z).wrapping_mul(0x1656_67b1_9e37_79f9).rotate_left(42);
    (mixed.wrapping_mul(0xd6e8_feb8_6659_fd93) >> 48) as usize % SETS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_are_one_vertex_and_others_are_not() {
        let mut weld = Weld::new();
        assert_eq!(weld.vertex([1.0, 2.0, 3.0]), Some((0, true)));
        assert_eq!(weld.vertex([3.0, 2.0, 1.0]), Some((1, true)));
        assert_eq!(weld.vertex([1.0, 2.0, 3.0]), Some((0, false)));
        assert_eq!(weld.vertex([0.0, 0.0, 0.0]), Some((2, true)), "an empty entry is no vertex at the origin");
        assert_eq!(weld.vertex([-0.0, 0.0, -0.0]), Some((2, false)));
        assert_eq!(weld.count, 3);
    }

    #[test]
    fn a_regular_grid_is_welded_within_a_wide_window() {
        let mut weld = Weld::new();
        let place = |x: u32, y: u32| [x as f32 * 0.25, y as f32 * 0.5, 7.0];
        let mut vertices = 0;
        // Rows of a thousand: a corner comes again a thousand vertices later.
        for y in 0..300 {
            for x in 0..1000 {
                for (dx, dy) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                    vertices += u64::from(weld.vertex(place(x + dx, y + dy)).unwrap().1);
                }
            }
        }
        assert_eq!((vertices, weld.count), (1001 * 301, 1001 * 301));
    }
}
