//! What time did to the stone, as far as it varies slowly: where it cracked, where rain ran, where paint survived.
//!
//! Takes a point (metres); gives noises that the table stores, so that no vertex needs to compute them.

use super::bust::Bust;
use super::shape::{HEAD_CENTER, HEAD_M};
use crate::math::smoothstep;
use crate::noise::{fbm, noise, noise3};
use glam::Vec3;

/// Slowly varying properties of the stone. Shares run from 0 to 1, the others from about −1 to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Marks {
    /// Cracks run where this is 0.
    pub(super) crack: f32,
    /// Veins run where this is 0.
    pub(super) vein: f32,
    /// Light and dark clouds in the marble.
    pub(super) cloud: f32,
    /// Patches of chisel marks: none near 0, one direction above, another below.
    pub(super) tooled: f32,
    /// Share of warm patina, in vertical streaks.
    pub(super) rain: f32,
    /// Share of paint left.
    pub(super) paint: f32,
    /// How strong veins are.
    pub(super) veined: f32,
    /// How damaged the place is: without damage no cracks.
    pub(super) damage: f32,
    /// Share of the lips.
    pub(super) lips: f32,
    /// Share of the cheeks' faint red.
    pub(super) flush: f32,
}

impl Marks {
    /// The stone at `p`, metres.
    pub(super) fn at(seed: u32, p: Vec3, near: &Bust) -> Self {
        let cloud = fbm(seed ^ 0x4001, p * 2.3, 3);
        let warp = noise3(seed ^ 0x4002, p * 1.6);
        let bent = p + noise3(seed ^ 0x3002, p * 4.5) * 0.06;
        // Faces are spared the worst.
        let face = (p - Vec3::new(0.0, 1.9, 0.5)).length_squared();
        let spared = 0.35 * smoothstep(0.25, 0.09, face);
        let streaks = Vec3::new(p.x * 5.0, p.y * 1.2, p.z * 5.0);
        let kept = noise(seed ^ 0x4005, p * 3.0) + 0.4 * noise(seed ^ 0x4006, p * 17.0);
        let head = (p - HEAD_CENTER) / HEAD_M;
        let inside = |center: Vec3, radii: Vec3| smoothstep(1.0, 0.6, ((head - center) / radii).length());
        let bare = 1.0 - near.hair.max(near.beard);
        let cheeks = Vec3::new(head.x.abs(), head.y, head.z);
        let cheeks = ((cheeks - Vec3::new(0.18, -0.13, 0.3)) / Vec3::new(0.13, 0.1, 0.2)).length();
        Self {
            crack: noise(seed ^ 0x3003, bent * 1.25),
            vein: noise(seed ^ 0x4003, Vec3::new(p.x, p.y * 0.6, p.z) * 1.5 + warp * 1.1),
            cloud,
            tooled: noise(seed ^ 0x2001, p * 3.2),
            rain: smoothstep(0.0, 0.55, fbm(seed ^ 0x4004, streaks, 2)),
            paint: smoothstep(0.05, 0.5, kept),
            veined: smoothstep(-0.25, 0.5, warp.x + cloud),
            damage: smoothstep(0.05, 0.30, noise(seed ^ 0x3001, p * 1.5 + Vec3::splat(3.7)) - spared),
            lips: inside(Vec3::new(0.0, -0.336, 0.41), Vec3::new(0.10, 0.034, 0.07)) * bare,
            flush: smoothstep(1.0, 0.2, cheeks) * bare,
        }
    }
}
