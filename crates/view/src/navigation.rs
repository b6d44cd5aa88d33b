//! Where the camera is and how a person moves it. No window, no clock.
//!
//! Goes in: drags, wheel turns, seconds of flight, picked points. Comes out: a [`Camera`]. The camera looks at a *pivot*; it turns
//! around it (orbit), takes it along (pan, flight), comes nearer to what is under the cursor (zoom), or turns it around itself
//! (look). All positions are `f64` in world space.
//!
//! What always holds, whatever goes in: the pose is finite; the eye is neither farther away than [`FARTHEST`] views of the whole
//! nor nearer to its pivot than [`NEAREST`] of the diagonal; and of the *anchors*, points close to the model's surface, at least one
//! is in the inner part of the picture ([`INNER`]), so that nobody loses the model. What would break that is done as far as it does
//! not, or moves the pivot towards the nearest anchor.

use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera, ImageSize};
use glam::{DVec2, DVec3};

/// Largest distance of the eye from the model's middle, in distances from which the whole model fills the picture.
pub const FARTHEST: f64 = 12.0;

/// Smallest distance of the eye from its pivot, in diagonals of the model.
pub const NEAREST: f64 = 1e-7;

/// Part of the picture's half height and half width in which an anchor must be.
pub const INNER: f64 = 0.85;

/// Most anchors that are kept; the last one is the point picked last.
pub const MOST_ANCHORS: usize = 1024;

/// The eye never looks straight up or down: then up would be undefined. In radians.
const STEEPEST: f64 = 89.9 * std::f64::consts::PI / 180.0;

/// A full turn, in radians.
const TURN: f64 = std::f64::consts::TAU;

/// Radians that a drag over the picture's height turns.
const TURN_PER_HEIGHT: f64 = std::f64::consts::PI;

/// Something a person does to the camera. Pixels are physical ones, y downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// Turns around the pivot, as if the model were dragged.
    Orbit {
        /// Pixels dragged.
        by_px: DVec2,
    },
    /// Moves across the view, so that what is as far away as the pivot stays under the cursor.
    Pan {
        /// Pixels dragged.
        by_px: DVec2,
    },
    /// Comes nearer to what is under the cursor, which stays there.
    Zoom {
        /// What is left of the distance: below 1 is nearer.
        factor: f64,
        /// Where the cursor is.
        at_px: DVec2,
        /// The surface point under it, where one is known.
        surface: Option<DVec3>,
    },
    /// Turns the eye on the spot, so that what is far away follows the hand.
    Look {
        /// Pixels dragged.
        by_px: DVec2,
    },
    /// Flies: right, up, forward, each in distances to the pivot.
    Fly {
        /// Along the view's axes.
        by: DVec3,
    },
    /// Turns towards a point and makes it the pivot.
    Pivot {
        /// World space.
        at: DVec3,
    },
    /// A surface point that a person pointed at: it counts as an anchor from now on.
    Anchor {
        /// World space.
        at: DVec3,
    },
    /// Back to the view of the whole.
    Home,
}

/// A camera that a person moves.
#[derive(Clone, Debug)]
pub struct Navigation {
    bounds: Aabb,
    up_axis: UpAxis,
    anchors: Vec<DVec3>,
    picked: Option<DVec3>,
    fov_y_rad: f64,
    /// Distance from which the whole model fills the picture.
    fit: f64,
    pose: Pose,
    home: Pose,
}

/// Where the camera is. Angles in radians: azimuth counter-clockwise seen from above, 0 in front; elevation of the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    pivot: DVec3,
    azimuth: f64,
    elevation: f64,
    /// Of the eye from the pivot.
    distance: f64,
}

