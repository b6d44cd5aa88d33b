//! What coder and decoder expect of positions, normals and colours, from what both know.
//!
//! All sums are of `f32` in a stated order, or of integers, so they are the same everywhere.

use super::values::{folded, unfolded};
use glam::{Vec4, Vec4Swizzles};

/// The plane of a known triangle: with it the third coordinate of a step along it follows from two.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// Axis that is most nearly across the plane; the steps' first and second coordinates are on the two axes after it, in turn.
    axis: usize,
    /// What a step on these two axes adds on the third.
    slopes: [f32; 2],
}

/// Added to a number below 2^22, it leaves the nearest whole number in the low bits.
const ROUNDING: f32 = 12_582_912.0;

#[inline(always)]
fn rounded(number: f32) -> i32 {
    (number + ROUNDING).to_bits() as i32 - ROUNDING.to_bits() as i32
}

#[inline(always)]
fn edge(from: [u16; 3], to: [u16; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| (i32::from(to[axis]) - i32::from(from[axis])) as f32)
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Plane {
    /// Where there is none.
    pub(super) const NONE: Self = Self { axis: 2, slopes: [0.0; 2] };

    /// Through three points.
    #[inline(always)]
    pub(super) fn of(a: [u16; 3], b: [u16; 3], c: [u16; 3]) -> Self {
        let normal = cross(edge(a, b), edge(a, c));
        let [x, y, z] = normal.map(f32::abs);
        let axis = if x > y && x > z {
            0
        } else if y > z {
            1
        } else {
            2
        };
        let across = normal[axis];
        let slopes = if across == 0.0 { [0.0; 2] } else { [1, 2].map(|next| -normal[(axis + next) % 3] / across) };
        Self { axis, slopes }
    }

    /// The position that is a step from another.
    #[inline(always)]
    pub(super) fn position(&self, guess: [i32; 3], [first, second, third]: [i16; 3]) -> [u16; 3] {
        let follows = rounded(self.slopes[0] * f32::from(first) + self.slopes[1] * f32::from(second));
        let across = i32::from(third).wrapping_add(follows);
        let step = match self.axis {
            0 => [across, i32::from(first), i32::from(second)],
            1 => [i32::from(second), across, i32::from(first)],
            _ => [i32::from(first), i32::from(second), across],
        };
        [0, 1, 2].map(|axis| guess[axis].wrapping_add(step[axis]) as u16)
    }

    /// Undoes [`Self::position`].
    pub(super) fn step(&self, guess: [i32; 3], position: [u16; 3]) -> [i16; 3] {
        let step = [0, 1, 2].map(|axis| i32::from(position[axis]).wrapping_sub(guess[axis]) as i16);
        let [first, second] = [1, 2].map(|next| step[(self.axis + next) % 3]);
        let follows = rounded(self.slopes[0] * f32::from(first) + self.slopes[1] * f32::from(second));
        [first, second, i32::from(step[self.axis]).wrapping_sub(follows) as i16]
    }
}

/// The fourth corner of a parallelogram: beyond the edge from `a` to `b`, opposite to `c`.
#[inline(always)]
pub(super) fn parallelogram(a: [u16; 3], b: [u16; 3], c: [u16; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| i32::from(a[axis]) + i32::from(b[axis]) - i32::from(c[axis]))
}

/// Normals of the vertices: the sum of the crosses of their triangles, in order.
pub(super) fn normals(positions: &[[u16; 3]], triangles: &[[u32; 3]], vertices: usize) -> Vec<Vec4> {
    let corners: Vec<Vec4> = positions[..vertices]
        .iter()
        .map(|[x, y, z]| Vec4::new(f32::from(*x), f32::from(*y), f32::from(*z), 0.0))
        .collect();
    let mut sums = vec![Vec4::ZERO; vertices];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| corners[vertex as usize]);
        let (b, c) = (b - a, c - a);
        let normal = b.yzxw() * c.zxyw() - b.zxyw() * c.yzxw();
        for vertex in triangle {
            sums[*vertex as usize] += normal;
        }
    }
    sums
}

/// Code of a direction on the octahedron, `most` = 2^bits − 1.
#[inline(always)]
pub(super) fn octahedral(direction: Vec4, most: f32) -> [i32; 2] {
    let [x, y, z, _] = direction.to_array();
    let sum = x.abs() + y.abs() + z.abs();
    let scale = 1.0 / if sum > 0.0 { sum } else { 1.0 };
    let (x, y) = (x * scale, y * scale);
    let (folded_x, folded_y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    let (x, y) = if z < 0.0 { (folded_x, folded_y) } else { (x, y) };
    [x, y].map(|coordinate| rounded((coordinate * 0.5 + 0.5) * most))
}

/// The edge between whose ends the colour of each vertex is expected: where it is the third corner of the first triangle that has it,
/// the other two; else twice the vertex before.
pub(super) fn edges(triangles: &[[u32; 3]], vertices: usize) -> Vec<[u32; 2]> {
    let mut edges = Vec::with_capacity(vertices);
    for [a, b, c] in triangles {
        for corner in [a, b] {
            if *corner as usize == edges.len() {
                edges.push([corner.saturating_sub(1); 2]);
            }
        }
        if *c as usize == edges.len() {
            edges.push([*a, *b]);
        }
    }
    edges.extend((edges.len()..vertices).map(|vertex| [vertex.saturating_sub(1) as u32; 2]));
    edges
}

/// A code from its guess and how far it is from that, round the corner.
#[inline(always)]
pub(super) fn wrapped(guess: i32, difference: u32, mask: u32) -> u32 {
    (guess + unfolded(difference)) as u32 & mask
}

/// Undoes [`wrapped`].
pub(super) fn difference(code: i32, guess: i32, bits: u32) -> u32 {
    let half = 1 << (bits - 1);
    folded((code - guess + half & (1 << bits) - 1) - half)
}

/// The code that a first normal is compared with.
pub(super) fn middle(bits: u32) -> [i32; 2] {
    [1 << (bits - 1); 2]
}

/// Half way between two colours.
#[inline(always)]
pub(super) fn between(a: [u8; 4], b: [u8; 4]) -> [u8; 4] {
    [0, 1, 2, 3].map(|channel| a[channel].midpoint(b[channel]))
}

/// Green, and red and blue relative to it, as differences to a guess.
pub(super) fn color_differences(color: [u8; 4], guess: [u8; 4]) -> [u32; 3] {
    let [red, green, blue] = [0, 1, 2].map(|channel| color[channel].wrapping_sub(guess[channel]));
    [green, red.wrapping_sub(green), blue.wrapping_sub(green)].map(|difference| folded(i32::from(difference as i8)))
}

/// Undoes [`color_differences`].
#[inline(always)]
pub(super) fn color_from(guess: [u8; 4], differences: [u8; 3]) -> [u8; 4] {
    let [green, red, blue] = differences;
    let add =
        |channel: usize, more: u8| guess[channel].wrapping_add(more).wrapping_add(if channel == 1 { 0 } else { green });
    [add(0, red), add(1, green), add(2, blue), 255]
}
