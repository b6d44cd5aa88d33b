//! `gigalod bench`: a camera path, measured frame by frame.

use super::args::BenchArgs;
use super::error::{CliError, Outcome};
use super::path_file;
use super::progress::Console;
use super::stage::{CAMERA, Stage, Wait, primitives};
use super::subject::Subject;
use gigalod_build::Progress;
use gigalod_geom::camera::default_orbit_deg;
use gigalod_geom::{Camera, CameraPath};
use gigalod_render::{Look, Renderer};
use gigalod_runtime::{CutReport, Fineness, FrameRate};
use serde::Serialize;
use std::fmt::Write;
use std::time::Instant;

/// The JSON object of `bench`.
#[derive(Serialize)]
struct BenchReport {
    adapter: String,
    frames: Vec<FrameFigures>,
    summary: Summary,
    problems: Vec<String>,
}

/// One frame; times in milliseconds of the wall clock.
#[derive(Clone, Serialize)]
struct FrameFigures {
    /// Seconds along the path; beyond its end the camera rests.
    t: f64,
    frame_ms: f64,
    select_ms: f64,
    upload_bytes: u64,
    triangles: u64,
    points: u64,
    /// What the cut was made at.
    threshold_px: f32,
    /// Pixels of the screen that a drawn one is wide.
    pixel_edge_px: f64,
    /// Null where something reaches the eye itself.
    max_error_px: Option<f32>,
    /// False where the camera rests.
    moved: bool,
    /// Pages that it could have used and that were not resident.
    page_misses: u64,
}

/// Percentiles over frames of the path; what came after its end is told apart.
#[derive(Serialize)]
struct Summary {
    frame_ms_median: f64,
    frame_ms_p95: f64,
    frame_ms_max: f64,
    /// Frames of a moving camera that were coarser than --error and --size ask for, so that the time they took was a choice; null
    /// without --target-ms.
    paced: Option<Paced>,
    /// What came after the path's end; null without --target-ms.
    rest: Option<Rest>,
}

#[derive(Serialize)]
struct Paced {
    frames: usize,
    frame_ms_p05: Option<f64>,
    frame_ms_median: Option<f64>,
    frame_ms_p95: Option<f64>,
}

#[derive(Serialize)]
struct Rest {
    frames: usize,
    seconds: f64,
    threshold_px: f32,
    /// How often the threshold turned from falling to rising, or back.
    sign_changes: usize,
}

/// Frames of one run.
struct Run<'a> {
    stage: &'a mut Stage,
    path: CameraPath,
    args: &'a BenchArgs,
    /// Error that is wanted.
    finest_px: f32,
    console: &'a Console,
    look: Look,
    frames: Vec<FrameFigures>,
    last: CutReport,
}

pub(crate) fn run(args: &BenchArgs, console: &Console) -> Result<Outcome, CliError> {
    let path = path_file::read(&args.path)?;
    let subject = Subject::open(&args.file, &args.build, console)?;
    let mut stage = Stage::open(&subject, args.draw.budgets())?;
    stage.scene.set_tint(args.draw.tint());
    stage.scene.set_cross_fade(args.draw.cross_fade);
    let finest_px = args.draw.threshold_px(subject.default_error_px()) as f32;
    let look = args.draw.look(&subject.description);
    warm_up(&mut stage, &path, look, args, console)?;
    let (stage_mut, last) = (&mut stage, CutReport::default());
    let mut run = Run { stage: stage_mut, path, args, finest_px, console, look, frames: Vec::new(), last };
    let on_path = match args.target_ms {
        None => run.each_pose()?,
        Some(target_ms) => run.in_real_time(target_ms)?,
    };
    let (frames, last) = (run.frames, run.last);
    let summary = summary(&frames, on_path, finest_px, args);
    let problems = stage.problems(&args.file, &last, console);
    let text = describe(&frames[..on_path], &summary, args);
    let report = BenchReport { adapter: stage.renderer.gpu().adapter(), frames, summary, problems };
    Ok(Outcome::new(&report, text))
}

