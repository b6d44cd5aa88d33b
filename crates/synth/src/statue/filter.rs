//! What needs neighbours in the table: bridging undercuts, and finding hollows.
//!
//! Takes the radii of one side, margins included; changes them, or tells how hollow a place is. Both judge by angles on
//! the sphere, not by rows and columns, so that two sides agree where they meet.

use super::table::MAX_CELLS;
use crate::math::mix;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_PI_2;

/// Most metres by which the radius may fall in one radian: keeps the longest edges within a few median lengths.
const STEEPEST_M_PER_RAD: f32 = 3.6;
/// How far around a place hollows are judged, in samples of the finest table (2 mm each).
const CAVITY_REACHES: [f32; 2] = [4.0, 12.0];

/// Samples that a table of `cells` needs beyond the borders of a side.
pub(super) fn margin(cells: usize) -> usize {
    reach(CAVITY_REACHES[1], cells) as usize + 4
}

/// `samples` of the finest table, in samples of one with `cells`; at least one.
fn reach(samples: f32, cells: usize) -> f32 {
    (samples * cells as f32 / MAX_CELLS as f32).max(1.0)
}

/// Raises what lies behind an overhang, as a sculptor leaves a bridge of stone: no radius is smaller than a neighbour's
/// by more than [`STEEPEST_M_PER_RAD`] allows (two sweeps of a chamfer transform). What was raised is then smoothed.
///
/// # Source
/// Borgefors, *Distance Transformations in Digital Images*, CVGIP 1986.
pub(super) fn fill_undercuts(radii: &mut [f32], stride: usize, cells: usize) {
    let before = radii.to_vec();
    let step = STEEPEST_M_PER_RAD * FRAC_PI_2 / cells as f32;
    let diagonal = step * 1.4;
    let mut sweep = |at: usize, [straight_1, straight_2, diagonal_1, diagonal_2]: [isize; 4]| {
        let from = |by: isize, drop: f32| radii[at.wrapping_add_signed(by)] - drop;
        let near = from(straight_1, step).max(from(straight_2, step));
        let far = from(diagonal_1, diagonal).max(from(diagonal_2, diagonal));
        radii[at] = radii[at].max(near).max(far);
    };
    let row = stride as isize;
    let inner = |at: &usize| (1..stride - 1).contains(&(at % stride));
    for at in (stride..stride * stride).filter(inner) {
        sweep(at, [-1, -row, -row - 1, -row + 1]);
    }
    for at in (0..stride * (stride - 1)).rev().filter(inner) {
        sweep(at, [1, row, row - 1, row + 1]);
    }
    // The rim of an overhang is a staircase of samples: it and the bridge below are blurred, twice.
    let all_inner = || (stride..stride * (stride - 1)).filter(inner);
    let raised: Vec<bool> = radii.iter().zip(&before).map(|(after, before)| after > before).collect();
    let rim: Vec<usize> = all_inner()
        .filter(|&at| [at, at - 1, at + 1, at - stride, at + stride].iter().any(|&near| raised[near]))
        .collect();
    for _ in 0..2 {
        let blurred: Vec<f32> = rim
            .iter()
            .map(|&at| {
                let three = |at: usize| radii[at - 1] + 2.0 * radii[at] + radii[at + 1];
                (three(at - stride) + 2.0 * three(at) + three(at + stride)) / 16.0
            })
            .collect();
        for (&at, blurred) in rim.iter().zip(blurred) {
            radii[at] = blurred;
        }
    }
}

/// The radii of one side, to look around in.
pub(super) struct Radii<'a> {
    pub(super) radii: &'a [f32],
    pub(super) stride: usize,
    pub(super) cells: usize,
}

