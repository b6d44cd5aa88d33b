//! Widths of normal cones in 2 bits.

/// Sines of the half-angles that the four codes stand for. The last one stands for every direction.
pub const SINES: [f32; 4] = [1.0 / 16.0, 4.0 / 16.0, 9.0 / 16.0, 1.0];

/// The narrowest code whose cone holds all directions with at least this cosine to the axis.
///
/// The cosine, not the sine, because cones wider than a half-space occur: they, and NaN, get the last code.
pub fn encode(cos_half_angle: f32) -> u8 {
    // cos = sqrt(1 − sin²), rounded up a little: the rounding of a dot product must not narrow a cone.
    const COSINES: [f32; 3] = [0.998_046_9 + 2e-6, 0.968_245_9 + 2e-6, 0.826_797_3 + 2e-6];
    COSINES.iter().position(|cos| cos_half_angle >= *cos).unwrap_or(3) as u8
}

/// Cosine of the half-angle of a code; −1 for the last one, which holds every direction.
pub fn cosine(code: u8) -> f32 {
    match code {
        0..=2 => {
            let sine = SINES[usize::from(code)];
            (1.0 - sine * sine).sqrt()
        }
        _ => -1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_never_narrower_than_what_it_was_made_from() {
        for step in 0..=2000 {
            let cos = step as f32 / 1000.0 - 1.0;
            let code = encode(cos);
            assert!(cosine(code) <= cos, "{cos} {code}");
            assert!(code == 0 || cosine(code - 1) > cos - 1e-5, "{cos} could be narrower than {code}");
        }
        assert_eq!(encode(f32::NAN), 3);
    }
}
