//! Camera paths as JSON: `{"up":[x,y,z],"fov":40,"frames":[{"t":seconds,"eye":[…],"target":[…]}]}`.

use super::error::CliError;
use super::files;
use gigalod_geom::{CameraPath, Pose};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use std::io::Read;
use std::path::Path;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PathFile {
    up: [f64; 3],
    fov: f64,
    frames: Vec<FrameFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameFile {
    t: f64,
    eye: [f64; 3],
    target: [f64; 3],
}

/// An hour at 60 poses a second is 30 MB; more is not a path.
const MOST_BYTES: u64 = 256 << 20;

fn no_path(path: &Path, error: &dyn Display) -> CliError {
    CliError::in_file(path, format!("not a camera path as `synth path` or the viewer writes them: {error}"))
}

pub(crate) fn read(path: &Path) -> Result<CameraPath, CliError> {
    let mut text = String::new();
    files::open(path)?.take(MOST_BYTES).read_to_string(&mut text).map_err(|error| no_path(path, &error))?;
    let file: PathFile = serde_json::from_str(&text).map_err(|error| no_path(path, &error))?;
    let finite = |v: &[f64; 3]| v.iter().all(|x| x.is_finite());
    if file.frames.is_empty() {
        return Err(CliError::in_file(path, "no frames, expected at least one"));
    }
    if !(0.01..=170.0).contains(&file.fov) {
        return Err(CliError::in_file(
            path,
            format!("a field of view of {}, expected degrees from 0.01 to 170", file.fov),
        ));
    }
    if !finite(&file.up) || file.up == [0.0; 3] {
        return Err(CliError::in_file(path, "an up direction of length 0, expected another"));
    }
    let bad =
        file.frames.iter().position(|frame| !(frame.t.is_finite() && finite(&frame.eye) && finite(&frame.target)));
    let back = file.frames.windows(2).position(|pair| pair[1].t < pair[0].t);
    if let Some(frame) = bad.or(back.map(|before| before + 1)) {
        return Err(CliError::in_file(
            path,
            format!("frame {frame}, expected finite numbers and time that does not run back"),
        ));
    }
    let pose = |frame: &FrameFile| Pose {
        t: frame.t,
        eye: DVec3::from_array(frame.eye),
        target: DVec3::from_array(frame.target),
    };
    Ok(CameraPath { up: DVec3::from_array(file.up), fov_deg: file.fov, frames: file.frames.iter().map(pose).collect() })
}

/// One pose of a path, by its number from 0.
pub(crate) fn pose(path: &Path, frame: usize) -> Result<(Pose, CameraPath), CliError> {
    let camera_path = read(path)?;
    let count = camera_path.frames.len();
    match camera_path.frames.get(frame) {
        Some(pose) => Ok((*pose, camera_path)),
        None => Err(CliError::in_file(path, format!("no frame {frame}, expected 0 to {}", count - 1))),
    }
}

pub(crate) fn write(path: &Path, camera_path: &CameraPath) -> Result<u64, CliError> {
    let file = PathFile {
        up: camera_path.up.to_array(),
        fov: camera_path.fov_deg,
        frames: camera_path
            .frames
            .iter()
            .map(|pose| FrameFile { t: pose.t, eye: pose.eye.to_array(), target: pose.target.to_array() })
            .collect(),
    };
    let text = serde_json::to_string(&file).expect("numbers of a path are finite");
    files::write_atomically(path, |out| out.write_all(text.as_bytes()).map_err(|error| CliError::write(path, &error)))?;
    Ok(text.len() as u64)
}
