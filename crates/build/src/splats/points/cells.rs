//! Points in cells: boxes of a bounded number of points, in the order of the tree that splits them.
//!
//! A cloud as it was read goes in; [`Cells`] come out. Sets of points are split at the midpoint of the longest axis, on disk as
//! long as they do not fit into memory, exactly as leaves are later.
//!
//! What always holds: within a cell, points are in order of place, then of all else they have; so cells do not depend on the
//! order of the input.

use super::super::checkpoint::Facts;
use super::super::leaves::spread_of_cos;
use super::super::mesh::Mesh;
use super::super::plan::MemoryPlan;
use super::super::tree::{self, Extent};
use crate::BuildError;
use crate::progress::Phases;
use crate::spool::Spool;
use bytemuck::{Pod, Zeroable};
use gigalod_format::InputCounts;
use gigalod_geom::Aabb;
use gigalod_geom::quantise::normal;
use glam::Vec3;
use rayon::prelude::*;
use std::io;

/// Points of a cell at most, unless they are all in one place: 5 MB of work while it is fitted.
pub(super) const MOST_POINTS: usize = 1 << 14;

/// A point as it was read.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in super::super) struct RawPoint {
    /// Local space.
    pub(super) center: [f32; 3],
    /// 8-bit sRGB.
    pub(super) color: [u8; 3],
    /// 1 where the file has a normal for it.
    pub(super) has_normal: u8,
    /// Code of [`normal`].
    pub(super) normal: u16,
    /// Of the normal before it became a code, as in a leaf.
    pub(super) spread: u16,
}

/// A place where points are: local space, times [`Cells::scale`].
pub(in super::super) type Site = [f32; 3];

/// A box of points.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in super::super) struct Cell {
    pub(super) points: u32,
    pub(super) sites: u32,
    pub(super) first_site: u32,
    /// Around its sites.
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
}

/// A cloud in cells.
pub(in super::super) struct Cells {
    /// Cell by cell.
    pub(in super::super) points: Spool<RawPoint>,
    /// Cell by cell.
    pub(in super::super) sites: Spool<Site>,
    pub(in super::super) cells: Vec<Cell>,
    /// A power of two that brings local space into ±1, where squares of distances neither vanish nor overflow.
    pub(in super::super) scale: f32,
    /// The file has normals.
    pub(in super::super) has_normals: bool,
}

