//! Cameras where renderers go wrong: random, but the same for the same seed.
//!
//! Takes a mesh and a seed; returns poses in turn from afar, from close to the surface, along it at 5°, and from behind it.

use crate::Mesh;
use gigalod_geom::{Camera, ImageSize};
use glam::DVec3;

/// Where a pose comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Any direction, from half to four times the distance that shows the whole.
    Around,
    /// Straight on, tilted by up to 45°, a thousandth to a tenth of the model's size away from a point of the surface.
    CloseUp,
    /// 5° above the surface.
    Grazing,
    /// From the other side of the surface, looking out.
    Behind,
}

/// The `index`th of any number of poses.
pub fn pose(mesh: &Mesh, seed: u64, index: u64, fov_y_rad: f64, size: ImageSize) -> (Place, Camera) {
    let mut random = Random(seed ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let scale = mesh.bounds().diagonal();
    let up = random.direction();
    let place = [Place::Around, Place::CloseUp, Place::Grazing, Place::Behind][(index % 4) as usize];
    if place == Place::Around {
        let distance = scale * 0.5 / (fov_y_rad * 0.5).tan() * random.between_log(0.5, 4.0);
        let center = mesh.bounds().center();
        let eye = center + random.direction() * distance;
        return (place, Camera::look_at(eye, center + random.direction() * scale * 0.2, up, fov_y_rad, size));
    }
    let (at, normal) = loop {
        let triangle = (random.unit() * mesh.triangles().len() as f64) as u32;
        let [a, b] = [random.unit(), random.unit()];
        let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
        // A triangle without area has no normal.
        if let Some(normal) = mesh.flat_normal(triangle).try_normalize() {
            break (mesh.point(triangle, [1.0 - a - b, a, b]), normal);
        }
    };
    let along = normal.cross(random.direction()).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
    let away = scale * random.between_log(1e-3, 0.1);
    let (sin, cos) = match place {
        Place::Grazing => 5f64.to_radians(),
        _ => random.between_log(45.0, 90.0).to_radians(),
    }
    .sin_cos();
    let offset = (normal * sin + along * cos) * away;
    let eye = if place == Place::Behind { at - offset } else { at + offset };
    (place, Camera::look_at(eye, at, up, fov_y_rad, size))
}

/// SplitMix64: Steele, Lea and Flood, *Fast splittable pseudorandom number generators*, 2014.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between_log(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// Uniform over the sphere: of equal heights there is equal area (Archimedes).
    fn direction(&mut self) -> DVec3 {
        let height = self.unit() * 2.0 - 1.0;
        let (sin, cos) = (self.unit() * std::f64::consts::TAU).sin_cos();
        let ring = (1.0 - height * height).sqrt();
        DVec3::new(ring * cos, ring * sin, height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    #[test]
    fn poses_are_where_they_say_and_the_same_for_the_same_seed() {
        let ball = fixtures::icosphere(4, DVec3::new(3.0, -1.0, 2.0));
        let size = ImageSize { width: 64, height: 48 };
        let center = DVec3::new(3.0, -1.0, 2.0);
        for index in 0..200 {
            let (place, camera) = pose(&ball, 7, index, 0.7, size);
            assert_eq!((place, camera), pose(&ball, 7, index, 0.7, size));
            assert_ne!(camera, pose(&ball, 8, index, 0.7, size).1);
            let from_center = (camera.eye - center).length();
            // A ball of radius 1 is 2 √3 across its box's diagonal.
            match place {
                Place::Around => assert!(from_center > 1.7, "{from_center}"),
                Place::CloseUp => assert!(from_center > 1.0 && from_center < 1.5, "{from_center}"),
                Place::Grazing => assert!(from_center > 0.99 && from_center < 1.1, "{from_center}"),
                Place::Behind => assert!(from_center < 1.0, "{from_center}"),
            }
        }
    }
}
