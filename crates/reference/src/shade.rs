//! The one shading that every comparison uses: Lambert with a little ambient light.
//!
//! Takes what a camera sees; returns linear light or an 8-bit sRGB picture. One directional light, no shadows, no tone map.
//! Surfaces are lit on the side that is seen.

use crate::mesh::linear_of_srgb8;
use crate::raytrace::SurfacePoint;
use crate::{Picture, Truth};
use gigalod_geom::color;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Share of the albedo that shows without any light; the light adds up to the rest.
pub const AMBIENT: f32 = 0.15;

/// Light and colours of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shading {
    /// Direction *towards* the light, any length but zero.
    pub to_light: DVec3,
    /// Where there is no surface.
    pub background_srgb: [u8; 3],
    /// Colour of a mesh that has none.
    pub plain_albedo_srgb: [u8; 3],
}

impl Shading {
    /// Linear RGB of a surface point, or of the background:
    /// `albedo * (AMBIENT + (1 - AMBIENT) * max(0, normal · to_light))`.
    pub fn linear(&self, point: Option<&SurfacePoint>) -> Vec3 {
        let Some(point) = point else { return linear_of_srgb8(self.background_srgb) };
        let to_light = self.to_light.normalize().as_vec3();
        point.albedo * (AMBIENT + (1.0 - AMBIENT) * point.shading_normal.dot(to_light).max(0.0))
    }
}

/// The picture of what a camera sees, one sample per pixel. Colours without a mesh colour are those the truth was traced
/// with.
pub fn picture(truth: &Truth, shading: &Shading) -> Picture {
    let pixels = truth.surface.par_iter().map(|point| srgb8_of_linear(shading.linear(point.as_ref()))).collect();
    Picture { size: truth.camera.size, pixels }
}

/// Nearest 8-bit sRGB colour of linear RGB.
pub fn srgb8_of_linear(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(color::srgb8_of_linear)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facing_the_light_shows_the_albedo_and_facing_away_the_ambient() {
        let shading = Shading { to_light: DVec3::Z * 3.0, background_srgb: [1, 2, 3], plain_albedo_srgb: [0; 3] };
        let albedo = linear_of_srgb8([200, 190, 175]);
        let lit = |normal: Vec3| {
            let point = SurfacePoint { depth: 1.0, shading_normal: normal, flat_normal: normal, albedo, triangle: 0 };
            shading.linear(Some(&point))
        };
        assert_eq!(srgb8_of_linear(lit(Vec3::Z)), [200, 190, 175]);
        assert_eq!(lit(Vec3::NEG_Z), albedo * AMBIENT);
        assert_eq!(lit(Vec3::X), albedo * AMBIENT);
        let half = lit(Vec3::new(0.0, 0.75f32.sqrt(), 0.5));
        assert!((half - albedo * 0.575).length() < 1e-6);
        assert_eq!(srgb8_of_linear(shading.linear(None)), [1, 2, 3]);
    }
}
