//! The way back to the whole model, for who zooms out.
//!
//! In: a camera, and where all of the model is seen from. Out: how far the model's middle is astray in the picture, and the way across the
//! view that leads it back. What always holds: where nothing is astray, there is no way to go.

use gigalod_geom::Camera;
use glam::{DVec2, DVec3};

/// The model as a view of the whole shows it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Whole {
    /// Of its bounds.
    pub(super) middle: DVec3,
    /// Distance from which it fills the picture.
    pub(super) fit: f64,
}

impl Whole {
    /// How far, as tangents along the picture's axes, the model's middle lies outside of where it would lie had a person zoomed in from a
    /// view of the whole at some point of the picture: that is all the picture from close by, and its middle from where all of the
    /// model is seen.
    pub(super) fn astray(&self, camera: &Camera) -> DVec2 {
        let middle = camera.view_point(self.middle);
        if middle.z <= 0.0 {
            return DVec2::ZERO;
        }
        let free = camera.tan_half_fov() * (self.fit / middle.z - 1.0).max(0.0);
        (DVec2::new(middle.x, middle.y).abs() / middle.z - free).max(DVec2::ZERO)
    }

    /// The way across the view after which the model is no more than so far astray.
    pub(super) fn way_back(&self, camera: &Camera, most: DVec2) -> DVec3 {
        let middle = camera.view_point(self.middle);
        let by = (self.astray(camera) - most).max(DVec2::ZERO) * middle.z;
        camera.right * by.x.copysign(middle.x) + camera.up * by.y.copysign(middle.y)
    }
}
