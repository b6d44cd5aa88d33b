//! How many pixels a list covers: what drawing it costs besides the number of splats.
//!
//! Goes in: a list and who looks at it. Comes out: pixels, each splat counted by itself. What always holds: the same list gives
//! the same number; it takes about as long for a long list as for a short one, because of a long one every so-and-so-many-th
//! splat stands for its neighbours.

use super::{SplatBall, SplatList};
use crate::ModelView;
use gigalod_geom::projected;
use glam::Vec3;

/// Splats that are looked at, at least, where there are so many.
const LOOKED_AT: usize = 4096;

impl SplatList {
    /// Sum of the areas of the balls' silhouettes, in pixels, none counted as more than the picture; an estimate for long lists.
    pub fn area_px(&self, view: &ModelView) -> f64 {
        let step = (self.len() / LOOKED_AT).max(1);
        let size = view.size();
        let most_px = f64::from(size.width) * f64::from(size.height);
        let area_px = |ball: &SplatBall| {
            let center = Vec3::from(ball.center_in_eye);
            let depth = center.dot(view.forward);
            let diameter = projected::diameter_px(depth, center.length_squared(), ball.radius, view.focal_px);
            // Of what lies behind the eye nothing shows.
            let shows = depth + ball.radius > 0.0;
            if shows { (f64::from(diameter).powi(2) * std::f64::consts::FRAC_PI_4).min(most_px) } else { 0.0 }
        };
        let (mut sum, mut counted, mut skip) = (0.0, 0usize, 0);
        for piece in &self.pieces {
            let looked_at = piece.balls.get(skip..).unwrap_or(&[]).iter().step_by(step);
            let here = looked_at.len();
            sum += looked_at.map(area_px).sum::<f64>();
            counted += here;
            // Where in the next piece to go on.
            skip = (skip + here * step) - piece.balls.len();
        }
        if counted == 0 { 0.0 } else { sum * (self.len() as f64 / counted as f64) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Similarity;
    use crate::splats::SplatPiece;
    use gigalod_geom::{Camera, ImageSize};
    use glam::DVec3;

    fn view() -> ModelView {
        let size = ImageSize { width: 640, height: 360 };
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.7, size);
        ModelView::new(&camera, &Similarity::IDENTITY)
    }

    fn list(sizes: &[f32], in_piece: usize) -> SplatList {
        let balls = sizes.iter().map(|radius| SplatBall { center_in_eye: [0.0, 0.0, -2.0], radius: *radius });
        let balls: Vec<_> = balls.collect();
        let pieces = balls
            .chunks(in_piece)
            .map(|balls| SplatPiece { balls: balls.to_vec(), normal_colors: vec![0; balls.len()] });
        SplatList { pieces: pieces.collect() }
    }

    #[test]
    fn a_short_list_is_counted_and_a_long_one_estimated_however_it_is_cut() {
        let view = view();
        let px = |radius: f32| f64::from(projected::diameter_px(2.0, 4.0, radius, view.focal_px));
        let area = |radius: f32| px(radius).powi(2) * std::f64::consts::FRAC_PI_4;
        let few = list(&[0.1, 0.2], 1);
        assert!((few.area_px(&view) / (area(0.1) + area(0.2)) - 1.0).abs() < 1e-6);
        let sizes: Vec<f32> = (0..100_003).map(|at| 0.001 + 0.01 * (at as f32 * 0.37).sin().abs()).collect();
        let all: f64 = sizes.iter().map(|radius| area(*radius)).sum();
        let whole = list(&sizes, sizes.len()).area_px(&view);
        assert!((whole / all - 1.0).abs() < 0.05, "{whole} {all}");
        for in_piece in [7, 1000, 33_333] {
            assert!((list(&sizes, in_piece).area_px(&view) / whole - 1.0).abs() < 1e-9, "pieces of {in_piece}");
        }
    }

    #[test]
    fn what_reaches_the_eye_counts_as_the_picture_and_what_is_behind_it_not_at_all() {
        let view = view();
        let mut near = list(&[5.0], 1);
        assert_eq!(near.area_px(&view), 640.0 * 360.0);
        near.pieces[0].balls[0].center_in_eye = [0.0, 0.0, 9.0];
        assert_eq!(near.area_px(&view), 0.0);
        assert_eq!(SplatList::default().area_px(&view), 0.0);
    }
}
