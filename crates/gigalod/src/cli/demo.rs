//! `gigalod demo`: from nothing to four pictures.

use super::args::{BuildOptions, DemoArgs};
use super::build::build;
use super::error::{CliError, Outcome};
use super::parse::readable_bytes;
use super::progress::Console;
use super::render::{Job, Stage};
use super::synth::{SynthReport, write_statue};
use gigalod_geom::camera::DEFAULT_FOV_DEG;
use gigalod_geom::{Camera, ImageSize};
use gigalod_render::Look;
use gigalod_runtime::splats::Tint;
use gigalod_synth::{Order, StatueOptions};
use std::fmt::Write;
use std::time::Instant;

/// A picture of the demo: file, what it shows, orbit, threshold in pixels, colours.
const PICTURES: [(&str, &str, [f64; 3], f64, Tint); 4] = [
    ("1-whole.png", "the whole statue, error 1 px", [25.0, 8.0, 1.0], 1.0, Tint::Model),
    ("2-face.png", "the face, error 1 px", [20.0, 5.0, 3.5], 1.0, Tint::Model),
    ("3-surface.png", "its surface, as fine as the data", [35.0, 12.0, 12.0], 1.0, Tint::Model),
    ("4-levels.png", "levels of detail by colour, error 6 px", [25.0, 8.0, 1.3], 6.0, Tint::Level),
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
    let build_options = BuildOptions { memory: 2 << 30, threads: 0 };
    let report = build(&scan, &built, &build_options, None, console)?;
    let _ = writeln!(text, "{}: {}", built.display(), readable_bytes(report.output_bytes));

    let mut stage = Stage::open(&built, 1 << 30)?;
    let size = ImageSize { width: 1280, height: 720 };
    for (name, shows, [azimuth, elevation, zoom], threshold_px, tint) in PICTURES {
        let picture = folder.join(name);
        let fov = DEFAULT_FOV_DEG.to_radians();
        let camera = Camera::orbit(&stage.bounds(), stage.up(), [azimuth, elevation], zoom, fov, size);
        let job = Job { camera, threshold_px, look: Look::default(), tint, output: &picture, depth: None };
        let drawn = stage.draw(&built, &job, console)?;
        let _ = write!(text, "{shows}: {}", drawn.text);
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
