//! From a mesh to leaves: for each referenced vertex a sphere, a normal, a cone and a colour.
//!
//! The sphere is centred on the vertex and as large as the largest bounding sphere of the triangles around it, so the spheres
//! at a triangle's corners cover it (splats paper, section 2.2). The normal is the mesh's own, or else the mean of the
//! triangles' normals weighted by their angles at the vertex (Thürmer & Wüthrich, *Computing vertex normals from polygonal
//! facets*, JGT 1998). The cone holds the normals of all triangles around the vertex, seen from the normal as quantised.
//!
//! Triangles that are diced (`dice/`) give nothing to their vertices; a vertex of no other triangle is no leaf.

use super::dice::{self, Dice, Kind};
use super::gather::{FaceNormal, Gathered, Gathering, STRIDE, Survey, for_each_batch, gather, survey};
use super::join::Corners;
use super::mesh::Mesh;
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
    pub(super) dicing: Option<gigalod_format::Dicing>,
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

/// More than the steps of a [`FaceNormal`] can change a cosine by.
pub(super) const STEPS: f32 = 6e-5;

/// `asked` is the spacing that the user asks for, if any.
pub(super) fn from_mesh(
    mut mesh: Mesh,
    asked: Option<f64>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> Result<Leaves, BuildError> {
    let vertex_count = mesh.positions.len();
    phases.begin("radii and normals", mesh.triangles.len());
    reorder::by_space(&mut mesh);
    let Gathering { mut gathered, mut faces, orientation, sizes } =
        gather(&mesh, None, plan, phases).map_err(BuildError::Scratch)?;
    let Survey { bounds, smooth_share } = survey(&mesh, &gathered).map_err(BuildError::Scratch)?;
    let extent = bounds.extent().max_element();
    if extent.is_nan() || extent > 1e30 {
        return Err(BuildError::TooWide { extent });
    }
    let texels = match &mesh.paint {
        Some(paint) => paint.count_texels(plan).map_err(BuildError::Scratch)?,
        None => 0,
    };
    let dicing = sizes.dicing(Kind { smooth_share, is_painted: mesh.paint.is_some(), texels }, asked);
    if let (Some(dicing), Some(spacing)) = (dicing, asked) {
        let samples = sizes.samples(dicing);
        if samples >= f64::from(1u32 << 31) {
            return Err(BuildError::TooFine { spacing, samples });
        }
    }
    if dicing.is_some() {
        phases.begin("radii and normals of small triangles", mesh.triangles.len());
        // What was gathered would be in the way of what is.
        drop((gathered, faces));
        Gathering { gathered, faces, .. } = gather(&mesh, dicing, plan, phases).map_err(BuildError::Scratch)?;
    }

    phases.begin("cones", mesh.triangles.len());
    let mut aspects = orient(&mesh, &gathered, plan).map_err(BuildError::Scratch)?;
    widen_cones(&mesh.triangles, &faces, &mut aspects, plan, phases).map_err(BuildError::Scratch)?;
    drop(faces);

    let origin = bounds.center();
    let has_colors = mesh.colors.len() > 0 || mesh.paint.is_some();
    let (mut samples, mut diced) = (None, None);
    if let Some(dicing) = dicing {
        let dice = Dice { mesh: &mesh, dicing, origin };
        phases.begin("grids", mesh.triangles.len());
        let count = dice::count(&dice, plan, phases).map_err(BuildError::Scratch)?;
        plan.expect_leaves(count.cells + vertex_count, mesh.spooled_bytes());
        phases.begin("dice", count.cells);
        let mut leaves = Spool::named(&plan.place(), LEAVES).map_err(BuildError::Scratch)?;
        leaves.expect(count.cells);
        dice::dice(&dice, &mut leaves, plan, phases).map_err(BuildError::Scratch)?;
        let (spacing, triangles, samples_made) = (dicing.spacing, count.triangles, leaves.len());
        diced = Some(gigalod_format::Dicing { spacing, triangles, samples: samples_made });
        samples = Some(leaves);
    }
    phases.begin("leaves", vertex_count);
    let leaves = collect(mesh, &gathered, &aspects, samples, origin, plan, phases).map_err(BuildError::Scratch)?;
    match leaves.len() {
        // All is masked out.
        0 => Err(BuildError::Nothing),
        found if found >= 1 << 31 => Err(BuildError::TooManyVertices { found }),
        _ => Ok(Leaves { leaves, origin, bounds, closed: orientation.is_closed(), has_colors, dicing: diced }),
    }
}

/// Name of the spool.
const LEAVES: &str = "leaves";

/// The normal of each vertex: its own where it has one, else what it gathered.
fn orient(mesh: &Mesh, gathered: &Spool<Gathered>, plan: &MemoryPlan<'_>) -> io::Result<Spool<Aspect>> {
    let mut aspects = Spool::new(&plan.place())?;
    aspects.expect(gathered.len());
    let has_own = mesh.normals.len() > 0;
    let mut own = Vec::new();
    gathered.for_each_piece(MemoryPlan::PIECE, |start, gathered| {
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
    Ok(aspects)
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

/// Leaves of all referenced vertices, in their order, after those of samples, if any.
fn collect(
    mesh: Mesh,
    gathered: &Spool<Gathered>,
    aspects: &Spool<Aspect>,
    samples: Option<Spool<Leaf>>,
    origin: DVec3,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Spool<Leaf>> {
    let Mesh { positions, normals, colors, triangles, paint } = mesh;
    let is_painted = paint.is_some();
    drop((normals, triangles, paint));
    let has_colors = colors.len() > 0;
    let mut leaves = match samples {
        // No triangle is left to vertices.
        Some(leaves) if is_painted => return Ok(leaves),
        Some(leaves) => leaves,
        None => Spool::named(&plan.place(), LEAVES)?,
    };
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
    Ok(leaves)
}
