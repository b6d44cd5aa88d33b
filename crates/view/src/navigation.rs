//! Where the camera is and how a person moves it. No window, no clock.
//!
//! Goes in: drags, wheel turns, seconds of flight, picked points. Comes out: a [`Camera`]. The camera looks at a *pivot*; it turns
//! around it (orbit), takes it along (pan, flight), comes nearer to what is under the cursor (zoom), or turns it around itself
//! (look). All positions are `f64` in world space.
//!
//! What always holds, whatever goes in: the pose is finite; the eye is neither farther away than [`FARTHEST`] views of the whole
//! nor nearer to its pivot than [`NEAREST`] of the diagonal; and of the *anchors*, balls that hold a part of the model's surface, at
//! least one is wholly in the picture, so that nobody loses the model; a pose that was given in numbers may look at any place within the
//! model's bounds. What would break that is done as far as it does
//! not, or moves the pivot towards the nearest anchor. Zoom and flight end before the surface that they are told of, where
//! [`LEAST_LEAVES`] of its leaves still fill the picture's height. Who zooms out sees the whole model come to the picture's middle.

mod whole;

use gigalod_geom::camera::{UpAxis, default_orbit_deg};
use gigalod_geom::{Aabb, Camera, ImageSize};
use glam::{DVec2, DVec3};
use whole::Whole;

/// Largest distance of the eye from the model's middle, in distances from which the whole model fills the picture.
pub const FARTHEST: f64 = 12.0;

/// Smallest distance of the eye from its pivot, in diagonals of the model.
pub const NEAREST: f64 = 1e-7;

/// So many leaves of the surface ahead, one above the other, fill the picture's height at least: nearer there is one flat colour.
pub const LEAST_LEAVES: f64 = 12.0;

/// Most anchors that are kept, besides points that were picked.
pub const MOST_ANCHORS: usize = 1024;

/// Picked points that are kept as anchors.
const MOST_PICKED: usize = 16;

/// The eye never looks straight up or down: then up would be undefined. In radians.
const STEEPEST: f64 = 89.9 * std::f64::consts::PI / 180.0;

/// What lies outside after the eye has gone twice as far away is 2 to the minus this of what it was.
const HOMEWARD: f64 = 3.0;

/// A point is ahead of the eye within so small a tangent of the view axis.
const AHEAD: f64 = 0.05;

/// A full turn, in radians.
const TURN: f64 = std::f64::consts::TAU;

/// Radians that a drag over the picture's height turns.
const TURN_PER_HEIGHT: f64 = std::f64::consts::PI;

/// A ball that holds a part of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Its middle; world space.
    pub at: DVec3,
    /// World units; 0 for a point of the surface itself.
    pub radius: f64,
}

impl Anchor {
    fn is_finite(&self) -> bool {
        self.at.is_finite() && self.radius.is_finite()
    }
}

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
    /// Comes nearer to what is under the cursor, or nearest to it, which stays there.
    Zoom {
        /// What is left of the distance: below 1 is nearer.
        factor: f64,
        /// Where the cursor is.
        at_px: DVec2,
        /// The surface point under it, where one is known.
        surface: Option<Anchor>,
    },
    /// Turns the eye on the spot, so that what is far away follows the hand.
    Look {
        /// Pixels dragged.
        by_px: DVec2,
    },
    /// Flies: right, up, forward, each in distances to the pivot; forward in those to the surface ahead where that is nearer.
    Fly {
        /// Along the view's axes.
        by: DVec3,
        /// The surface point in the middle of the picture, where one is known.
        ahead: Option<Anchor>,
    },
    /// Turns towards a point of the surface and makes it the pivot.
    Pivot(Anchor),
    /// A surface point that a person pointed at: it counts from now on, until many others have.
    Anchor(Anchor),
    /// Back to the view of the whole.
    Home,
}

