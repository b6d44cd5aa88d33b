//! Camera paths: recorded from what is looked at, and played.
//!
//! Goes in: poses with their times. Comes out: a path that begins at 0 seconds, and while it is played the pose of each moment. The
//! last pose of a recording is where it was stopped.

use gigalod_geom::{CameraPath, Pose};
use glam::DVec3;

/// Records, or plays, or neither.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    recording: Option<(f64, Vec<Pose>)>,
    playing: Option<f64>,
    path: Option<CameraPath>,
}

/// What defines a camera along a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// World space.
    pub eye: DVec3,
    /// World space.
    pub target: DVec3,
    /// World space.
    pub up: DVec3,
    /// Vertical, degrees.
    pub fov_deg: f64,
}

impl Recorder {
    /// True between [`Recorder::start`] and [`Recorder::stop`].
    pub fn is_recording(&self) -> bool {
        self.recording.is_some()
    }

    /// True from [`Recorder::play`] to the path's end, or [`Recorder::pause`].
    pub fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// What was recorded or loaded last.
    pub fn path(&self) -> Option<&CameraPath> {
        self.path.as_ref()
    }

    /// Takes a path to play.
    pub fn load(&mut self, path: CameraPath) {
        (self.path, self.playing, self.recording) = (Some(path), None, None);
    }

    /// Begins to record at `now`, in seconds of any clock.
    pub fn start(&mut self, now: f64) {
        (self.recording, self.playing) = (Some((now, Vec::new())), None);
    }

    /// Takes note of where the camera is; only where it has moved.
    pub fn note(&mut self, now: f64, at: &Viewpoint) {
        let Some((begun, poses)) = &mut self.recording else { return };
        let t = (now - *begun).max(poses.last().map_or(0.0, |last| last.t));
        if poses.last().is_some_and(|last| (last.eye, last.target) == (at.eye, at.target)) {
            return;
        }
        // It rested until now; without this pose it would have crept.
        if let Some(last) = poses.last().copied().filter(|last| t - last.t > 0.1) {
            poses.push(Pose { t: t - 1e-3, ..last });
        }
        poses.push(Pose { t, eye: at.eye, target: at.target });
    }

    /// Ends the recording at `now`; the path is there then.
    pub fn stop(&mut self, now: f64, at: &Viewpoint) {
        self.note(now, at);
        let Some((begun, mut poses)) = self.recording.take() else { return };
        let t = (now - begun).max(poses.last().map_or(0.0, |last| last.t));
        if poses.last().is_none_or(|last| t > last.t) {
            poses.push(Pose { t, eye: at.eye, target: at.target });
        }
        self.path = Some(CameraPath { up: at.up, fov_deg: at.fov_deg, frames: poses });
    }

    /// Plays the path from its beginning, if there is one.
    pub fn play(&mut self, now: f64) {
        self.playing = self.path.is_some().then_some(now);
    }

    /// Stops playing where it is.
    pub fn pause(&mut self) {
        self.playing = None;
    }

    /// Where the camera is while a path is played; after its end, once, the last pose.
    pub fn at(&mut self, now: f64) -> Option<Viewpoint> {
        let (begun, path) = (self.playing?, self.path.as_ref()?);
        let (first, last) = (path.frames.first()?, path.frames.last()?);
        let t = first.t + (now - begun).max(0.0);
        if t >= last.t {
            self.playing = None;
        }
        let pose = path.at(t);
        Some(Viewpoint { eye: pose.eye, target: pose.target, up: path.up, fov_deg: path.fov_deg })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Viewpoint {
        Viewpoint { eye: DVec3::X * x, target: DVec3::ZERO, up: DVec3::Y, fov_deg: 40.0 }
    }

    #[test]
    fn what_is_recorded_is_played_at_the_same_pace() {
        let mut recorder = Recorder::default();
        recorder.start(100.0);
        // Stands for a second, moves for a second, stands again.
        for now in 0..=30 {
            let now = f64::from(now) * 0.1;
            recorder.note(100.0 + now, &at((now - 1.0).clamp(0.0, 1.0)));
        }
        recorder.stop(103.5, &at(1.0));
        let path = recorder.path().unwrap().clone();
        assert_eq!((path.frames[0].t, path.frames.last().unwrap().t), (0.0, 3.5));
        assert!(path.frames.windows(2).all(|pair| pair[0].t <= pair[1].t));
        recorder.play(7.0);
        for now in [0.0, 0.5, 0.9, 1.5, 2.0, 3.0] {
            let expected = (now - 1.0_f64).clamp(0.0, 1.0);
            let played = recorder.at(7.0 + now).unwrap().eye.x;
            assert!((played - expected).abs() < 0.05, "{played} at {now}");
        }
        assert_eq!(recorder.at(11.0), Some(at(1.0)));
        assert!(!recorder.is_playing() && recorder.at(11.1).is_none());
    }

    #[test]
    fn nothing_is_played_where_nothing_is_there_and_an_instant_is_a_path() {
        let mut recorder = Recorder::default();
        recorder.play(0.0);
        assert!(!recorder.is_playing());
        recorder.start(5.0);
        recorder.stop(5.0, &at(2.0));
        assert_eq!(recorder.path().unwrap().frames.len(), 1);
    }
}