impl Radii<'_> {
    /// How hollow a place is, −1 (ridge) to 1: its depth below the circle around it, at two scales.
    pub(super) fn cavity(&self, row: usize, column: usize, direction: impl Fn(usize, usize) -> Vec3) -> f32 {
        // Columns and rows per sample's angle, along two directions on the sphere that do not depend on the side.
        let here = direction(row, column);
        let per_angle = self.cells as f32 / FRAC_PI_2;
        let (du, dv) =
            ((direction(row, column + 1) - here) * per_angle, (direction(row + 1, column) - here) * per_angle);
        let pole = if here.y.abs() < 0.9 { Vec3::Y } else { Vec3::X };
        let e1 = pole.cross(here).normalize();
        let e2 = here.cross(e1);
        let (a, b, c, d) = (du.dot(e1), dv.dot(e1), du.dot(e2), dv.dot(e2));
        let det = a * d - b * c;
        let (first, second) = (Vec2::new(d, -c) / det, Vec2::new(-b, a) / det);
        let place = Vec2::new(column as f32, row as f32);
        let middle = self.radii[row * self.stride + column];
        let below = |samples: f32| {
            let r = reach(samples, self.cells);
            let at = |x: f32, y: f32| self.at(place + (first * x + second * y) * r);
            let diagonal = std::f32::consts::FRAC_1_SQRT_2;
            let straight = at(1.0, 0.0) + at(-1.0, 0.0) + at(0.0, 1.0) + at(0.0, -1.0);
            let oblique =
                at(diagonal, diagonal) + at(-diagonal, diagonal) + at(diagonal, -diagonal) + at(-diagonal, -diagonal);
            // Depth as a slope: metres over metres.
            ((straight + oblique) / 8.0 - middle) * per_angle / (middle * r)
        };
        let hollow = 1.1 * below(CAVITY_REACHES[0]) + 1.4 * below(CAVITY_REACHES[1]);
        hollow / (1.0 + hollow.abs())
    }

    /// The radius between samples, linear; beyond the margin that of its border.
    fn at(&self, place: Vec2) -> f32 {
        let last = (self.stride - 1) as f32;
        let place = place.clamp(Vec2::ZERO, Vec2::splat(last - 0.001));
        let (column, row) = (place.x as usize, place.y as usize);
        let (fu, fv) = (place.x - column as f32, place.y - row as f32);
        let low = row * self.stride + column;
        let high = low + self.stride;
        mix(mix(self.radii[low], self.radii[low + 1], fu), mix(self.radii[high], self.radii[high + 1], fu), fv)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_undercut_is_bridged_and_level_ground_stays() {
        let (stride, cells) = (64, 512);
        let step = STEEPEST_M_PER_RAD * FRAC_PI_2 / cells as f32;
        let mut radii: Vec<f32> = (0..stride * stride).map(|at| if at % stride < 20 { 0.6 } else { 0.4 }).collect();
        fill_undercuts(&mut radii, stride, cells);
        for at in (stride * 2..stride * (stride - 2)).filter(|at| (2..stride - 2).contains(&(at % stride))) {
            assert!((radii[at] - radii[at + 1]).abs() < step * 1.01, "{at}");
        }
        assert_eq!((radii[stride * 30 + 5], radii[stride * 30 + 55]), (0.6, 0.4));
    }

    #[test]
    fn a_dent_is_hollow_and_a_bump_is_not() {
        let (stride, cells) = (64, 512);
        let dented = |depth: f32| -> Vec<f32> {
            let far = |at: usize| Vec2::new((at % stride) as f32 - 32.0, (at / stride) as f32 - 32.0).length();
            (0..stride * stride).map(|at| 0.5 - depth * (1.0 - far(at) / 10.0).max(0.0)).collect()
        };
        let flat = |row: usize, column: usize| {
            Vec3::new((column as f32 - 32.0) * FRAC_PI_2 / 512.0, (row as f32 - 32.0) * FRAC_PI_2 / 512.0, 1.0)
        };
        let cavity = |depth| Radii { radii: &dented(depth), stride, cells }.cavity(32, 32, flat);
        assert!(cavity(0.01) > 0.2 && cavity(-0.01) < -0.2 && cavity(0.0).abs() < 1e-4);
    }
}
