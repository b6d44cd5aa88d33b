//! Holes and fat: whether a drawn frame covers what it should, and no more.
//!
//! Takes the [`Truth`] of a camera, the pixels the model truly touches, and the depth that was drawn; returns the offending
//! pixels. Both lists must be empty for a frame that keeps its promise.
//!
//! * A *hole* is a pixel where the reference sees surface and the frame shows background, or something behind the surface by
//!   more than the threshold's footprint there: `threshold_px * depth / focal_px` model units. So a crack that shows the
//!   model's own back wall is a hole. Pixels beside a [depth discontinuity](crate::discontinuity) are not judged.
//! * *Fat* is a pixel that is drawn although the model touches no pixel within one pixel plus the threshold (or plus what the
//!   frame says it drew there, where the data end), between pixel centres. What lies beyond the picture's edge may be the
//!   model too: nobody looked.

use crate::discontinuity::away_from_discontinuities;
use crate::distance_transform::squared_distance_px;
use crate::{Mask, Picture, Truth};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Drawn depths are `f32` and went through a renderer in `f32`: differences up to this part of the depth are rounding. One
/// pixel at 1280×720 and 40° is two thousand times as much.
const DEPTH_ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// A frame as it was drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<'a> {
    /// Distance along the viewing axis per pixel, in model units; +inf for background. NaN counts as wrong either way.
    pub depth: &'a [f32],
    /// Per pixel the drawn size, in pixels, of what ran out of data there (a splat of the finest level, say), 0 elsewhere;
    /// `None` where no pixel is limited by data.
    pub data_footprint_px: Option<&'a [f32]>,
}

/// What is wrong with a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Pixels judged for holes: they see surface, away from discontinuities.
    pub judged: Mask,
    /// Pixels that let one see through the surface; row by row.
    pub holes: Vec<Hole>,
    /// Pixels, as `[x, y]`, drawn where there is nothing; row by row.
    pub fat: Vec<[u32; 2]>,
}

/// A pixel through which one sees what the surface should hide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole {
    /// `[x, y]`.
    pub pixel: [u32; 2],
    /// How far behind the surface the drawn point lies, along the viewing axis, in pixel footprints at the surface; +inf for
    /// background, NaN for NaN.
    pub behind_px: f64,
    /// True where the reference itself is that deep within the threshold of the pixel (and a neighbour at least): what a
    /// surface seen at a grazing angle looks like when it is drawn a little to the side. A hole by the letter, though every
    /// drawn point may lie within the threshold of the surface; a crack is not such a hole.
    pub within_error: bool,
}

/// Judges a drawn frame. `touched` are the pixels that the model truly touches, thin features included
/// ([`supersampled_coverage`](crate::raytrace::supersampled_coverage)); `threshold_px` is the error on screen that was asked
/// for.
///
/// # Panics
/// When the sizes differ.
pub fn judge(truth: &Truth, touched: &Mask, drawn: &Drawn, threshold_px: f64) -> Verdict {
    let size = truth.camera.size;
    assert_eq!(touched.size, size, "the coverage is of another size than the truth");
    assert_eq!(drawn.depth.len(), size.pixels(), "the drawn depth is of another size than the truth");
    if let Some(footprint) = drawn.data_footprint_px {
        assert_eq!(footprint.len(), size.pixels(), "the drawn footprint is of another size than the truth");
    }
    let judged = away_from_discontinuities(truth, threshold_px);
    Verdict {
        holes: find_holes(truth, &judged, drawn, threshold_px),
        fat: find_fat(truth, touched, drawn, threshold_px),
        judged,
    }
}

fn find_holes(truth: &Truth, judged: &Mask, drawn: &Drawn, threshold_px: f64) -> Vec<Hole> {
    let camera = &truth.camera;
    let hole_at = |index: usize| {
        let point = truth.surface[index].filter(|_| judged.members[index])?;
        let pixel_footprint = point.depth / camera.focal_px();
        let drawn_depth = f64::from(drawn.depth[index]);
        let slack = threshold_px * pixel_footprint + DEPTH_ROUNDING * point.depth;
        // Written so that NaN is a hole.
        let covered = drawn_depth <= point.depth + slack;
        (!covered).then(|| Hole {
            pixel: truth.pixel(index),
            behind_px: (drawn_depth - point.depth) / pixel_footprint,
            within_error: drawn_depth <= deepest_around(truth, index, threshold_px) + slack,
        })
    };
    (0..truth.surface.len()).filter_map(hole_at).collect()
}

