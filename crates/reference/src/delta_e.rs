//! How different two colours look: CIEDE2000.
//!
//! In: 8-bit sRGB colours, or CIE L*a*b* of daylight (D65). Out: ΔE₀₀, about 1 where a difference is just noticeable.
//!
//! # Source
//! CIE 142-2001; Sharma, Wu & Dalal, *The CIEDE2000 Color-Difference Formula: Implementation Notes, Supplementary Test Data, and
//! Mathematical Observations*, Color Research and Application 30(1), 2005.

use crate::metrics::compared_pixels;
use crate::{Mask, Picture};
use gigalod_geom::color::LINEAR_OF_SRGB8;

/// Mean ΔE₀₀ of two pictures within `mask`, or everywhere; 0 where nothing is compared.
///
/// # Panics
/// When the sizes differ.
pub fn mean_delta_e(reference: &Picture, test: &Picture, mask: Option<&Mask>) -> f64 {
    let (mut sum, mut pixels) = (0.0, 0u64);
    for (a, b) in compared_pixels(reference, test, mask) {
        sum += if a == b { 0.0 } else { delta_e(lab(a), lab(b)) };
        pixels += 1;
    }
    if pixels == 0 { 0.0 } else { sum / pixels as f64 }
}

/// CIE L*a*b* of an 8-bit sRGB colour, relative to D65.
pub fn lab(srgb: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = srgb.map(|value| f64::from(LINEAR_OF_SRGB8[usize::from(value)]));
    // IEC 61966-2-1; each row divided by what it gives for white.
    let rows = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
    let [x, y, z] = rows.map(|[of_r, of_g, of_b]| {
        let t: f64 = (of_r * r + of_g * g + of_b * b) / (of_r + of_g + of_b);
        if t > 216.0 / 24389.0 { libm::cbrt(t) } else { (24389.0 / 27.0 * t + 16.0) / 116.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// ΔE₀₀ of two colours in CIE L*a*b*.
pub fn delta_e([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
    let chroma = |a: f64, b: f64| (a * a + b * b).sqrt();
    let pow7 = |value: f64| libm::pow(value, 7.0);
    let share = |chroma: f64| (pow7(chroma) / (pow7(chroma) + pow7(25.0))).sqrt();
    let stretch = 1.0 + 0.5 * (1.0 - share((chroma(a1, b1) + chroma(a2, b2)) * 0.5));
    let (a1, a2) = (a1 * stretch, a2 * stretch);
    let (c1, c2) = (chroma(a1, b1), chroma(a2, b2));
    // Degrees from 0; of grey, 0.
    let hue = |a: f64, b: f64| {
        let degrees = libm::atan2(b, a).to_degrees();
        if degrees < 0.0 { degrees + 360.0 } else { degrees }
    };
    let (h1, h2) = (hue(a1, b1), hue(a2, b2));
    let is_grey = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if is_grey => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let mean_hue = match (h1 + h2, (h1 - h2).abs()) {
        (sum, _) if is_grey => sum,
        (sum, apart) if apart <= 180.0 => sum * 0.5,
        (sum, _) if sum < 360.0 => (sum + 360.0) * 0.5,
        (sum, _) => (sum - 360.0) * 0.5,
    };
    let (dl, dc) = (l2 - l1, c2 - c1);
    let dh = 2.0 * (c1 * c2).sqrt() * libm::sin(turn.to_radians() * 0.5);
    let (mean_l, mean_c) = ((l1 + l2) * 0.5, (c1 + c2) * 0.5);
    let cos = |degrees: f64| libm::cos(degrees.to_radians());
    let t = 1.0 - 0.17 * cos(mean_hue - 30.0) + 0.24 * cos(2.0 * mean_hue) + 0.32 * cos(3.0 * mean_hue + 6.0)
        - 0.20 * cos(4.0 * mean_hue - 63.0);
    let lightness = (mean_l - 50.0) * (mean_l - 50.0);
    let sl = 1.0 + 0.015 * lightness / (20.0 + lightness).sqrt();
    let (sc, sh) = (1.0 + 0.045 * mean_c, 1.0 + 0.015 * mean_c * t);
    let off_blue = (mean_hue - 275.0) / 25.0;
    let rotation = -2.0 * share(mean_c) * libm::sin((60.0 * libm::exp(-off_blue * off_blue)).to_radians());
    let (l, c, h) = (dl / sl, dc / sc, dh / sh);
    (l * l + c * c + h * h + rotation * c * h).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;

    /// Table 1 of Sharma, Wu & Dalal: two colours and their difference.
    const PAIRS: [[f64; 7]; 34] = [
        [50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425],
        [50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615],
        [50.0, 2.8361, -74.02, 50.0, 0.0, -82.7485, 3.4412],
        [50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0],
        [50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0],
        [50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0],
        [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669],
        [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.001, 7.1792],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.0012, 7.2195],
        [50.0, -0.001, 2.49, 50.0, 0.0009, -2.49, 4.8045],
        [50.0, -0.001, 2.49, 50.0, 0.001, -2.49, 4.8045],
        [50.0, -0.001, 2.49, 50.0, 0.0011, -2.49, 4.7461],
        [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065],
        [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492],
        [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977],
        [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.9030],
        [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535],
        [50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0],
        [50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0],
        [50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0],
        [50.0, 2.5, 0.0, 50.0, 3.2592, 0.335, 1.0],
        [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
        [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630],
        [61.2901, 3.7196, -5.3901, 61.4292, 2.248, -4.962, 1.8731],
        [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
        [22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373],
        [36.4612, 47.858, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
        [90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441],
        [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
        [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
        [2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082],
    ];

    #[test]
    fn the_published_pairs_differ_as_published() {
        for [l1, a1, b1, l2, a2, b2, expected] in PAIRS {
            let (first, second) = ([l1, a1, b1], [l2, a2, b2]);
            for found in [delta_e(first, second), delta_e(second, first)] {
                assert!((found - expected).abs() < 5e-5, "{first:?} {second:?}: {found}, published {expected}");
            }
        }
    }

    #[test]
    fn srgb_colours_are_where_they_are_known_to_be() {
        let known = [
            ([255; 3], [100.0, 0.0, 0.0]),
            ([0; 3], [0.0; 3]),
            ([255, 0, 0], [53.24, 80.09, 67.20]),
            ([0, 255, 0], [87.74, -86.18, 83.18]),
            ([0, 0, 255], [32.30, 79.19, -107.86]),
        ];
        for (srgb, expected) in known {
            let found = lab(srgb);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.05), "{srgb:?}: {found:?}");
        }
    }

    #[test]
    fn a_mean_is_that_of_the_pixels_compared() {
        let size = ImageSize { width: 2, height: 1 };
        let pictures = [[[9; 3], [255; 3]], [[9; 3], [0; 3]]].map(|both| Picture { size, pixels: both.to_vec() });
        let [a, b] = pictures;
        let second = Mask { size, members: vec![false, true] };
        assert!((mean_delta_e(&a, &b, None) - 50.0).abs() < 1e-3);
        assert!((mean_delta_e(&a, &b, Some(&second)) - 100.0).abs() < 1e-3);
        assert_eq!(mean_delta_e(&a, &b, Some(&Mask { size, members: vec![false; 2] })), 0.0);
    }
}
