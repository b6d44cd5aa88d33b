//! The finest scales: weathering, tool marks, cracks and grain, computed at every vertex.
//!
//! Takes a block of points of the coarse surface and their materials; gives heights in metres along their rays. Each octave of grain
//! appears once the samples are dense enough to carry it: a larger statue has more of them, and the coarser ones stay.

use super::marks::Marks;
use super::texel::Coarse;
use crate::math::{cos_turns, floor_i32, smoothstep};
use crate::noise::{BLOCK, noise, noise_block, turned};
use glam::Vec3;

/// Coarsest wavelength of the grain, metres.
const GRAIN_M: f32 = 0.048;
/// Most octaves of grain: the finest is then 0.4 mm, for 400 million triangles.
const MAX_OCTAVES: u32 = 8;

/// Fine relief for one density of samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detail {
    seed: u32,
    /// Typical distance between neighbouring vertices, metres.
    spacing_m: f32,
}

impl Detail {
    /// Fine relief for vertices about `spacing_m` apart.
    pub(super) fn new(seed: u32, spacing_m: f32) -> Self {
        Self { seed, spacing_m }
    }

    /// Heights at up to [`BLOCK`] points (metres), and how deep in a crack each lies (0–1).
    pub(super) fn heights(&self, points: &[Vec3], coarse: &[Coarse], heights: &mut [(f32, f32); BLOCK]) {
        let mut grain = [0.0; BLOCK];
        self.grain(points, &mut grain);
        for (at, (&p, coarse)) in points.iter().zip(coarse).enumerate() {
            let rough = 0.45 + 0.35 * coarse.cloth + 0.9 * coarse.base + 0.3 * coarse.hair;
            let (crack, depth) = self.crack(p, &coarse.marks);
            heights[at] = (rough * grain[at] + self.chisel(p, coarse) - depth, crack);
        }
    }

    /// How much of a feature of size `wavelength_m` the samples can carry: 0 below three samples, 1 above six.
    fn carried(&self, wavelength_m: f32) -> f32 {
        smoothstep(2.5 * self.spacing_m, 5.0 * self.spacing_m, wavelength_m)
    }

    fn grain(&self, points: &[Vec3], sums: &mut [f32; BLOCK]) {
        let mut q = [[0.0; BLOCK]; 3];
        for (at, p) in points.iter().enumerate() {
            (q[0][at], q[1][at], q[2][at]) = (p.x / GRAIN_M, p.y / GRAIN_M, p.z / GRAIN_M);
        }
        let (mut values, mut wavelength) = ([0.0; BLOCK], GRAIN_M);
        for octave in 0..MAX_OCTAVES {
            let share = self.carried(wavelength);
            if share == 0.0 {
                break;
            }
            noise_block(self.seed.wrapping_add(octave * 0x3c6e), &q, &mut values);
            // 2.4 % of the wavelength: slopes of about one in fifteen at every scale.
            let height = 0.024 * share * wavelength;
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += height * value;
            }
            let [x, y, z] = &mut q;
            for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
                [*x, *y, *z] = (turned(Vec3::new(*x, *y, *z)) * 2.0).to_array();
            }
            wavelength *= 0.5;
        }
    }

    /// Parallel grooves of a claw chisel, in patches, each patch with its own direction; on drum and cloth.
    fn chisel(&self, p: Vec3, coarse: &Coarse) -> f32 {
        const PITCH_M: f32 = 0.016;
        let place = coarse.base + 0.5 * coarse.cloth;
        let share = place * self.carried(PITCH_M);
        if share < 0.02 {
            return 0.0;
        }
        let patch = coarse.marks.tooled;
        let fade = smoothstep(0.05, 0.35, patch.abs());
        if fade == 0.0 {
            return 0.0;
        }
        // Two directions, one for either sign of the patch noise; both bend slowly.
        let bend = 0.02 * patch;
        let along = if patch > 0.0 { 0.8 * p.y + 0.5 * p.x + 0.33 * p.z } else { 0.7 * p.y - 0.6 * p.x - 0.39 * p.z };
        let turns = (along + bend) / PITCH_M;
        // A row of strokes, each a little deeper or shallower.
        let stroke = floor_i32(turns) as f32 * 0.37;
        let depth = 0.6 + 0.4 * cos_turns(stroke);
        share * fade * 0.0007 * depth * cos_turns(turns)
    }

    /// Thin, deep, jagged lines where the stone has suffered. Returns (0–1 how deep, metres of depth).
    fn crack(&self, p: Vec3, marks: &Marks) -> (f32, f32) {
        // Half width in metres; the noise changes by about 2 in a metre.
        let half_m = (0.0028 * marks.damage).max(1.1 * self.spacing_m);
        let half_level = half_m * 2.0;
        // Most vertices stop here: unharmed, or far from the line.
        if marks.damage < 0.004 || marks.crack.abs() > half_level + 0.02 {
            return (0.0, 0.0);
        }
        let jagged = marks.crack + 0.012 * noise(self.seed ^ 0x3004, p * 26.0);
        let inside = (1.0 - jagged.abs() / half_level).max(0.0);
        let crack = inside * inside * marks.damage;
        (crack, (2.6 * half_m).min(0.009) * crack)
    }
}
