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

/// Added to a number below 2^22 and taken away again, it leaves the nearest whole number, the even one of two.
const ROUNDING: f32 = 12_582_912.0;

#[inline(always)]
fn rounded(number: f32) -> f32 {
    (number + ROUNDING) - ROUNDING
}

#[inline(always)]
fn cross(a: Vec4, b: Vec4) -> Vec4 {
    a.yzxw() * b.zxyw() - a.zxyw() * b.yzxw()
}

impl Plane {
    /// Where there is none.
    pub(super) const NONE: Self = Self { axis: 2, slopes: [0.0; 2] };

    /// Through three points.
    #[inline(always)]
    pub(super) fn of(a: Vec4, b: Vec4, c: Vec4) -> Self {
        let normal = cross(b - a, c - a);
        let [x, y, z, _] = normal.abs().to_array();
        let [nx, ny, nz, _] = normal.to_array();
        let (axis, across, first, second) = if x > y && x > z {
            (0, nx, ny, nz)
        } else if y > z {
            (1, ny, nz, nx)
        } else {
            (2, nz, nx, ny)
        };
        let scale = if across == 0.0 { 0.0 } else { -1.0 / across };
        Self { axis, slopes: [first * scale, second * scale] }
    }

    /// The position that is a step from another.
    #[inline(always)]
    pub(super) fn position(&self, guess: Vec4, step: Vec4) -> Vec4 {
        let follows = rounded(self.slopes[0] * step.x + self.slopes[1] * step.y);
        let step = Vec4::new(step.x, step.y, step.z + follows, 0.0);
        guess
            + match self.axis {
                0 => step.zxyw(),
                1 => step.yzxw(),
                _ => step,
            }
    }

    /// Undoes [`Self::position`].
    pub(super) fn step(&self, guess: Vec4, position: Vec4) -> Vec4 {
        let step = position - guess;
        let step = match self.axis {
            0 => step.yzxw(),
            1 => step.zxyw(),
            _ => step,
        };
        let follows = rounded(self.slopes[0] * step.x + self.slopes[1] * step.y);
        Vec4::new(step.x, step.y, step.z - follows, 0.0)
    }
}

/// A position in steps, to reckon with: all numbers stay whole and exact.
pub(super) fn point([x, y, z]: [u16; 3]) -> Vec4 {
    Vec4::new(f32::from(x), f32::from(y), f32::from(z), 0.0)
}

/// The fourth corner of a parallelogram: beyond the edge from `a` to `b`, opposite to `c`.
#[inline(always)]
pub(super) fn parallelogram(a: Vec4, b: Vec4, c: Vec4) -> Vec4 {
    a + b - c
}

/// Undoes [`point`]. `None` where one is not from 0 to `most`.
pub(super) fn positions(points: &[Vec4], most: [u16; 3], out: &mut [[u16; 3]]) -> Option<()> {
    let most = point(most);
    let mut good = true;
    for (point, position) in points.iter().zip(out) {
        good &= (point.cmpge(Vec4::ZERO) & point.cmple(most)).all();
        *position = [point.x, point.y, point.z].map(|coordinate| (coordinate + ROUNDING).to_bits() as u16);
    }
    good.then_some(())
}

/// Normals of the vertices: the sum of the crosses of their triangles, in order.
pub(super) fn normals(points: &[Vec4], triangles: &[[u32; 3]]) -> Vec<Vec4> {
    let mut sums = vec![Vec4::ZERO; points.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| points[vertex as usize]);
        let normal = cross(b - a, c - a);
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
    [x, y].map(|coordinate| ((coordinate * 0.5 + 0.5) * most + ROUNDING).to_bits() as i32 - ROUNDING.to_bits() as i32)
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
    folded(((code - guess + half) & ((1 << bits) - 1)) - half)
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
