//! A child sphere relative to its decoded parent, in 13 bits.
//!
//! In the cube around the parent, cut into 13³ cells, a child is the ball in a sub-cube of s × s × s cells (s = 1..13): its
//! radius is s/13 of the parent's and its centre a multiple of 1/13 of the parent's diameter. Of the 8,281 sub-cubes those
//! whose circumscribed ball touches the parent count: 7,621 codes, ordered by (s, x, y, z).
//!
//! What always holds: a child's decoded sphere encloses its true one ([`encode`] rounds up until it does), it is computed
//! from its parent's *decoded* sphere in `f32` with one multiplication and one addition per coordinate, no fused ones, so
//! every machine decodes the same spheres; and s = 13 is the parent itself, so a code always exists. A decoded child may
//! overhang its decoded parent.
//!
//! Source: the splats paper, section 3.1, "Position and radius".

use crate::Sphere;
use glam::Vec3;
use std::sync::LazyLock;

/// Cells along an edge.
pub const GRID: usize = 13;
/// Number of codes.
pub const CODES: usize = 7621;
/// The code of the parent itself: the root's.
pub const SELF: u16 = CODES as u16 - 1;

/// Centre and radius of a code in units of the parent's radius, relative to the parent's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relative {
    /// Offset of the centre.
    pub offset: Vec3,
    /// Radius: `cells / 13`.
    pub scale: f32,
}

/// The sub-cube of a code: its edge in cells, 1–13, and its lower corner, each coordinate 0 to 13 less the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// Edge.
    pub edge: u8,
    /// Lower corner.
    pub corner: [u8; 3],
}

impl Cells {
    /// Twice the centre's offset from the parent's centre on an axis, in cells: −12 to 12.
    pub fn doubled_offset(self, axis: usize) -> i32 {
        2 * i32::from(self.corner[axis]) + i32::from(self.edge) - GRID as i32
    }
}

struct Tables {
    relative: Vec<Relative>,
    cells: Vec<Cells>,
    /// Code of each sub-cube by (s, x, y, z), or `NONE`.
    code: Vec<u16>,
    /// Where the sub-cubes of edge s begin in `code`.
    first: [usize; GRID + 1],
}

const NONE: u16 = u16::MAX;

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let mut tables =
        Tables { relative: Vec::with_capacity(CODES), cells: Vec::new(), code: Vec::new(), first: [0; GRID + 1] };
    for s in 1..=GRID {
        tables.first[s] = tables.code.len();
        let places = GRID + 1 - s;
        for corner in 0..places * places * places {
            let corner = [corner / (places * places), corner / places % places, corner % places];
            // Centre in 1/13 of the parent's radius: an integer, so the condition is decided exactly.
            let center = corner.map(|at| 2 * at as i64 + s as i64 - GRID as i64);
            let squared: i64 = center.iter().map(|c| c * c).sum();
            let reach = GRID as f64 + 3f64.sqrt() * s as f64;
            tables.code.push(if squared as f64 <= reach * reach { tables.relative.len() as u16 } else { NONE });
            if squared as f64 <= reach * reach {
                tables.cells.push(Cells { edge: s as u8, corner: corner.map(|at| at as u8) });
                tables.relative.push(Relative {
                    offset: Vec3::from_array(center.map(|c| c as f32 / GRID as f32)),
                    scale: s as f32 / GRID as f32,
                });
            }
        }
    }
    tables
});

/// All codes' spheres relative to a unit parent, in code order.
pub fn table() -> &'static [Relative] {
    &TABLES.relative
}

/// The sub-cubes of all codes, in code order.
pub fn cells_table() -> &'static [Cells] {
    &TABLES.cells
}

/// The code of a sub-cube; `None` where it does not touch the parent, or is no sub-cube at all.
pub fn code_of(cells: Cells) -> Option<u16> {
    let edge = usize::from(cells.edge);
    if !(1..=GRID).contains(&edge) {
        return None;
    }
    let places = GRID + 1 - edge;
    let [x, y, z] = cells.corner.map(usize::from);
    if x.max(y).max(z) >= places {
        return None;
    }
    Some(TABLES.code[TABLES.first[edge] + (x * places + y) * places + z]).filter(|code| *code != NONE)
}

/// The child sphere that `code` stands for. Codes beyond the last stand for the parent itself.
pub fn decode(parent: &Sphere, code: u16) -> Sphere {
    decode_with(table(), parent, code)
}

/// [`decode`] with the table at hand, for inner loops.
#[inline(always)]
pub fn decode_with(table: &[Relative], parent: &Sphere, code: u16) -> Sphere {
    let relative = &table[usize::from(code).min(CODES - 1)];
    Sphere { center: parent.center + relative.offset * parent.radius, radius: parent.radius * relative.scale }
}

/// The code with the smallest sphere that encloses `child`, and that sphere.
///
/// `parent` is decoded and must enclose `child`; where it does not (a caller's bug), the parent itself is returned.
pub fn encode(parent: &Sphere, child: &Sphere) -> (u16, Sphere) {
    // A ball whose centre is too far off cannot enclose the child: seen without looking anything up.
    let is_near = |off: f32, slack: f32| off <= slack;
    smallest(parent, child, is_near, |decoded| decoded.encloses(child))
}

/// The code with a small sphere that encloses all of `child` that lies in `bound`, and that sphere.
///
/// `parent` is decoded and must enclose `bound`. `child` may stick out: where all that it stands for lies in `bound` too, what
/// sticks out is empty. Of each size one place is tried, the one that is nearest to the child.
pub fn encode_within(parent: &Sphere, bound: &Sphere, child: &Sphere) -> (u16, Sphere) {
    if bound.encloses(child) {
        return encode(parent, child);
    }
    smallest(parent, child, |_, _| true, |decoded| decoded.encloses_common(child, bound))
}

