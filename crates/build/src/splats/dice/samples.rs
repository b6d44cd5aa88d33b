//! Cells become leaves: a ball, a normal, a cone and a colour each.
//!
//! The normal is interpolated between the vertices' own where the file has some, else the triangle's: what is large and flat is meant
//! to be flat. The colour is the product, in linear light, of the vertices', the material's and the texture's mean over the cell.

use super::super::facets;
use super::super::join::Corners;
use super::super::leaves::{Leaf, STEPS, spread_of_cos};
use super::super::mesh::{Corner, Mesh, Positions};
use super::super::paint::{Area, Look, NONE, Paint, Tiles};
use super::super::plan::MemoryPlan;
use super::grid::{Cell, Grid};
use super::sizes::Dicing;
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_geom::color::{LINEAR_OF_SRGB8, srgb8_of_linear};
use gigalod_geom::quantise::normal;
use gigalod_geom::sphere::round_up;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::io;
use std::ops::Range;

/// What is diced, and how.
pub(in super::super) struct Dice<'a> {
    pub(in super::super) mesh: &'a Mesh,
    pub(in super::super) dicing: Dicing,
    /// Of local space; model space.
    pub(in super::super) origin: DVec3,
}

/// What triangles were cut into.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Count {
    pub(in super::super) triangles: u64,
    pub(in super::super) cells: u64,
}

/// Cells that a thread makes at a time.
const SHARE: u32 = 1 << 12;

/// Some cells of a triangle: of several rows all, or of one row some.
struct Item {
    triangle: usize,
    rows: Range<u32>,
    strips: Option<Range<u32>>,
}

/// What some triangles carry, three for each; what there is none of is empty.
#[derive(Default)]
struct Carried {
    positions: Vec<DVec3>,
    normals: Vec<[f32; 3]>,
    colors: Vec<[u8; 3]>,
    tex_coords: Vec<Option<[f32; 2]>>,
    /// One for each triangle.
    looks: Vec<u32>,
}

/// Counts the cells that [`dice`] will make.
pub(in super::super) fn count(dice: &Dice<'_>, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> io::Result<Count> {
    let mut count = Count::default();
    let mut carried = Carried::default();
    dice.for_each_batch(plan, |start, triangles| {
        let mut corners = Corners::of(triangles);
        let is_large = dice.positions(&mut corners, &mut carried)?;
        let cells = |triangle: usize| dice.grid(&carried, triangle).cells();
        let of = |triangle: usize| if is_large[triangle] { cells(triangle) } else { 0 };
        count.cells += (0..triangles.len()).into_par_iter().with_min_len(64).map(of).sum::<u64>();
        count.triangles += is_large.iter().filter(|is_large| **is_large).count() as u64;
        phases.at(start + triangles.len() as u64);
        Ok(())
    })?;
    Ok(count)
}

