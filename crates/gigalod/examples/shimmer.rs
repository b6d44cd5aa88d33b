//! How much each kernel shimmers while a camera moves slowly, beside a picture filtered as it should be.
//!
//! `cargo run --release --example shimmer -- MODEL.ply [ERROR_PX [splats|hybrid|faded|geometry [SAMPLES]]]`
//!
//! The camera moves by a tenth of a pixel a frame, to the right and forwards. Prints one JSON object: for each kernel its
//! shimmer and its sharpness as multiples of those of a ray tracer with 16 rays a pixel, and the holes of its first frame (what
//! is steep and a little to the side is none, as everywhere).
//! A kernel with less shimmer than that at less sharpness only blurs. Hybrid models have one; `geometry` is without appearance, `faded` with
//! levels that fade into each other.
//! SAMPLES: at how many places each pixel is looked at; 1 where it is not said.

use anyhow::{Context, Result};
use gigalod::build::{NoProgress, Options, hybrid, splats};
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::import::read_all;
use gigalod::render::{Frame, Gpu, Kernel, Lighting, Look, Renderer};
use gigalod::runtime::residency::InlineLoader;
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod::runtime::{Fineness, Instance, ModelFile, Residency, Scene, Similarity, ViewId};
use gigalod::verify;
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::{supersampled_coverage, supersampled_picture};
use gigalod_reference::{Bvh, Mesh, Picture, Shading, Truth, metrics, temporal};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

const SIZE: ImageSize = ImageSize { width: 640, height: 360 };
const FRAMES: u32 = 12;
const STEP_PX: f64 = 0.1;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, rest @ ..] = &arguments[..] else {
        anyhow::bail!("usage: shimmer MODEL.ply [ERROR_PX [splats|hybrid|faded|geometry [SAMPLES]]]");
    };
    let threshold_px: f32 = rest.first().map_or(Ok(1.0), |text| text.parse())?;
    let mesh = read(Path::new(model))?;
    let kind = rest.get(1).map_or("splats", String::as_str);
    let samples: u32 = rest.get(2).map_or(Ok(1), |text| text.parse())?;
    let mut scene = open(Path::new(model), kind)?;
    scene.set_cross_fade(kind == "faded");
    let mut renderer = Renderer::new(Gpu::open()?)?;

    let cameras: Vec<Camera> = (0..FRAMES).map(|frame| dolly(&mesh, f64::from(frame))).collect();
    let bvh = Bvh::build(&mesh);
    let truth = Truth::trace(&bvh, &cameras[0], MATERIAL_SRGB);
    let touched = supersampled_coverage(&bvh, &cameras[0], 4);
    let mask = metrics::silhouette_mask(&truth);
    let filtered: Vec<Picture> =
        cameras.iter().map(|camera| supersampled_picture(&bvh, camera, &shading(camera), 4)).collect();
    let (shimmer, sharpness) = (temporal::shimmer(&filtered, &mask), temporal::sharpness(&filtered[0], &mask));

    let mut kernels = serde_json::Map::new();
    let used = if kind == "splats" { &Kernel::ALL[..] } else { &[Kernel::Round] };
    for kernel in used.iter().copied() {
        let mut first = None;
        let pictures = cameras
            .iter()
            .map(|camera| {
                let report = scene.select_converged(ViewId(0), camera, &Fineness::px(threshold_px));
                let draws =
                    scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
                let look = Look { kernel, samples, ..Look::default() };
                let frame = Frame { camera: *camera, look, draws };
                let drawn = renderer.picture(&frame)?;
                let pixels = drawn.rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
                first.get_or_insert((report, drawn));
                Ok(Picture { size: SIZE, pixels })
            })
            .collect::<Result<Vec<Picture>>>()?;
        let (report, drawn) = first.context("there is a first frame")?;
        let footprint = report.limited_by.is_some().then_some(&drawn.footprint_px[..]);
        let judged = Drawn { depth: &drawn.depth, data_footprint_px: footprint };
        let verdict = judge(&truth, &touched, &judged, f64::from(threshold_px));
        let figures = serde_json::json!({
            "shimmer": temporal::shimmer(&pictures, &mask) / shimmer,
            "sharpness": temporal::sharpness(&pictures[0], &mask) / sharpness,
            "primitives": report.primitives(),
            "holes": verdict.holes.iter().filter(|hole| !hole.within_error).count(),
            "fat": verdict.fat.len(),
            "psnr_db": metrics::psnr_db(&filtered[0], &pictures[0], Some(&mask)),
        });
        kernels.insert(format!("{kernel:?}"), figures);
    }
    let traced: Vec<Picture> = cameras
        .iter()
        .map(|camera| gigalod_reference::shade::picture(&Truth::trace(&bvh, camera, MATERIAL_SRGB), &shading(camera)))
        .collect();
    kernels.insert(
        "one ray a pixel".into(),
        serde_json::json!({
            "shimmer": temporal::shimmer(&traced, &mask) / shimmer,
            "sharpness": temporal::sharpness(&traced[0], &mask) / sharpness,
            "psnr_db": metrics::psnr_db(&filtered[0], &traced[0], Some(&mask)),
        }),
    );
    println!(
        "{}",
        serde_json::json!({ "model": model, "threshold_px": threshold_px, "samples": samples, "kernels": kernels })
    );
    Ok(())
}

/// A tenth of a pixel to the right a frame, and as much at the outline by coming nearer.
fn dolly(mesh: &Mesh, frame: f64) -> Camera {
    let bounds = mesh.bounds();
    let up = gigalod::geom::camera::UpAxis::Y;
    let mut camera = Camera::orbit(&bounds, up, [30.0, 10.0], 1.0, 40f64.to_radians(), SIZE);
    let distance = (bounds.center() - camera.eye).dot(camera.forward);
    let pixel = distance / camera.focal_px();
    let nearer = distance * pixel / (bounds.diagonal() * 0.5);
    camera.eye += (camera.right * pixel + camera.forward * nearer) * (STEP_PX * frame);
    camera
}

/// The light of the pictures: the camera does not turn, so it stays where it is.
fn shading(camera: &Camera) -> Shading {
    Shading {
        to_light: camera.shoulder_light(),
        background_srgb: Lighting::default().background,
        plain_albedo_srgb: MATERIAL_SRGB,
    }
}

fn open(model: &Path, kind: &str) -> Result<Scene> {
    let folder = tempfile::tempdir()?;
    let built = folder.path().join("model.glod");
    let stream = gigalod::import::open(Box::new(File::open(model)?))?;
    let options = Options { keeps_looks: kind != "geometry", ..Options::default() };
    let builder = if kind == "splats" { splats::build } else { hybrid::build };
    builder(stream, &options, &NoProgress, &built)?;
    let mut residency = Residency::new(4 << 30, Box::new(InlineLoader::default()));
    let id = residency.add(ModelFile::open(Container::open(Arc::new(FileStore::open(&built)?))?)?);
    let mut scene = Scene::new(residency);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });
    Ok(scene)
}

fn read(path: &Path) -> Result<Mesh> {
    let mut stream = gigalod::import::open(Box::new(File::open(path).context(path.display().to_string())?))?;
    Ok(verify::mesh_of(read_all(&mut *stream, &mut |_, _| {})?)?)
}
