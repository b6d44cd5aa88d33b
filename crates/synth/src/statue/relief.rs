//! What the sculptor cut into the big forms: curls of hair and beard, folds of cloth.
//!
//! Takes a point of the smooth surface (metres) and its materials; gives the height, in metres, by which the surface
//! moves outwards along its ray. Features are centimetres large; finer ones are in `detail`.

use super::bust::{Bust, arm_cut};
use super::shape::{HEAD_CENTER, HEAD_M, Shape};
use crate::math::{mix, smoothstep};
use crate::noise::{Random, hash32, noise, noise3};
use glam::Vec3;
use std::f32::consts::TAU;

/// All locks and folds of one statue.
#[derive(Clone, Debug)]
pub(super) struct Relief {
    shape: Shape,
    hair: Locks,
    beard: Locks,
}

impl Relief {
    /// The relief of one statue.
    pub(super) fn new(shape: &Shape) -> Self {
        let hair_center = HEAD_CENTER + Vec3::new(0.0, 0.08, -0.05) * HEAD_M;
        let beard_center = HEAD_CENTER + Vec3::new(0.0, -0.36, 0.06) * HEAD_M;
        Self {
            shape: *shape,
            hair: Locks::new(hair_center, Vec3::new(1.0, 0.95, 0.9), 0.52, 250, shape.seed ^ 0xa1),
            beard: Locks::new(beard_center, Vec3::new(1.0, 0.5, 1.0), 0.36, 130, shape.seed ^ 0xb2),
        }
    }

    /// Height above the smooth surface at `p`, metres.
    pub(super) fn height(&self, p: Vec3, near: &Bust) -> f32 {
        let mut height = 0.0;
        if near.hair > 0.0 {
            height += near.hair * self.hair.height(p);
        }
        if near.beard > 0.0 {
            height += near.beard * 0.8 * self.beard.height(p);
        }
        if near.cloth > 0.0 {
            height += near.cloth * self.cloth(p);
        }
        height
    }

    /// Tunic and cloak.
    fn cloth(&self, p: Vec3) -> f32 {
        let seed = self.shape.seed;
        let drift = noise3(seed ^ 0x1001, p * 1.3);
        let (start, p) = (p, p + drift * 0.07);
        let side = if self.shape.turn_rad > 0.0 { 1.0 } else { -1.0 };
        let x = p.x * side;
        // Neckline of the tunic: a shallow V in front, high behind.
        let neckline = mix(1.24, 1.13 + 0.42 * x.abs(), smoothstep(-0.1, 0.25, p.z));
        let covered = smoothstep(0.028, -0.022, p.y - neckline);
        // Tunic: folds sag between the shoulders, tighter towards the middle.
        let sag = p.y - 0.62 * x * x / (0.25 + x.abs()) + 0.12 * drift.y;
        let tunic = folds(sag / 0.135 + self.shape.phase, seed ^ 0x1002, p);
        // Cloak: over one shoulder, across the chest to the other side; folds run along it and gather on the shoulder.
        let across = (p.y - 0.36) * 0.62 - (0.44 - x) * 0.62 + 0.05 * drift.x;
        let gather = mix(0.085, 0.15, smoothstep(1.2, 0.4, p.y));
        let cloak_edge = smoothstep(-0.02, 0.02, x * 0.75 - (p.y - 0.86) * 0.62 + 0.02 + 0.03 * drift.z);
        let cloak = 0.05 + 0.042 * folds(across / gather, seed ^ 0x1003, p * Vec3::new(1.0, 0.8, 1.0));
        let uncut = smoothstep(0.0, -0.035, arm_cut(start, &self.shape));
        uncut * covered * mix(0.014 + 0.034 * tunic, cloak, cloak_edge)
    }
}

/// Profile of cloth hung in folds, 0 in the valleys to about 1 on the crests; `phase` counts folds.
fn folds(phase: f32, seed: u32, p: Vec3) -> f32 {
    let bend = phase + 0.35 * noise(seed, p * 2.2);
    let wave = |turns: f32| {
        let c = 0.5 + 0.5 * crate::math::cos_turns(turns + 0.10 * crate::math::cos_turns(turns - 0.25));
        c * (1.3 - 0.3 * c)
    };
    // Folds come and go along their length.
    let strong = 0.35 + 0.65 * smoothstep(-0.35, 0.35, noise(seed ^ 0x77, p * 2.6 + Vec3::splat(7.0)));
    let minor = 0.30 * smoothstep(-0.1, 0.4, noise(seed ^ 0x78, p * 3.1));
    wave(bend) * strong + minor * wave(bend * 2.0 + 0.3)
}