/// Compiles what draws, by frames that nobody counts: of a few large splats, and of small ones from far away. Of the models no more
/// is loaded than their roots.
fn warm_up(
    stage: &mut Stage,
    path: &CameraPath,
    look: Look,
    args: &BenchArgs,
    console: &Console,
) -> Result<(), CliError> {
    let fov_y_rad = args.fov.unwrap_or(path.fov_deg).to_radians();
    let (bounds, up) = (stage.bounds(), stage.up());
    let orbit_deg = default_orbit_deg(&bounds, up);
    for (zoom, threshold_px) in [(1.0, f32::INFINITY), (0.05, 2.0)] {
        let camera = Camera::orbit(&bounds, up, orbit_deg, zoom, fov_y_rad, args.draw.size);
        stage.draw_until(&camera, look, &Fineness::px(threshold_px), Wait::Converged, Renderer::draw, console)?;
    }
    Ok(())
}

impl Run<'_> {
    /// Each pose once. Returns the number of frames.
    fn each_pose(&mut self) -> Result<usize, CliError> {
        let work = self.console.work("bench");
        work.begin("draw", self.path.frames.len() as u64);
        let wanted = Fineness::px(self.finest_px);
        for index in 0..self.path.frames.len() {
            self.frame(self.path.frames[index].t, &wanted, true)?;
            work.at(index as u64 + 1);
        }
        Ok(self.frames.len())
    }

    /// The path as fast as time passes, then at rest until nothing gets finer. Returns the number of frames on the path.
    fn in_real_time(&mut self, target_ms: f64) -> Result<usize, CliError> {
        let work = self.console.work("bench");
        let (first, last) = (self.path.frames[0].t, self.path.frames[self.path.frames.len() - 1].t);
        work.begin("play", ((last - first) * 1e3) as u64);
        let control = FrameRate::new(target_ms, self.finest_px).with_larger_pixels();
        self.stage.control = Some(control);
        let begun = Instant::now();
        let mut before = None;
        let mut moved = loop {
            let elapsed = begun.elapsed().as_secs_f64();
            let t = (first + elapsed).min(last);
            work.at(((t - first) * 1e3) as u64);
            let pose = self.path.at(t);
            let moved = before != Some((pose.eye, pose.target));
            if first + elapsed >= last {
                break moved;
            }
            before = Some((pose.eye, pose.target));
            self.paced_frame(t, moved)?;
        };
        let on_path = self.frames.len();
        loop {
            self.paced_frame(first + begun.elapsed().as_secs_f64(), moved)?;
            if self.control().is_settled() {
                break;
            }
            moved = false;
        }
        Ok(on_path)
    }

    fn paced_frame(&mut self, t: f64, moved: bool) -> Result<(), CliError> {
        let wanted = self.control().next(moved);
        self.frame(t, &wanted, moved)?;
        let (frame_ms, report) = (self.frames.last().expect("a frame was just drawn").frame_ms, self.last);
        let loading = self.stage.scene.residency().is_loading();
        self.control().drew(frame_ms, &report, loading);
        Ok(())
    }

    fn control(&mut self) -> &mut FrameRate {
        self.stage.control.as_mut().expect("the path is played in real time")
    }

    /// One frame of what is resident now.
    fn frame(&mut self, t: f64, wanted: &Fineness, moved: bool) -> Result<(), CliError> {
        let pose = self.path.at(t);
        let fov = self.args.fov.unwrap_or(self.path.fov_deg).to_radians();
        let camera = Camera::look_at(pose.eye, pose.target, self.path.up, fov, self.args.draw.size);
        let drawn = self.stage.draw_until(&camera, self.look, wanted, Wait::Never, Renderer::draw, self.console)?;
        let scene = &mut self.stage.scene;
        let page_misses = scene.draws(CAMERA).map(|(_, selection)| selection.requests.len() as u64).sum();
        scene.serve();
        self.last = drawn.report;
        self.frames.push(FrameFigures {
            t,
            frame_ms: drawn.frame_ms,
            select_ms: drawn.select_ms,
            upload_bytes: self.stage.renderer.uploaded_bytes(),
            triangles: self.last.triangles,
            points: self.last.points,
            threshold_px: self.last.threshold_px,
            pixel_edge_px: drawn.pixel_edge_px,
            max_error_px: self.last.max_error_px.is_finite().then_some(self.last.max_error_px),
            moved,
            page_misses,
        });
        Ok(())
    }
}

