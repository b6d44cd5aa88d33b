//! sRGB and linear light, and the 16-bit colour of a splat.

use std::sync::LazyLock;

/// Linear intensity (0–1) of each 8-bit sRGB value (IEC 61966-2-1).
pub static LINEAR_OF_SRGB8: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|value| {
        let encoded = value as f64 / 255.0;
        let linear = if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
        linear as f32
    })
});

/// Nearest 8-bit sRGB value of a linear intensity; below 0 gives 0, above 1 and NaN give 255 and 0.
pub fn srgb8_of_linear(linear: f32) -> u8 {
    let linear = f64::from(linear).clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
    (encoded * 255.0 + 0.5) as u8
}

/// Nearest 5-6-5 colour: red in the top five bits.
pub fn rgb565_of_srgb8([r, g, b]: [u8; 3]) -> u16 {
    let five = |value: u8| (u16::from(value) * 31 + 127) / 255;
    let six = |value: u8| (u16::from(value) * 63 + 127) / 255;
    five(r) << 11 | six(g) << 5 | five(b)
}

/// The 8-bit sRGB colour that a 5-6-5 colour stands for.
pub fn srgb8_of_rgb565(packed: u16) -> [u8; 3] {
    let widen = |value: u16, max: u16| ((value * 255 + max / 2) / max) as u8;
    [widen(packed >> 11, 31), widen(packed >> 5 & 63, 63), widen(packed & 31, 31)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_srgb_value_survives_linear_light() {
        for value in 0..=255u8 {
            assert_eq!(srgb8_of_linear(LINEAR_OF_SRGB8[usize::from(value)]), value);
        }
        assert_eq!([srgb8_of_linear(-1.0), srgb8_of_linear(9.0), srgb8_of_linear(f32::NAN)], [0, 255, 0]);
    }

    #[test]
    fn every_565_colour_survives_widening_and_the_error_is_half_a_step() {
        for packed in 0..=u16::MAX {
            assert_eq!(rgb565_of_srgb8(srgb8_of_rgb565(packed)), packed);
        }
        for value in 0..=255u8 {
            let [r, g, _] = srgb8_of_rgb565(rgb565_of_srgb8([value; 3]));
            assert!(r.abs_diff(value) <= 5 && g.abs_diff(value) <= 3, "{value}: {r} {g}");
        }
    }
}