/// Divides a mesh without triangles.
pub(in super::super) fn divide(
    cloud: Mesh,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> Result<(Facts, Cells), BuildError> {
    let count = cloud.positions.len();
    phases.begin("cells", 2 * count);
    let mut bounds = Aabb::EMPTY;
    let mut at = Vec::new();
    let mut start = 0;
    while start < count {
        let now = (count - start).min(MemoryPlan::PIECE as u64) as usize;
        cloud.positions.read_vec(start, now, &mut at).map_err(BuildError::Scratch)?;
        bounds = at.iter().fold(bounds, |bounds, position| bounds.including(*position));
        start += now as u64;
    }
    let extent = bounds.extent().max_element();
    if extent.is_nan() || extent > 1e30 {
        return Err(BuildError::TooWide { extent });
    }
    let facts = Facts {
        counts: InputCounts { triangles: 0, vertices: 0, points: count },
        origin: bounds.center(),
        bounds,
        closed: false,
        has_colors: cloud.colors.len() > 0,
        dicing: None,
    };
    let scale = scale_of(extent);
    let has_normals = cloud.normals.len() > 0;
    let (points, extent) = points_of(cloud, &facts, plan, phases).map_err(BuildError::Scratch)?;
    let mut divider = Divider {
        out: Cells {
            points: Spool::named(&plan.place(), "points").map_err(BuildError::Scratch)?,
            sites: Spool::named(&plan.place(), "sites").map_err(BuildError::Scratch)?,
            cells: Vec::new(),
            scale,
            has_normals,
        },
        done: count,
        plan,
        phases,
    };
    divider.out.sites.expect(count);
    divider.all(points, extent)?;
    Ok((facts, divider.out))
}

/// A power of two that brings half an extent to between ½ and 1; as far as `f32` has it.
fn scale_of(extent: f64) -> f32 {
    let exponent = (extent.to_bits() >> 52) as i32 - 1023;
    f32::from_bits(((127 - exponent.clamp(-110, 110)) as u32) << 23)
}

/// All points, in the order of the input.
fn points_of(
    cloud: Mesh,
    facts: &Facts,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<(Spool<RawPoint>, Extent)> {
    let Mesh { positions, normals, colors, .. } = cloud;
    let mut out = Spool::new(&plan.place())?;
    out.expect(positions.len());
    let (mut at, mut normal, mut color) = (Vec::new(), Vec::new(), Vec::new());
    let (mut start, mut extent) = (0, Extent::EMPTY);
    while start < positions.len() {
        let now = (positions.len() - start).min(MemoryPlan::PIECE as u64) as usize;
        positions.read_vec(start, now, &mut at)?;
        if normals.len() > 0 {
            normals.read_vec(start, now, &mut normal)?;
        }
        if colors.len() > 0 {
            colors.read_vec(start, now, &mut color)?;
        }
        let point = |index: usize| {
            // Adding zero makes of −0 what is in the same place.
            let center = ((at[index] - facts.origin).as_vec3() + Vec3::ZERO).to_array();
            let own = normal.get(index).map_or(Vec3::ZERO, |own| Vec3::from_array(*own).normalize_or_zero());
            let code = normal::encode(own);
            let has_normal = own != Vec3::ZERO;
            RawPoint {
                center,
                color: color.get(index).copied().unwrap_or_default(),
                has_normal: u8::from(has_normal),
                normal: if has_normal { code } else { 0 },
                spread: if has_normal { spread_of_cos(normal::decode(code).dot(own) - 1e-6) } else { u16::MAX },
            }
        };
        let piece: Vec<RawPoint> = (0..now).into_par_iter().with_min_len(1 << 12).map(point).collect();
        extent = piece.iter().fold(extent, |extent, point| extent.including(point.center));
        out.push(&piece)?;
        start += now as u64;
        phases.at(start);
    }
    Ok((out, extent))
}

struct Divider<'a> {
    out: Cells,
    done: u64,
    plan: &'a MemoryPlan<'a>,
    phases: &'a Phases<'a>,
}

struct Half {
    points: Spool<RawPoint>,
    extent: Extent,
    waiting: Vec<RawPoint>,
}

/// Cells that are put away at a time.
const CELLS_AT_ONCE: usize = 64;

impl Divider<'_> {
    /// Splits sets on disk, the first first, until they fit into memory.
    fn all(&mut self, points: Spool<RawPoint>, extent: Extent) -> Result<(), BuildError> {
        let at_once = self.plan.leaves_at_once() as u64;
        let mut pending = vec![(points, extent)];
        while let Some((set, extent)) = pending.pop() {
            let set = match set {
                Spool::Memory(mut all) => {
                    self.block(&mut all, false).map_err(BuildError::Scratch)?;
                    self.out.points = Spool::Memory(all);
                    return Ok(());
                }
                file => file,
            };
            if set.len() <= at_once {
                let mut all = Vec::new();
                set.read_vec(0, set.len() as usize, &mut all).map_err(BuildError::Scratch)?;
                drop(set);
                self.block(&mut all, true).map_err(BuildError::Scratch)?;
                continue;
            }
            let Some(plane) = extent.plane() else {
                return Err(BuildError::Crowd { vertices: set.len(), most: at_once });
            };
            let half = || -> io::Result<Half> {
                Ok(Half { points: Spool::new(&self.plan.place())?, extent: Extent::EMPTY, waiting: vec![] })
            };
            let mut halves = [half().map_err(BuildError::Scratch)?, half().map_err(BuildError::Scratch)?];
            let sort = |_: u64, piece: &[RawPoint]| {
                for point in piece {
                    let half = &mut halves[usize::from(!plane.is_left(point.center))];
                    half.extent = half.extent.including(point.center);
                    half.waiting.push(*point);
                }
                halves.iter_mut().try_for_each(|half| {
                    half.points.push(&half.waiting)?;
                    half.waiting.clear();
                    Ok(())
                })
            };
            set.for_each_piece(MemoryPlan::PIECE, sort).map_err(BuildError::Scratch)?;
            let [left, right] = halves.map(|half| (half.points, half.extent));
            pending.extend([right, left]);
        }
        Ok(())
    }

    /// A set in memory, which is put into the order of cells where it lies.
    fn block(&mut self, points: &mut [RawPoint], keeps_points: bool) -> io::Result<()> {
        let mut cells = Vec::new();
        split(points, &mut cells);
        let scale = self.out.scale;
        for cells in cells.chunks_mut(CELLS_AT_ONCE) {
            let finish = |points: &mut &mut [RawPoint]| {
                points.sort_unstable_by_key(order);
                let mut sites: Vec<Site> = Vec::with_capacity(points.len());
                let places = points.chunk_by(|a, b| a.center == b.center);
                sites.extend(places.map(|points| (Vec3::from_array(points[0].center) * scale).to_array()));
                sites
            };
            let sites: Vec<Vec<Site>> = cells.par_iter_mut().map(finish).collect();
            for (points, sites) in cells.iter().zip(sites) {
                let corner = |start: f32, f: fn(Vec3, Vec3) -> Vec3| {
                    sites.iter().fold(Vec3::splat(start), |corner, site| f(corner, Vec3::from_array(*site))).to_array()
                };
                self.out.cells.push(Cell {
                    points: points.len() as u32,
                    sites: sites.len() as u32,
                    first_site: self.out.sites.len() as u32,
                    min: corner(f32::INFINITY, Vec3::min),
                    max: corner(f32::NEG_INFINITY, Vec3::max),
                });
                self.out.sites.push(&sites)?;
                if keeps_points {
                    self.out.points.push(points)?;
                }
                self.done += points.len() as u64;
            }
            self.phases.at(self.done);
        }
        Ok(())
    }
}

/// Splits points into cells, in order.
fn split<'a>(points: &'a mut [RawPoint], out: &mut Vec<&'a mut [RawPoint]>) {
    if points.len() > MOST_POINTS {
        let extent = points.iter().fold(Extent::EMPTY, |extent, point| extent.including(point.center));
        if let Some(plane) = extent.plane() {
            let middle = tree::partition(points, |point| plane.is_left(point.center));
            let (left, right) = points.split_at_mut(middle);
            split(left, out);
            return split(right, out);
        }
    }
    if !points.is_empty() {
        out.push(points);
    }
}

/// Points by place, then by all else.
fn order(point: &RawPoint) -> ([i32; 3], u8, u16, u16, [u8; 3]) {
    // As integers, positive numbers are in order and negative ones in the opposite: an order all the same.
    let place = point.center.map(|value| value.to_bits() as i32);
    (place, point.has_normal, point.normal, point.spread, point.color)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_is_a_power_of_two_that_fits() {
        for extent in [1.0, 3.0, 1e-20, 1e30, 0.75] {
            let scale = scale_of(extent);
            let scaled = extent * f64::from(scale);
            assert!((1.0..2.0).contains(&scaled), "{extent} {scaled}");
            assert_eq!(scale.to_bits() << 9, 0);
        }
        assert!(scale_of(0.0).is_finite() && scale_of(1e-300).is_finite());
    }
}
