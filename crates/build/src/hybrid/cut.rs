//! Triangles that are too large for an eighth of a cell are cut where the eighths meet.
//!
//! In: a piece, and the middle of its cell. Out: parts that each lie in one eighth and together cover it. A place on an edge is computed from
//! the edge alone, so neighbours that are cut there stay joined; what lies beside a neighbour that is not cut is off by rounding only, which
//! [`Piece::cuts`] counts.
//!
//! Source: the hybrid paper, section 3.2, cuts all triangles at cell faces. Differs: small ones stay whole, so that there are no slivers.

use super::octree::Piece;
use super::weld::{code_of, normal_of};
use glam::{DVec3, Vec3};

/// A corner of a part.
#[derive(Clone, Copy, PartialEq)]
struct Corner {
    at: [f32; 3],
    normal: [u16; 2],
    color: [u8; 3],
}

impl Corner {
    fn beside(&self, axis: usize, plane: f64) -> f64 {
        f64::from(self.at[axis]) - plane
    }

    /// Where an edge meets a plane that its ends lie on both sides of.
    fn between(one: &Self, other: &Self, axis: usize, plane: f64) -> Self {
        // The same from both sides.
        let is_ordered = one.at.map(f32::to_bits) <= other.at.map(f32::to_bits);
        let (from, to) = if is_ordered { (one, other) } else { (other, one) };
        let share = from.beside(axis, plane) / (from.beside(axis, plane) - to.beside(axis, plane));
        let mix = |a: f64, b: f64| a + (b - a) * share;
        let mut at = [0, 1, 2].map(|i| mix(f64::from(from.at[i]), f64::from(to.at[i])) as f32);
        at[axis] = plane as f32;
        let normal = match from.normal == to.normal {
            true => from.normal,
            false => {
                let [a, b]: [Vec3; 2] = [from, to].map(|corner| normal_of(corner.normal));
                a.lerp(b, share as f32).try_normalize().map_or(from.normal, code_of)
            }
        };
        let color = [0, 1, 2].map(|i| mix(f64::from(from.color[i]), f64::from(to.color[i])).round() as u8);
        Self { at, normal, color }
    }
}

/// Parts of a piece by eighth, bit for bit of x, y, z: set where a part is beyond the middle.
pub(super) fn cut(piece: &Piece, middle: DVec3, mut put: impl FnMut(u8, Piece)) {
    let whole =
        [0, 1, 2].map(|side| Corner { at: piece.at[side], normal: piece.normals[side], color: piece.colors[side] });
    let mut parts: Vec<(u8, Vec<Corner>)> = vec![(0, whole.to_vec())];
    let mut cuts = piece.cuts;
    for axis in 0..3 {
        let plane = middle[axis];
        let mut next = Vec::with_capacity(2 * parts.len());
        let mut is_cut = false;
        for (octant, part) in parts {
            let beyond = octant | 1 << axis;
            let is_below = part.iter().any(|corner| corner.beside(axis, plane) < 0.0);
            let is_above = part.iter().any(|corner| corner.beside(axis, plane) > 0.0);
            if !(is_below && is_above) {
                next.push((if is_below { octant } else { beyond }, part));
                continue;
            }
            is_cut = true;
            next.push((octant, half(&part, axis, plane, -1.0)));
            next.push((beyond, half(&part, axis, plane, 1.0)));
        }
        cuts = cuts.saturating_add(u8::from(is_cut));
        parts = next;
    }
    for (octant, part) in parts {
        for second in 1..part.len().saturating_sub(1) {
            let corners = [part[0], part[second], part[second + 1]];
            let [a, b, c] = corners.map(|corner| corner.at);
            // What rounding has flattened lies on what is beside it.
            if a != b && b != c && c != a {
                put(
                    octant,
                    Piece {
                        at: [a, b, c],
                        normals: corners.map(|corner| corner.normal),
                        colors: corners.map(|corner| corner.color),
                        cuts,
                        ..*piece
                    },
                );
            }
        }
    }
}

