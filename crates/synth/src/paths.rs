//! Camera paths around any box: what a bench or a soak test flies along.
//!
//! Takes the kind of movement, the model's bounds and its up axis; gives 30 poses per second. Everything is a multiple of
//! the box, so the same call suits a coin and a city. Positions are in the model's own space and units.
//!
//! Always holds: times start at 0 and grow by 1/30 s; the eye never coincides with its target.

use gigalod_geom::camera::{DEFAULT_FOV_DEG, UpAxis};
use gigalod_geom::{Aabb, CameraPath, Pose};
use glam::{DMat3, DVec3};
use std::f64::consts::{PI, TAU};

use crate::noise::Random;

/// Poses in one second of a path.
pub const POSES_PER_SECOND: f64 = 30.0;
/// How long the sudden turn takes, seconds.
pub const TURN_SECONDS: f64 = 0.2;
/// How far it turns, degrees.
pub const TURN_DEG: f64 = 120.0;

/// How the camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathKind {
    /// Once around, at a distance that shows the whole, rising and sinking a little.
    Orbit,
    /// From three times that distance straight towards the front, each second nearer by the same factor, ending outside
    /// the front of the box by 0.35 of its half depth.
    Approach,
    /// Along a wavy line beside the front, near, at varying heights, looking at the model a little ahead.
    Walk,
    /// Stand; turn by 120° within 0.2 s; stand; turn back as fast. Nothing can be predicted.
    SuddenTurn,
}

/// How long and which variant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathOptions {
    /// Length in seconds; less than one pose's time gives a single pose. At most an hour is made.
    pub seconds: f64,
    /// Varies heights, waves and the side turned to.
    pub seed: u64,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { seconds: 10.0, seed: 1 }
    }
}

/// The path of a camera around `bounds`; vertical field of view [`DEFAULT_FOV_DEG`].
///
/// An empty, infinite or single-point box is taken for a unit cube around its middle (or the origin).
pub fn camera_path(kind: PathKind, bounds: &Aabb, up: UpAxis, options: PathOptions) -> CameraPath {
    let place = Place::new(bounds, up);
    let mut random = Random::new(options.seed, 3);
    let variant = Variant {
        phase: f64::from(random.unit()),
        wave: f64::from(random.between(0.7, 1.3)),
        side: if random.unit() < 0.5 { -1.0 } else { 1.0 },
    };
    let seconds = if options.seconds.is_finite() { options.seconds.clamp(0.0, 3600.0) } else { 0.0 };
    let steps = (seconds * POSES_PER_SECOND).round() as u32;
    let frames = (0..=steps)
        .map(|step| {
            let t = f64::from(step) / POSES_PER_SECOND;
            let share = if steps == 0 { 0.0 } else { f64::from(step) / f64::from(steps) };
            let (eye, target) = match kind {
                PathKind::Orbit => place.orbit(share, &variant),
                PathKind::Approach => place.approach(share),
                PathKind::Walk => place.walk(share, &variant),
                PathKind::SuddenTurn => place.sudden_turn(t, seconds, &variant),
            };
            Pose { t, eye: place.center + place.frame * eye, target: place.center + place.frame * target }
        })
        .collect();
    CameraPath { up: up.direction(), fov_deg: DEFAULT_FOV_DEG, frames }
}

/// What the seed chooses.
struct Variant {
    /// 0 to 1.
    phase: f64,
    /// About 1.
    wave: f64,
    /// +1 or −1.
    side: f64,
}

/// The box, seen in a frame with x to the right, y up and z to the front; origin at its middle.
struct Place {
    center: DVec3,
    frame: DMat3,
    /// Half the edge lengths.
    half: DVec3,
    /// Half the diagonal.
    radius: f64,
    /// From here a sphere around the box fits the picture's height.
    whole: f64,
}

impl Place {
    fn new(bounds: &Aabb, up: UpAxis) -> Self {
        let frame = up.frame();
        let usable = !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite();
        let center = if usable { bounds.center() } else { DVec3::ZERO };
        let half = if usable { (frame.transpose() * bounds.extent()).abs() * 0.5 } else { DVec3::ZERO };
        let half = if half.length() > 0.0 && half.is_finite() { half } else { DVec3::splat(0.5) };
        let radius = half.length();
        let whole = 1.05 * radius / libm::sin(DEFAULT_FOV_DEG.to_radians() * 0.5);
        Self { center, frame, half, radius, whole }
    }

    fn orbit(&self, share: f64, variant: &Variant) -> (DVec3, DVec3) {
        let azimuth = TAU * share;
        let elevation = 0.17 + 0.12 * libm::sin(TAU * (share + variant.phase));
        let level = libm::cos(elevation);
        let to_eye = DVec3::new(libm::sin(azimuth) * level, libm::sin(elevation), libm::cos(azimuth) * level);
        (to_eye * self.whole, DVec3::ZERO)
    }

    fn approach(&self, share: f64) -> (DVec3, DVec3) {
        // A flat model is approached to a twentieth of its size, not to nothing.
        let end = (1.35 * self.half.z).max(self.half.z + 0.05 * self.radius);
        let start = 3.0 * self.whole;
        let distance = start * libm::pow(end / start, share);
        // From slightly above down to the level of the middle.
        let above = 0.25 * distance * (1.0 - share);
        (DVec3::new(0.0, above, distance), DVec3::ZERO)
    }

