//! Structural similarity of two pictures.
//!
//! Takes two 8-bit sRGB pictures and perhaps a mask; returns the mean of the three channels' SSIM. Channels rather than luma:
//! a texture that is right in brightness and wrong in colour is wrong.

use crate::metrics::assert_same_size;
use crate::{Mask, Picture};
use rayon::prelude::*;

/// The window is 2 · 5 + 1 = 11 pixels wide.
const WINDOW_RADIUS: usize = 5;
/// Standard deviation of the Gaussian window, in pixels.
const WINDOW_SIGMA: f64 = 1.5;
/// (K₁ L)² and (K₂ L)² with K₁ = 0.01, K₂ = 0.03 and L = 255.
const C1: f64 = 0.01 * 255.0 * (0.01 * 255.0);
const C2: f64 = 0.03 * 255.0 * (0.03 * 255.0);

/// Mean structural similarity, at most 1: over all pixels of the mask whose window lies inside the picture, and over the
/// three channels. Where there are no such pixels (small pictures), over all pixels of the mask, with windows cut at the
/// border. An empty mask gives 1.
///
/// # Panics
/// When the sizes differ.
///
/// # Source
/// Wang, Bovik, Sheikh & Simoncelli, *Image Quality Assessment: From Error Visibility to Structural Similarity*, IEEE TIP
/// 13(4), 2004, eq. 13, with the authors' window and constants. Differs: three channels instead of luma, no downsampling;
/// the same as scikit-image's `structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False)`.
pub fn ssim(reference: &Picture, test: &Picture, mask: Option<&Mask>) -> f64 {
    assert_same_size(reference, test, mask);
    let (width, height) = (reference.size.width as usize, reference.size.height as usize);
    let is_member = |index: &usize| mask.is_none_or(|mask| mask.members[*index]);
    let has_whole_window = |index: &usize| {
        let inside = |at: usize, length: usize| at >= WINDOW_RADIUS && at + WINDOW_RADIUS < length;
        inside(index % width, width) && inside(index / width, height)
    };
    let members: Vec<usize> = (0..width * height).filter(is_member).collect();
    let mut pixels: Vec<usize> = members.iter().copied().filter(has_whole_window).collect();
    if pixels.is_empty() {
        pixels = members;
    }
    if pixels.is_empty() {
        return 1.0;
    }
    let sum: f64 = (0..3)
        .map(|channel| {
            let map = ssim_map(width, &channel_of(reference, channel), &channel_of(test, channel));
            pixels.iter().map(|&pixel| map[pixel]).sum::<f64>()
        })
        .sum();
    sum / (3 * pixels.len()) as f64
}

fn channel_of(picture: &Picture, channel: usize) -> Vec<f64> {
    picture.pixels.iter().map(|pixel| f64::from(pixel[channel])).collect()
}

/// SSIM around every pixel of one channel.
fn ssim_map(width: usize, x: &[f64], y: &[f64]) -> Vec<f64> {
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let (mean_x, mean_y) = (windowed_mean(width, x), windowed_mean(width, y));
    let mean_xx = windowed_mean(width, &product(x, x));
    let mean_yy = windowed_mean(width, &product(y, y));
    let mean_xy = windowed_mean(width, &product(x, y));
    (0..x.len()).map(|i| ssim_of_moments(mean_x[i], mean_y[i], mean_xx[i], mean_yy[i], mean_xy[i])).collect()
}

/// The similarity that the means, mean squares and mean product within a window say.
fn ssim_of_moments(mean_x: f64, mean_y: f64, mean_xx: f64, mean_yy: f64, mean_xy: f64) -> f64 {
    let variance_x = mean_xx - mean_x * mean_x;
    let variance_y = mean_yy - mean_y * mean_y;
    let covariance = mean_xy - mean_x * mean_y;
    (2.0 * mean_x * mean_y + C1) * (2.0 * covariance + C2)
        / ((mean_x * mean_x + mean_y * mean_y + C1) * (variance_x + variance_y + C2))
}

