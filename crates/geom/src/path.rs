//! Camera paths: poses over time.

use glam::DVec3;

/// Where the camera is at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Seconds from the start of the path; never decreasing along it.
    pub t: f64,
    /// World space.
    pub eye: DVec3,
    /// World space; what the eye looks at.
    pub target: DVec3,
}

/// A recorded or generated walk; positions are linear between poses.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// World up.
    pub up: DVec3,
    /// Vertical field of view in degrees.
    pub fov_deg: f64,
    /// At least one, in order of time.
    pub frames: Vec<Pose>,
}

impl CameraPath {
    /// The pose at `t` seconds; before the first and after the last frame that frame's own.
    pub fn at(&self, t: f64) -> Pose {
        let after = self.frames.partition_point(|frame| frame.t <= t);
        let last = self.frames.len() - 1;
        let (a, b) = (&self.frames[after.saturating_sub(1)], &self.frames[after.min(last)]);
        let span = b.t - a.t;
        let share = if span > 0.0 { ((t - a.t) / span).clamp(0.0, 1.0) } else { 0.0 };
        // Exactly the same between frames that are: a camera that stands does not tremble.
        let between = |a: DVec3, b: DVec3| a + (b - a) * share;
        Pose { t, eye: between(a.eye, b.eye), target: between(a.target, b.target) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_linear_between_frames_and_constant_outside() {
        let pose = |t, x| Pose { t, eye: DVec3::X * x, target: DVec3::ZERO };
        let path = CameraPath { up: DVec3::Y, fov_deg: 40.0, frames: vec![pose(1.0, 0.0), pose(3.0, 4.0)] };
        assert_eq!([0.0, 1.0, 1.5, 3.0, 9.0].map(|t| path.at(t).eye.x), [0.0, 0.0, 1.0, 4.0, 4.0]);
    }

    #[test]
    fn a_camera_that_stands_does_not_tremble() {
        let stands = |t| Pose { t, eye: DVec3::new(0.1, -0.7, 1.3), target: DVec3::splat(1.0 / 3.0) };
        let path = CameraPath { up: DVec3::Y, fov_deg: 40.0, frames: vec![stands(0.0), stands(0.9)] };
        for t in (0..100).map(|at| f64::from(at) / 99.0) {
            assert_eq!(path.at(t), Pose { t, ..stands(0.0) });
        }
    }
}
