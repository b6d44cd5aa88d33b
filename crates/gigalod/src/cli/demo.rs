//! `gigalod demo`: from nothing to four pictures.

use super::args::{BuildOptions, DemoArgs};
use super::build::{Recovery, build};
use super::error::{CliError, Outcome};
use super::inputs::{Inputs, Sense};
use super::parse::readable_bytes;
use super::progress::Console;
use super::render::Job;
use super::stage::{Budgets, Stage};
use super::subject::Subject;
use super::synth::{SynthReport, write_statue};
use gigalod_geom::camera::DEFAULT_FOV_DEG;
use gigalod_geom::{Camera, ImageSize};
use gigalod_render::Look;
use gigalod_runtime::splats::Tint;
use gigalod_synth::{Order, StatueOptions};
use glam::DVec3;
use std::fmt::Write;
use std::time::Instant;

/// A picture of the demo.
struct Shot {
    file: &'static str,
    shows: &'static str,
    /// What the camera looks at, in halves of the bounds' size from their middle.
    at: DVec3,
    /// Azimuth and elevation in degrees, and how many times nearer than a view of the whole.
    orbit: [f64; 3],
    threshold_px: f64,
    tint: Tint,
}

const SHOTS: [Shot; 4] = [
    Shot {
        file: "1-whole.png",
        shows: "the whole statue, --error 1",
        at: DVec3::ZERO,
        orbit: [25.0, 6.0, 1.0],
        threshold_px: 1.0,
        tint: Tint::Model,
    },
    Shot {
        file: "2-face.png",
        shows: "the face, --error 1",
        at: DVec3::new(0.0, 0.5, 0.3),
        orbit: [32.0, 4.0, 2.6],
        threshold_px: 1.0,
        tint: Tint::Model,
    },
    Shot {
        file: "3-eyes.png",
        shows: "the eyes, as close as the data go",
        at: DVec3::new(0.14, 0.53, 0.55),
        orbit: [20.0, 8.0, 8.0],
        threshold_px: 1.0,
        tint: Tint::Model,
    },
    Shot {
        file: "4-levels.png",
        shows: "from above, levels of detail, a colour each, --error 3",
        at: DVec3::ZERO,
        orbit: [32.0, 52.0, 2.0],
        threshold_px: 3.0,
        tint: Tint::Level,
    },
];

pub(crate) fn run(args: &DemoArgs, console: &Console) -> Result<Outcome, CliError> {
    let begun = Instant::now();
    let folder = &args.output;
    std::fs::create_dir_all(folder).map_err(|error| CliError::in_file(folder, error))?;
    let mut text = String::new();

    let scan = folder.join("statue.ply");
    let options = StatueOptions { triangles: args.triangles, seed: 1, colors: true, order: Order::Coherent };
    let statue = write_statue(&scan, &options, console)?;
    let _ = writeln!(text, "{}: {} triangles, {}", scan.display(), statue.triangles, readable_bytes(statue.bytes));

    let built = folder.join("statue.glod");
    let build_options = BuildOptions::within(2 << 30);
    let report = build(&Inputs::one(&scan), &built, &build_options, Sense::default(), Recovery::Lost, console)?;
    let _ = writeln!(text, "{}: {}", built.display(), readable_bytes(report.output_bytes));

    let mut stage = Stage::open(&Subject::of_container(&built)?, Budgets { cpu: 1 << 30, gpu: None })?;
    let size = ImageSize { width: 1280, height: 720 };
    for shot in &SHOTS {
        let picture = folder.join(shot.file);
        let bounds = stage.bounds();
        let [azimuth, elevation, zoom] = shot.orbit;
        let fov = DEFAULT_FOV_DEG.to_radians();
        let mut camera = Camera::orbit(&bounds, stage.up(), [azimuth, elevation], zoom, fov, size);
        camera.eye += bounds.extent() * 0.5 * shot.at;
        let look = Look::default();
        let job = Job {
            camera,
            threshold_px: shot.threshold_px,
            look,
            tint: shot.tint,
            cross_fade: false,
            output: &picture,
            depth: None,
        };
        let drawn = stage.draw(&built, &job, console)?;
        let _ = write!(text, "{}: {}", shot.shows, drawn.text);
    }
    let _ = write!(
        text,
        "\nOpen the pictures in {folder}. With a model of your own (PLY, also gzipped):\n\n    \
         gigalod build model.ply -o model.glod\n    gigalod render model.glod -o model.png --orbit 30,10\n    \
         gigalod info model.glod\n\n\
         From a checkout of the source, `cargo run --release -- …` stands for `gigalod …`. All options: gigalod help render\n",
        folder = folder.display()
    );
    let json = SynthReport {
        output: folder.display().to_string(),
        bytes: report.output_bytes,
        triangles: statue.triangles,
        vertices: statue.vertices,
        points: 0,
        seconds: begun.elapsed().as_secs_f64(),
    };
    Ok(Outcome::new(&json, text))
}