/// The part of a convex polygon on one side of a plane.
fn half(part: &[Corner], axis: usize, plane: f64, side: f64) -> Vec<Corner> {
    let mut kept: Vec<Corner> = Vec::with_capacity(part.len() + 1);
    let mut keep = |corner: Corner| {
        if kept.last() != Some(&corner) {
            kept.push(corner);
        }
    };
    for (number, corner) in part.iter().enumerate() {
        let next = &part[(number + 1) % part.len()];
        let (here, there) = (corner.beside(axis, plane) * side, next.beside(axis, plane) * side);
        if here >= 0.0 {
            keep(*corner);
        }
        if here * there < 0.0 {
            keep(Corner::between(corner, next, axis, plane));
        }
    }
    while kept.len() > 1 && kept.first() == kept.last() {
        kept.pop();
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn piece(at: [[f32; 3]; 3]) -> Piece {
        Piece { at, normals: [[40_000, 40_000]; 3], colors: [[1, 2, 3]; 3], cuts: 0, unused: [0; 2] }
    }

    fn area([a, b, c]: [[f32; 3]; 3]) -> DVec3 {
        let [a, b, c] = [a, b, c].map(|at| Vec3::from_array(at).as_dvec3());
        (b - a).cross(c - a) * 0.5
    }

    fn parts(piece: &Piece, middle: DVec3) -> Vec<(u8, Piece)> {
        let mut all = Vec::new();
        cut(piece, middle, |octant, part| all.push((octant, part)));
        all
    }

    fn corner() -> impl Strategy<Value = [f32; 3]> {
        // Some lie on the planes.
        let coordinate = prop_oneof![4 => -2.0f32..2.0, 1 => Just(0.25f32)];
        [coordinate.clone(), coordinate.clone(), coordinate]
    }

    proptest! {
        #[test]
        fn parts_are_the_whole_and_each_lies_in_its_eighth(at in [corner(), corner(), corner()]) {
            let middle = DVec3::splat(0.25);
            let all = parts(&piece(at), middle);
            let sum: DVec3 = all.iter().map(|(_, part)| area(part.at)).sum();
            prop_assert!((sum - area(at)).length() < 1e-5, "{} of {}", sum, area(at));
            for (octant, part) in &all {
                for (axis, value) in part.at.iter().flat_map(|at| at.iter().enumerate()) {
                    let beyond = octant >> axis & 1 == 1;
                    let at = f64::from(*value);
                    prop_assert!(if beyond { at >= 0.25 } else { at <= 0.25 }, "{} of axis {}", at, axis);
                }
                // It faces where the whole does.
                prop_assert!(area(part.at).dot(area(at)) >= -1e-9);
            }
        }

        #[test]
        fn neighbours_stay_joined(shared in [corner(), corner()], others in [corner(), corner()]) {
            let middle = DVec3::splat(0.25);
            let [p, q] = shared;
            let on_edge = |at: [f32; 3]| {
                let [a, b, x] = [p, q, at].map(|at| Vec3::from_array(at).as_dvec3());
                (b - a).cross(x - a).length() <= 1e-6 * (b - a).length()
            };
            let found = |third: [f32; 3]| -> BTreeSet<[u32; 3]> {
                let all = parts(&piece([p, q, third]), middle);
                let corners = all.iter().flat_map(|(_, part)| part.at);
                corners.filter(|at| on_edge(*at)).map(|at| at.map(f32::to_bits)).collect()
            };
            let flipped: BTreeSet<[u32; 3]> = {
                let all = parts(&piece([q, p, others[1]]), middle);
                let corners = all.iter().flat_map(|(_, part)| part.at);
                corners.filter(|at| on_edge(*at)).map(|at| at.map(f32::to_bits)).collect()
            };
            let far = |third: [f32; 3]| {
                let [a, b, x] = [p, q, third].map(|at| Vec3::from_array(at).as_dvec3());
                (b - a).cross(x - a).length() > 0.1 * (b - a).length()
            };
            prop_assume!(far(others[0]) && far(others[1]));
            prop_assert_eq!(found(others[0]), flipped);
        }
    }
}
