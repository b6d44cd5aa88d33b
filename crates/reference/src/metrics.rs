//! How far two pictures are apart: PSNR, SSIM, FLIP and the largest difference.
//!
//! Takes two 8-bit sRGB pictures of one size and perhaps a mask; returns [`Comparison`], the figures of `gigalod compare`.
//! A mask limits what is averaged, not what a filter may look at. An empty mask compares nothing: no difference.

use crate::ssim::ssim;
use crate::{Mask, Picture, Truth};

/// Comparisons look at the reference silhouette, dilated by so many pixels: the error of an outline counts, an empty
/// background does not flatter.
pub const SILHOUETTE_MARGIN_PX: f64 = 8.0;

/// Viewing distance FLIP assumes: a 0.7 m wide 4K monitor seen from 0.7 m.
pub const FLIP_PIXELS_PER_DEGREE: f32 = 67.0;

/// The figures of one comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Peak signal-to-noise ratio in dB; `None` when identical.
    pub psnr_db: Option<f64>,
    /// Mean structural similarity, at most 1.
    pub ssim: f64,
    /// Mean FLIP error, 0 to 1.
    pub flip_mean: f64,
    /// Largest difference of any channel, in 8-bit steps.
    pub max_diff: u8,
}

/// Compares `test` with `reference` within `mask`, or everywhere.
///
/// # Panics
/// When the sizes differ.
pub fn compare(reference: &Picture, test: &Picture, mask: Option<&Mask>) -> Comparison {
    Comparison {
        psnr_db: psnr_db(reference, test, mask),
        ssim: ssim(reference, test, mask),
        flip_mean: flip_mean(reference, test, mask),
        max_diff: max_diff(reference, test, mask),
    }
}

/// The pixels that a comparison looks at: the silhouette of `truth`, dilated by [`SILHOUETTE_MARGIN_PX`].
pub fn silhouette_mask(truth: &Truth) -> Mask {
    truth.silhouette().dilated(SILHOUETTE_MARGIN_PX)
}

/// Peak signal-to-noise ratio in dB over all channels of 8-bit sRGB: `10 log10(255² / mean squared difference)`; `None` when
/// identical.
///
/// # Panics
/// When the sizes differ.
pub fn psnr_db(reference: &Picture, test: &Picture, mask: Option<&Mask>) -> Option<f64> {
    let (mut sum, mut pixels) = (0u64, 0u64);
    for (a, b) in compared_pixels(reference, test, mask) {
        pixels += 1;
        sum += (0..3).map(|channel| u64::from(a[channel].abs_diff(b[channel])).pow(2)).sum::<u64>();
    }
    let mean = sum as f64 / (pixels * 3) as f64;
    (sum > 0).then(|| 10.0 * libm::log10(255.0 * 255.0 / mean))
}

/// Largest difference of any channel, in 8-bit steps.
///
/// # Panics
/// When the sizes differ.
pub fn max_diff(reference: &Picture, test: &Picture, mask: Option<&Mask>) -> u8 {
    compared_pixels(reference, test, mask)
        .flat_map(|(a, b)| (0..3).map(move |channel| a[channel].abs_diff(b[channel])))
        .max()
        .unwrap_or(0)
}

/// Mean FLIP error, 0 to 1, at [`FLIP_PIXELS_PER_DEGREE`].
///
/// # Panics
/// When the sizes differ.
///
/// # Source
/// Andersson et al., *FLIP: A Difference Evaluator for Alternating Images*, HPG 2020; the authors' code.
pub fn flip_mean(reference: &Picture, test: &Picture, mask: Option<&Mask>) -> f64 {
    assert_same_size(reference, test, mask);
    if reference.size.pixels() == 0 {
        return 0.0;
    }
    let flip_image = |picture: &Picture| {
        nv_flip::FlipImageRgb8::with_data(picture.size.width, picture.size.height, picture.as_bytes())
    };
    let errors = nv_flip::flip(flip_image(reference), flip_image(test), FLIP_PIXELS_PER_DEGREE).to_vec();
    mean_within(&errors, mask)
}