/// Tries sizes from small to large. `may` is asked first, with the squares of how far the centre is off and of how far it may be, in
/// cells.
#[inline(always)]
fn smallest(
    parent: &Sphere,
    child: &Sphere,
    may: impl Fn(f32, f32) -> bool,
    encloses: impl Fn(&Sphere) -> bool,
) -> (u16, Sphere) {
    let tables = &*TABLES;
    if parent.radius > 0.0 {
        let scale = GRID as f32 / parent.radius;
        let center = (child.center - parent.center) * scale;
        let radius = child.radius * scale;
        // The smallest size that is not smaller than the child.
        let least = (radius as usize + usize::from(radius > radius as usize as f32)).clamp(1, GRID);
        for s in least..GRID {
            let places = GRID + 1 - s;
            let shift = GRID as f32 - s as f32;
            // Nearest corner on each axis: centre = 2 · corner + s − 13. Truncation rounds what is not negative down.
            let corner = ((center + shift) * 0.5).clamp(Vec3::ZERO, Vec3::splat((places - 1) as f32));
            let [x, y, z] = corner.to_array().map(|at| (at + 0.5) as usize);
            let found = Vec3::new(x as f32, y as f32, z as f32) * 2.0 - shift;
            // A thousandth of a cell is more than these roundings.
            let slack = s as f32 - radius + 1e-3;
            if !may((found - center).length_squared(), slack * slack) {
                continue;
            }
            let code = tables.code[tables.first[s] + (x * places + y) * places + z];
            if code != NONE {
                let decoded = decode_with(&tables.relative, parent, code);
                if encloses(&decoded) {
                    return (code, decoded);
                }
            }
        }
    }
    (SELF, *parent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_table_has_7621_codes_and_the_last_is_the_parent() {
        assert_eq!(table().len(), CODES);
        assert_eq!(table()[usize::from(SELF)], Relative { offset: Vec3::ZERO, scale: 1.0 });
        assert!(TABLES.code.len() == 8281 && TABLES.code.iter().filter(|code| **code != NONE).count() == 7621);
    }

    #[test]
    fn each_code_has_the_sub_cube_that_has_the_code() {
        for (code, cells) in cells_table().iter().enumerate() {
            assert_eq!(code_of(*cells), Some(code as u16));
            for axis in 0..3 {
                let offset = f64::from(cells.doubled_offset(axis)) / 13.0;
                assert!((offset - f64::from(table()[code].offset[axis])).abs() < 1e-6);
            }
        }
        for (edge, corner) in [(0, [0; 3]), (14, [0; 3]), (13, [1, 0, 0]), (1, [0, 0, 0]), (255, [255; 3])] {
            assert_eq!(code_of(Cells { edge, corner }), None);
        }
    }

    #[test]
    fn mean_errors_are_near_the_papers() {
        // Children as in a tree: balls of a typical size that touch the inside of their parent at random places.
        let parent = Sphere { center: Vec3::ZERO, radius: 1.0 };
        let (mut position, mut radius, mut count) = (0.0f64, 0.0f64, 0);
        for i in 0..20_000 {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / 20_000.0;
            let angle = i as f64 * 2.399_963_229_728_653;
            let ring = (1.0 - z * z).sqrt();
            let r = 0.3 + 0.3 * ((i * 7919 % 1000) as f64 / 1000.0);
            let center = glam::DVec3::new(ring * angle.cos(), ring * angle.sin(), z) * (1.0 - r) * 0.999;
            let child = Sphere { center: center.as_vec3(), radius: r as f32 };
            let (_, decoded) = encode(&parent, &child);
            let off = (decoded.center - child.center).abs();
            position += f64::from(off.x + off.y + off.z) / 3.0;
            radius += f64::from(decoded.radius - child.radius);
            count += 1;
        }
        let (position, radius) = (position / f64::from(count), radius / f64::from(count));
        // The paper: 0.04 and 0.15.
        assert!(position < 0.045 && radius < 0.16, "position {position}, radius {radius}");
    }

    proptest! {
        #[test]
        fn a_decoded_child_encloses_the_true_one(
            at in prop::array::uniform3(-1e4f32..1e4), radius in 1e-6f32..1e3,
            direction in prop::array::uniform3(-1f32..1.0), inner in 0f32..1.0, out in 0f32..1.0,
        ) {
            let parent = Sphere { center: Vec3::from_array(at), radius };
            let direction = Vec3::from_array(direction).normalize_or_zero();
            let child = Sphere {
                center: parent.center + direction * (radius * (1.0 - inner) * out),
                radius: radius * inner,
            };
            prop_assume!(parent.encloses(&child));
            let (code, decoded) = encode(&parent, &child);
            prop_assert!(decoded.encloses(&child));
            prop_assert_eq!(decode(&parent, code), decoded);
        }

        #[test]
        fn no_smaller_code_encloses_it(direction in prop::array::uniform3(-1f32..1.0), inner in 0.01f32..1.0, out in 0f32..1.0) {
            let parent = Sphere { center: Vec3::ZERO, radius: 1.0 };
            let child = Sphere {
                center: Vec3::from_array(direction).normalize_or_zero() * ((1.0 - inner) * out * 0.999),
                radius: inner,
            };
            prop_assume!(parent.encloses(&child));
            let (_, decoded) = encode(&parent, &child);
            let best = (0..CODES as u16).map(|code| decode(&parent, code)).filter(|ball| ball.encloses(&child))
                .map(|ball| ball.radius).fold(f32::INFINITY, f32::min);
            prop_assert_eq!(decoded.radius, best);
        }
    }
}
