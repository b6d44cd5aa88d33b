//! How fast triangles are drawn: layers of grids that fill the picture, with triangles of some sizes. Prints, for each size and each
//! largest extent that a single invocation draws, processor time a frame and triangles a processor-second.
//!
//! `cargo run --release -p gigalod-render --example hybrid_drawing [EXTENT…]`

#[path = "../tests/models/mod.rs"]
mod models;

use gigalod_geom::{Camera, ImageSize};
use gigalod_render::{Frame, Gpu, Look, Renderer};
use gigalod_runtime::{DrawSource, Similarity};
use glam::{DVec3, Vec3};
use models::{Extra, Grid, Soup};

const SIZE: ImageSize = ImageSize { width: 1280, height: 720 };

/// Layers of right triangles whose legs have `leg_px` pixels, facing the eye at (0, 0, 1), a pixel of length 1/1000 each.
fn layers(leg_px: f64, count: u32) -> Soup {
    let mut soup = Soup::default();
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    for layer in 0..count {
        let depth = 1.0 + f64::from(count - layer) * 0.003;
        let pitch = leg_px * 0.001 * depth;
        let [columns, rows] = [SIZE.width, SIZE.height].map(|px| (f64::from(px) / leg_px) as u32);
        let first = soup.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let at = |index: u32, of: u32, jitter: f64| (f64::from(index) - f64::from(of) * 0.5 + jitter) * pitch;
                let (x, y) = (at(column, columns, 0.3 * random()), at(row, rows, 0.3 * random()));
                soup.positions.push(DVec3::new(x, y, 1.0 - depth));
                soup.normals.push(Vec3::Z);
            }
        }
        let at = |row, column| first + row * (columns + 1) + column;
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let (a, b, c, d) = (at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column));
            soup.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup
}

/// Seconds of processor time that this process has had, the device's threads included.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("this is Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("a name in parentheses").split_whitespace().collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().expect("a number")).sum::<f64>() / 100.0
}

/// Processor time of a frame.
fn seconds(renderer: &mut Renderer, draws: &[(Similarity, &DrawSource)]) -> f64 {
    // A pixel of length 1/1000, one unit away.
    let fov_y_rad = 2.0 * (0.0005 * f64::from(SIZE.height)).atan();
    let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, fov_y_rad, SIZE);
    renderer.draw(&Frame { camera, look: Look::default(), draws: draws.to_vec() }).expect("it can be drawn");
    let (start, mut frames) = (cpu_seconds(), 0);
    while frames < 3 || cpu_seconds() - start < 1.0 {
        renderer.redraw().expect("it can be drawn again");
        frames += 1;
    }
    (cpu_seconds() - start) / f64::from(frames)
}

fn main() {
    let mut renderer = Gpu::open().and_then(Renderer::new).expect("there is an adapter");
    println!("{}", renderer.gpu().adapter());
    let extents: Vec<u32> = std::env::args().skip(1).map(|text| text.parse().expect("an extent in pixels")).collect();
    let extents = if extents.is_empty() { vec![16, 60] } else { extents };
    let empty = seconds(&mut renderer, &[]);
    println!("nothing: {:.1} ms", empty * 1e3);
    for (leg_px, layer_count) in
        [(720.0, 1), (0.5, 1), (1.0, 1), (2.0, 3), (4.0, 6), (10.0, 12), (20.0, 12), (50.0, 12), (200.0, 12)]
    {
        let soup = layers(leg_px, layer_count);
        let model = soup.model(&Grid::around(&soup), 24, Extra::default());
        let draw = model.draw(0, false);
        for extent in &extents {
            renderer.set_compute_extent(*extent);
            let took = seconds(&mut renderer, &[(Similarity::IDENTITY, &draw)]) - empty;
            let triangles = soup.triangles.len() as f64;
            println!(
                "legs of {leg_px} px, {triangles} triangles in {} nodes, one invocation up to {extent} px: {:.1} ms, {:.2} M/s, {:.1} Mpx/s",
                model.pages.len(),
                took * 1e3,
                triangles / took * 1e-6,
                f64::from(layer_count) * SIZE.pixels() as f64 / took * 1e-6
            );
        }
    }
}
