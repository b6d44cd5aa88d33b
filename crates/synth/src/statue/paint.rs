//! The colour of the stone: marble with veins, dust in hollows, a patina above, and a few traces of ancient paint.
//!
//! Takes what the table knows of a place, and how deep in a crack it lies; gives 8-bit sRGB. Mixing happens in sRGB
//! values, as a painter judges them.

use super::texel::Coarse;
use crate::math::smoothstep;
use crate::noise::{BLOCK, noise_block};
use glam::Vec3;

/// How much each of a block of points (metres) differs from its surroundings, about −1 to 1.
pub(super) fn speckles(seed: u32, points: &[Vec3; BLOCK], values: &mut [f32; BLOCK]) {
    let mut q = [[0.0; BLOCK]; 3];
    for (at, &p) in points.iter().enumerate() {
        (q[0][at], q[1][at], q[2][at]) = (p.x * 140.0, p.y * 140.0, p.z * 140.0);
    }
    noise_block(seed ^ 0x4007, &q, values);
}

/// Colour of a vertex; `upwards` is the y of its ray's direction, `speckle` comes from [`speckles`].
pub(super) fn color(coarse: &Coarse, upwards: f32, crack: f32, speckle: f32) -> [u8; 3] {
    let marks = &coarse.marks;
    let mut stone = Vec3::new(224.0, 216.0, 203.0) + Vec3::new(12.0, 11.0, 9.0) * marks.cloud;
    let mut glaze = |r: f32, g: f32, b: f32, share: f32| stone += (Vec3::new(r, g, b) - stone) * share;
    // Veins: thin grey lines with soft flanks.
    let away = marks.vein.abs();
    let vein = 0.7 * smoothstep(0.06, 0.0, away) + 0.3 * smoothstep(0.25, 0.0, away);
    glaze(148.0, 151.0, 158.0, 0.52 * vein * marks.veined);
    // Warm patina where rain runs.
    glaze(194.0, 168.0, 128.0, 0.40 * marks.rain);
    // Traces of paint survive in hollows, in patches: ochre hair, a blue cloak, red lips.
    let kept = marks.paint * smoothstep(-0.35, 0.25, coarse.cavity);
    glaze(142.0, 80.0, 48.0, 0.50 * kept * coarse.hair);
    glaze(86.0, 104.0, 148.0, 0.45 * kept * coarse.cloth * smoothstep(-0.1, 0.3, marks.cloud));
    glaze(176.0, 104.0, 90.0, 0.42 * marks.lips);
    glaze(206.0, 164.0, 144.0, 0.22 * marks.flush);
    // Dirt in hollows and cracks, dust on what faces up.
    glaze(100.0, 86.0, 68.0, 0.62 * smoothstep(0.05, 0.85, coarse.cavity));
    glaze(60.0, 52.0, 44.0, 0.75 * smoothstep(0.05, 0.5, crack));
    glaze(186.0, 178.0, 164.0, 0.35 * smoothstep(0.35, 0.9, upwards));
    // Worn edges are paler; every grain differs a little.
    let worn = smoothstep(-0.1, -0.6, coarse.cavity);
    stone += Vec3::splat(14.0 * worn + 5.0 * speckle);
    [stone.x as u8, stone.y as u8, stone.z as u8]
}