/// Locks of hair: snail curls around points spread evenly over a ball.
#[derive(Clone, Debug)]
struct Locks {
    center: Vec3,
    /// Scale of each axis before directions are taken: less than 1 draws locks out along it.
    squash: Vec3,
    /// Typical distance of the hair from the centre, metres; makes angles lengths.
    radius_m: f32,
    seed: u32,
    locks: Vec<Lock>,
    /// Typical distance between neighbours, metres.
    spacing_m: f32,
}

#[derive(Clone, Copy, Debug)]
struct Lock {
    direction: Vec3,
    /// Unit vectors across and along (downwards) the lock.
    across: Vec3,
    along: Vec3,
    /// +1 or −1: which way it curls.
    hand: f32,
    /// Turns by which the spiral is rotated.
    start: f32,
    /// How far it stands out, 1 = ordinary.
    size: f32,
}

impl Locks {
    fn new(center: Vec3, squash: Vec3, radius_m: f32, count: u32, seed: u32) -> Self {
        let mut random = Random::new(u64::from(seed), 2);
        let spacing = (2.0 * TAU / count as f32).sqrt();
        let locks = (0..count)
            .map(|index| {
                // A spiral of equal areas (Fibonacci lattice), then jittered.
                let y = 1.0 - (2.0 * index as f32 + 1.0) / count as f32;
                let angle = TAU * (index as f32 * 0.618_034).fract();
                let ring = (1.0 - y * y).sqrt();
                let even = Vec3::new(ring * libm::cosf(angle), y, ring * libm::sinf(angle));
                let direction = (even + random.direction() * (0.30 * spacing)).normalize();
                let across = if direction.y.abs() < 0.98 { Vec3::Y.cross(direction) } else { Vec3::X.cross(direction) };
                let across = across.normalize();
                let along = across.cross(direction);
                let hand = if hash32(seed ^ index) & 1 == 0 { 1.0 } else { -1.0 };
                Lock { direction, across, along, hand, start: random.unit(), size: random.between(0.8, 1.15) }
            })
            .collect();
        Self { center, squash, radius_m, seed, locks, spacing_m: spacing * radius_m }
    }

    fn height(&self, p: Vec3) -> f32 {
        let warped = p + noise3(self.seed, p * 5.0) * 0.018;
        let direction = ((warped - self.center) * self.squash).normalize();
        // The two nearest locks, by distance over size.
        let (mut nearest, mut second, mut lock) = (f32::MAX, f32::MAX, &self.locks[0]);
        for candidate in &self.locks {
            let far = (1.0 - candidate.direction.dot(direction)) / (candidate.size * candidate.size);
            if far < nearest {
                (second, nearest, lock) = (nearest, far, candidate);
            } else if far < second {
                second = far;
            }
        }
        // 1 - cos → chord → metres.
        let [near_m, second_m] = [nearest, second].map(|far| (2.0 * far.max(0.0)).sqrt() * self.radius_m);
        let crease = smoothstep(0.0, 0.30 * self.spacing_m, second_m - near_m);
        let offset = direction - lock.direction;
        let (u, v) = (offset.dot(lock.across) * self.radius_m, offset.dot(lock.along) * self.radius_m);
        let rho = (u * u + v * v).sqrt();
        let turns = lock.hand * libm::atan2f(v, u) / TAU + lock.start;
        let pitch = 0.30 * self.spacing_m;
        let phase = rho / pitch - turns;
        let core = smoothstep(0.0, 0.5 * pitch, rho);
        let ridge = 0.5 + 0.5 * crate::math::cos_turns(phase);
        let strands = crate::math::cos_turns(phase * 3.0 + noise(self.seed ^ 5, p * 30.0) * 0.25);
        let reach = rho / (0.62 * self.spacing_m);
        let dome = (1.0 - reach * reach).max(0.0);
        let body = 0.032 * lock.size * dome.sqrt() * crease;
        let carved = crease * core * (0.0145 * ridge + 0.0022 * strands);
        body + carved - 0.012
    }
}