/// The largest depth that the reference sees in the pixels nearest to any point within the threshold of this pixel's centre,
/// and in its eight neighbours.
fn deepest_around(truth: &Truth, index: usize, threshold_px: f64) -> f64 {
    // The centre nearest to a point is at most half a diagonal from it; a neighbour's centre is a diagonal away.
    let reach_px = (threshold_px + FRAC_1_SQRT_2).max(SQRT_2);
    let size = truth.camera.size;
    let [x, y] = truth.pixel(index).map(i64::from);
    let reach = reach_px as i64;
    let around = |at: i64, length: u32| (at - reach).max(0)..=(at + reach).min(i64::from(length) - 1);
    around(y, size.height)
        .flat_map(|row| around(x, size.width).map(move |column| (column, row)))
        .filter(|&(column, row)| ((column - x).pow(2) + (row - y).pow(2)) as f64 <= reach_px * reach_px)
        .map(|(column, row)| truth.depth((row * i64::from(size.width) + column) as usize))
        .fold(0.0, f64::max)
}

fn find_fat(truth: &Truth, touched: &Mask, drawn: &Drawn, threshold_px: f64) -> Vec<[u32; 2]> {
    let away_squared = squared_distance_px(touched);
    let size = truth.camera.size;
    let is_fat = |&index: &usize| {
        let [x, y] = truth.pixel(index);
        let to_edge_px = f64::from((x + 1).min(y + 1).min(size.width - x).min(size.height - y));
        let data_footprint_px = drawn.data_footprint_px.map_or(0.0, |footprint| f64::from(footprint[index]));
        let reach_px = 1.0 + threshold_px.max(data_footprint_px);
        let reaches_something = away_squared[index] <= reach_px * reach_px || to_edge_px <= reach_px;
        drawn.depth[index] != f32::INFINITY && !reaches_something
    };
    (0..drawn.depth.len()).filter(is_fat).map(|index| truth.pixel(index)).collect()
}

impl Verdict {
    /// True when there is nothing to complain about.
    pub fn is_clean(&self) -> bool {
        self.holes.is_empty() && self.fat.is_empty()
    }

