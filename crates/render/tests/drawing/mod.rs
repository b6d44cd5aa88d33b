//! What tests of pictures share: renderers, cameras, pictures and files of them.
#![allow(dead_code, reason = "each test file uses its own part")]

use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera, ImageSize};
use gigalod_render::{Frame, Gpu, GpuLevel, Look, Picture, Renderer};
use gigalod_runtime::{DrawSource, Similarity};

pub(crate) const SIZE: ImageSize = ImageSize { width: 480, height: 300 };
pub(crate) const FOV: f64 = 0.7;

pub(crate) fn renderer_at(level: GpuLevel) -> Option<Renderer> {
    match Gpu::open_at(level).and_then(Renderer::new) {
        Ok(renderer) => Some(renderer),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_none() => {
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("REQUIRE_GPU is set, but {error}"),
    }
}

pub(crate) fn renderer() -> Option<Renderer> {
    renderer_at(GpuLevel::Native)
}

pub(crate) fn picture(renderer: &mut Renderer, camera: &Camera, draws: &[(Similarity, &DrawSource)]) -> Picture {
    renderer.picture(&Frame { camera: *camera, look: Look::default(), draws: draws.to_vec() }).unwrap()
}

pub(crate) fn show(name: &str, picture: &Picture) {
    let Some(folder) = std::env::var_os("GIGALOD_PICTURES") else { return };
    let mut bytes = format!("P6 {} {} 255\n", picture.size.width, picture.size.height).into_bytes();
    bytes.extend(picture.rgba.as_chunks::<4>().0.iter().flat_map(|pixel| &pixel[..3]));
    std::fs::write(std::path::Path::new(&folder).join(format!("{name}.ppm")), bytes).unwrap();
}

pub(crate) fn same(a: &Picture, b: &Picture) -> bool {
    a.rgba == b.rgba && a.depth == b.depth && a.footprint_px == b.footprint_px
}

pub(crate) fn orbit(bounds: &Aabb, orbit_deg: [f64; 2], zoom: f64) -> Camera {
    Camera::orbit(bounds, UpAxis::Y, orbit_deg, zoom, FOV, SIZE)
}