/// A camera that a person moves.
#[derive(Clone, Debug)]
pub struct Navigation {
    bounds: Aabb,
    up_axis: UpAxis,
    anchors: Vec<Anchor>,
    /// The points picked last, oldest first.
    picked: Vec<Anchor>,
    /// What an explicit pose looks at, where that is within the bounds: it counts as well.
    aim: Option<Anchor>,
    home_aim: Option<Anchor>,
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
        let orbit_deg = default_orbit_deg(&bounds, up_axis);
        let camera = Camera::orbit(&bounds, up_axis, orbit_deg, 1.0, fov_y_rad, size);
        let fit = (camera.eye - bounds.center()).length().max(f64::MIN_POSITIVE);
        let [azimuth, elevation] = orbit_deg.map(f64::to_radians);
        let home = Pose { pivot: bounds.center(), azimuth, elevation, distance: fit };
        Self {
            bounds,
            up_axis,
            anchors: Vec::new(),
            picked: Vec::new(),
            aim: None,
            home_aim: None,
            fov_y_rad,
            fit,
            pose: home,
            home,
        }
    }

    /// Balls all around the model; without any, its middle and what was picked are all that is kept in view.
    /// More than [`MOST_ANCHORS`] are thinned out.
    pub fn set_anchors(&mut self, anchors: &[Anchor], size: ImageSize) {
        let step = anchors.len().div_ceil(MOST_ANCHORS).max(1);
        self.anchors = anchors.iter().copied().step_by(step).filter(Anchor::is_finite).collect();
        self.keep(size);
    }

    /// True once points of the surface are known.
    pub fn has_anchors(&self) -> bool {
        !self.anchors.is_empty()
    }

    /// The view that [`Input::Home`] leads to, and to which this moves: from `eye` towards `target`. Exactly so where the target is within the
    /// bounds; else as far as that shows the model.
    pub fn set_home(&mut self, eye: DVec3, target: DVec3, size: ImageSize) {
        self.go_to(eye, target, size);
        (self.home, self.home_aim) = (self.pose, self.aim);
    }

    /// Looks at a part of what there is, from the side that it was seen from.
    pub fn look_at(&mut self, bounds: Aabb, size: ImageSize) {
        let one = Self::new(bounds, self.up_axis, self.fov_y_rad, size);
        self.pose = Pose { pivot: one.home.pivot, distance: one.fit, ..self.pose };
        self.keep(size);
    }

    /// Takes another axis for up, and looks at all there is.
    pub fn stand_up(&mut self, up_axis: UpAxis, size: ImageSize) {
        let anew = Self::new(self.bounds, up_axis, self.fov_y_rad, size);
        let (anchors, picked) = (std::mem::take(&mut self.anchors), std::mem::take(&mut self.picked));
        *self = Self { anchors, picked, ..anew };
        self.keep(size);
    }

    /// Goes on with bounds that hardly differ, as of a model in place of its preview; home is around them.
    pub fn set_bounds(&mut self, bounds: Aabb, size: ImageSize) {
        let anew = Self::new(bounds, self.up_axis, self.fov_y_rad, size);
        (self.bounds, self.fit, self.home, self.home_aim) = (anew.bounds, anew.fit, anew.home, None);
        self.keep(size);
    }

    /// Moves to a pose, as of a camera path. Exactly there where its target is within the bounds; else as far as that shows the model.
    pub fn go_to(&mut self, eye: DVec3, target: DVec3, size: ImageSize) {
        if let Some(pose) = self.pose_of(eye, target) {
            self.pose = pose;
            self.aim = self.bounds.contains(target).then_some(Anchor { at: target, radius: 0.0 });
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
            Input::Fly { by, ahead } => {
                let camera = self.camera(size);
                let room = ahead.map_or(f64::INFINITY, |ahead| room_before(&ahead, &camera));
                let forward =
                    if by.z > 0.0 { (by.z * before.distance.min(room)).min(room) } else { by.z * before.distance };
                let by = (camera.right * by.x + camera.up * by.y) * before.distance + camera.forward * forward;
                self.take_as_far(size, |part| Pose { pivot: before.pivot + by * part, ..before });
            }
            Input::Pivot(anchor) => {
                if let Some(pose) = self.pose_of(self.eye(), anchor.at).filter(|_| anchor.is_finite()) {
                    // As much of it as is seen from here: the eye stays where it is.
                    let seen = pose.distance / enough_distance(1.0, &self.camera(size));
                    self.pick(Anchor { radius: anchor.radius.min(seen), ..anchor });
                    self.take(pose);
                    self.keep(size);
                }
            }
            Input::Anchor(anchor) => {
                if anchor.is_finite() {
                    self.pick(anchor);
                    self.keep(size);
                }
            }
            Input::Home => {
                self.aim = self.home_aim;
                self.take(self.home);
                self.keep(size);
            }
        }
        self.pose != before
    }

    fn pick(&mut self, anchor: Anchor) {
        if self.picked.last() == Some(&anchor) {
            return;
        }
        if self.picked.len() == MOST_PICKED {
            self.picked.remove(0);
        }
        self.picked.push(anchor);
    }

    fn zoom(&mut self, factor: f64, at_px: DVec2, surface: Option<Anchor>, size: ImageSize) {
        if !(factor.is_finite() && factor > 0.0 && at_px.is_finite()) {
            return;
        }
        if let Some(surface) = surface {
            self.apply(&Input::Anchor(surface), size);
        }
        let (before, camera) = (self.pose, self.camera(size));
        // What is under the cursor: a known point; or what is nearest to it, so that nobody goes past the model; or as far away as the pivot.
        let in_front = |at: DVec3| Some(camera.view_point(at)).filter(|at| at.is_finite() && at.z > 0.0);
        let beside = |at: DVec3| Some((camera.pixel_of_view_point(in_front(at)?), in_front(at)?.z));
        let nearest = || {
            let places = self.all_anchors().filter_map(|anchor| beside(anchor.at));
            places.min_by(|a, b| a.0.distance_squared(at_px).total_cmp(&b.0.distance_squared(at_px)))
        };
        let known = surface.and_then(|surface| in_front(surface.at)).map(|at| (at_px, at.z));
        let beside_it = || if factor < 1.0 { nearest() } else { None };
        let (at_px, depth) = known.or_else(beside_it).unwrap_or((at_px, before.distance));
        let fixed = camera.eye + camera.ray_through(at_px) * depth;
        // What is left of the distance at the least; where the eye is too near already, it does not come nearer.
        let least = surface.map_or(0.0, |surface| least_depth(&surface, &camera) / depth).min(1.0);
        let whole = Whole { middle: self.bounds.center(), fit: self.fit };
        let astray = whole.astray(&camera);
        self.take_as_far(size, |part| {
            // In equal ratios, so that half the way is half the zoom.
            let left = if factor < 1.0 { factor.powf(part).max(least) } else { factor.powf(part) };
            let eye = fixed + (camera.eye - fixed) * left;
            let distance = depth * left;
            let pose = Pose { pivot: eye + camera.forward * distance, distance, ..before };
            if factor < 1.0 {
                return pose;
            }
            let by = whole.way_back(&Camera { eye, ..camera }, astray * left.powf(-HOMEWARD));
            Pose { pivot: pose.pivot + by, ..pose }
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
        let nearest = self
            .all_anchors()
            .min_by(|a, b| {
                let distance = |anchor: &Anchor| anchor.at.distance_squared(self.pose.pivot);
                distance(a).total_cmp(&distance(b))
            })
            .unwrap_or(Anchor { at: self.bounds.center(), radius: 0.0 });
        // From so far away all of it is seen.
        let enough = enough_distance(nearest.radius, &self.camera(size));
        let from = Pose { distance: self.pose.distance.max(enough), ..self.pose };
        // The whole way always is enough: then the anchor is in the middle of the picture.
        let (mut bad, mut good) = (0.0, 1.0);
        for _ in 0..16 {
            let middle = (good + bad) * 0.5;
            let pose = Pose { pivot: from.pivot.lerp(nearest.at, middle), ..from };
            *(if self.is_in_view(&pose, size) { &mut good } else { &mut bad }) = middle;
        }
        let pivot = if good < 1.0 { from.pivot.lerp(nearest.at, good) } else { nearest.at };
        self.pose = Pose { pivot, ..from };
    }

    /// True where the eye is not too far away, and all of an anchor is in the picture.
    fn is_in_view(&self, pose: &Pose, size: ImageSize) -> bool {
        let eye = pose.pivot + to_eye(self.up_axis, pose) * pose.distance;
        if !eye.is_finite() || (eye - self.bounds.center()).length() > self.farthest() {
            return false;
        }
        let camera = Camera::look_at(eye, pose.pivot, self.up_axis.direction(), self.fov_y_rad, size);
        let tan = camera.tan_half_fov();
        let slant = DVec2::new((1.0 + tan.x * tan.x).sqrt(), (1.0 + tan.y * tan.y).sqrt());
        self.all_anchors().any(|Anchor { at, radius }| {
            let in_view = camera.view_point(at);
            in_view.z > 0.0
                && in_view.x.abs() + radius * slant.x <= tan.x * in_view.z
                && in_view.y.abs() + radius * slant.y <= tan.y * in_view.z
        })
    }

    fn all_anchors(&self) -> impl Iterator<Item = Anchor> {
        let middle = self.anchors.is_empty().then(|| Anchor { at: self.bounds.center(), radius: 0.0 });
        self.anchors.iter().copied().chain(middle).chain(self.picked.iter().copied()).chain(self.aim)
    }

    fn farthest(&self) -> f64 {
        self.fit * FARTHEST
    }

    fn least_distance(&self) -> f64 {
        self.bounds.diagonal().max(self.fit * 1e-3) * NEAREST
    }
}

/// From so far away a ball in the middle of the picture is seen as a whole.
fn enough_distance(radius: f64, camera: &Camera) -> f64 {
    let tan = camera.tan_half_fov().min_element();
    radius * (1.0 + tan * tan).sqrt() / tan * 1.001
}

/// Depth from which [`LEAST_LEAVES`] of a surface fill the picture's height; a ball around a picked point has a leaf's diameter for radius.
fn least_depth(surface: &Anchor, camera: &Camera) -> f64 {
    surface.radius * LEAST_LEAVES / (2.0 * camera.tan_half_fov().y)
}

/// How far the eye may go forward before it is too near to a surface; without end where the surface is not ahead any more.
fn room_before(surface: &Anchor, camera: &Camera) -> f64 {
    let at = camera.view_point(surface.at);
    let is_ahead = at.z > 0.0 && DVec2::new(at.x, at.y).length() < AHEAD * at.z;
    if is_ahead { (at.z - least_depth(surface, camera)).max(0.0) } else { f64::INFINITY }
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
mod tests;