    /// A picture for people: the surface in grey, darker where not judged for holes; holes magenta, or orange where
    /// [`within_error`](Hole::within_error); fat yellow.
    pub fn picture(&self, truth: &Truth) -> Picture {
        let size = truth.camera.size;
        let mut picture = Picture::filled(size, [16, 16, 24]);
        for (index, pixel) in picture.pixels.iter_mut().enumerate() {
            if let Some(point) = &truth.surface[index] {
                let facing = truth.ray(index).normalize().dot(point.shading_normal.as_dvec3()).abs();
                let grey = 60.0 + 150.0 * facing;
                *pixel = [if self.judged.members[index] { grey } else { grey * 0.5 } as u8; 3];
            }
        }
        let hole_color = |hole: &Hole| if hole.within_error { [255, 128, 0] } else { [255, 0, 255] };
        let holes = self.holes.iter().map(|hole| (hole.pixel, hole_color(hole)));
        for ([x, y], color) in holes.chain(self.fat.iter().map(|&pixel| (pixel, [255, 255, 0]))) {
            picture.pixels[y as usize * size.width as usize + x as usize] = color;
        }
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raytrace::supersampled_coverage;
    use crate::{Bvh, Mesh, fixtures};
    use gigalod_geom::{Camera, ImageSize};
    use glam::DVec3;

    const SIZE: ImageSize = ImageSize { width: 64, height: 64 };

    /// From 10 units up the z axis; at z = 0 a pixel is 1/8 wide.
    fn camera() -> Camera {
        Camera::look_at(DVec3::Z * 10.0, DVec3::ZERO, DVec3::Y, 2.0 * (0.4f64).atan(), SIZE)
    }

    fn traced(mesh: &Mesh) -> (Truth, Mask) {
        let bvh = Bvh::build(mesh);
        (Truth::trace(&bvh, &camera(), [200; 3]), supersampled_coverage(&bvh, &camera(), 4))
    }

    fn judged(truth: &Truth, touched: &Mask, depth: &[f32], threshold_px: f64) -> Verdict {
        judge(truth, touched, &Drawn { depth, data_footprint_px: None }, threshold_px)
    }

    fn index(x: usize, y: usize) -> usize {
        y * 64 + x
    }

    #[test]
    fn the_truth_itself_is_clean_and_all_but_edges_are_judged() {
        let sphere = fixtures::icosphere(4, DVec3::ZERO);
        let (truth, touched) = traced(&sphere);
        for threshold_px in [0.0, 0.5, 1.0, 3.0] {
            let verdict = judged(&truth, &touched, &truth.depths_f32(), threshold_px);
            assert!(verdict.is_clean(), "{:?}", verdict.holes);
            // A sphere is convex: only pixels beside the background are left out, however steep the rim.
            let beside_background = |i: usize| {
                let (x, y) = (i % 64, i / 64);
                (y - 1..=y + 1).any(|y| (x - 1..=x + 1).any(|x| truth.surface[index(x, y)].is_none()))
            };
            for i in (0..64 * 64).filter(|&i| truth.surface[i].is_some()) {
                assert_eq!(verdict.judged.members[i], !beside_background(i), "pixel {:?}", (i % 64, i / 64));
            }
        }
    }

    #[test]
    fn a_punched_hole_counts_and_a_missing_rim_does_not() {
        let (truth, touched) = traced(&fixtures::icosphere(4, DVec3::ZERO));
        let mut depth = truth.depths_f32();
        depth[index(32, 32)] = f32::INFINITY;
        let rim = (0..64).find(|&x| depth[index(x, 32)].is_finite()).unwrap();
        depth[index(rim, 32)] = f32::INFINITY;
        let verdict = judged(&truth, &touched, &depth, 1.0);
        assert_eq!(verdict.holes.iter().map(|hole| hole.pixel).collect::<Vec<_>>(), [[32, 32]]);
        assert_eq!(verdict.holes[0].behind_px, f64::INFINITY);
        assert_eq!(verdict.picture(&truth).pixels[index(32, 32)], [255, 0, 255]);
        // The next one in from the rim is judged again.
        depth[index(rim + 1, 32)] = f32::INFINITY;
        assert_eq!(judged(&truth, &touched, &depth, 1.0).holes.len(), 2);
    }

    #[test]
    fn a_crack_that_shows_the_back_wall_is_a_hole_from_the_threshold_on() {
        let (truth, touched) = traced(&fixtures::icosphere(4, DVec3::ZERO));
        let at = index(33, 30);
        let footprint = truth.depth(at) / truth.camera.focal_px();
        for (behind_px, threshold_px, holes) in
            [(0.9, 1.0, 0), (1.1, 1.0, 1), (1.1, 1.2, 0), (0.6, 0.5, 1), (16.0, 1.0, 1)]
        {
            let mut depth = truth.depths_f32();
            depth[at] = (truth.depth(at) + behind_px * footprint) as f32;
            let verdict = judged(&truth, &touched, &depth, threshold_px);
            assert_eq!(verdict.holes.len(), holes, "{behind_px} px behind at threshold {threshold_px} px");
            for hole in verdict.holes {
                assert!((hole.behind_px - behind_px).abs() < 1e-3);
                // The sphere is eight pixels in radius: a neighbour is a fraction of a pixel deeper.
                assert_eq!(hole.within_error, behind_px < 2.0);
            }
        }
        let mut depth = truth.depths_f32();
        depth[at] = f32::NAN;
        assert_eq!(judged(&truth, &touched, &depth, 1.0).holes.len(), 1);
    }

    #[test]
    fn a_rim_drawn_a_little_to_the_side_is_a_hole_by_the_letter_but_within_the_error() {
        let (truth, touched) = traced(&fixtures::icosphere(4, DVec3::ZERO));
        let nearest = (0..truth.surface.len()).map(|i| truth.depth(i)).fold(f64::INFINITY, f64::min);
        let (moved, _) = traced(&fixtures::icosphere(4, DVec3::X * 0.9 * nearest / truth.camera.focal_px()));
        let verdict = judged(&truth, &touched, &moved.depths_f32(), 1.0);
        assert!(verdict.holes.len() > 3 && verdict.fat.is_empty());
        assert!(verdict.holes.iter().all(|hole| hole.within_error), "{:?}", verdict.holes);
    }

    #[test]
    fn an_edge_drawn_one_pixel_to_the_side_is_no_hole_and_two_pixels_are() {
        // A plate two units above a floor; its right edge runs between columns 31 and 32.
        let mut triangles = fixtures::rectangle([-20.0, -20.0], [20.0, 20.0], 0.0);
        triangles.extend(fixtures::rectangle([-20.0, -20.0], [0.0, 20.0], 2.0));
        let (truth, touched) = traced(&fixtures::soup(&triangles));
        let verdict = judged(&truth, &touched, &truth.depths_f32(), 1.0);
        for x in 0..64 {
            assert_eq!(verdict.judged.members[index(x, 20)], !(31..=32).contains(&x), "column {x}");
        }
        // The edge drawn one pixel to the left shows the floor where the plate should be: no hole.
        let mut depth = truth.depths_f32();
        (0..64).for_each(|y| depth[index(31, y)] = depth[index(32, y)]);
        assert!(judged(&truth, &touched, &depth, 1.0).is_clean());
        // Two pixels: a hole in every row.
        (0..64).for_each(|y| depth[index(30, y)] = depth[index(32, y)]);
        assert_eq!(judged(&truth, &touched, &depth, 1.0).holes.len(), 64);
    }

    #[test]
    fn fat_begins_exactly_beyond_one_pixel_plus_the_threshold() {
        // What is touched is one pixel; a disc is drawn around it.
        let (truth, _) = traced(&Mesh::new(vec![], None, None, vec![]).unwrap());
        let mut touched = truth.silhouette();
        touched.members[index(32, 32)] = true;
        let disc = |radius_squared: i64| -> Vec<f32> {
            let inside = |i: i64| (i % 64 - 32).pow(2) + (i / 64 - 32).pow(2) <= radius_squared;
            (0..64 * 64).map(|i| if inside(i) { 9.0 } else { f32::INFINITY }).collect()
        };
        // √13 is reached by eight pixels.
        let reach = 13f64.sqrt() - 1.0;
        assert_eq!(judged(&truth, &touched, &disc(13), reach + 1e-9).fat.len(), 0);
        assert_eq!(judged(&truth, &touched, &disc(13), reach - 1e-9).fat.len(), 8);
        assert_eq!(judged(&truth, &touched, &disc(12), reach - 1e-9).fat.len(), 0);
        // Whole numbers: at the radius itself nothing is fat yet.
        assert_eq!(judged(&truth, &touched, &disc(9), 2.0).fat.len(), 0);
        assert_eq!(judged(&truth, &touched, &disc(9), 1.99).fat.len(), 4);
        // Where the data end, the size drawn there takes the threshold's place.
        let (depth, footprint) = (disc(9), vec![2.0; 64 * 64]);
        let drawn = Drawn { depth: &depth, data_footprint_px: Some(&footprint) };
        assert!(judge(&truth, &touched, &drawn, 0.5).is_clean());
    }

    #[test]
    fn what_is_drawn_beside_the_pictures_edge_may_belong_to_what_lies_beyond_it() {
        let (truth, _) = traced(&Mesh::new(vec![], None, None, vec![]).unwrap());
        let touched = truth.silhouette();
        // A row of pixels from the left edge on.
        let depth: Vec<f32> =
            (0..64 * 64).map(|i| if i / 64 == 32 && i % 64 < 9 { 9.0 } else { f32::INFINITY }).collect();
        // Column 3 is 4 pixels away from what lies beyond, and column 4 is 5.
        assert_eq!(judged(&truth, &touched, &depth, 3.0).fat, (4..9).map(|x| [x, 32]).collect::<Vec<_>>());
    }
}
