//! How far every pixel is from the nearest pixel of a set: the exact Euclidean distance transform.

use crate::Mask;

/// Squared distance, in pixels, from the centre of each pixel to that of the nearest pixel of `mask`: an exact whole number,
/// or +inf everywhere where the mask is empty. Row by row.
///
/// # Source
/// Felzenszwalb & Huttenlocher, *Distance Transforms of Sampled Functions*, Theory of Computing 8, 2012, algorithm 1 along
/// rows, then along columns.
pub fn squared_distance_px(mask: &Mask) -> Vec<f64> {
    let (width, height) = (mask.size.width as usize, mask.size.height as usize);
    let mut squared: Vec<f64> = mask.members.iter().map(|&member| if member { 0.0 } else { f64::INFINITY }).collect();
    let mut envelope = LowerEnvelope::default();
    for row in squared.chunks_exact_mut(width.max(1)) {
        envelope.transform(row);
    }
    let mut column = vec![0.0; height];
    for x in 0..width {
        for y in 0..height {
            column[y] = squared[y * width + x];
        }
        envelope.transform(&mut column);
        for y in 0..height {
            squared[y * width + x] = column[y];
        }
    }
    squared
}

/// The lower envelope of parabolas `(q - v)² + f(v)`, one per finite sample `f(v)`; kept between lines for its memory.
#[derive(Default)]
struct LowerEnvelope {
    /// Parabolas on the envelope, left to right: vertex `v`, height `f(v)`, and the abscissa from which it is the lowest.
    parabolas: Vec<(f64, f64, f64)>,
}

impl LowerEnvelope {
    /// Replaces each sample by the envelope's height there.
    fn transform(&mut self, samples: &mut [f64]) {
        self.parabolas.clear();
        for (v, &f) in samples.iter().enumerate().filter(|(_, f)| f.is_finite()) {
            let v = v as f64;
            let mut from = f64::NEG_INFINITY;
            while let Some(&(last_v, last_f, last_from)) = self.parabolas.last() {
                from = ((f + v * v) - (last_f + last_v * last_v)) / (2.0 * (v - last_v));
                if from > last_from {
                    break;
                }
                self.parabolas.pop();
                from = f64::NEG_INFINITY;
            }
            self.parabolas.push((v, f, from));
        }
        let mut lowest = 0;
        for (q, sample) in samples.iter_mut().enumerate() {
            let q = q as f64;
            while self.parabolas.get(lowest + 1).is_some_and(|next| next.2 < q) {
                lowest += 1;
            }
            if let Some((v, f, _)) = self.parabolas.get(lowest) {
                *sample = (q - v) * (q - v) + f;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distance_is_that_of_brute_force(
            width in 1u32..20, height in 1u32..20, seeds in prop::collection::vec((0u32..20, 0u32..20), 0..6)) {
            let size = ImageSize { width, height };
            let seeds: Vec<_> = seeds.into_iter().map(|(x, y)| (x % width, y % height)).collect();
            let mut mask = Mask { size, members: vec![false; size.pixels()] };
            for (x, y) in &seeds {
                mask.members[(y * width + x) as usize] = true;
            }
            let squared = squared_distance_px(&mask);
            for y in 0..height {
                for x in 0..width {
                    let away = |(sx, sy): &(u32, u32)| f64::from(sx.abs_diff(x).pow(2) + sy.abs_diff(y).pow(2));
                    let expected = seeds.iter().map(away).fold(f64::INFINITY, f64::min);
                    prop_assert_eq!(squared[(y * width + x) as usize], expected);
                }
            }
        }
    }
}