impl Navigation {
    /// Looks at all of `bounds`, for a picture of this size. Empty bounds are taken for a unit box around the origin.
    pub fn new(bounds: Aabb, up_axis: UpAxis, fov_y_rad: f64, size: ImageSize) -> Self {
        let is_good = !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite();
        let bounds = if is_good { bounds } else { Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) } };
        let camera = Camera::orbit(&bounds, up_axis, [0.0, 0.0], 1.0, fov_y_rad, size);
        let fit = (camera.eye - bounds.center()).length().max(f64::MIN_POSITIVE);
        let home = Pose { pivot: bounds.center(), azimuth: 0.0, elevation: 0.0, distance: fit };
        Self { bounds, up_axis, anchors: Vec::new(), picked: None, fov_y_rad, fit, pose: home, home }
    }

    /// Points close to the model's surface, all around it; without any, its middle and what was picked are all that is kept in view.
    /// More than [`MOST_ANCHORS`] are thinned out.
    pub fn set_anchors(&mut self, anchors: &[DVec3], size: ImageSize) {
        let step = anchors.len().div_ceil(MOST_ANCHORS).max(1);
        self.anchors = anchors.iter().copied().step_by(step).filter(|anchor| anchor.is_finite()).collect();
        self.keep(size);
    }

    /// True once points of the surface are known.
    pub fn has_anchors(&self) -> bool {
        !self.anchors.is_empty()
    }

    /// The view that [`Input::Home`] leads to, and to which this moves: from `eye` towards `target`, as far as that shows the model.
    pub fn set_home(&mut self, eye: DVec3, target: DVec3, size: ImageSize) {
        if let Some(pose) = self.pose_of(eye, target) {
            self.pose = pose;
            self.keep(size);
            self.home = self.pose;
        }
    }

    /// Moves to a pose, as of a camera path, as far as that shows the model.
    pub fn go_to(&mut self, eye: DVec3, target: DVec3, size: ImageSize) {
        if let Some(pose) = self.pose_of(eye, target) {
            self.pose = pose;
            self.keep(size);
        }
    }

    /// Around the model.
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Which way is up.
    pub fn up_axis(&self) -> UpAxis {
        self.up_axis
    }

    /// Vertical field of view in radians.
    pub fn fov_y_rad(&self) -> f64 {
        self.fov_y_rad
    }

    /// Where the eye is; world space.
    pub fn eye(&self) -> DVec3 {
        self.pose.pivot + to_eye(self.up_axis, &self.pose) * self.pose.distance
    }

    /// What it looks at; world space.
    pub fn pivot(&self) -> DVec3 {
        self.pose.pivot
    }

    /// The camera, for a picture of this size: exactly [`Camera::look_at`] from [`Navigation::eye`] to [`Navigation::pivot`].
    pub fn camera(&self, size: ImageSize) -> Camera {
        Camera::look_at(self.eye(), self.pose.pivot, self.up_axis.direction(), self.fov_y_rad, size)
    }

    /// Does as it is told, as far as that keeps what always holds; true where the camera moved. After the picture's size has changed,
    /// call it with [`Input::Orbit`] by nothing.
    pub fn apply(&mut self, input: &Input, size: ImageSize) -> bool {
        let before = self.pose;
        match *input {
            Input::Orbit { by_px } => {
                let turn = angles(by_px * (TURN_PER_HEIGHT / f64::from(size.height.max(1))));
                let pose = Pose { azimuth: before.azimuth - turn.x, elevation: before.elevation + turn.y, ..before };
                self.take(pose);
                self.keep(size);
            }
            Input::Pan { by_px } => {
                let camera = self.camera(size);
                let unit = before.distance / camera.focal_px();
                let by = camera.right * (-by_px.x * unit) + camera.up * (by_px.y * unit);
                self.take_as_far(size, |part| Pose { pivot: before.pivot + by * part, ..before });
            }
            Input::Zoom { factor, at_px, surface } => self.zoom(factor, at_px, surface, size),
            Input::Look { by_px } => {
                let turn = angles(by_px * (2.0 * (self.fov_y_rad * 0.5).tan() / f64::from(size.height.max(1))));
                let (eye, up_axis) = (self.eye(), self.up_axis);
                let look = |part: f64| {
                    let mut pose = Pose {
                        azimuth: before.azimuth + turn.x * part,
                        elevation: (before.elevation - turn.y * part).clamp(-STEEPEST, STEEPEST),
                        ..before
                    };
                    pose.pivot = eye - to_eye(up_axis, &pose) * pose.distance;
                    pose
                };
                self.take_as_far(size, look);
            }
            Input::Fly { by } => {
                let camera = self.camera(size);
                let by = (camera.right * by.x + camera.up * by.y + camera.forward * by.z) * before.distance;
                self.take_as_far(size, |part| Pose { pivot: before.pivot + by * part, ..before });
            }
            Input::Pivot { at } => {
                if let Some(pose) = self.pose_of(self.eye(), at) {
                    self.picked = Some(at);
                    self.take(pose);
                    self.keep(size);
                }
            }
            Input::Anchor { at } if at.is_finite() => {
                self.picked = Some(at);
                self.keep(size);
            }
            Input::Anchor { .. } => {}
            Input::Home => {
                self.take(self.home);
                self.keep(size);
            }
        }
        self.pose != before
    }

    fn zoom(&mut self, factor: f64, at_px: DVec2, surface: Option<DVec3>, size: ImageSize) {
        if !(factor.is_finite() && factor > 0.0 && at_px.is_finite()) {
            return;
        }
        if let Some(surface) = surface {
            self.apply(&Input::Anchor { at: surface }, size);
        }
        let (before, camera) = (self.pose, self.camera(size));
        // What is under the cursor: a known point, or as far away as the pivot.
        let depth = surface.map(|point| camera.view_point(point).z).filter(|depth| depth.is_finite() && *depth > 0.0);
        let depth = depth.unwrap_or(before.distance);
        let fixed = camera.eye + camera.ray_through(at_px) * depth;
        self.take_as_far(size, |part| {
            // In equal ratios, so that half the way is half the zoom.
            let left = factor.powf(part);
            let eye = fixed + (camera.eye - fixed) * left;
            let distance = depth * left;
            Pose { pivot: eye + camera.forward * distance, distance, ..before }
        });
    }

    /// The pose of an eye that looks at a point; `None` where that says nothing.
    fn pose_of(&self, eye: DVec3, target: DVec3) -> Option<Pose> {
        let to_eye = self.up_axis.frame().transpose() * (eye - target);
        let distance = to_eye.length();
        let direction = to_eye.try_normalize()?;
        (eye.is_finite() && target.is_finite() && distance.is_finite()).then(|| Pose {
            pivot: target,
            azimuth: direction.x.atan2(direction.z),
            elevation: direction.y.clamp(-1.0, 1.0).asin().clamp(-STEEPEST, STEEPEST),
            distance,
        })
    }

    /// Takes over a pose with its numbers in range; not at all where they are not finite.
    fn take(&mut self, pose: Pose) {
        let Pose { pivot, azimuth, elevation, distance } = pose;
        if !(pivot.is_finite() && azimuth.is_finite() && elevation.is_finite() && distance.is_finite()) {
            return;
        }
        self.pose = Pose {
            pivot,
            azimuth: azimuth.rem_euclid(TURN),
            elevation: elevation.clamp(-STEEPEST, STEEPEST),
            distance: distance.max(self.least_distance()),
        };
    }

    /// Goes along `way` from where it is, at 0, towards 1, as far as the model stays in view.
    fn take_as_far(&mut self, size: ImageSize, way: impl Fn(f64) -> Pose) {
        const STEPS: u32 = 16;
        let is_good = |pose: &Pose| pose.distance >= self.least_distance() && self.is_in_view(pose, size);
        let (mut good, mut bad) = (0.0, 1.0);
        if is_good(&way(1.0)) {
            good = 1.0;
        } else {
            for _ in 0..STEPS {
                let middle = (good + bad) * 0.5;
                *(if is_good(&way(middle)) { &mut good } else { &mut bad }) = middle;
            }
        }
        if good > 0.0 {
            self.take(way(good));
        }
    }

    /// Moves the pivot towards the nearest anchor, and the eye towards the pivot, as little as it takes to have the model in view.
    fn keep(&mut self, size: ImageSize) {
        let farthest = self.farthest();
        self.pose.distance = self.pose.distance.clamp(self.least_distance(), farthest * 0.5);
        if self.is_in_view(&self.pose, size) {
            return;
        }
        let from = self.pose;
        let nearest = self
            .all_anchors()
            .min_by(|a, b| a.distance_squared(from.pivot).total_cmp(&b.distance_squared(from.pivot)))
            .unwrap_or(self.bounds.center());
        // The whole way always is enough: then the anchor is in the middle of the picture.
        let (mut bad, mut good) = (0.0, 1.0);
        for _ in 0..16 {
            let middle = (good + bad) * 0.5;
            let pose = Pose { pivot: from.pivot.lerp(nearest, middle), ..from };
            *(if self.is_in_view(&pose, size) { &mut good } else { &mut bad }) = middle;
        }
        self.pose.pivot = if good < 1.0 { from.pivot.lerp(nearest, good) } else { nearest };
    }

    /// True where the eye is not too far away, and an anchor is in the inner part of the picture.
    fn is_in_view(&self, pose: &Pose, size: ImageSize) -> bool {
        let eye = pose.pivot + to_eye(self.up_axis, pose) * pose.distance;
        if !eye.is_finite() || (eye - self.bounds.center()).length() > self.farthest() {
            return false;
        }
        let camera = Camera::look_at(eye, pose.pivot, self.up_axis.direction(), self.fov_y_rad, size);
        let inner = camera.tan_half_fov() * INNER;
        self.all_anchors().any(|anchor| {
            let in_view = camera.view_point(anchor);
            in_view.z > 0.0 && in_view.x.abs() <= inner.x * in_view.z && in_view.y.abs() <= inner.y * in_view.z
        })
    }

    fn all_anchors(&self) -> impl Iterator<Item = DVec3> {
        let middle = self.anchors.is_empty().then(|| self.bounds.center());
        self.anchors.iter().copied().chain(middle).chain(self.picked)
    }

    fn farthest(&self) -> f64 {
        self.fit * FARTHEST
    }

    fn least_distance(&self) -> f64 {
        self.bounds.diagonal().max(self.fit * 1e-3) * NEAREST
    }
}

