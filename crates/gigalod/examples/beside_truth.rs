//! Draws a model beside what a ray tracer sees of it, and their difference.
//!
//! `cargo run --release --example beside_truth -- MODEL.ply OUT.png [AZIMUTH ELEVATION ZOOM [ERROR_PX [splats|hybrid|geometry]]]`
//!
//! `geometry` is a hybrid without appearance. Left: as it is drawn. Middle: the ray tracer. Right: their difference, four times
//! enlarged; holes red, steep places drawn a little to the side blue, fat green. Prints the judge's counts and the image metrics as one
//! JSON object, and where the first holes are on standard error.

use anyhow::{Context, Result};
use gigalod::build::{NoProgress, Options, hybrid, splats};
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::import::read_all;
use gigalod::render::{Frame, Gpu, Lighting, Look, Renderer};
use gigalod::runtime::residency::InlineLoader;
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod::runtime::{Fineness, Instance, ModelFile, Residency, Scene, Similarity, ViewId};
use gigalod::verify;
use gigalod_reference::judge::{Drawn, Hole, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Mesh, Picture, Shading, Truth, metrics, shade};
use serde_json::json;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, out, rest @ ..] = &arguments[..] else {
        anyhow::bail!(
            "usage: beside_truth MODEL.ply OUT.png [AZIMUTH ELEVATION ZOOM [ERROR_PX [splats|hybrid|geometry]]]"
        );
    };
    let number = |at: usize, default: f64| rest.get(at).map_or(Ok(default), |text: &String| text.parse::<f64>());
    let (orbit_deg, zoom, threshold_px) = ([number(0, 0.0)?, number(1, 0.0)?], number(2, 1.0)?, number(3, 1.0)?);

    let mesh = read(Path::new(model))?;
    let folder = tempfile::tempdir()?;
    let built = folder.path().join("model.glod");
    let stream = gigalod::import::open(Box::new(File::open(model)?))?;
    let kind = rest.get(4).map_or("splats", String::as_str);
    let options = Options { keeps_looks: kind != "geometry", ..Options::default() };
    let builder = if kind == "splats" { splats::build } else { hybrid::build };
    builder(stream, &options, &NoProgress, &built)?;
    let file = ModelFile::open(Container::open(Arc::new(FileStore::open(&built)?))?)?;
    let up = file.up();
    let mut residency = Residency::new(4 << 30, Box::new(InlineLoader::default()));
    let id = residency.add(file);
    let mut scene = Scene::new(residency);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });

    let camera = Camera::orbit(&mesh.bounds(), up, orbit_deg, zoom, 40f64.to_radians(), SIZE);
    let report = scene.select_converged(ViewId(0), &camera, &Fineness::px(threshold_px as f32));
    let draws = scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
    let frame = Frame { camera, look: Look::default(), draws };
    let drawn = Renderer::new(Gpu::open()?)?.picture(&frame)?;
    let splats =
        Picture { size: SIZE, pixels: drawn.rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect() };

    let bvh = Bvh::build(&mesh);
    let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
    let shading = Shading {
        to_light: camera.shoulder_light(),
        background_srgb: Lighting::default().background,
        plain_albedo_srgb: MATERIAL_SRGB,
    };
    let expected = shade::picture(&truth, &shading);
    let footprint = report.limited_by.is_some().then_some(&drawn.footprint_px[..]);
    let judged = Drawn { depth: &drawn.depth, data_footprint_px: footprint };
    let verdict = judge(&truth, &supersampled_coverage(&bvh, &camera, 4), &judged, threshold_px);
    let compared = metrics::compare(&expected, &splats, Some(&metrics::silhouette_mask(&truth)));
    // What is steep, and drawn a little to the side, is deeper by the letter; nothing is seen through it.
    let (steep, open): (Vec<&Hole>, Vec<&Hole>) = verdict.holes.iter().partition(|hole| hole.within_error);
    for Hole { pixel: [x, y], behind_px, .. } in open.iter().take(10) {
        eprintln!("hole at {x}, {y}: {behind_px:.2} px behind");
    }
    let figures = json!({
        "primitives": report.triangles + report.points,
        "max_error_px": report.max_error_px,
        "holes": open.len(),
        "fat": verdict.fat.len(),
        "steep": steep.len(),
        "judged": verdict.judged.count(),
        "psnr_db": compared.psnr_db,
        "ssim": compared.ssim,
        "flip_mean": compared.flip_mean,
    });
    println!("{figures}");
    let mut difference: Vec<[u8; 3]> = std::iter::zip(&expected.pixels, &splats.pixels)
        .map(|(a, b)| std::array::from_fn(|channel| a[channel].abs_diff(b[channel]).saturating_mul(4)))
        .collect();
    let mut mark = |[x, y]: [u32; 2], color| difference[(y * SIZE.width + x) as usize] = color;
    steep.iter().for_each(|hole| mark(hole.pixel, [0, 96, 255]));
    open.iter().for_each(|hole| mark(hole.pixel, [255, 0, 0]));
    verdict.fat.iter().for_each(|pixel| mark(*pixel, [0, 255, 0]));
    write_sheet(Path::new(out), [&splats.pixels, &expected.pixels, &difference])
}

fn read(path: &Path) -> Result<Mesh> {
    let mut stream = gigalod::import::open(Box::new(File::open(path).context(path.display().to_string())?))?;
    Ok(verify::mesh_of(read_all(&mut *stream, &mut |_, _| {})?)?)
}

fn write_sheet(path: &Path, pictures: [&Vec<[u8; 3]>; 3]) -> Result<()> {
    let width = SIZE.width as usize;
    let rows = (0..SIZE.height as usize).flat_map(|row| pictures.map(|picture| &picture[row * width..][..width]));
    let bytes: Vec<u8> = rows.flat_map(|row| row.as_flattened().to_vec()).collect();
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(File::create(path)?), SIZE.width * 3, SIZE.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&bytes)?;
    Ok(())
}
