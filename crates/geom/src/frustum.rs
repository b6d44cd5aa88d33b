//! The part of space that a picture shows: four planes through the eye, and the half-space in front of it.

use crate::Camera;
use glam::{DVec3, Vec3};

/// A camera's view volume, in eye space (translated so that the eye is the origin).
#[derive(Clone, Copy, Debug)]
pub struct Frustum {
    /// Unit normals that point inwards: left, right, bottom, top, front. All planes pass through the eye.
    inward: [Vec3; 5],
}

/// Where a ball lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// No point of it is in view.
    Outside,
    /// Every point of it is in view.
    Inside,
    /// Neither is certain.
    Crossing,
}

impl Frustum {
    /// The volume that `camera` sees, the picture's border included.
    pub fn of(camera: &Camera) -> Self {
        let tan = camera.tan_half_fov();
        let side = |across: DVec3, tan: f64| ((camera.forward * tan + across).normalize()).as_vec3();
        Self {
            inward: [
                side(camera.right, tan.x),
                side(-camera.right, tan.x),
                side(camera.up, tan.y),
                side(-camera.up, tan.y),
                camera.forward.as_vec3(),
            ],
        }
    }

    /// Unit normals of the five planes, which point inwards and pass through the eye.
    pub fn planes(&self) -> &[Vec3; 5] {
        &self.inward
    }

    /// Where the ball around `center_in_eye` lies. Sound, not tight: a ball near an edge of the volume may be `Crossing`
    /// although it is outside.
    pub fn side(&self, center_in_eye: Vec3, radius: f32) -> Side {
        let mut side = Side::Inside;
        for inward in &self.inward {
            let distance = inward.dot(center_in_eye);
            if distance < -radius {
                return Side::Outside;
            }
            if distance < radius {
                side = Side::Crossing;
            }
        }
        side
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImageSize;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_point_of_an_outside_ball_is_never_in_the_picture(
            center in prop::array::uniform3(-5f32..5.0), offset in prop::array::uniform3(-1f32..1.0), radius in 0f32..2.0,
        ) {
            let size = ImageSize { width: 160, height: 90 };
            let camera = Camera::look_at(DVec3::ZERO, DVec3::new(1.0, 0.4, -0.3), DVec3::Y, 0.8, size);
            let center = Vec3::from_array(center);
            let offset = Vec3::from_array(offset);
            let point = camera.view_point((center + offset * (radius / offset.length().max(1.0))).as_dvec3());
            let pixel = camera.pixel_of_view_point(point);
            let seen = point.z > 0.0 && (0.0..=160.0).contains(&pixel.x) && (0.0..=90.0).contains(&pixel.y);
            match Frustum::of(&camera).side(center, radius) {
                Side::Outside => prop_assert!(!seen || point.z < 1e-4),
                Side::Inside => prop_assert!(seen || point.z < 1e-4),
                Side::Crossing => {}
            }
        }
    }
}
