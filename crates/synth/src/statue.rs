//! A sculpted marble bust of any number of triangles: the project's standard test model.
//!
//! Takes [`StatueOptions`]; writes a binary PLY. The surface is one closed, outward-oriented shell: the topology is a
//! subdivided box (`boxgrid`), each vertex lies on its own ray from inside (`ray`), and only its distance along the ray
//! is sculpted, so the surface can never fold over. Coarse forms (`head`, `bust`, `relief`, `marks`) are sampled
//! once into a table of fixed size (`table`, `filter`); fine ones (`detail`, `paint`) are computed at every vertex.
//!
//! Always holds: a vertex is a pure function of its number, so threads, blocks and order cannot change its bytes.

mod boxgrid;
mod bust;
mod detail;
mod filter;
mod head;
mod marks;
mod paint;
mod ray;
mod relief;
mod shape;
mod table;
mod texel;

use crate::math::smoothstep;
use crate::noise::BLOCK;
use crate::permute::Permutation;
use crate::ply::{FACE_BYTES, PlyWriter, VertexKind, put_face, put_vertex};
use crate::{Order, SynthError, Written};
use boxgrid::BoxGrid;
use detail::Detail;
use glam::Vec3;
use ray::{Ray, SidePoint};
use shape::Shape;
use std::io::Write;
use table::Table;
use texel::Coarse;

/// Fewest triangles of a statue: a box.
pub const MIN_TRIANGLES: u64 = 12;
/// Most triangles of a statue: PLY indices are 31 bits, and there are half as many vertices.
pub const MAX_TRIANGLES: u64 = 4_290_000_000;
/// Cells along x, z and y for one size: a little finer upwards, where the faces are.
const CELL_WEIGHTS: [f64; 3] = [1.0, 1.0, 1.15];
/// Area of the surface, square metres, nearly the same for all seeds; sets the scale of the finest detail.
const AREA_M2: f32 = 11.0;

/// Which statue, and how fine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatueOptions {
    /// Wanted number of triangles, [`MIN_TRIANGLES`] to [`MAX_TRIANGLES`]; met within 1 % from 1,000 on.
    pub triangles: u64,
    /// Which statue: proportions, hair, drapery, cracks, veins.
    pub seed: u64,
    /// Whether vertices carry a colour (8-bit sRGB).
    pub colors: bool,
    /// Order of vertices and of triangles.
    pub order: Order,
}

impl Default for StatueOptions {
    fn default() -> Self {
        Self { triangles: 2_000_000, seed: 1, colors: true, order: Order::Coherent }
    }
}

/// Writes a statue as binary little-endian PLY: `float x y z` in metres, `uchar red green blue` where asked for, faces
/// `list uchar int`. About 2.7 m high, base at y = 0, around x = z = 0, y up, facing +z.
///
/// `progress` is told the bytes done and the bytes in all, at least once per mebibyte or so.
///
/// # Errors
/// [`SynthError::TriangleCount`] for a number outside the limits; [`SynthError::Io`] when `out` refuses bytes.
pub fn write_statue(
    options: StatueOptions,
    out: &mut dyn Write,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Written, SynthError> {
    if !(MIN_TRIANGLES..=MAX_TRIANGLES).contains(&options.triangles) {
        return Err(SynthError::TriangleCount { asked: options.triangles, least: MIN_TRIANGLES, most: MAX_TRIANGLES });
    }
    let grid = BoxGrid::nearest(options.triangles, CELL_WEIGHTS);
    let statue = Statue::new(&options, grid);
    let kind = if options.colors { VertexKind::PositionColor } else { VertexKind::Position };
    let comment = format!("gigalod synth statue, seed {}", options.seed);
    let mut ply = PlyWriter::start(out, progress, &comment, kind, grid.vertices(), grid.triangles())?;
    let orders = match options.order {
        Order::Coherent => None,
        Order::Shuffled => Some((
            Permutation::new(grid.vertices(), options.seed ^ 0x5eed_0001),
            Permutation::new(grid.triangles(), options.seed ^ 0x5eed_0002),
        )),
    };
    ply.vertices(|first, records| {
        for (block, records) in records.chunks_mut(kind.bytes() * BLOCK).enumerate() {
            let first = first + (block * BLOCK) as u64;
            statue.put_vertices(records, kind.bytes(), |at| {
                let place = first + at as u64;
                orders.map_or(place, |(vertices, _)| vertices.invert(place))
            });
        }
    })?;
    ply.faces(|first, records| {
        for (place, record) in (first..).zip(records.chunks_exact_mut(FACE_BYTES)) {
            let corners = match orders {
                None => grid.triangle(place),
                Some((vertices, triangles)) => {
                    grid.triangle(triangles.invert(place)).map(|corner| vertices.apply(u64::from(corner)) as u32)
                }
            };
            put_face(record, corners);
        }
    })?;
    ply.finish()
}

/// Everything needed to compute any vertex alone.
struct Statue {
    shape: Shape,
    grid: BoxGrid,
    table: Table,
    detail: Detail,
    colors: bool,
}

impl Statue {
    fn new(options: &StatueOptions, grid: BoxGrid) -> Self {
        let shape = Shape::new(options.seed);
        let most_cells = grid.cells().into_iter().max().unwrap_or(1) as usize;
        // A small statue needs no finer table than itself; steps of powers of two keep neighbours alike.
        let table = Table::new(&shape, most_cells.next_power_of_two().clamp(32, table::MAX_CELLS));
        let spacing_m = (AREA_M2 / grid.vertices() as f32).sqrt();
        Self { shape, grid, table, detail: Detail::new(shape.seed, spacing_m), colors: options.colors }
    }

    /// Fills up to [`BLOCK`] records of `record_bytes`; `vertex(at)` is the number of the one at place `at`.
    fn put_vertices(&self, records: &mut [u8], record_bytes: usize, vertex: impl Fn(usize) -> u64) {
        let count = records.len() / record_bytes;
        let mut rays = [Ray::of(Vec3::Y); BLOCK];
        let (mut coarse, mut points) = ([Coarse::default(); BLOCK], [Vec3::ZERO; BLOCK]);
        for at in 0..count {
            let point = SidePoint::of_place(self.grid.place(vertex(at)), self.grid.cells());
            rays[at] = Ray::of(point.direction());
            coarse[at] = self.table.at(point);
            points[at] = rays[at].at(coarse[at].radius);
        }
        let mut heights = [(0.0, 0.0); BLOCK];
        self.detail.heights(&points[..count], &coarse[..count], &mut heights);
        for (at, (height, _)) in heights.iter().enumerate().take(count) {
            // The underside stays flat: the statue stands on it.
            let height = height * smoothstep(0.0, 0.03, points[at].y);
            points[at] = rays[at].at((coarse[at].radius + height).min(rays[at].length_above_ground()));
        }
        let mut colors = [[0; 3]; BLOCK];
        if self.colors {
            let mut speckles = [0.0; BLOCK];
            paint::speckles(self.shape.seed, &points, &mut speckles);
            for at in 0..count {
                let (crack, speckle) = (heights[at].1, speckles[at]);
                colors[at] = paint::color(&coarse[at], rays[at].direction.y, crack, speckle);
            }
        }
        for (at, record) in records.chunks_exact_mut(record_bytes).enumerate() {
            put_vertex(record, self.shape.pose(points[at]).to_array(), colors[at]);
        }
    }
}
