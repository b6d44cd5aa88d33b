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
        Pose { t, eye: a.eye.lerp(b.eye, share), target: a.target.lerp(b.target, share) }
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
}
