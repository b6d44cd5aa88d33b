//! What a moving camera shows: shimmer, and the sharpness without which it is easily had.
//!
//! Takes the pictures of a camera that moves by the same small step each frame. Where a picture is filtered well, a pixel
//! changes smoothly; where it is not, samples jump from pixel to pixel and it flickers. So shimmer is the second difference
//! in time. A blurred picture has none: that is what the gradient beside it is for.

use crate::{Mask, Picture};

/// Root mean square over frames and pixels within `mask` of the second difference in time of luma, in 8-bit steps.
///
/// # Panics
/// When there are fewer than three pictures, or sizes differ.
pub fn shimmer(frames: &[Picture], mask: &Mask) -> f64 {
    assert!(frames.len() >= 3, "a second difference needs three pictures");
    let (mut sum, mut count) = (0.0, 0u64);
    for three in frames.windows(3) {
        let [before, now, after] = three else { unreachable!("windows of three") };
        assert!(now.size == mask.size && before.size == mask.size && after.size == mask.size, "sizes differ");
        for pixel in (0..mask.members.len()).filter(|&pixel| mask.members[pixel]) {
            let [a, b, c] = [before, now, after].map(|picture| luma(picture.pixels[pixel]));
            sum += (a - 2.0 * b + c).powi(2);
            count += 1;
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

/// Mean length of the luma's gradient within `mask`, in 8-bit steps a pixel, by central differences; pixels at the picture's
/// edge are left out.
///
/// # Panics
/// When sizes differ.
pub fn sharpness(picture: &Picture, mask: &Mask) -> f64 {
    assert_eq!(picture.size, mask.size, "sizes differ");
    let [width, height] = [picture.size.width, picture.size.height].map(|length| length as usize);
    let at = |x: usize, y: usize| luma(picture.pixels[y * width + x]);
    let (mut sum, mut count) = (0.0, 0u64);
    for y in 1..height.saturating_sub(1) {
        for x in (1..width.saturating_sub(1)).filter(|x| mask.members[y * width + x]) {
            sum += (at(x + 1, y) - at(x - 1, y)).hypot(at(x, y + 1) - at(x, y - 1)) * 0.5;
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// Rec. 709 luma of an encoded colour, in 8-bit steps.
fn luma([r, g, b]: [u8; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;

    const SIZE: ImageSize = ImageSize { width: 32, height: 8 };

    fn picture(value: impl Fn(usize) -> f64) -> Picture {
        let pixels = (0..SIZE.pixels()).map(|index| [value(index % 32).round() as u8; 3]).collect();
        Picture { size: SIZE, pixels }
    }

    fn all() -> Mask {
        Mask { size: SIZE, members: vec![true; SIZE.pixels()] }
    }

    #[test]
    fn what_moves_smoothly_does_not_shimmer_and_what_jumps_does() {
        // A ramp that moves by a pixel a frame.
        let smooth: Vec<Picture> = (0..9).map(|t| picture(|x| (x as f64 - f64::from(t)) * 5.0 + 50.0)).collect();
        assert!(shimmer(&smooth, &all()) < 1e-9);
        // Stripes one pixel wide that jump every second frame.
        let stripes = |shift: usize| picture(|x| if (x + shift).is_multiple_of(2) { 200.0 } else { 100.0 });
        let jumping: Vec<Picture> = (0..9).map(|t| stripes(t / 2)).collect();
        assert!((shimmer(&jumping, &all()) - 100.0).abs() < 1.0, "{}", shimmer(&jumping, &all()));
    }

    #[test]
    fn a_blurred_edge_is_less_sharp_than_its_mean_slope_is_wide() {
        let ramp = picture(|x| x as f64 * 4.0);
        assert!((sharpness(&ramp, &all()) - 4.0).abs() < 1e-9);
        let texture = |contrast: f64| picture(move |x| 128.0 + contrast * (x as f64 * 1.3).sin());
        assert!(sharpness(&texture(60.0), &all()) > 1.9 * sharpness(&texture(30.0), &all()));
        let nothing = Mask { size: SIZE, members: vec![false; SIZE.pixels()] };
        assert_eq!((sharpness(&ramp, &nothing), shimmer(&vec![ramp; 3], &nothing)), (0.0, 0.0));
    }
}
