//! From a mesh to leaves: for each referenced vertex a sphere, a normal, a cone and a colour.
//!
//! The sphere is centred on the vertex and as large as the largest bounding sphere of the triangles around it, so the spheres
//! at a triangle's corners cover it (splats paper, section 2.2). The normal is the mesh's own, or else the mean of the
//! triangles' normals weighted by their angles at the vertex (Thürmer & Wüthrich, *Computing vertex normals from polygonal
//! facets*, JGT 1998). The cone holds the normals of all triangles around the vertex, seen from the normal as quantised.

use super::facets::{self, Facet};
use super::join::Corners;
use super::mesh::{Corner, Mesh, Positions};
use super::orientation::Orientation;
use super::plan::MemoryPlan;
use super::reorder;
use crate::BuildError;
use crate::progress::Phases;
use crate::spool::Spool;
use bytemuck::{Pod, Zeroable};
use gigalod_geom::quantise::normal;
use gigalod_geom::sphere::round_up;
use gigalod_geom::{Aabb, Sphere};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::io;

/// A leaf of the hierarchy.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Leaf {
    /// Local space. Encloses the exact sphere around the exact vertex, whatever rounding to `f32` did to it.
    pub(super) center: [f32; 3],
    pub(super) radius: f32,
    /// 8-bit sRGB.
    pub(super) color: [u8; 3],
    pub(super) unused: u8,
    /// Code of [`normal`].
    pub(super) normal: u16,
    /// A lower bound of the cosine of its cone's half-angle, as [`spread_of_cos`] has it.
    pub(super) spread: u16,
}

/// A cosine in 16 bits, rounded down.
pub(super) fn spread_of_cos(cos: f32) -> u16 {
    // Casting truncates, and negative numbers become 0.
    ((cos + 1.0) * 32_767.5 - 0.01) as u16
}

impl Leaf {
    /// A lower bound of the cosine of its cone's half-angle.
    pub(super) fn cos_spread(&self) -> f32 {
        f32::from(self.spread) / 32_767.5 - 1.0
    }

    pub(super) fn sphere(&self) -> Sphere {
        Sphere { center: Vec3::from_array(self.center), radius: self.radius }
    }
}

pub(super) struct Leaves {
    pub(super) leaves: Spool<Leaf>,
    /// Of local space; model space.
    pub(super) origin: DVec3,
    /// Of the referenced vertices; model space.
    pub(super) bounds: Aabb,
    pub(super) closed: bool,
    pub(super) has_colors: bool,
}

/// What a vertex gathers from its triangles.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Gathered {
    /// −1 until the vertex is referenced.
    radius: f32,
    /// In steps of 2⁻¹⁶: integers, so that the order of the triangles does not matter.
    normal: [i32; 3],
}

/// How a vertex is oriented.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Aspect {
    /// Code of [`normal`].
    normal: u16,
    /// As in [`Leaf`].
    spread: u16,
}

/// A triangle's normal in steps of 1/32767; zero where it has no area.
type FaceNormal = [i16; 3];

/// Rounded to the nearest: without `round`, which is a call where the processor is not known to have it.
fn steps_of(value: f32) -> i16 {
    ((value * 32_767.0 + 32_768.5) as i32 - 32_768) as i16
}

/// More than the steps of a [`FaceNormal`] can change a cosine by.
const STEPS: f32 = 6e-5;

/// Triangles that add up their volumes one after the other; batches hold whole strides, so that the sum does not depend on them.
const STRIDE: usize = 4096;

pub(super) fn from_mesh(mut mesh: Mesh, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> Result<Leaves, BuildError> {
    let vertex_count = mesh.positions.len();
    phases.begin("radii and normals", mesh.triangles.len());
    reorder::by_space(&mut mesh);
    let (gathered, faces, orientation) = match &mesh.positions {
        Positions::Narrow(positions) => gather(&mesh.triangles, positions, plan, phases),
        Positions::Wide(positions) => gather(&mesh.triangles, positions, plan, phases),
    }
    .map_err(BuildError::Scratch)?;

    phases.begin("cones", mesh.triangles.len());
    let (mut aspects, bounds) = orient(&mesh, &gathered, plan).map_err(BuildError::Scratch)?;
    let extent = bounds.extent().max_element();
    if extent.is_nan() || extent > 1e30 {
        return Err(BuildError::TooWide { extent });
    }
    widen_cones(&mesh.triangles, &faces, &mut aspects, plan, phases).map_err(BuildError::Scratch)?;
    drop(faces);

    phases.begin("leaves", vertex_count);
    let origin = bounds.center();
    let (leaves, has_colors) = collect(mesh, &gathered, &aspects, origin, plan, phases).map_err(BuildError::Scratch)?;
    Ok(Leaves { leaves, origin, bounds, closed: orientation.is_closed(), has_colors })
}

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
}

