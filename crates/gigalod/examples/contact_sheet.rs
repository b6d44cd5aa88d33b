//! All kernels side by side, far and near: `cargo run --release --example contact_sheet -- MODEL.glod OUT.png [ERROR_PX]`.
//!
//! Columns: square, round and Gaussian splats, then their elliptical kinds. Upper row: the whole model at one pixel. Lower row:
//! near, with splats of ERROR_PX pixels (20 if not given), so that their shape can be seen, as in the splats paper's figures 3 and 4.

use anyhow::{Context, Result};
use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Frame, Gpu, Kernel, Look, Renderer};
use gigalod::runtime::residency::InlineLoader;
use gigalod::runtime::{Fineness, Instance, Residency, Scene, Similarity, ViewId};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

const TILE: ImageSize = ImageSize { width: 420, height: 420 };

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, out, rest @ ..] = &arguments[..] else {
        anyhow::bail!("usage: contact_sheet MODEL.glod OUT.png [ERROR_PX]");
    };
    let near_px: f32 = rest.first().map_or(Ok(20.0), |text| text.parse())?;
    let store = FileStore::open(Path::new(model)).context(model.clone())?;
    let file = Arc::new(SplatFile::open(Container::open(Arc::new(store))?)?);
    let (up, bounds) = (file.skeleton().root().up, file.skeleton().root().bounds);
    let mut residency = Residency::new(4 << 30, Box::new(InlineLoader::default()));
    let id = residency.add(file);
    let mut scene = Scene::new(residency);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });
    let mut renderer = Renderer::new(Gpu::open()?)?;

    let columns = Kernel::ALL.len();
    let sheet_width = columns * TILE.width as usize;
    let mut sheet = vec![[0u8; 3]; sheet_width * TILE.height as usize * 2];
    for (row, (zoom, threshold_px)) in [(1.0, 1.0), (3.0, near_px)].into_iter().enumerate() {
        let camera = Camera::orbit(&bounds, up, [30.0, 10.0], zoom, 40f64.to_radians(), TILE);
        scene.select_converged(ViewId(0), &camera, &Fineness::px(threshold_px));
        for (column, kernel) in Kernel::ALL.into_iter().enumerate() {
            let draws =
                scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
            let frame = Frame { camera, look: Look { kernel, ..Look::default() }, draws };
            let picture = renderer.picture(&frame)?;
            let width = TILE.width as usize;
            for (y, line) in picture.rgba.as_chunks::<4>().0.chunks(width).enumerate() {
                let start = (row * TILE.height as usize + y) * sheet_width + column * width;
                for (to, [r, g, b, _]) in sheet[start..start + width].iter_mut().zip(line) {
                    *to = [*r, *g, *b];
                }
            }
        }
    }
    let mut encoder =
        png::Encoder::new(std::io::BufWriter::new(File::create(out)?), sheet_width as u32, TILE.height * 2);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(sheet.as_flattened())?;
    Ok(())
}
