//! A small closed statue as a splat file, and scenes of it.
#![allow(dead_code, reason = "each test file uses its own part")]

pub(crate) mod judge;
pub(crate) mod octree;

use gigalod_build::{NoProgress, Options, splats};
use gigalod_format::splats::SplatFile;
use gigalod_format::{Container, MemoryStore};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::residency::InlineLoader;
use gigalod_runtime::{Instance, Residency, Scene, Similarity};
use gigalod_synth::{Order, StatueOptions, write_statue};
use std::io::Cursor;
use std::sync::{Arc, OnceLock};

/// Bytes of the file: 60,000 triangles, several pages.
pub(crate) fn statue_bytes() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| bytes_of(statue_ply(60_000, true)))
}

/// A closed statue as PLY.
pub(crate) fn statue_ply(triangles: u64, colors: bool) -> Vec<u8> {
    let mut ply = Vec::new();
    write_statue(StatueOptions { triangles, seed: 3, colors, order: Order::Coherent }, &mut ply, &mut |_, _| {})
        .unwrap();
    ply
}

/// What becomes of a PLY file.
pub(crate) fn bytes_of(ply: Vec<u8>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("model.glod");
    let stream = gigalod_import::open(Box::new(Cursor::new(ply))).unwrap();
    splats::build(stream, &Options::default(), &NoProgress, &out).unwrap();
    std::fs::read(out).unwrap()
}

pub(crate) fn open(bytes: Vec<u8>) -> Arc<SplatFile> {
    Arc::new(SplatFile::open(Container::open(Arc::new(MemoryStore::new(bytes))).unwrap()).unwrap())
}

pub(crate) fn statue() -> Arc<SplatFile> {
    open(statue_bytes().to_vec())
}

/// One statue where its file has it.
pub(crate) fn scene(file: Arc<SplatFile>, budget_bytes: u64) -> Scene {
    let mut residency = Residency::new(budget_bytes, Box::new(InlineLoader::default()));
    let file = residency.add(file);
    let mut scene = Scene::new(residency);
    scene.add(Instance { file, placement: Similarity::IDENTITY });
    scene
}

pub(crate) fn camera(scene: &Scene, azimuth_deg: f64, zoom: f64) -> Camera {
    let size = ImageSize { width: 400, height: 300 };
    Camera::orbit(&scene.bounds(), UpAxis::Y, [azimuth_deg, 12.0], zoom, 0.7, size)
}
