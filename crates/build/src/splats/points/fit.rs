//! Cell by cell: each point's radius and normal, and which points are on one side.
//!
//! [`Cells`] go in; [`Fits`] come out, cell by cell, so that work can go on after any of them.

use super::super::plan::MemoryPlan;
use super::cells::{Cells, RawPoint};
use super::nearest::{Key, number_of, square_of};
use super::neighbours::{CellBoxes, Lists, Pool};
use super::patches::{Patches, SIDES_OF};
use super::{plane, spacing};
use crate::progress::Phases;
use crate::spool::Spool;
use bytemuck::{Pod, Zeroable};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::quantise::normal;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::cell::RefCell;
use std::io;

/// A point with its size and direction.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in super::super) struct FittedPoint {
    pub(super) center: [f32; 3],
    /// In units of sites.
    pub(super) radius: f32,
    pub(super) color: [u8; 3],
    /// [`FIRST`], [`OWN_NORMAL`], [`AWAY_FROM_SKY`].
    pub(super) flags: u8,
    /// Code of [`normal`]; of those that are not the file's own, all of a patch are on one side.
    pub(super) normal: u16,
    pub(super) spread: u16,
}

/// The first point of its site.
pub(super) const FIRST: u8 = 1;
/// The normal is the file's: its side is right.
pub(super) const OWN_NORMAL: u8 = 2;
/// Where normals are to be on the side of the sky, this one is to be turned.
pub(super) const AWAY_FROM_SKY: u8 = 4;

/// What others have to know of a site.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in super::super) struct Aspect {
    pub(super) normal: u16,
    /// Number of its patch in its cell.
    pub(super) patch: u16,
}

/// What adds up over the sites of a patch; each counts by its area, the square of its radius.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in super::super) struct PatchSums {
    /// Of places times normals: three times the volume inside, seen from the origin.
    pub(super) flux: f64,
    pub(super) normal: [f64; 3],
    pub(super) place: [f64; 3],
    pub(super) area: f64,
    /// Of how far normals are along the axis of the sky, up or down.
    pub(super) along_up: f64,
}

/// Cells that are fitted, from the first on.
pub(in super::super) struct Fits {
    pub(in super::super) points: Spool<FittedPoint>,
    /// For each site; empty where the file has normals, and so is what follows.
    pub(in super::super) aspects: Spool<Aspect>,
    /// Sites that are neighbours and in two cells.
    pub(in super::super) crossing: Spool<[u32; 2]>,
    /// Cell by cell.
    pub(in super::super) patches: Vec<PatchSums>,
    /// For each cell that is fitted, the number of its first patch.
    pub(in super::super) first_patches: Vec<u32>,
}

impl Fits {
    pub(in super::super) fn new(plan: &MemoryPlan<'_>) -> io::Result<Self> {
        Ok(Self {
            points: Spool::named(&plan.place(), "fitted")?,
            aspects: Spool::named(&plan.place(), "aspects")?,
            crossing: Spool::named(&plan.place(), "crossing")?,
            patches: vec![],
            first_patches: vec![],
        })
    }

    /// Cells that are fitted.
    pub(in super::super) fn done(&self) -> usize {
        self.first_patches.len()
    }
}

/// Cells that are fitted side by side.
const CELLS_AT_ONCE: usize = 8;

/// All points that are fitted between two places to go on from: a quarter of the cloud.
const SAVE_EVERY: u64 = 4;