    fn walk(&self, share: f64, variant: &Variant) -> (DVec3, DVec3) {
        let along = (2.0 * share - 1.0) * variant.side;
        let wave = libm::sin(TAU * (2.0 * variant.wave * share + variant.phase));
        let slow = libm::sin(TAU * (1.1 * variant.wave * share + 0.37 + variant.phase));
        let away = self.half.z + self.radius * (0.35 + 0.12 * wave);
        let eye = DVec3::new(along * 1.1 * self.half.x, 0.55 * slow * self.half.y, away);
        let ahead = (along + 0.25 * variant.side).clamp(-1.0, 1.0);
        (eye, DVec3::new(ahead * 0.8 * self.half.x, 0.7 * eye.y, 0.0))
    }

    fn sudden_turn(&self, t: f64, seconds: f64, variant: &Variant) -> (DVec3, DVec3) {
        let eye = DVec3::new(0.0, 0.1 * self.half.y, self.half.z + 0.6 * self.radius);
        // Away after two fifths of the time, back after four; a shorter path sees only the beginning.
        let turned_at = |start: f64| ((t - start) / TURN_SECONDS).clamp(0.0, 1.0);
        let share = turned_at(0.4 * seconds) - turned_at(0.8 * seconds);
        let angle = variant.side * share * TURN_DEG * (PI / 180.0);
        let gaze = DVec3::new(-libm::sin(angle), 0.0, -libm::cos(angle)) * eye.z;
        (eye, eye + gaze)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [PathKind; 4] = [PathKind::Orbit, PathKind::Approach, PathKind::Walk, PathKind::SuddenTurn];

    fn statue_box() -> Aabb {
        Aabb { min: DVec3::new(-0.9, 0.0, -0.5), max: DVec3::new(0.9, 2.7, 0.6) }
    }

    #[test]
    fn poses_come_thirty_times_a_second_and_never_stand_in_their_target() {
        let flat = Aabb { min: DVec3::new(5.0, 5.0, 5.0), max: DVec3::new(9.0, 7.0, 5.0) };
        let point = Aabb::of([DVec3::splat(1e6)]);
        for bounds in [statue_box(), flat, point, Aabb::EMPTY] {
            for kind in KINDS {
                for up in [UpAxis::Y, UpAxis::Z] {
                    let path = camera_path(kind, &bounds, up, PathOptions { seconds: 4.0, seed: 3 });
                    assert_eq!(path.frames.len(), 121);
                    for (step, pose) in path.frames.iter().enumerate() {
                        assert!((pose.t - step as f64 / 30.0).abs() < 1e-12);
                        assert!(pose.eye.is_finite() && pose.target.is_finite());
                        assert!((pose.eye - pose.target).length() > 0.0, "{kind:?} at {step}");
                    }
                }
            }
        }
    }

    #[test]
    fn orbit_shows_the_whole_and_closes() {
        let bounds = statue_box();
        let path = camera_path(PathKind::Orbit, &bounds, UpAxis::Y, PathOptions::default());
        let half_angle = (bounds.diagonal() * 0.5 / (path.frames[7].eye - bounds.center()).length()).asin();
        assert!(half_angle < 20_f64.to_radians() && half_angle > 18_f64.to_radians());
        assert!((path.frames[0].eye - path.frames[300].eye).length() < 1e-9);
    }

    #[test]
    fn approach_ends_close_in_front_and_walk_stays_outside() {
        let bounds = statue_box();
        let path = camera_path(PathKind::Approach, &bounds, UpAxis::Y, PathOptions::default());
        let (first, last) = (path.frames[0], path.frames[300]);
        let gap = last.eye.z - bounds.max.z;
        assert!(gap > 0.0 && gap < 0.25 && (last.eye - last.target).y.abs() < 1e-9, "{last:?}");
        assert!((first.eye - first.target).length() > 3.0 * bounds.diagonal());
        let walk = camera_path(PathKind::Walk, &bounds, UpAxis::Y, PathOptions { seconds: 20.0, seed: 9 });
        assert!(walk.frames.iter().all(|pose| !bounds.contains(pose.eye)));
    }

    #[test]
    fn sudden_turn_takes_a_fifth_of_a_second_and_comes_back() {
        let path = camera_path(PathKind::SuddenTurn, &statue_box(), UpAxis::Y, PathOptions::default());
        let gaze = |step: usize| (path.frames[step].target - path.frames[step].eye).normalize();
        let (before, after, end) = (gaze(120), gaze(126), gaze(300));
        assert!((before.dot(after) + 0.5).abs() < 1e-9, "{before} {after}");
        assert!((before - end).length() < 1e-9);
        assert!(path.frames.iter().all(|pose| pose.eye == path.frames[0].eye));
    }

    #[test]
    fn z_up_paths_are_the_y_up_ones_turned() {
        let y_up = statue_box();
        let turn = UpAxis::Z.frame();
        let z_up = Aabb::of(y_up.corners().map(|corner| turn * corner));
        for kind in KINDS {
            let a = camera_path(kind, &y_up, UpAxis::Y, PathOptions::default());
            let b = camera_path(kind, &z_up, UpAxis::Z, PathOptions::default());
            for (a, b) in a.frames.iter().zip(&b.frames) {
                assert!((turn * a.eye - b.eye).length() < 1e-9 && (turn * a.target - b.target).length() < 1e-9);
            }
        }
    }
}
