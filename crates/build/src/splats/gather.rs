//! What vertices gather from the triangles around them, in one look at all triangles; and what that says of the mesh as a whole.
//!
//! In: a mesh, and what of it is diced, if that is known. Out: a [`Gathered`] for each vertex and a normal for each triangle, whether all
//! is closed, and how large triangles are. Sums are integers, or go in order of strides: neither order nor threads show.

use super::dice::{Dicing, Sizes};
use super::facets::{self, Facet};
use super::join::Corners;
use super::mesh::{Corner, Mesh, Positions};
use super::orientation::Orientation;
use super::plan::MemoryPlan;
use crate::progress::Phases;
use crate::spool::Spool;
use bytemuck::{Pod, Zeroable};
use gigalod_geom::Aabb;
use rayon::prelude::*;
use std::io;

/// What a vertex gathers from its triangles.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct Gathered {
    /// [`UNREFERENCED`] until a triangle that is not diced has come.
    pub(crate) radius: f32,
    /// In steps of 2⁻¹⁶: integers, so that the order of the triangles does not matter.
    pub(crate) normal: [i32; 3],
}

/// Radius of what no triangle has come to yet.
const UNREFERENCED: f32 = -1.0;

/// A triangle's normal in steps of 1/32767; zero where it has no area.
pub(crate) type FaceNormal = [i16; 3];

/// Rounded to the nearest: without `round`, which is a call where the processor is not known to have it.
fn steps_of(value: f32) -> i16 {
    ((value * 32_767.0 + 32_768.5) as i32 - 32_768) as i16
}

/// Triangles that add up their volumes one after the other; batches hold whole strides, so that the sum does not depend on them.
pub(crate) const STRIDE: usize = 4096;

/// A batch of triangles, measured; nothing of it is gathered yet.
#[derive(Default)]
struct Measured {
    corners: Corners,
    strides: Vec<Stride>,
}

struct Stride {
    facets: Vec<Facet>,
    faces: Vec<FaceNormal>,
    orientation: Orientation,
    sizes: Option<Sizes>,
}

impl Measured {
    /// `anchor` is the first corner of all. Sizes are counted until it is known what is `diced`.
    fn of<C: Corner>(
        triangles: &[[u32; 3]],
        positions: &Spool<C>,
        diced: Option<Dicing>,
        anchor: &mut Option<C>,
    ) -> io::Result<Self> {
        let (mut corners, mut fetched) = (Corners::of(triangles), Vec::new());
        corners.fetch(positions, &mut fetched)?;
        let corner_positions: &[[C; 3]] = fetched.as_chunks().0;
        let anchor = *anchor.get_or_insert(fetched[0]);
        let strides = triangles
            .par_chunks(STRIDE)
            .zip(corner_positions.par_chunks(STRIDE))
            .map(|(triangles, corners)| {
                let (mut facets, mut orientation) = (Vec::new(), Orientation::default());
                facets::measure(corners, anchor, &mut facets);
                for (triangle, facet) in triangles.iter().zip(&facets) {
                    orientation.add(*triangle, facet.six_volumes);
                }
                let sizes = diced.is_none().then(|| {
                    let mut sizes = Sizes::default();
                    facets.iter().for_each(|facet| sizes.add(facet.radius, facet.area_share));
                    sizes
                });
                for facet in facets.iter_mut().filter(|facet| diced.is_some_and(|it| it.is_diced(facet.radius))) {
                    *facet = Facet { radius: UNREFERENCED, ..Facet::default() };
                }
                let faces = facets.iter().map(|facet| facet.normal.to_array().map(steps_of)).collect();
                Stride { facets, faces, orientation, sizes }
            })
            .collect();
        Ok(Self { corners, strides })
    }

    fn gather(mut self, gathered: &mut Spool<Gathered>) -> io::Result<()> {
        let strides = self.strides;
        self.corners.fold(gathered, |vertex, corner| {
            let facet = &strides[corner / (3 * STRIDE)].facets[corner / 3 % STRIDE];
            vertex.radius = vertex.radius.max(facet.radius);
            let normal = (facet.normal * (facet.angles[corner % 3] * 65_536.0)).to_array();
            for (sum, value) in vertex.normal.iter_mut().zip(normal) {
                *sum = sum.wrapping_add(value as i32);
            }
        })
    }
}

/// What a look at all triangles gives.
pub(crate) struct Gathering {
    pub(crate) gathered: Spool<Gathered>,
    pub(crate) faces: Spool<FaceNormal>,
    pub(crate) orientation: Orientation,
    /// Of all triangles, until it is known what is diced.
    pub(crate) sizes: Sizes,
}

