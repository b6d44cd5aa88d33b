//! `gigalod render`.

use super::args::{CameraArgs, RenderArgs};
use super::error::{CliError, Outcome};
use super::files;
use super::path_file;
use super::progress::Console;
use super::stage::{Drawn, Stage, Wait, primitives};
use super::subject::Subject;
use gigalod_geom::camera::{DEFAULT_FOV_DEG, default_orbit_deg};
use gigalod_geom::{Aabb, Camera, ImageSize};
use gigalod_render::{Look, Picture, Renderer};
use gigalod_runtime::splats::Tint;
use gigalod_runtime::{CutReport, Fineness, Limit};
use serde::Serialize;
use std::path::Path;

/// The JSON object of `render`.
#[derive(Serialize)]
struct RenderReport {
    width: u32,
    height: u32,
    adapter: String,
    threshold_px: f64,
    /// Null where something reaches the eye itself.
    max_error_px: Option<f64>,
    converged: bool,
    limited_by: Option<&'static str>,
    drawn: DrawnCounts,
    culled: Culled,
    bytes_read: u64,
    cpu_bytes: u64,
    gpu_bytes: u64,
    select_ms: f64,
    frame_ms: f64,
    problems: Vec<String>,
}

#[derive(Serialize)]
struct DrawnCounts {
    nodes: u64,
    triangles: u64,
    points: u64,
    lines: u64,
}

#[derive(Serialize)]
struct Culled {
    frustum: u64,
    backface: u64,
}

/// One picture to draw.
pub(crate) struct Job<'a> {
    pub(crate) camera: Camera,
    pub(crate) threshold_px: f64,
    pub(crate) look: Look,
    pub(crate) tint: Tint,
    pub(crate) cross_fade: bool,
    pub(crate) output: &'a Path,
    pub(crate) depth: Option<&'a Path>,
}

pub(crate) fn run(args: &RenderArgs, console: &Console) -> Result<Outcome, CliError> {
    if args.depth.as_ref() == Some(&args.output) {
        return Err(CliError::usage("the picture and its depth in one file, expected two"));
    }
    let inputs: Vec<&Path> =
        [Some(&args.file), args.camera.path.as_ref()].into_iter().flatten().map(AsRef::as_ref).collect();
    for output in [Some(&args.output), args.depth.as_ref()].into_iter().flatten() {
        files::check_output(output, &inputs)?;
    }
    files::check_png_name(&args.output)?;
    let subject = Subject::open(&args.file, &args.build, console)?;
    let mut stage = Stage::open(&subject, args.draw.budgets())?;
    let camera = camera(&args.camera, args.draw.size, &stage.bounds(), &subject)?;
    let job = Job {
        camera,
        threshold_px: args.draw.threshold_px(subject.default_error_px()),
        look: args.draw.look(&subject.description),
        tint: args.draw.tint(),
        cross_fade: args.draw.cross_fade,
        output: &args.output,
        depth: args.depth.as_deref(),
    };
    stage.draw(&args.file, &job, console)
}

impl Stage {
    /// Draws one picture and writes it; `name` is what messages call the model.
    pub(crate) fn draw(&mut self, name: &Path, job: &Job<'_>, console: &Console) -> Result<Outcome, CliError> {
        self.scene.set_tint(job.tint);
        self.scene.set_cross_fade(job.cross_fade);
        let wanted = Fineness::px(job.threshold_px as f32);
        let Drawn { report, select_ms, frame_ms, what: picture, .. } =
            self.draw_until(&job.camera, job.look, &wanted, Wait::Converged, Renderer::picture, console)?;

        files::write_png(job.output, picture.size, &picture.rgba)?;
        if let Some(depth) = job.depth {
            write_depth(depth, &picture)?;
        }
        let problems = self.problems(name, &report, console);
        let json = self.report(job, &report, select_ms, frame_ms, problems);
        let text = format!(
            "{}: {}, {}, in {frame_ms:.0} ms on {}\n",
            job.output.display(),
            primitives(report.triangles as f64, report.points as f64),
            finish(&report),
            self.renderer.gpu().adapter(),
        );
        Ok(Outcome::new(&json, text))
    }