/// At most a full turn each: beyond that, sines say little.
fn angles(turn: DVec2) -> DVec2 {
    DVec2::new(turn.x.clamp(-TURN, TURN), turn.y.clamp(-TURN, TURN))
}

/// Direction from the pivot to the eye.
fn to_eye(up_axis: UpAxis, pose: &Pose) -> DVec3 {
    let ((sin_az, cos_az), (sin_el, cos_el)) = (pose.azimuth.sin_cos(), pose.elevation.sin_cos());
    up_axis.frame() * DVec3::new(sin_az * cos_el, sin_el, cos_az * cos_el)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

    /// Points all over a sphere.
    fn sphere(middle: DVec3, radius: f64, points: u32) -> Vec<DVec3> {
        let around = |i: u32| {
            let (turn, height) = (f64::from(i) * 2.4, f64::from(2 * i) / f64::from(points) - 1.0);
            let ring = (1.0 - height * height).max(0.0).sqrt();
            middle + DVec3::new(turn.cos() * ring, height, turn.sin() * ring) * radius
        };
        (0..=points).map(around).collect()
    }

    /// Bounds, and points on a sphere inside: a model that fills its bounds with a surface.
    fn ball(middle: DVec3, radius: f64) -> (Aabb, Vec<DVec3>) {
        (Aabb { min: middle - radius, max: middle + radius }, sphere(middle, radius, 300))
    }

    fn navigation(middle: DVec3, radius: f64) -> Navigation {
        let (bounds, anchors) = ball(middle, radius);
        let mut navigation = Navigation::new(bounds, UpAxis::Y, 0.7, SIZE);
        navigation.set_anchors(&anchors, SIZE);
        navigation
    }

    fn pixel(navigation: &Navigation, point: DVec3) -> DVec2 {
        let camera = navigation.camera(SIZE);
        camera.pixel_of_view_point(camera.view_point(point))
    }

    #[test]
    fn it_begins_with_the_view_that_a_picture_has_by_default() {
        let (bounds, _) = ball(DVec3::new(3.0, 4.0, 5.0), 2.0);
        for up in [UpAxis::Y, UpAxis::Z] {
            let begun = Navigation::new(bounds, up, 0.7, SIZE).camera(SIZE);
            let expected = Camera::orbit(&bounds, up, [0.0, 0.0], 1.0, 0.7, SIZE);
            assert!((begun.eye - expected.eye).length() < 1e-12 && (begun.up - expected.up).length() < 1e-12);
        }
    }

    #[test]
    fn what_is_dragged_follows_the_hand() {
        let mut navigation = navigation(DVec3::ZERO, 1.0);
        // What is nearest to the eye goes to the right and down, as the hand.
        let front = navigation.eye().normalize();
        navigation.apply(&Input::Orbit { by_px: DVec2::new(20.0, 10.0) }, SIZE);
        let moved = pixel(&navigation, front) - DVec2::new(320.0, 240.0);
        assert!(moved.x > 5.0 && moved.y > 2.0, "{moved}");
        // The pivot moves with the cursor, to the pixel.
        navigation.apply(&Input::Home, SIZE);
        let pivot = navigation.pivot();
        navigation.apply(&Input::Pan { by_px: DVec2::new(31.0, -17.0) }, SIZE);
        assert!((pixel(&navigation, pivot) - DVec2::new(351.0, 223.0)).length() < 1e-9);
    }

    #[test]
    fn a_zoom_keeps_what_is_under_the_cursor_there() {
        let mut navigation = navigation(DVec3::new(1e6, 2e6, 10.0), 100.0);
        let surface = DVec3::new(1e6 + 40.0, 2e6 + 30.0, 96.0);
        let at_px = pixel(&navigation, surface);
        let mut distance = (navigation.eye() - surface).length();
        for _ in 0..60 {
            assert!(navigation.apply(&Input::Zoom { factor: 0.8, at_px, surface: Some(surface) }, SIZE));
            let now = (navigation.eye() - surface).length();
            assert!((now / distance - 0.8).abs() < 1e-3, "{now} of {distance}");
            distance = now;
            assert!((pixel(&navigation, surface) - at_px).length() < 0.01, "{}", pixel(&navigation, surface));
        }
        assert!(distance < 1e-3);
    }

    #[test]
    fn looking_turns_the_eye_on_the_spot_and_flying_moves_it_along_its_axes() {
        let mut navigation = navigation(DVec3::ZERO, 1.0);
        let (eye, before) = (navigation.eye(), navigation.camera(SIZE));
        navigation.apply(&Input::Look { by_px: DVec2::new(30.0, 0.0) }, SIZE);
        assert!((navigation.eye() - eye).length() < 1e-12);
        // Dragged to the right, the picture goes to the right: the eye turns to the left.
        assert!(navigation.camera(SIZE).forward.dot(before.right) < -0.01);
        navigation.apply(&Input::Home, SIZE);
        navigation.apply(&Input::Fly { by: DVec3::new(0.0, 0.0, 0.25) }, SIZE);
        let flown = navigation.eye() - eye;
        assert!((flown - before.forward * (eye.length() * 0.25)).length() < 1e-9, "{flown}");
    }

    #[test]
    fn a_picked_pivot_is_in_the_middle_and_is_turned_around() {
        let mut navigation = navigation(DVec3::ZERO, 1.0);
        let at = DVec3::new(0.5, 0.5, 0.5_f64.sqrt());
        let distance = (navigation.eye() - at).length();
        navigation.apply(&Input::Pivot { at }, SIZE);
        navigation.apply(&Input::Orbit { by_px: DVec2::new(50.0, -20.0) }, SIZE);
        assert!((pixel(&navigation, at) - DVec2::new(320.0, 240.0)).length() < 1e-9);
        assert!(((navigation.eye() - at).length() - distance).abs() < 1e-9);
    }

    fn any_input() -> impl Strategy<Value = Input> {
        let px = || {
            let wild = prop_oneof![-2000.0..2000.0, Just(f64::NAN), Just(f64::INFINITY), Just(1e300)];
            (wild, -2000.0..2000.0).prop_map(|(x, y)| DVec2::new(x, y))
        };
        let point = || [-3.0..3.0, -3.0..3.0, -3.0..3.0].prop_map(|[x, y, z]: [f64; 3]| DVec3::new(x, y, z));
        let factor = prop_oneof![0.01..100.0, Just(0.0), Just(f64::NAN), Just(1e-300), Just(1e300)];
        prop_oneof![
            px().prop_map(|by_px| Input::Orbit { by_px }),
            px().prop_map(|by_px| Input::Pan { by_px }),
            (factor, px(), proptest::option::of(point())).prop_map(|(factor, at_px, direction)| Input::Zoom {
                factor,
                at_px,
                // On the surface, as picked points are.
                surface: direction.map(|direction| direction.normalize_or(DVec3::X)),
            }),
            px().prop_map(|by_px| Input::Look { by_px }),
            point().prop_map(|by| Input::Fly { by: by * 10.0 }),
            point().prop_map(|at| Input::Pivot { at: at.normalize_or(DVec3::X) }),
            Just(Input::Home),
        ]
    }

    proptest! {
        #[test]
        fn nobody_loses_the_model(
            inputs in proptest::collection::vec((any_input(), 100u32..2000, 100u32..2000), 1..60),
            scale in prop_oneof![Just(1.0), Just(1e-4), Just(1e5)],
        ) {
            let middle = DVec3::new(7.0, -3.0, 11.0) * scale;
            let mut navigation = navigation(middle, scale);
            let whole = (navigation.eye() - middle).length();
            let surface = sphere(middle, scale, 5000);
            for (input, width, height) in inputs {
                // Points of inputs are those of a unit ball around the origin.
                let place = |point: DVec3| middle + point * scale;
                let input = match input {
                    Input::Zoom { factor, at_px, surface } => {
                        Input::Zoom { factor, at_px, surface: surface.map(place) }
                    }
                    Input::Pivot { at } => Input::Pivot { at: place(at) },
                    other => other,
                };
                let size = ImageSize { width, height };
                navigation.apply(&Input::Orbit { by_px: DVec2::ZERO }, size);
                navigation.apply(&input, size);
                let camera = navigation.camera(size);
                let finite = [camera.eye, camera.right, camera.up, camera.forward].iter().all(|v| v.is_finite());
                prop_assert!(finite, "{camera:?} after {input:?}");
                let distance = (camera.eye - middle).length();
                prop_assert!(distance <= whole * FARTHEST * 1.001, "{distance} after {input:?}");
                prop_assert!((camera.eye - navigation.pivot()).length() >= scale * NEAREST * 0.99);
                // Other points of the ball's surface than those that hold the camera.
                let is_seen = surface.iter().any(|point| {
                    let view = camera.view_point(*point);
                    let pixel = camera.pixel_of_view_point(view);
                    view.z > 0.0
                        && (0.0..=f64::from(width)).contains(&pixel.x)
                        && (0.0..=f64::from(height)).contains(&pixel.y)
                });
                // Closer to the surface than its samples lie to each other there is what was picked, or nothing.
                let is_close = (distance - scale).abs() < scale * 0.1;
                prop_assert!(is_seen || is_close, "lost after {input:?}: {camera:?}");
            }
        }
    }
}