pub(crate) fn gather(
    mesh: &Mesh,
    diced: Option<Dicing>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Gathering> {
    match &mesh.positions {
        Positions::Narrow(positions) => gather_from(&mesh.triangles, positions, diced, plan, phases),
        Positions::Wide(positions) => gather_from(&mesh.triangles, positions, diced, plan, phases),
    }
}

/// First look at all triangles: each vertex' radius and normal, each triangle's normal, whether all is closed, and sizes. Where it is
/// known what is diced, the same but for that, and without sizes.
fn gather_from<C: Corner>(
    triangles: &Spool<[u32; 3]>,
    positions: &Spool<C>,
    diced: Option<Dicing>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Gathering> {
    let mut gathered = Spool::new(&plan.place())?;
    fill(&mut gathered, positions.len(), Gathered { radius: UNREFERENCED, normal: [0; 3] })?;
    let mut sizes = Sizes::default();
    let mut faces = Spool::new(&plan.place())?;
    faces.expect(triangles.len());
    let mut orientation = Orientation::default();
    let mut anchor = None;
    // While a batch is measured, the one before it is gathered.
    let mut measured = Measured::default();
    for_each_batch(triangles, plan, |start, triangles| {
        let before = std::mem::take(&mut measured);
        let (gathering, measuring) =
            rayon::join(|| before.gather(&mut gathered), || Measured::of(triangles, positions, diced, &mut anchor));
        gathering?;
        measured = measuring?;
        for Stride { faces: normals, orientation: stride, sizes: counted, .. } in &measured.strides {
            faces.push(normals)?;
            orientation.merge(stride);
            counted.iter().for_each(|counted| sizes.merge(counted));
        }
        phases.at(start);
        Ok(())
    })?;
    measured.gather(&mut gathered)?;
    Ok(Gathering { gathered, faces, orientation, sizes })
}

/// What vertices have gathered, as a whole.
pub(crate) struct Survey {
    /// Of all that are referenced.
    pub(crate) bounds: Aabb,
    /// Share of them that lie inside a smooth surface: triangles all around, in about one direction.
    pub(crate) smooth_share: f64,
}

/// Sum of the normals of triangles around a vertex, weighted by their angles in radians, from which on it is inside a smooth surface:
/// of a flat one, the sum is a full turn; at the corner of a house, less than half of one.
const SMOOTH: f32 = 0.75 * std::f32::consts::TAU * 65_536.0;

pub(crate) fn survey(mesh: &Mesh, gathered: &Spool<Gathered>) -> io::Result<Survey> {
    let mut bounds = Aabb::EMPTY;
    let (mut smooth, mut all) = (0u64, 0u64);
    let mut at = Vec::new();
    gathered.for_each_piece(MemoryPlan::PIECE, |start, gathered| {
        mesh.positions.read_vec(start, gathered.len(), &mut at)?;
        for (position, gathered) in at.iter().zip(gathered).filter(|(_, gathered)| gathered.radius >= 0.0) {
            bounds = bounds.including(*position);
            let [x, y, z] = gathered.normal.map(|sum| sum as f32);
            smooth += u64::from(x * x + y * y + z * z >= SMOOTH * SMOOTH);
            all += 1;
        }
        Ok(())
    })?;
    Ok(Survey { bounds, smooth_share: smooth as f64 / all.max(1) as f64 })
}

/// All triangles, as many at a time as the plan allows, in whole strides.
pub(crate) fn for_each_batch(
    triangles: &Spool<[u32; 3]>,
    plan: &MemoryPlan<'_>,
    mut visit: impl FnMut(u64, &[[u32; 3]]) -> io::Result<()>,
) -> io::Result<()> {
    // In memory more than this at a time gains nothing and leaves the cache.
    let at_once = plan.triangles_at_once().min(if plan.is_in_memory() { 1 << 15 } else { usize::MAX });
    let at_once = (at_once / STRIDE).max(1) * STRIDE;
    triangles.for_each_piece(at_once, |start, piece| visit(start, piece))
}

fn fill<T: bytemuck::Pod>(spool: &mut Spool<T>, count: u64, record: T) -> io::Result<()> {
    spool.expect(count);
    let piece: Vec<T> = std::iter::repeat_n(record, MemoryPlan::PIECE).collect();
    let mut left = count;
    while left > 0 {
        let now = left.min(piece.len() as u64);
        spool.push(&piece[..now as usize])?;
        left -= now;
    }
    Ok(())
}