/// Appends a leaf for each cell, but for those that an alpha mask leaves out. Progress is counted in cells.
pub(in super::super) fn dice(
    dice: &Dice<'_>,
    out: &mut Spool<Leaf>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<()> {
    let mut carried = Carried::default();
    let tiles = dice.mesh.paint.as_ref().map(|paint| Tiles::new(&paint.texels, plan.tile_bytes()));
    let mut done = 0;
    dice.for_each_batch(plan, |start, triangles| {
        let mut corners = Corners::of(triangles);
        let is_large = dice.positions(&mut corners, &mut carried)?;
        if !is_large.contains(&true) {
            return Ok(());
        }
        dice.fetch(start, &mut corners, &mut carried)?;
        let (mut items, mut cells) = (Vec::new(), 0);
        let mut flush = |items: &mut Vec<Item>, cells: &mut u64| -> io::Result<()> {
            let of = |item: &Item| dice.leaves(&carried, item, tiles.as_ref());
            let leaves: Vec<Vec<Leaf>> = items.par_iter().map(of).collect::<io::Result<_>>()?;
            leaves.iter().try_for_each(|leaves| out.push(leaves))?;
            done += *cells;
            phases.at(done);
            items.clear();
            *cells = 0;
            Ok(())
        };
        for triangle in (0..triangles.len()).filter(|triangle| is_large[*triangle]) {
            for (item, count) in shares(triangle, &dice.grid(&carried, triangle)) {
                items.push(item);
                cells += count;
                if cells >= plan.cells_at_once() as u64 {
                    flush(&mut items, &mut cells)?;
                }
            }
        }
        flush(&mut items, &mut cells)
    })
}

/// The cells of a grid in shares of about the same size, and how many each has.
fn shares(triangle: usize, grid: &Grid) -> impl Iterator<Item = (Item, u64)> {
    let mut row = 0;
    let mut next_strip = 0;
    std::iter::from_fn(move || {
        let first = row;
        let mut cells = 0;
        while row < grid.rows() {
            let strips = grid.strips(row);
            if strips > SHARE {
                if cells > 0 {
                    break;
                }
                let part = next_strip..strips.min(next_strip + SHARE);
                (next_strip, row) = if part.end == strips { (0, row + 1) } else { (part.end, row) };
                let count = u64::from(part.end - part.start);
                return Some((Item { triangle, rows: first..first + 1, strips: Some(part) }, count));
            }
            cells += u64::from(strips);
            row += 1;
            if cells >= u64::from(SHARE) {
                break;
            }
        }
        (cells > 0).then_some((Item { triangle, rows: first..row, strips: None }, cells))
    })
}

impl Dice<'_> {
    fn for_each_batch(
        &self,
        plan: &MemoryPlan<'_>,
        mut visit: impl FnMut(u64, &[[u32; 3]]) -> io::Result<()>,
    ) -> io::Result<()> {
        self.mesh.triangles.for_each_piece(plan.diced_at_once(), |start, triangles| visit(start, triangles))
    }

    /// Fetches the positions of corners; says which triangles are large.
    fn positions(&self, corners: &mut Corners, carried: &mut Carried) -> io::Result<Vec<bool>> {
        let radii = match &self.mesh.positions {
            Positions::Narrow(spool) => fetch_positions(spool, corners, &mut carried.positions)?,
            Positions::Wide(spool) => fetch_positions(spool, corners, &mut carried.positions)?,
        };
        carried.positions.par_iter_mut().with_min_len(1 << 12).for_each(|position| *position -= self.origin);
        Ok(radii.into_iter().map(|radius| self.dicing.is_diced(radius)).collect())
    }

    /// Fetches all else that the corners of some triangles carry, of which the first has this number.
    fn fetch(&self, start: u64, corners: &mut Corners, carried: &mut Carried) -> io::Result<()> {
        let Mesh { normals, colors, paint, .. } = self.mesh;
        if normals.len() > 0 {
            corners.fetch(normals, &mut carried.normals)?;
        }
        if colors.len() > 0 {
            corners.fetch(colors, &mut carried.colors)?;
        }
        let Some(Paint { tex_coords, corners: numbers, materials, .. }) = paint else { return Ok(()) };
        let count = carried.positions.len() / 3;
        materials.read_vec(start, count, &mut carried.looks)?;
        let mut named = Vec::new();
        numbers.read_vec(start, count, &mut named)?;
        let named = named.as_flattened();
        carried.tex_coords.clear();
        if tex_coords.len() == 0 {
            carried.tex_coords.resize(named.len(), None);
            return Ok(());
        }
        let mut fetched = Vec::new();
        let known = named.iter().map(|number| if *number == NONE { 0 } else { *number }).collect();
        Corners::of_vertices(known).fetch(tex_coords, &mut fetched)?;
        let coords = named.iter().zip(&fetched).map(|(number, coord)| (*number != NONE).then_some(*coord));
        carried.tex_coords.extend(coords);
        Ok(())
    }

    fn grid(&self, carried: &Carried, triangle: usize) -> Grid {
        Grid::new(carried.corners(triangle), self.dicing.spacing)
    }

    fn leaves(&self, carried: &Carried, item: &Item, tiles: Option<&Tiles<'_>>) -> io::Result<Vec<Leaf>> {
        let grid = self.grid(carried, item.triangle);
        let [a, b, c] = carried.corners(item.triangle);
        let flat = (b - a).cross(c - a).try_normalize().map(|normal| normal.as_vec3());
        let coat = self.coat(carried, item.triangle, &grid);
        let mut leaves = Vec::new();
        for row in item.rows.clone() {
            for strip in item.strips.clone().unwrap_or(0..grid.strips(row)) {
                let cell = grid.cell(row, strip);
                let weights = grid.weights([(cell.min[0] + cell.max[0]) * 0.5, (cell.min[1] + cell.max[1]) * 0.5]);
                let Some(color) = self.color(carried, item.triangle, &grid, &cell, weights, coat.as_ref(), tiles)?
                else {
                    continue;
                };
                let center = cell.center.as_vec3();
                let moved = (center.as_dvec3() - cell.center).length();
                let own = carried.own_normal(item.triangle, weights);
                let direction = [own, flat].into_iter().flatten().next().unwrap_or(Vec3::Y);
                let code = normal::encode(direction);
                // What has no area has no side that could be seen.
                let spread = flat.map_or(u16::MAX, |flat| spread_of_cos(normal::decode(code).dot(flat) - STEPS));
                leaves.push(Leaf {
                    center: center.to_array(),
                    radius: round_up((cell.radius + moved) * (1.0 + 1e-14)),
                    color,
                    unused: 0,
                    normal: code,
                    spread,
                });
            }
        }
        Ok(leaves)
    }

    /// What a triangle is painted with.
    fn coat<'a>(&'a self, carried: &Carried, triangle: usize, grid: &Grid) -> Option<Coat<'a>> {
        let paint = self.mesh.paint.as_ref()?;
        let look = paint.looks.get(*carried.looks.get(triangle)? as usize)?;
        let coords = match carried.tex_coords[3 * triangle..][..3] {
            [Some(a), Some(b), Some(c)] => Some([a, b, c].map(|coord| coord.map(f64::from))),
            _ => None,
        };
        let texture = coords.map(|coords| (coords, grid.gradient(coords)));
        Some(Coat { paint, look, texture })
    }

    /// 8-bit sRGB; none where an alpha mask leaves all of the cell out.
    #[allow(clippy::too_many_arguments, reason = "all of it is what a cell is")]
    fn color(
        &self,
        carried: &Carried,
        triangle: usize,
        grid: &Grid,
        cell: &Cell,
        weights: [f64; 3],
        coat: Option<&Coat<'_>>,
        tiles: Option<&Tiles<'_>>,
    ) -> io::Result<Option<[u8; 3]>> {
        let mut linear = match carried.colors.get(3 * triangle..3 * triangle + 3) {
            Some(colors) => colors.iter().zip(weights).map(|(color, weight)| linear_of(*color) * weight as f32).sum(),
            None if self.mesh.paint.is_some() => Vec3::ONE,
            None => return Ok(Some([0; 3])),
        };
        if let Some(coat) = coat {
            linear *= linear_of(coat.look.color);
            if let (Some((coords, along)), Some(tiles)) = (&coat.texture, tiles) {
                let sizes: [f64; 2] = std::array::from_fn(|axis| cell.max[axis] - cell.min[axis]);
                let corner_weights = grid.weights(cell.min);
                let area = Area {
                    corner: std::array::from_fn(|axis| (0..3).map(|k| coords[k][axis] * corner_weights[k]).sum()),
                    sides: [along[0].map(|grows| grows * sizes[0]), along[1].map(|grows| grows * sizes[1])],
                };
                // Beyond the triangle's edges, an atlas shows something else. What a mask shows of it may as well be there.
                let is_within = |by: [f64; 2]| {
                    if coat.look.cutoff.is_some() {
                        return true;
                    }
                    let at = std::array::from_fn(|axis| cell.min[axis] + sizes[axis] * by[axis]);
                    grid.weights(at).iter().all(|weight| *weight >= 0.0)
                };
                let shown = coat.paint.shown(tiles, coat.look, &area, is_within)?;
                if coat.look.cutoff.is_some_and(|cutoff| shown.alpha < f32::from(cutoff) * 0.5) {
                    return Ok(None);
                }
                linear *= shown.color;
            }
        }
        Ok(Some(linear.to_array().map(srgb8_of_linear)))
    }
}