/// Fits all cells that are not fitted yet. `save` is told now and then how far that has come, and at the end.
pub(in super::super) fn fit(
    cells: &Cells,
    mut fits: Fits,
    up: UpAxis,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
    mut save: impl FnMut(&Fits) -> io::Result<()>,
) -> io::Result<Fits> {
    let total = cells.points.len();
    phases.begin("radii and normals", total);
    if plan.is_in_memory() {
        fits.points.expect(total);
        fits.aspects.expect(if cells.has_normals { 0 } else { cells.sites.len() });
    }
    let boxes = CellBoxes::of(&cells.cells);
    let mut start: u64 = cells.cells[..fits.done()].iter().map(|cell| u64::from(cell.points)).sum();
    let mut unsaved = 0;
    let up = axis(up);
    while fits.done() < cells.cells.len() {
        let batch = fits.done()..(fits.done() + CELLS_AT_ONCE).min(cells.cells.len());
        let starts: Vec<(usize, u64)> = batch
            .map(|cell| {
                let own = start;
                start += u64::from(cells.cells[cell].points);
                (cell, own)
            })
            .collect();
        let fitted = starts
            .par_iter()
            .map(|(cell, start)| WORK.with_borrow_mut(|work| work.cell(cells, &boxes, *cell, *start, up)))
            .collect::<io::Result<Vec<_>>>()?;
        for cell in fitted {
            fits.first_patches.push(fits.patches.len() as u32);
            fits.patches.extend(cell.patches);
            fits.points.push(&cell.points)?;
            fits.aspects.push(&cell.aspects)?;
            fits.crossing.push(&cell.crossing)?;
            unsaved += cell.points.len() as u64;
        }
        phases.at(start);
        if unsaved >= total / SAVE_EVERY || fits.done() == cells.cells.len() {
            save(&fits)?;
            unsaved = 0;
        }
    }
    // Later steps need the room.
    rayon::broadcast(|_| drop(WORK.take()));
    Ok(fits)
}

/// Towards the sky.
pub(super) fn axis(up: UpAxis) -> Vec3 {
    match up {
        UpAxis::Y => Vec3::Y,
        UpAxis::Z => Vec3::Z,
    }
}

#[derive(Default)]
struct CellFits {
    points: Vec<FittedPoint>,
    aspects: Vec<Aspect>,
    crossing: Vec<[u32; 2]>,
    patches: Vec<PatchSums>,
}

/// Neighbours that a plane is fitted to, and that show the cell of most points.
const NEIGHBOURS: usize = 16;
/// For points whose cell these do not show: at borders, and on scan lines.
const MORE_NEIGHBOURS: usize = 64;
/// Points that are asked for more neighbours at a time.
const MORE_AT_ONCE: usize = 2048;

#[derive(Default)]
struct Work {
    pool: Pool,
    lists: Lists,
    more: Lists,
    raw: Vec<RawPoint>,
    asked: Vec<u32>,
    differences: Vec<Vec3>,
    squares: Vec<f32>,
    normals: Vec<Vec3>,
    radii: Vec<f32>,
    /// Of each site, neighbours in the cell, and how many.
    near: Vec<([u32; SIDES_OF], u8)>,
    open: Vec<u32>,
    patches: Patches,
}

thread_local! {
    /// Megabytes that the system would clear for each cell anew.
    static WORK: RefCell<Work> = RefCell::default();
}

impl Work {
    /// Fits a cell whose points begin at `start`.
    fn cell(&mut self, cells: &Cells, boxes: &CellBoxes, cell: usize, start: u64, up: Vec3) -> io::Result<CellFits> {
        cells.points.read_vec(start, cells.cells[cell].points as usize, &mut self.raw)?;
        self.pool.read(cells, cell)?;
        self.asked.clear();
        self.asked.extend(self.pool.tree.sites());
        self.pool.neighbours(cells, boxes, cell, &self.asked, NEIGHBOURS, &mut self.lists)?;
        let count = self.asked.len();
        self.normals.clear();
        self.normals.resize(count, Vec3::ZERO);
        self.radii.clear();
        self.radii.resize(count, 0.0);
        self.near.clear();
        self.near.resize(count, ([0; SIDES_OF], 0));
        self.open.clear();
        let mut out = CellFits::default();
        for (list, site) in self.asked.iter().enumerate() {
            let keys = self.lists.list(list);
            differences(&self.pool, *site, keys, &mut self.differences, &mut self.squares);
            let normal = plane::normal(&self.differences, &self.squares);
            let size = spacing::size(&self.differences, &self.squares, normal, keys.len() < NEIGHBOURS);
            if size.is_open {
                self.open.push(*site);
            }
            let site = *site as usize;
            (self.normals[site], self.radii[site]) = (normal, size.radius);
            let (near, near_count) = &mut self.near[site];
            for key in keys.iter().take(SIDES_OF) {
                let other = number_of(*key);
                if (other as usize) < count {
                    near[usize::from(*near_count)] = other;
                    *near_count += 1;
                } else if !cells.has_normals {
                    out.crossing.push([self.pool.number_in_cloud(site as u32), self.pool.number_in_cloud(other)]);
                }
            }
        }
        for open in self.open.chunks(MORE_AT_ONCE) {
            self.pool.neighbours(cells, boxes, cell, open, MORE_NEIGHBOURS, &mut self.more)?;
            for (list, site) in open.iter().enumerate() {
                let keys = self.more.list(list);
                differences(&self.pool, *site, keys, &mut self.differences, &mut self.squares);
                let normal = self.normals[*site as usize];
                self.radii[*site as usize] = spacing::size(&self.differences, &self.squares, normal, true).radius;
            }
        }
        if cells.has_normals {
            self.towards_own();
        } else {
            self.on_one_side(up, &mut out);
        }
        self.points(cells.has_normals, &mut out);
        Ok(out)
    }

