//! The proportions of one statue, drawn from its seed.

use crate::noise::Random;
use glam::Vec3;

/// Height of the head in metres, chin to crown without hair; the unit of head space.
pub(super) const HEAD_M: f32 = 1.1;
/// Middle of the head, between the eyes' height and the ears; metres.
pub(super) const HEAD_CENTER: Vec3 = Vec3::new(0.0, 1.98, 0.03);

/// What differs between two statues besides noise. Lengths in head space (1 = [`HEAD_M`]) unless said otherwise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// For all noise.
    pub(super) seed: u32,
    /// Half the distance between the eyes.
    pub(super) eye_x: f32,
    /// Length of the nose, 1 = ordinary.
    pub(super) nose: f32,
    /// Width of nose and nostrils, 1 = ordinary.
    pub(super) nose_width: f32,
    /// Height of the hump of the nose.
    pub(super) nose_hump: f32,
    /// Width of jaw and cheeks, 1 = ordinary.
    pub(super) jaw: f32,
    /// How heavy the brow is, 1 = ordinary.
    pub(super) brow: f32,
    /// Fullness of the lips, 1 = ordinary.
    pub(super) lips: f32,
    /// Length of the beard below the chin, 1 = ordinary.
    pub(super) beard: f32,
    /// Height of the hair above the skull, 1 = ordinary.
    pub(super) hair: f32,
    /// Width of the shoulders, 1 = ordinary.
    pub(super) shoulders: f32,
    /// Turn of the head about the vertical, radians.
    pub(super) turn_rad: f32,
    /// Sideways inclination of the head, as a slope.
    pub(super) lean: f32,
    /// Where folds and curls begin: offsets in their own periods.
    pub(super) phase: f32,
}

impl Shape {
    /// The statue that `seed` names.
    pub(super) fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, 1);
        let mut about_1 = |spread: f32| random.between(1.0 - spread, 1.0 + spread);
        let (eye_x, nose, nose_width, jaw) = (0.136 * about_1(0.04), about_1(0.08), about_1(0.12), about_1(0.05));
        let (brow, lips, beard, hair) = (about_1(0.2), about_1(0.2), about_1(0.18), about_1(0.15));
        let (shoulders, nose_hump) = (about_1(0.05), 0.006 * about_1(1.0));
        let side = if random.unit() < 0.5 { -1.0 } else { 1.0 };
        Self {
            seed: random.next_u32(),
            eye_x,
            nose,
            nose_width,
            nose_hump,
            jaw,
            brow,
            lips,
            beard,
            hair,
            shoulders,
            turn_rad: side * random.between(0.14, 0.26),
            lean: side * random.between(0.01, 0.05),
            phase: random.unit(),
        }
    }

    /// Turns and inclines the head: a warp of all space that leaves the chest alone and never folds.
    pub(super) fn pose(&self, p: Vec3) -> Vec3 {
        let share = crate::math::smoothstep(1.0, 1.75, p.y);
        let angle = self.turn_rad * share;
        // Rotation about the vertical, rational in tan(angle / 2): no sine needed.
        let t = 0.5 * angle * (1.0 + angle * angle / 12.0);
        let (c, s) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
        let lean = -self.lean * (p.y - 1.2).max(0.0) * share;
        Vec3::new(p.x * c + p.z * s + lean, p.y, p.z * c - p.x * s)
    }
}