/// Figures over all frames; `on_path` of them show the path.
fn summary(frames: &[FrameFigures], on_path: usize, finest_px: f32, args: &BenchArgs) -> Summary {
    let (path, rest) = frames.split_at(on_path);
    let sorted = |frames: &mut dyn Iterator<Item = &FrameFigures>| {
        let mut times: Vec<f64> = frames.map(|frame| frame.frame_ms).collect();
        times.sort_by(f64::total_cmp);
        times
    };
    let all = sorted(&mut if path.is_empty() { rest } else { path }.iter());
    let coarser = |frame: &&FrameFigures| frame.threshold_px > finest_px || frame.pixel_edge_px > 1.0;
    // Where there is nothing to draw, nothing makes a frame longer.
    let paced =
        sorted(&mut path.iter().filter(|frame| frame.moved && frame.triangles + frame.points > 0).filter(coarser));
    let thresholds: Vec<f32> = rest.iter().map(|frame| frame.threshold_px).collect();
    let steps: Vec<f32> = thresholds.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step != 0.0).collect();
    let of = |part: f64| percentile(&all, part).unwrap_or(0.0);
    Summary {
        frame_ms_median: of(0.5),
        frame_ms_p95: of(0.95),
        frame_ms_max: of(1.0),
        paced: args.target_ms.map(|_| Paced {
            frames: paced.len(),
            frame_ms_p05: percentile(&paced, 0.05),
            frame_ms_median: percentile(&paced, 0.5),
            frame_ms_p95: percentile(&paced, 0.95),
        }),
        rest: args.target_ms.map(|_| Rest {
            frames: rest.len(),
            // An empty sum is -0.
            seconds: rest.iter().map(|frame| frame.frame_ms).sum::<f64>().max(0.0) / 1e3,
            threshold_px: thresholds.last().copied().unwrap_or(finest_px),
            sign_changes: steps.windows(2).filter(|pair| (pair[0] < 0.0) != (pair[1] < 0.0)).count(),
        }),
    }
}

/// The value that so great a part of `sorted` does not exceed (nearest rank).
fn percentile(sorted: &[f64], part: f64) -> Option<f64> {
    let rank = (sorted.len() as f64 * part).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

fn describe(path: &[FrameFigures], summary: &Summary, args: &BenchArgs) -> String {
    let mut text = format!(
        "{} frames: median {:.1} ms, 95 % within {:.1} ms, longest {:.1} ms\n",
        path.len(),
        summary.frame_ms_median,
        summary.frame_ms_p95,
        summary.frame_ms_max
    );
    let mean = |of: fn(&FrameFigures) -> f64| path.iter().map(of).sum::<f64>() / path.len().max(1) as f64;
    let _ = writeln!(
        text,
        "on average {}, {:.1} ms to select them, {:.2} px; pixels {:.2} px wide",
        primitives(mean(|frame| frame.triangles as f64), mean(|frame| frame.points as f64)),
        mean(|frame| frame.select_ms),
        mean(|frame| f64::from(frame.threshold_px)),
        mean(|frame| frame.pixel_edge_px),
    );
    if let (Some(target_ms), Some(paced)) = (args.target_ms, &summary.paced)
        && let (Some(low), Some(median), Some(high)) = (paced.frame_ms_p05, paced.frame_ms_median, paced.frame_ms_p95)
    {
        let _ = writeln!(
            text,
            "{} frames held back to {target_ms} ms: median {median:.1} ms, nine of ten from {low:.1} to {high:.1} ms",
            paced.frames
        );
    }
    if let Some(rest) = &summary.rest {
        let _ = writeln!(
            text,
            "at rest: {} frames and {:.2} s until all is drawn at {:.2} px",
            rest.frames, rest.seconds, rest.threshold_px
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn percentiles_are_values_that_were_measured() {
        let times: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!([0.05, 0.5, 0.95, 1.0].map(|part| percentile(&times, part)), [1.0, 10.0, 19.0, 20.0].map(Some));
        assert_eq!(percentile(&[3.0], 0.5), Some(3.0));
        assert_eq!(percentile(&[], 0.5), None);
    }
}
