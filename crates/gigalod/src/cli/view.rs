//! `gigalod view`.

use super::args::ViewArgs;
use super::error::{CliError, Outcome};
use super::path_file;
use super::progress::Console;
use super::view_files::Files;
use gigalod_geom::camera::DEFAULT_FOV_DEG;
use gigalod_view::{FirstLook, Options, Report, Settings, ViewError, percentile};
use serde::Serialize;
use std::fmt::Write;
use std::sync::Arc;

/// The JSON object of `view`: figures at exit. Times in milliseconds.
#[derive(Serialize)]
struct ViewReport {
    adapter: String,
    width: u32,
    height: u32,
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov: f64,
    /// Of the window.
    frames: usize,
    /// Processor time of the window's thread for each of its frames, without the driver's.
    window_cpu_ms: Spread,
    /// What the driver takes of it besides, to give images and to take them.
    driver_cpu_ms: Spread,
    /// Processor time of the thread that selects, uploads and draws, for each of its frames.
    stage_cpu_ms: Spread,
    /// From input to the frame that shows it.
    input_to_frame_ms: Spread,
    /// From the open device to the first frame of a model; null where there was none.
    first_frame_ms: Option<f32>,
    /// From the last input to the picture that gets no finer; null where it was not waited for.
    rest_to_settled_ms: Option<f32>,
    settled: bool,
    /// Places at which each pixel of the last picture was looked at.
    samples: u32,
    threshold_px: Option<f32>,
    max_error_px: Option<f32>,
    limited_by: Option<&'static str>,
    splats: u64,
    bytes_read: u64,
    /// The distance that was measured last; null where none is shown.
    measured: Option<Distance>,
    written: Vec<String>,
    problems: Vec<String>,
}

#[derive(Serialize)]
struct Distance {
    points: Vec<[f64; 3]>,
    distance: f64,
    /// How far it may be off; 0 where it is the original's.
    uncertain: f64,
}

#[derive(Serialize)]
struct Spread {
    median: Option<f32>,
    p99: Option<f32>,
    max: Option<f32>,
}

pub(crate) fn run(args: &ViewArgs, console: &Console) -> Result<Outcome, CliError> {
    if args.camera.up.is_some() {
        return Err(
            CliError::usage("the viewer keeps the model's up, expected no --up").hint("a scene has an up = \"z\"")
        );
    }
    let mut fov_deg = args.camera.fov;
    let first_look = match (args.camera.eye, args.camera.target, &args.camera.path, args.camera.frame) {
        (Some(eye), Some(target), ..) => FirstLook::From { eye, target },
        (_, _, Some(path), Some(frame)) => {
            let (pose, camera_path) = path_file::pose(path, frame)?;
            fov_deg = fov_deg.or(Some(camera_path.fov_deg));
            FirstLook::From { eye: pose.eye, target: pose.target }
        }
        _ => args.camera.orbit.map_or(FirstLook::Whole, FirstLook::Orbit),
    };
    let look = args.draw.look(&Default::default());
    let options = Options {
        files: args.files.clone(),
        settings: Settings {
            kernel: look.kernel,
            samples: args.draw.samples.unwrap_or(gigalod_view::SAMPLES),
            towards_light: look.lighting.towards_light,
            background: look.lighting.background,
            tint: args.draw.tint(),
            cross_fade: args.draw.cross_fade,
            finest_px: args.draw.asked_px().map(|px| px as f32),
            target_ms: args.target_ms,
            cpu_budget: args.draw.cpu_budget,
            gpu_budget: args.draw.gpu_budget,
        },
        fov_deg: fov_deg.unwrap_or(DEFAULT_FOV_DEG),
        first_look,
        size: args.draw.size,
    };
    let host = Arc::new(Files::new(args.build.clone()));
    let report = gigalod_view::run(options, host).map_err(|error| match error {
        ViewError::Window(_) => CliError::new(error).hint("on Linux it needs an X server; `gigalod render` needs none"),
        ViewError::Render(error) => super::stage::graphics_error(error),
        ViewError::Threads(_) | ViewError::Forced => CliError::new(error),
    })?;
    // The window has told all of it; who called the program has not seen that.
    let Report { tally, .. } = &report;
    let nothing_shown = tally.last.as_ref().is_none_or(|last| last.frames == 0);
    let failed = nothing_shown && !args.files.is_empty();
    for problem in tally.problems.iter().skip(usize::from(failed)) {
        console.warn(&CliError::new(problem));
    }
    if let (true, Some(first)) = (failed, tally.problems.first()) {
        return Err(CliError::new(first));
    }
    let text = describe(&report);
    Ok(Outcome::new(&json(report), text))
}

fn spread(values: &[f32]) -> Spread {
    Spread { median: percentile(values, 0.5), p99: percentile(values, 0.99), max: percentile(values, 1.0) }
}

fn json(report: Report) -> ViewReport {
    let Report { adapter, tally, viewpoint, size, measured } = report;
    let last = tally.last.unwrap_or_default();
    let has_drawn = last.frames > 0;
    ViewReport {
        adapter,
        width: size.width,
        height: size.height,
        eye: viewpoint.eye.to_array(),
        target: viewpoint.target.to_array(),
        up: viewpoint.up.to_array(),
        fov: viewpoint.fov_deg,
        frames: tally.window_cpu_ms.len(),
        window_cpu_ms: spread(&tally.window_cpu_ms),
        driver_cpu_ms: spread(&tally.driver_cpu_ms),
        stage_cpu_ms: spread(&tally.stage_cpu_ms),
        input_to_frame_ms: spread(&tally.input_to_frame_ms),
        first_frame_ms: tally.first_frame_ms,
        rest_to_settled_ms: tally.rest_to_settled_ms,
        settled: last.settled,
        samples: last.samples,
        threshold_px: has_drawn.then_some(last.report.threshold_px),
        max_error_px: (has_drawn && last.report.max_error_px.is_finite()).then_some(last.report.max_error_px),
        limited_by: last.report.limited_by.map(|limit| limit.name()),
        splats: last.report.primitives(),
        bytes_read: last.bytes_read,
        measured: measured.map(|measured| Distance {
            points: measured.points.iter().map(|point| point.to_array()).collect(),
            distance: measured.distance,
            uncertain: measured.uncertain,
        }),
        written: tally.written,
        problems: tally.problems,
    }
}

fn describe(report: &Report) -> String {
    let tally = &report.tally;
    let mut text = String::new();
    if let (Some(median), Some(p99)) = (percentile(&tally.window_cpu_ms, 0.5), percentile(&tally.window_cpu_ms, 0.99)) {
        let frames = tally.window_cpu_ms.len();
        let _ = writeln!(text, "{frames} frames, {median:.1} ms of the window's thread each, 99 % within {p99:.1} ms");
    }
    if let (Some(median), Some(p99)) =
        (percentile(&tally.input_to_frame_ms, 0.5), percentile(&tally.input_to_frame_ms, 0.99))
    {
        let _ = writeln!(text, "from input to its frame {median:.0} ms, 99 % within {p99:.0} ms");
    }
    for file in &tally.written {
        let _ = writeln!(text, "{file}");
    }
    text
}
