//! Where a picture is taken from, and the default places.
//!
//! Right-handed. Pixel (0, 0) is the top left. The field of view is vertical.

use crate::Aabb;
use glam::{DMat3, DVec2, DVec3};

/// Width and height of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl ImageSize {
    /// Pixels in all.
    pub fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Width over height.
    pub fn aspect(self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }
}

/// Default vertical field of view, in degrees.
pub const DEFAULT_FOV_DEG: f64 = 40.0;

/// Where a model is looked at from unless somebody says otherwise: azimuth and elevation in degrees, for [`Camera::orbit`]. From the
/// front; what lies flat, as terrain does, obliquely from above, since from the front there is only its edge.
pub fn default_orbit_deg(bounds: &Aabb, up: UpAxis) -> [f64; 2] {
    /// Flat is at most so high, in shortest sides of the ground.
    const FLAT: f64 = 0.3;
    let sides = (up.frame().transpose() * bounds.extent()).abs();
    let ground = sides.x.min(sides.z);
    [0.0, if ground > 0.0 && sides.y <= FLAT * ground { 35.0 } else { 0.0 }]
}

/// A pinhole camera; world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where the eye is.
    pub eye: DVec3,
    /// Unit vector: x axis of the picture, to the right.
    pub right: DVec3,
    /// Unit vector: y axis of the picture, upwards.
    pub up: DVec3,
    /// Unit vector: the viewing direction.
    pub forward: DVec3,
    /// Vertical field of view, in radians, in (0, π).
    pub fov_y_rad: f64,
    /// The picture it takes.
    pub size: ImageSize,
}

impl Camera {
    /// A camera at `eye` that looks at `target`. Where `up` is parallel to the view (straight down, say) or zero, another
    /// axis takes its place, so the result is always a proper frame; the same holds for `eye == target`.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov_y_rad: f64, size: ImageSize) -> Self {
        let forward = (target - eye).try_normalize().unwrap_or(DVec3::NEG_Z);
        let right = [up, DVec3::NEG_Z, DVec3::X]
            .into_iter()
            .filter_map(|up| up.try_normalize())
            .map(|up| forward.cross(up))
            .find(|right| right.length_squared() > 1e-12)
            .expect("one of two orthogonal axes is not parallel to the view")
            .normalize();
        Self { eye, right, up: right.cross(forward), forward, fov_y_rad, size }
    }

    /// A camera on a circle around the middle of `bounds`, so near that the box just fills the picture's height (or width,
    /// where that is the tighter fit), then `zoom` times as near.
    ///
    /// `orbit` is azimuth and elevation in degrees. At (0, 0) the camera looks along −z with y up (z-up models: along +y
    /// with z up); a growing azimuth turns it counter-clockwise seen from above; a growing elevation raises the eye.
    pub fn orbit(
        bounds: &Aabb,
        world_up: UpAxis,
        orbit_deg: [f64; 2],
        zoom: f64,
        fov_y_rad: f64,
        size: ImageSize,
    ) -> Self {
        let [azimuth, elevation] = orbit_deg.map(f64::to_radians);
        let (sin_az, cos_az) = (libm::sin(azimuth), libm::cos(azimuth));
        let (sin_el, cos_el) = (libm::sin(elevation), libm::cos(elevation));
        // In a y-up frame; then turned to the model's own up.
        let to_eye = DVec3::new(sin_az * cos_el, sin_el, cos_az * cos_el);
        let up = DVec3::new(-sin_az * sin_el, cos_el, -cos_az * sin_el);
        let frame = world_up.frame();
        let center = bounds.center();
        let mut camera = Self::look_at(center + frame * to_eye, center, frame * up, fov_y_rad, size);
        let tan_y = camera.tan_half_fov().y;
        let tan_x = camera.tan_half_fov().x;
        let fit = bounds.corners().into_iter().fold(0.0_f64, |fit, corner| {
            let from_center = corner - center;
            let towards_eye = -from_center.dot(camera.forward);
            let vertical = from_center.dot(camera.up).abs() / tan_y + towards_eye;
            let horizontal = from_center.dot(camera.right).abs() / tan_x + towards_eye;
            fit.max(vertical).max(horizontal)
        });
        // A single point has no size: stand one unit away.
        let distance = if fit > 0.0 { fit } else { 1.0 };
        camera.eye = center - camera.forward * (distance / zoom);
        camera
    }

    /// Tangents of half the horizontal (x) and vertical (y) field of view.
    pub fn tan_half_fov(&self) -> DVec2 {
        let tan_y = libm::tan(self.fov_y_rad * 0.5);
        DVec2::new(tan_y * self.size.aspect(), tan_y)
    }

    /// Pixels covered by one unit of length across the view, seen from one unit away: `height / (2 tan(fov / 2))`.
    pub fn focal_px(&self) -> f64 {
        f64::from(self.size.height) * 0.5 / self.tan_half_fov().y
    }

    /// Rotation from world axes to view axes (x right, y up, z forward).
    pub fn view_from_world(&self) -> DMat3 {
        DMat3::from_cols(self.right, self.up, self.forward).transpose()
    }

    /// `point`, in view space.
    pub fn view_point(&self, point: DVec3) -> DVec3 {
        let from_eye = point - self.eye;
        DVec3::new(from_eye.dot(self.right), from_eye.dot(self.up), from_eye.dot(self.forward))
    }

    /// Where a view-space point in front of the eye appears, in pixels from the top left corner.
    pub fn pixel_of_view_point(&self, point: DVec3) -> DVec2 {
        let focal = self.focal_px();
        let middle = DVec2::new(f64::from(self.size.width), f64::from(self.size.height)) * 0.5;
        middle + DVec2::new(point.x, -point.y) * (focal / point.z)
    }

    /// Direction, in world axes, of the ray through `pixel` (its centre is at +0.5), scaled so that its component along
    /// [`Camera::forward`] is 1: the parameter along it is the depth.
    pub fn ray_through(&self, pixel: DVec2) -> DVec3 {
        let focal = self.focal_px();
        let from_middle = pixel - DVec2::new(f64::from(self.size.width), f64::from(self.size.height)) * 0.5;
        self.forward + self.right * (from_middle.x / focal) - self.up * (from_middle.y / focal)
    }

    /// Unit vector towards the default light: a lamp behind the viewer's left shoulder, as far away as the sun.
    pub fn shoulder_light(&self) -> DVec3 {
        (self.right * -0.4 + self.up * 0.5 - self.forward).normalize()
    }
}