    /// Turns normals towards those that the file has for neighbours.
    fn towards_own(&mut self) {
        let mut own = vec![Vec3::ZERO; self.normals.len()];
        for (site, points) in self.raw.chunk_by(|a, b| a.center == b.center).enumerate() {
            own[site] =
                points.iter().filter(|point| point.has_normal == 1).map(|point| normal::decode(point.normal)).sum();
        }
        for (site, normal) in self.normals.iter_mut().enumerate() {
            let (near, count) = &self.near[site];
            let around: Vec3 = near[..usize::from(*count)].iter().map(|other| own[*other as usize]).sum();
            if normal.dot(around + own[site]) < 0.0 {
                *normal = -*normal;
            }
        }
    }

    /// Finds patches and what they add up to.
    fn on_one_side(&mut self, up: Vec3, out: &mut CellFits) {
        let near = &self.near;
        self.patches.find(&mut self.normals, |site| &near[site].0[..usize::from(near[site].1)], up);
        out.patches.resize(self.patches.count, PatchSums::default());
        out.aspects.reserve_exact(self.normals.len());
        for (site, normal) in self.normals.iter().enumerate() {
            let patch = self.patches.patch_of[site];
            out.aspects.push(Aspect { normal: normal::encode(*normal), patch });
            let sums = &mut out.patches[usize::from(patch)];
            let (place, normal) = (Vec3::from_array(self.pool.at[site]).as_dvec3(), normal.as_dvec3());
            let area = f64::from(self.radii[site]) * f64::from(self.radii[site]);
            sums.flux += area * place.dot(normal);
            sums.normal = (DVec3::from_array(sums.normal) + normal * area).to_array();
            sums.place = (DVec3::from_array(sums.place) + place * area).to_array();
            sums.area += area;
            sums.along_up += area * normal.dot(up.as_dvec3()).abs();
        }
    }

    /// All points of the cell, each with what its site has.
    fn points(&self, has_normals: bool, out: &mut CellFits) {
        out.points.reserve_exact(self.raw.len());
        for (site, points) in self.raw.chunk_by(|a, b| a.center == b.center).enumerate() {
            let away = !has_normals && self.patches.away_from_sky[site];
            let code = normal::encode(self.normals[site]);
            for (number, point) in points.iter().enumerate() {
                let is_own = point.has_normal == 1;
                let first = if number == 0 { FIRST } else { 0 };
                let own = if is_own { OWN_NORMAL } else { 0 };
                let away = if away { AWAY_FROM_SKY } else { 0 };
                out.points.push(FittedPoint {
                    center: point.center,
                    radius: self.radii[site],
                    color: point.color,
                    flags: first | own | away,
                    normal: if is_own { point.normal } else { code },
                    spread: point.spread,
                });
            }
        }
    }
}

/// From a site to those of its list.
fn differences(pool: &Pool, site: u32, keys: &[Key], differences: &mut Vec<Vec3>, squares: &mut Vec<f32>) {
    let at = Vec3::from_array(pool.at[site as usize]);
    differences.clear();
    differences.extend(keys.iter().map(|key| Vec3::from_array(pool.at[number_of(*key) as usize]) - at));
    squares.clear();
    squares.extend(keys.iter().map(|key| square_of(*key)));
}
