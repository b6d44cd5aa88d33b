//! Error on screen as it is, not as it is claimed: how far what was drawn lies from the surface, in pixels.
//!
//! Takes the depths a frame drew; returns the largest error of any pixel and where it is. Each drawn pixel is a point of
//! space; its error is the distance to the nearest point of the surface, as a length seen from the eye at the depth of the
//! middle between the two. (No two points of a ball show a longer one than the ball's silhouette is across, so for what is
//! drawn on balls around the surface the projected diameter bounds it.)

use crate::Bvh;
use gigalod_geom::Camera;
use glam::DVec2;
use rayon::prelude::*;

/// An error on screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenError {
    /// In pixels; +inf where the middle between the drawn and the true point is not in front of the eye.
    pub px: f64,
    /// `[x, y]`.
    pub pixel: [u32; 2],
}

/// The largest error of all drawn pixels; `None` where nothing is drawn, or where there is no surface. `depth` is measured
/// along the viewing axis, row by row, +inf for background.
///
/// # Panics
/// When there are not as many depths as pixels.
pub fn largest(bvh: &Bvh, camera: &Camera, depth: &[f32]) -> Option<ScreenError> {
    assert_eq!(depth.len(), camera.size.pixels(), "the drawn depth is of another size than the camera's picture");
    let width = camera.size.width as usize;
    let error_at = |index: usize| {
        let drawn = f64::from(depth[index]);
        let pixel = [(index % width) as u32, (index / width) as u32];
        let center = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + 0.5;
        let point = camera.eye + camera.ray_through(center) * drawn;
        let nearest = bvh.nearest_point(point).filter(|_| drawn.is_finite())?;
        let on_surface = bvh.mesh().point(nearest.triangle, nearest.barycentrics);
        let middle_depth = ((point + on_surface) * 0.5 - camera.eye).dot(camera.forward);
        let px = if middle_depth > 0.0 { nearest.distance * camera.focal_px() / middle_depth } else { f64::INFINITY };
        Some(ScreenError { px, pixel })
    };
    (0..depth.len())
        .into_par_iter()
        .filter_map(error_at)
        .max_by(|a, b| a.px.total_cmp(&b.px).then(b.pixel.cmp(&a.pixel)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, Truth, fixtures};
    use gigalod_geom::ImageSize;
    use glam::DVec3;

    fn ball() -> (Mesh, Camera) {
        let size = ImageSize { width: 80, height: 60 };
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.6, size);
        (fixtures::icosphere(4, DVec3::ZERO), camera)
    }

    #[test]
    fn the_truth_has_no_error() {
        let (mesh, camera) = ball();
        let bvh = Bvh::build(&mesh);
        let depths = Truth::trace(&bvh, &camera, [128; 3]).depths_f32();
        let error = largest(&bvh, &camera, &depths).unwrap();
        assert!(error.px < 1e-3, "{error:?}");
        assert_eq!(largest(&bvh, &camera, &vec![f32::INFINITY; depths.len()]), None);
    }

    #[test]
    fn a_pixel_in_front_of_the_surface_has_its_distance_as_error() {
        let (mesh, camera) = ball();
        let bvh = Bvh::build(&mesh);
        let mut depths = Truth::trace(&bvh, &camera, [128; 3]).depths_f32();
        // The middle of the picture sees the ball at depth 4; half a unit nearer is half a unit off, seen at 3.75.
        let middle = 30 * 80 + 40;
        depths[middle] -= 0.5;
        let error = largest(&bvh, &camera, &depths).unwrap();
        assert_eq!(error.pixel, [40, 30]);
        let expected = 0.5 * camera.focal_px() / 3.75;
        assert!((error.px / expected - 1.0).abs() < 0.01, "{} for {expected}", error.px);
    }
}