/// Mean of the values within a mask, or of all; 0 of none.
fn mean_within(values: &[f32], mask: Option<&Mask>) -> f64 {
    let members = values.iter().enumerate().filter(|(index, _)| mask.is_none_or(|mask| mask.members[*index]));
    let (sum, count) = members.fold((0.0, 0u64), |(sum, count), (_, &value)| (sum + f64::from(value), count + 1));
    if count > 0 { sum / count as f64 } else { 0.0 }
}

pub(crate) fn compared_pixels<'a>(
    reference: &'a Picture,
    test: &'a Picture,
    mask: Option<&'a Mask>,
) -> impl Iterator<Item = ([u8; 3], [u8; 3])> {
    assert_same_size(reference, test, mask);
    let both = reference.pixels.iter().copied().zip(test.pixels.iter().copied()).enumerate();
    both.filter(move |(index, _)| mask.is_none_or(|mask| mask.members[*index])).map(|(_, pair)| pair)
}

pub(crate) fn assert_same_size(reference: &Picture, test: &Picture, mask: Option<&Mask>) {
    assert_eq!(reference.size, test.size, "the pictures differ in size");
    if let Some(mask) = mask {
        assert_eq!(reference.size, mask.size, "the mask differs in size from the pictures");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;

    const SIZE: ImageSize = ImageSize { width: 24, height: 16 };

    fn gradient() -> Picture {
        let pixels = (0..SIZE.pixels()).map(|i| [(i % 24 * 10) as u8, (i / 24 * 15) as u8, 90]).collect();
        Picture { size: SIZE, pixels }
    }

    #[test]
    fn identical_pictures_have_no_psnr_and_no_error() {
        let none = Comparison { psnr_db: None, ssim: 1.0, flip_mean: 0.0, max_diff: 0 };
        assert_eq!(compare(&gradient(), &gradient(), None), none);
    }

    #[test]
    fn psnr_is_that_of_the_formula_by_hand() {
        let (black, white) = (Picture::filled(SIZE, [0; 3]), Picture::filled(SIZE, [255; 3]));
        assert_eq!(psnr_db(&black, &white, None), Some(0.0));
        // One step everywhere: 20 log10 255.
        let psnr = psnr_db(&black, &Picture::filled(SIZE, [1; 3]), None).unwrap();
        assert!((psnr - 48.130_803_608_679_1).abs() < 1e-9);
        // Ten steps in one channel of a quarter of the pixels: mean square 100 / 12.
        let mut spotted = black.clone();
        spotted.pixels.iter_mut().step_by(4).for_each(|pixel| pixel[1] = 10);
        let psnr = psnr_db(&black, &spotted, None).unwrap();
        assert!((psnr - 10.0 * (65025.0f64 * 12.0 / 100.0).log10()).abs() < 1e-9);
        assert_eq!(max_diff(&black, &spotted, None), 10);
    }

    #[test]
    fn what_lies_outside_the_mask_does_not_count() {
        let mut damaged = gradient();
        damaged.pixels[0] = [255; 3];
        let mut mask = Mask { size: SIZE, members: vec![true; SIZE.pixels()] };
        mask.members[0] = false;
        assert_eq!(
            (psnr_db(&gradient(), &damaged, Some(&mask)), max_diff(&gradient(), &damaged, Some(&mask))),
            (None, 0)
        );
        assert!(psnr_db(&gradient(), &damaged, None).is_some());
        mask.members.fill(false);
        let nothing = Comparison { psnr_db: None, ssim: 1.0, flip_mean: 0.0, max_diff: 0 };
        assert_eq!(compare(&gradient(), &damaged, Some(&mask)), nothing);
    }

    #[test]
    fn flip_grows_with_the_difference_and_stays_below_one() {
        let (black, white) = (Picture::filled(SIZE, [0; 3]), Picture::filled(SIZE, [255; 3]));
        let worst = flip_mean(&black, &white, None);
        let mut slight = gradient();
        slight.pixels.iter_mut().for_each(|pixel| pixel[1] += 4);
        let mut strong = gradient();
        strong.pixels.iter_mut().for_each(|pixel| pixel[1] = 255 - pixel[1]);
        let (slight, strong) = (flip_mean(&gradient(), &slight, None), flip_mean(&gradient(), &strong, None));
        assert!(0.0 < slight && slight < 0.2 && slight < strong && strong < worst, "{slight} {strong} {worst}");
        assert!(worst > 0.9 && worst <= 1.0, "{worst}");
    }
}
