//! What is known of the statue at one direction, and how it is stored in 20 bytes.

use super::marks::Marks;

/// The coarse statue at one ray. Shares run from 0 to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Coarse {
    /// Distance from the ray's origin, metres.
    pub(super) radius: f32,
    /// Share of hair and beard.
    pub(super) hair: f32,
    /// Share of cloth.
    pub(super) cloth: f32,
    /// Share of the drum.
    pub(super) base: f32,
    /// −1 on ridges, 0 on even ground, 1 in hollows.
    pub(super) cavity: f32,
    /// Slowly varying properties of the stone.
    pub(super) marks: Marks,
}

/// A [`Coarse`] in 20 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Texel {
    /// Distance from the ray's origin, metres.
    pub(super) radius: f32,
    /// [`Marks::crack`] and [`Marks::vein`], in units of [`LINE_STEP`].
    lines: [i16; 2],
    /// In the order of [`Texel::new`]; 255 is 1.
    shares: [u8; SHARES],
}

const SHARES: usize = 12;
/// Place of the cavity among the shares.
const CAVITY: usize = 3;
/// Places of the marks among the shares.
const MARKS: std::ops::Range<usize> = CAVITY + 1..SHARES;
/// Resolution of the noises whose zero lines are cracks and veins; they stay within ±2.
const LINE_STEP: f32 = 1.0 / 16_384.0;

impl Texel {
    /// Packs `coarse`.
    pub(super) fn new(coarse: &Coarse) -> Self {
        let marks = &coarse.marks;
        let shares = [
            coarse.hair,
            coarse.cloth,
            coarse.base,
            half(coarse.cavity),
            half(marks.cloud),
            half(marks.tooled),
            marks.rain,
            marks.paint,
            marks.veined,
            marks.damage,
            marks.lips,
            marks.flush,
        ];
        let lines = [marks.crack, marks.vein].map(|line| (line / LINE_STEP) as i16);
        Self { radius: coarse.radius, lines, shares: shares.map(byte) }
    }

    /// Sets how hollow the place is, −1 to 1.
    pub(super) fn set_cavity(&mut self, cavity: f32) {
        self.shares[CAVITY] = byte(half(cavity));
    }

    /// This texel with the mean of two others' marks.
    pub(super) fn with_marks_between(mut self, a: &Self, b: &Self) -> Self {
        for (line, (a, b)) in self.lines.iter_mut().zip(a.lines.into_iter().zip(b.lines)) {
            *line = ((i32::from(a) + i32::from(b)) >> 1) as i16;
        }
        for at in MARKS {
            self.shares[at] = ((u16::from(a.shares[at]) + u16::from(b.shares[at])) / 2) as u8;
        }
        self
    }

    /// The weighted mean of four, but for the radius, which is given.
    pub(super) fn mean(radius: f32, four: [&Self; 4], weights: [f32; 4]) -> Coarse {
        let (mut lines, mut shares) = ([0.0; 2], [0.0; SHARES]);
        for (texel, weight) in four.into_iter().zip(weights) {
            let (line_weight, share_weight) = (weight * LINE_STEP, weight * (1.0 / 255.0));
            for (sum, value) in lines.iter_mut().zip(texel.lines) {
                *sum += f32::from(value) * line_weight;
            }
            for (sum, value) in shares.iter_mut().zip(texel.shares) {
                *sum += f32::from(value) * share_weight;
            }
        }
        let [hair, cloth, base, cavity, cloud, tooled, rain, paint, veined, damage, lips, flush] = shares;
        let [crack, vein] = lines;
        let signed = |half: f32| half * 2.0 - 1.0;
        let (cloud, tooled, cavity) = (signed(cloud), signed(tooled), signed(cavity));
        let marks = Marks { crack, vein, cloud, tooled, rain, paint, veined, damage, lips, flush };
        Coarse { radius, hair, cloth, base, cavity, marks }
    }
}

fn half(signed: f32) -> f32 {
    signed * 0.5 + 0.5
}

fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