/// Which axis of a model points to the sky.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// Most scans and all of glTF.
    #[default]
    Y,
    /// Maps, LAS, CAD.
    Z,
}

impl UpAxis {
    /// The axis as a unit vector.
    pub fn direction(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }

    /// Rotation from a y-up frame (x right, z towards the viewer) to this one.
    pub fn frame(self) -> DMat3 {
        match self {
            Self::Y => DMat3::IDENTITY,
            Self::Z => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

    #[test]
    fn orbit_zero_looks_along_minus_z_and_fills_the_height() {
        let bounds = Aabb { min: DVec3::new(-1.0, -1.0, -1.0), max: DVec3::new(1.0, 3.0, 1.0) };
        let camera = Camera::orbit(&bounds, UpAxis::Y, [0.0, 0.0], 1.0, 0.7, SIZE);
        assert!((camera.forward - DVec3::NEG_Z).length() < 1e-12);
        let top = camera.pixel_of_view_point(camera.view_point(DVec3::new(0.0, 3.0, 1.0)));
        let bottom = camera.pixel_of_view_point(camera.view_point(DVec3::new(0.0, -1.0, 1.0)));
        assert!(top.y.abs() < 1e-9 && (bottom.y - 480.0).abs() < 1e-9, "{top} {bottom}");
        assert!((top.x - 320.0).abs() < 1e-9);
    }

    #[test]
    fn azimuth_turns_counter_clockwise_seen_from_above_and_elevation_raises_the_eye() {
        let bounds = Aabb { min: DVec3::splat(-1.0), max: DVec3::ONE };
        let side = Camera::orbit(&bounds, UpAxis::Y, [90.0, 0.0], 1.0, 0.7, SIZE);
        // From above (+y towards us, x right, z down the page) counter-clockwise leads from +z to +x.
        assert!(side.eye.x > 1.0 && side.eye.z.abs() < 1e-9);
        let above = Camera::orbit(&bounds, UpAxis::Y, [0.0, 90.0], 1.0, 0.7, SIZE);
        assert!(above.eye.y > 1.0 && (above.up - DVec3::NEG_Z).length() < 1e-9);
        let z_up = Camera::orbit(&bounds, UpAxis::Z, [0.0, 0.0], 1.0, 0.7, SIZE);
        assert!((z_up.forward - DVec3::Y).length() < 1e-12 && (z_up.up - DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn what_lies_flat_is_seen_from_above_and_all_else_from_the_front() {
        let look = |x, y, z, up| default_orbit_deg(&Aabb { min: DVec3::ZERO, max: DVec3::new(x, y, z) }, up)[1];
        assert!(look(600.0, 500.0, 40.0, UpAxis::Z) >= 30.0, "terrain");
        assert_eq!(look(600.0, 500.0, 40.0, UpAxis::Y), 0.0, "a relief on a wall");
        assert_eq!(look(100.0, 5.0, 4.0, UpAxis::Y), 0.0, "a train is long, not flat");
        assert_eq!(look(2.0, 1.5, 1.0, UpAxis::Z), 0.0, "a statue");
        assert_eq!(look(0.0, 0.0, 0.0, UpAxis::Y), 0.0, "a point");
    }

    #[test]
    fn ray_through_a_pixel_meets_what_projects_there() {
        let camera = Camera::look_at(DVec3::new(3.0, 2.0, 1.0), DVec3::ZERO, DVec3::Y, 0.6, SIZE);
        let point = DVec3::new(0.3, -0.2, 0.4);
        let in_view = camera.view_point(point);
        let pixel = camera.pixel_of_view_point(in_view);
        let again = camera.eye + camera.ray_through(pixel) * in_view.z;
        assert!((again - point).length() < 1e-12);
    }

    #[test]
    fn looking_straight_down_or_at_itself_is_still_a_frame() {
        for (target, up) in [(DVec3::NEG_Y, DVec3::Y), (DVec3::ZERO, DVec3::Y), (DVec3::X, DVec3::ZERO)] {
            let camera = Camera::look_at(DVec3::ZERO, target, up, 0.6, SIZE);
            let det = camera.right.dot(camera.up.cross(-camera.forward));
            assert!((det - 1.0).abs() < 1e-12, "{camera:?}");
        }
    }
}
