//! Views, instances, and a camera as a model sees it.

use gigalod_geom::camera::ImageSize;
use gigalod_geom::{Camera, Frustum};
use glam::{DQuat, DVec3, Vec3};

/// One way of looking: the camera, a light, the prefetcher's camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ViewId(pub u32);

/// One placement of one model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

/// Where a model stands: world = position + rotation · (scale · model).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// World space.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Uniform, > 0: spheres stay spheres.
    pub scale: f64,
}

impl Similarity {
    /// The model where its file has it.
    pub const IDENTITY: Self = Self { position: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: 1.0 };

    /// A world-space point, in model space.
    pub fn model_point(&self, world: DVec3) -> DVec3 {
        self.rotation.inverse() * (world - self.position) / self.scale
    }

    /// A world-space direction, in model space; length kept.
    pub fn model_direction(&self, world: DVec3) -> DVec3 {
        self.rotation.inverse() * world
    }
}

/// A camera in the space of one model, ready for the inner loops.
///
/// Projected sizes are the same in model space as in the world, because a similarity keeps all ratios.
#[derive(Clone, Copy, Debug)]
pub struct ModelView {
    /// The camera in model space.
    pub camera: Camera,
    /// The part of model space it shows, relative to the eye.
    pub frustum: Frustum,
    /// [`Camera::focal_px`].
    pub focal_px: f32,
    /// Viewing direction.
    pub forward: Vec3,
}

impl ModelView {
    /// `camera` as the model at `placement` sees it.
    pub fn new(camera: &Camera, placement: &Similarity) -> Self {
        let camera = Camera {
            eye: placement.model_point(camera.eye),
            right: placement.model_direction(camera.right),
            up: placement.model_direction(camera.up),
            forward: placement.model_direction(camera.forward),
            ..*camera
        };
        Self {
            frustum: Frustum::of(&camera),
            focal_px: camera.focal_px() as f32,
            forward: camera.forward.as_vec3(),
            camera,
        }
    }

    /// The eye relative to `origin`, as a sum of two `f32` vectors: subtracting one after the other keeps the digits that a
    /// single one would lose close to the surface of a large model.
    pub fn eye_in_local(&self, origin: DVec3) -> [Vec3; 2] {
        let eye = self.camera.eye - origin;
        let high = eye.as_vec3();
        [high, (eye - high.as_dvec3()).as_vec3()]
    }

    /// Size of the picture.
    pub fn size(&self) -> ImageSize {
        self.camera.size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_sees_the_camera_where_it_stands() {
        let size = ImageSize { width: 64, height: 64 };
        let camera = Camera::look_at(DVec3::new(10.0, 0.0, 0.0), DVec3::ZERO, DVec3::Y, 0.7, size);
        let turned = Similarity {
            position: DVec3::new(4.0, 0.0, 0.0),
            rotation: DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2),
            scale: 2.0,
        };
        let view = ModelView::new(&camera, &turned);
        // 6 units away along world x, which is the model's z, twice as large.
        assert!((view.camera.eye - DVec3::new(0.0, 0.0, 3.0)).length() < 1e-12, "{}", view.camera.eye);
        assert!((view.forward - Vec3::NEG_Z).length() < 1e-6);
    }

    #[test]
    fn an_eye_far_from_the_origin_keeps_its_digits() {
        let size = ImageSize { width: 64, height: 64 };
        let eye = DVec3::new(630_000.123_456_789, 850_000.987_654_321, 12.5);
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 0.7, size);
        let [high, low] = ModelView::new(&camera, &Similarity::IDENTITY).eye_in_local(DVec3::new(5e5, 7e5, 0.0));
        let error = high.as_dvec3() + low.as_dvec3() - (eye - DVec3::new(5e5, 7e5, 0.0));
        assert!(error.length() < 1e-9, "{error}");
    }
}