/// Texture coordinates of a triangle's corners, and how they grow along the axes of its grid.
type Coords = ([[f64; 2]; 3], [[f64; 2]; 2]);

/// What a triangle is painted with.
struct Coat<'a> {
    paint: &'a Paint,
    look: &'a Look,
    texture: Option<Coords>,
}

impl Carried {
    /// Local space.
    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        [0, 1, 2].map(|corner| self.positions[3 * triangle + corner])
    }

    /// Unit length.
    fn own_normal(&self, triangle: usize, weights: [f64; 3]) -> Option<Vec3> {
        let normals = self.normals.get(3 * triangle..3 * triangle + 3)?;
        let unit = |normal: &[f32; 3]| Vec3::from_array(*normal).normalize_or_zero();
        let sum: Vec3 = normals.iter().zip(weights).map(|(normal, weight)| unit(normal) * weight as f32).sum();
        sum.try_normalize()
    }
}

fn linear_of(color: [u8; 3]) -> Vec3 {
    Vec3::from_array(color.map(|value| LINEAR_OF_SRGB8[usize::from(value)]))
}

/// The positions of corners, and the bounding radius of each triangle as its vertices are told it.
fn fetch_positions<C: Corner>(
    spool: &Spool<C>,
    corners: &mut Corners,
    positions: &mut Vec<DVec3>,
) -> io::Result<Vec<f32>> {
    let mut fetched = Vec::new();
    corners.fetch(spool, &mut fetched)?;
    fetched.par_iter().with_min_len(1 << 12).map(C::exact).collect_into_vec(positions);
    let triangles: &[[C; 3]] = fetched.as_chunks().0;
    let mut radii = Vec::with_capacity(triangles.len());
    let mut measured = Vec::new();
    for some in triangles.chunks(1 << 10) {
        facets::measure(some, some[0][0], &mut measured);
        radii.extend(measured.iter().map(|facet| facet.radius));
    }
    Ok(radii)
}