/// Gaussian-weighted mean around every pixel; at a border the window is cut and its weights again sum to 1.
fn windowed_mean(width: usize, values: &[f64]) -> Vec<f64> {
    let weights = window();
    let weighted_mean = |at: usize, length: usize, value: &dyn Fn(usize) -> f64| {
        let first = at.saturating_sub(WINDOW_RADIUS);
        let last = (at + WINDOW_RADIUS).min(length - 1);
        let (mut sum, mut weight_sum) = (0.0, 0.0);
        for i in first..=last {
            let weight = weights[i + WINDOW_RADIUS - at];
            sum += weight * value(i);
            weight_sum += weight;
        }
        sum / weight_sum
    };
    let height = values.len() / width;
    let along_rows: Vec<f64> = (0..values.len())
        .into_par_iter()
        .map(|index| weighted_mean(index % width, width, &|x| values[index / width * width + x]))
        .collect();
    (0..values.len())
        .into_par_iter()
        .map(|index| weighted_mean(index / width, height, &|y| along_rows[y * width + index % width]))
        .collect()
}

/// Weights of the window along one axis, not normalised.
fn window() -> [f64; 2 * WINDOW_RADIUS + 1] {
    std::array::from_fn(|i| {
        let away = i as f64 - WINDOW_RADIUS as f64;
        libm::exp(-away * away / (2.0 * WINDOW_SIGMA * WINDOW_SIGMA))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;

    /// The definition, pixel by pixel in two dimensions, with centred moments.
    fn ssim_slowly(a: &Picture, b: &Picture) -> f64 {
        let (width, height) = (a.size.width as i64, a.size.height as i64);
        let (mut sum, mut count) = (0.0, 0.0);
        for (y, x) in (5..height - 5).flat_map(|y| (5..width - 5).map(move |x| (y, x))) {
            for channel in 0..3 {
                let mut window = Vec::new();
                for (dy, dx) in (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (dy, dx))) {
                    let index = ((y + dy) * width + x + dx) as usize;
                    let weight = (-((dx * dx + dy * dy) as f64) / 4.5).exp();
                    window.push((weight, f64::from(a.pixels[index][channel]), f64::from(b.pixels[index][channel])));
                }
                let total: f64 = window.iter().map(|w| w.0).sum();
                let mean = |f: &dyn Fn(f64, f64) -> f64| window.iter().map(|w| w.0 * f(w.1, w.2)).sum::<f64>() / total;
                let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
                let (va, vb) = (mean(&|a, _| (a - ma) * (a - ma)), mean(&|_, b| (b - mb) * (b - mb)));
                let cov = mean(&|a, b| (a - ma) * (b - mb));
                let (c1, c2) = (6.5025, 58.5225);
                sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
                count += 1.0;
            }
        }
        sum / count
    }

    fn noise(size: ImageSize, seed: u32) -> Picture {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        Picture { size, pixels: (0..size.pixels()).map(|_| [next(), next(), next()]).collect() }
    }

    #[test]
    fn fast_and_slow_ssim_agree() {
        let size = ImageSize { width: 31, height: 23 };
        let mut softened = noise(size, 1);
        softened.pixels.iter_mut().for_each(|pixel| pixel[0] = pixel[0] / 2 + 40);
        for (a, b) in [(noise(size, 1), noise(size, 2)), (noise(size, 1), softened)] {
            let (fast, slow) = (ssim(&a, &b, None), ssim_slowly(&a, &b));
            assert!((fast - slow).abs() < 1e-9, "{fast} {slow}");
        }
    }

    #[test]
    fn flat_pictures_compare_by_their_means_alone() {
        let size = ImageSize { width: 16, height: 16 };
        let expected = (2.0 * 100.0 * 150.0 + C1) / (100.0 * 100.0 + 150.0 * 150.0 + C1);
        let found = ssim(&Picture::filled(size, [100; 3]), &Picture::filled(size, [150; 3]), None);
        assert!((found - expected).abs() < 1e-9);
    }

    #[test]
    fn pictures_smaller_than_the_window_still_have_a_similarity() {
        for (width, height) in [(1, 1), (3, 40), (40, 2)] {
            let size = ImageSize { width, height };
            assert_eq!(ssim(&noise(size, 3), &noise(size, 3), None), 1.0);
            assert!(ssim(&noise(size, 3), &noise(size, 4), None) < 0.99);
        }
    }
}