impl Measured {
    /// `anchor` is the first corner of all.
    fn of<C: Corner>(triangles: &[[u32; 3]], positions: &Spool<C>, anchor: &mut Option<C>) -> io::Result<Self> {
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
                let faces = facets.iter().map(|facet| facet.normal.to_array().map(steps_of)).collect();
                Stride { facets, faces, orientation }
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

/// First look at all triangles: each vertex' radius and normal, each triangle's normal, and whether all is closed.
fn gather<C: Corner>(
    triangles: &Spool<[u32; 3]>,
    positions: &Spool<C>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<(Spool<Gathered>, Spool<FaceNormal>, Orientation)> {
    let mut gathered = Spool::new(&plan.place())?;
    fill(&mut gathered, positions.len(), Gathered { radius: -1.0, normal: [0; 3] })?;
    let mut faces = Spool::new(&plan.place())?;
    faces.expect(triangles.len());
    let mut orientation = Orientation::default();
    let mut anchor = None;
    // While a batch is measured, the one before it is gathered.
    let mut measured = Measured::default();
    for_each_batch(triangles, plan, |start, triangles| {
        let before = std::mem::take(&mut measured);
        let (gathering, measuring) =
            rayon::join(|| before.gather(&mut gathered), || Measured::of(triangles, positions, &mut anchor));
        gathering?;
        measured = measuring?;
        for Stride { faces: normals, orientation: stride, .. } in &measured.strides {
            faces.push(normals)?;
            orientation.merge(stride);
        }
        phases.at(start);
        Ok(())
    })?;
    measured.gather(&mut gathered)?;
    Ok((gathered, faces, orientation))
}

/// The normal of each vertex: its own where it has one, else what it gathered; and the bounds of all that are referenced.
fn orient(mesh: &Mesh, gathered: &Spool<Gathered>, plan: &MemoryPlan<'_>) -> io::Result<(Spool<Aspect>, Aabb)> {
    let mut aspects = Spool::new(&plan.place())?;
    aspects.expect(gathered.len());
    let mut bounds = Aabb::EMPTY;
    let has_own = mesh.normals.len() > 0;
    let (mut own, mut at) = (Vec::new(), Vec::new());
    gathered.for_each_piece(MemoryPlan::PIECE, |start, gathered| {
        mesh.positions.read_vec(start, gathered.len(), &mut at)?;
        let referenced = at.iter().zip(gathered).filter(|(_, gathered)| gathered.radius >= 0.0);
        bounds = referenced.fold(bounds, |bounds, (position, _)| bounds.including(*position));
        if has_own {
            mesh.normals.read_vec(start, gathered.len(), &mut own)?;
        }
        let aspect = |(vertex, gathered): (usize, &Gathered)| {
            let own = own.get(vertex).map_or(Vec3::ZERO, |own| Vec3::from_array(*own).normalize_or_zero());
            let candidates = [own, Vec3::from_array(gathered.normal.map(|sum| sum as f32)), Vec3::Y];
            let direction = candidates.into_iter().find(|n| *n != Vec3::ZERO).unwrap_or(Vec3::Y);
            Aspect { normal: normal::encode(direction), spread: u16::MAX }
        };
        aspects.push(&gathered.par_iter().with_min_len(1 << 12).enumerate().map(aspect).collect::<Vec<_>>())
    })?;
    Ok((aspects, bounds))
}

/// Second look at all triangles: how far their normals are from their vertices'.
fn widen_cones(
    triangles: &Spool<[u32; 3]>,
    faces: &Spool<FaceNormal>,
    aspects: &mut Spool<Aspect>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<()> {
    let (mut normals, mut oriented) = (Vec::new(), Vec::new());
    let table = normal::table();
    for_each_batch(triangles, plan, |start, triangles| {
        faces.read_vec(start, triangles.len(), &mut normals)?;
        let mut corners = Corners::of(triangles);
        corners.fetch(aspects, &mut oriented)?;
        let spreads: Vec<[u16; 3]> = normals
            .par_iter()
            .with_min_len(STRIDE)
            .zip(oriented.as_chunks::<3>().0)
            .map(|(face, aspects)| {
                let [x, y, z] = face.map(|value| f32::from(value) * (1.0 / 32_767.0));
                let face = Vec3::new(x, y, z);
                // Triangles without an area have no side that could be seen.
                let spread = |aspect: &Aspect| spread_of_cos(table[usize::from(aspect.normal)].dot(face) - STEPS);
                if face == Vec3::ZERO { [u16::MAX; 3] } else { aspects.each_ref().map(spread) }
            })
            .collect();
        let spreads = spreads.as_flattened();
        corners.fold(aspects, |aspect, corner| aspect.spread = aspect.spread.min(spreads[corner]))?;
        phases.at(start + triangles.len() as u64);
        Ok(())
    })
}

/// Leaves of all referenced vertices, in their order; and whether they have colours.
fn collect(
    mesh: Mesh,
    gathered: &Spool<Gathered>,
    aspects: &Spool<Aspect>,
    origin: DVec3,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<(Spool<Leaf>, bool)> {
    let Mesh { positions, normals, colors, triangles } = mesh;
    drop((normals, triangles));
    let has_colors = colors.len() > 0;
    let mut leaves = Spool::named(&plan.place(), "leaves")?;
    leaves.expect(positions.len());
    let (mut at, mut aspect, mut color) = (Vec::new(), Vec::new(), Vec::new());
    gathered.for_each_piece(MemoryPlan::PIECE, |start, gathered| {
        positions.read_vec(start, gathered.len(), &mut at)?;
        aspects.read_vec(start, gathered.len(), &mut aspect)?;
        if has_colors {
            colors.read_vec(start, gathered.len(), &mut color)?;
        }
        let leaf = |(vertex, gathered): (usize, &Gathered)| {
            let exact = at[vertex] - origin;
            let center = exact.as_vec3();
            let moved = (center.as_dvec3() - exact).length();
            let radius = round_up((f64::from(gathered.radius) + moved) * (1.0 + 1e-14));
            let Aspect { normal, spread } = aspect[vertex];
            let color = color.get(vertex).copied().unwrap_or_default();
            let center = center.to_array();
            (gathered.radius >= 0.0).then_some(Leaf { center, radius, color, unused: 0, normal, spread })
        };
        let piece: Vec<Leaf> = gathered.par_iter().with_min_len(1 << 12).enumerate().filter_map(leaf).collect();
        leaves.push(&piece)?;
        phases.at(start + gathered.len() as u64);
        Ok(())
    })?;
    Ok((leaves, has_colors))
}

/// All triangles, as many at a time as the plan allows, in whole strides.
fn for_each_batch(
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