    fn report(
        &self,
        job: &Job<'_>,
        report: &CutReport,
        select_ms: f64,
        frame_ms: f64,
        problems: Vec<String>,
    ) -> RenderReport {
        let residency = self.scene.residency();
        let complete =
            !residency.is_full() && report.limited_by != Some(Limit::Budget) && residency.damaged().next().is_none();
        RenderReport {
            width: job.camera.size.width,
            height: job.camera.size.height,
            adapter: self.renderer.gpu().adapter(),
            threshold_px: job.threshold_px,
            max_error_px: report.max_error_px.is_finite().then_some(f64::from(report.max_error_px)),
            converged: complete,
            limited_by: report.limited_by.map(|limit| limit.name()),
            drawn: DrawnCounts {
                nodes: report.drawn,
                triangles: report.triangles,
                points: report.points,
                lines: report.lines,
            },
            culled: Culled { frustum: report.culled_frustum, backface: report.culled_backface },
            bytes_read: residency.bytes_read(),
            cpu_bytes: self.scene.cpu_bytes(),
            gpu_bytes: self.renderer.gpu_bytes(),
            select_ms,
            frame_ms,
            problems,
        }
    }
}

/// How fine a picture became, in words.
fn finish(report: &CutReport) -> String {
    let coarsest = if report.max_error_px.is_finite() {
        // Of splats that is a diameter.
        format!("{:.2} px {}", report.max_error_px, if report.triangles == 0 { "across" } else { "off" })
    } else if report.drawn == 0 {
        "not there at all".into()
    } else {
        "around the eye itself".into()
    };
    match report.limited_by {
        None => format!("none more than {coarsest}"),
        Some(Limit::Data) => format!("as fine as the data: the coarsest is {coarsest}"),
        Some(limit) => format!("coarser than asked for ({}): the coarsest is {coarsest}", limit.name()),
    }
}

/// The camera that the options ask for; without any, the scene's.
fn camera(args: &CameraArgs, size: ImageSize, bounds: &Aabb, subject: &Subject) -> Result<Camera, CliError> {
    let (scene, up) = (subject.description.camera.unwrap_or_default(), subject.up());
    let fov_rad = |degrees: Option<f64>| degrees.unwrap_or(DEFAULT_FOV_DEG).to_radians();
    if let (Some(eye), Some(target)) = (args.eye, args.target) {
        if eye == target {
            return Err(CliError::usage("--eye and --target are the same point, expected two"));
        }
        let fov = fov_rad(args.fov.or(scene.fov_deg));
        return Ok(Camera::look_at(eye, target, args.up.unwrap_or(up.direction()), fov, size));
    }
    if let (Some(path), Some(frame)) = (&args.path, args.frame) {
        let (pose, camera_path) = path_file::pose(path, frame)?;
        let fov = fov_rad(args.fov.or(Some(camera_path.fov_deg)));
        return Ok(Camera::look_at(pose.eye, pose.target, camera_path.up, fov, size));
    }
    let fov = fov_rad(args.fov.or(scene.fov_deg));
    let [azimuth, elevation, zoom] = args.orbit.unwrap_or_else(|| {
        let [azimuth, elevation] = default_orbit_deg(bounds, up);
        [azimuth, elevation, 1.0]
    });
    let whole = Camera::orbit(bounds, up, [azimuth, elevation], zoom, fov, size);
    if args.orbit.is_some() || scene.eye.is_none() && scene.target.is_none() {
        return Ok(whole);
    }
    let (eye, target) = (scene.eye.unwrap_or(whole.eye), scene.target.unwrap_or(bounds.center()));
    Ok(Camera::look_at(eye, target, scene.up.unwrap_or(up.direction()), fov, size))
}

fn write_depth(path: &Path, picture: &Picture) -> Result<(), CliError> {
    use exr::prelude::*;
    let size = (picture.size.width as usize, picture.size.height as usize);
    let channel = AnyChannel::new("Z", FlatSamples::F32(picture.depth.clone()));
    let image = Image::from_channels(size, AnyChannels::sort(SmallVec::from_vec(vec![channel])));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| CliError::in_file(path, format!("could not write: {error}")))?;
    files::write_atomically(path, |out| out.write_all(bytes.get_ref()).map_err(|error| CliError::write(path, &error)))
}
