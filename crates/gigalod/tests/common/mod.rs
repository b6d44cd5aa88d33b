//! What picture tests share: real models, builds in a temporary folder, drawing.
#![allow(dead_code, reason = "each test file uses its own part")]

use gigalod::build::{NoProgress, Options, hybrid, splats};
use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::import::read_all;
use gigalod::render::{Frame, Gpu, Kernel, Look, Picture, Renderer};
use gigalod::runtime::residency::InlineLoader;
use gigalod::runtime::{CutReport, Fineness, Instance, ModelFile, Residency, Scene, Similarity, ViewId};
use gigalod::verify;
use gigalod_reference::Mesh;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A real model, or `None` (said so) where there are none.
pub(crate) fn scan(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("GIGALOD_DATA") else {
        println!("skipped: GIGALOD_DATA not set");
        return None;
    };
    let path = Path::new(&folder).join("scans").join(name);
    assert!(path.is_file(), "{} is missing", path.display());
    Some(path)
}

/// A renderer, or `None` (said so) where there is no adapter; with `REQUIRE_GPU` set that is a failure.
pub(crate) fn renderer() -> Option<Renderer> {
    match Gpu::open().and_then(Renderer::new) {
        Ok(renderer) => Some(renderer),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_none() => {
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("REQUIRE_GPU is set, but {error}"),
    }
}

/// A whole mesh in memory.
pub(crate) fn mesh(path: &Path) -> Mesh {
    let mut stream = gigalod::import::open(Box::new(File::open(path).unwrap())).unwrap();
    verify::mesh_of(read_all(&mut *stream, &mut |_, _| {}).unwrap()).unwrap()
}

/// Builds `model` as splats into `folder`; opens the result.
pub(crate) fn built(model: &Path, folder: &Path) -> Arc<SplatFile> {
    let out = folder.join("model.glod");
    let stream = gigalod::import::open(Box::new(File::open(model).unwrap())).unwrap();
    splats::build(stream, &Options::default(), &NoProgress, &out).unwrap();
    open(&out)
}

/// Opens a `.glod` file.
pub(crate) fn open(path: &Path) -> Arc<SplatFile> {
    let container = Container::open(Arc::new(FileStore::open(path).unwrap())).unwrap();
    Arc::new(SplatFile::open(container).unwrap())
}

/// Builds `model` as triangles and points into `folder`; opens the result.
pub(crate) fn built_hybrid(model: &Path, folder: &Path) -> ModelFile {
    let out = folder.join("model.glod");
    let stream = gigalod::import::open(Box::new(File::open(model).unwrap())).unwrap();
    hybrid::build(stream, &Options::default(), &NoProgress, &out).unwrap();
    open_any(&out)
}

/// Opens a `.glod` file of any kind.
pub(crate) fn open_any(path: &Path) -> ModelFile {
    ModelFile::open(Container::open(Arc::new(FileStore::open(path).unwrap())).unwrap()).unwrap()
}

/// A scene of one model where its file has it.
pub(crate) fn scene(file: impl Into<ModelFile>) -> Scene {
    let mut residency = Residency::new(1 << 30, Box::new(InlineLoader::default()));
    let file = residency.add(file);
    let mut scene = Scene::new(residency);
    scene.add(Instance { file, placement: Similarity::IDENTITY });
    scene
}

/// Cuts until nothing is missing, and draws.
pub(crate) fn draw(
    scene: &mut Scene,
    renderer: &mut Renderer,
    camera: &Camera,
    threshold_px: f32,
    kernel: Kernel,
) -> (CutReport, Picture) {
    let report = scene.select_converged(ViewId(0), camera, &Fineness::px(threshold_px));
    let draws = scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
    let frame = Frame { camera: *camera, look: Look { kernel, ..Look::default() }, draws };
    (report, renderer.picture(&frame).unwrap())
}

/// Azimuth and elevation of twelve views all around: the corners of an icosahedron.
pub(crate) fn twelve_directions() -> [[f64; 2]; 12] {
    std::array::from_fn(|corner| match corner {
        0 => [0.0, 90.0],
        11 => [0.0, -90.0],
        corner => {
            [corner as f64 * 72.0 + if corner > 5 { 36.0 } else { 0.0 }, if corner > 5 { -26.565 } else { 26.565 }]
        }
    })
}

pub(crate) const SIZE: ImageSize = ImageSize { width: 640, height: 360 };
