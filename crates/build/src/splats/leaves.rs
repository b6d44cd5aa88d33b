//! From a mesh to leaves: for each referenced vertex a sphere, a normal, a cone and a colour.
//!
//! The sphere is centred on the vertex and as large as the largest bounding sphere of the triangles around it, so the spheres
//! at a triangle's corners cover it (splats paper, section 2.2). The normal is the mesh's own, or else the mean of the
//! triangles' normals weighted by their angles at the vertex (Thürmer & Wüthrich, *Computing vertex normals from polygonal
//! facets*, JGT 1998). The cone holds the normals of all triangles around the vertex, seen from the normal as quantised.

use super::join::Corners;
use super::mesh::Mesh;
use super::orientation::Orientation;
use super::plan::MemoryPlan;
use crate::BuildError;
use crate::progress::Phases;
use crate::spool::Spool;
use bytemuck::{Pod, Zeroable};
use gigalod_geom::quantise::{cone, normal};
use gigalod_geom::sphere::{round_up, triangle_bounding_radius};
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
    /// Code of [`cone`].
    pub(super) cone: u8,
    /// Code of [`normal`].
    pub(super) normal: u16,
    pub(super) unused: u16,
}

impl Leaf {
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
    normal: [f32; 3],
}

/// How a vertex is oriented.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Aspect {
    /// Code of [`normal`].
    normal: u16,
    /// Code of [`cone`].
    cone: u8,
    unused: u8,
}

/// Triangles that add up their volumes one after the other; batches hold whole strides, so that the sum does not depend on them.
const STRIDE: usize = 4096;

/// What is found out about all triangles.
struct Found {
    bounds: Aabb,
    orientation: Orientation,
}

pub(super) fn from_mesh(mesh: Mesh, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> Result<Leaves, BuildError> {
    let vertex_count = mesh.positions.len();
    phases.begin("radii and normals", mesh.triangles.len());
    let mut gathered = Spool::new(&plan.place()).map_err(BuildError::Scratch)?;
    fill(&mut gathered, vertex_count, Gathered { radius: -1.0, normal: [0.0; 3] }).map_err(BuildError::Scratch)?;
    let found = gather(&mesh, &mut gathered, plan, phases).map_err(BuildError::Scratch)?;
    let extent = found.bounds.extent().max_element();
    if extent.is_nan() || extent > 1e30 {
        return Err(BuildError::TooWide { extent });
    }

    phases.begin("cones", mesh.triangles.len());
    let mut aspects = orient(&mesh, &gathered, plan).map_err(BuildError::Scratch)?;
    widen_cones(&mesh, &mut aspects, plan, phases).map_err(BuildError::Scratch)?;

    phases.begin("leaves", vertex_count);
    let origin = found.bounds.center();
    let leaves = collect(mesh, gathered, aspects, origin, plan, phases).map_err(BuildError::Scratch)?;
    Ok(Leaves {
        leaves: leaves.0,
        origin,
        bounds: found.bounds,
        closed: found.orientation.is_closed(),
        has_colors: leaves.1,
    })
}

/// First look at all triangles: bounds, orientation, and each vertex' radius and normal.
fn gather(
    mesh: &Mesh,
    gathered: &mut Spool<Gathered>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Found> {
    let mut found = Found { bounds: Aabb::EMPTY, orientation: Orientation::default() };
    let mut anchor = None;
    let mut positions = Vec::new();
    for_each_batch(mesh, plan, |start, triangles| {
        let mut corners = Corners::of(triangles);
        corners.fetch(&mesh.positions, &mut positions)?;
        let corner_positions: &[[[f64; 3]; 3]] = positions.as_chunks().0;
        let anchor = *anchor.get_or_insert(DVec3::from_array(positions[0]));
        let strides: Vec<(Aabb, Orientation)> = triangles
            .par_chunks(STRIDE)
            .zip(corner_positions.par_chunks(STRIDE))
            .map(|(triangles, corners)| {
                let (mut bounds, mut orientation) = (Aabb::EMPTY, Orientation::default());
                for (triangle, corners) in triangles.iter().zip(corners) {
                    let corners = corners.map(DVec3::from_array);
                    bounds = corners.into_iter().fold(bounds, Aabb::including);
                    orientation.add(*triangle, corners.map(|corner| corner - anchor));
                }
                (bounds, orientation)
            })
            .collect();
        for (bounds, orientation) in strides {
            found.bounds = found.bounds.union(bounds);
            found.orientation.merge(&orientation);
        }
        let contributions: Vec<(f32, [Vec3; 3])> = corner_positions
            .par_iter()
            .map(|corners| {
                let corners = corners.map(DVec3::from_array);
                (round_up(triangle_bounding_radius(corners) * (1.0 + 1e-14)), angle_weighted_normals(corners))
            })
            .collect();
        corners.fold(gathered, |vertex, corner| {
            let (radius, normals) = contributions[corner / 3];
            vertex.radius = vertex.radius.max(radius);
            vertex.normal = (Vec3::from_array(vertex.normal) + normals[corner % 3]).to_array();
        })?;
        phases.at(start + triangles.len() as u64);
        Ok(())
    })?;
    Ok(found)
}

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
            let candidates = [own, Vec3::from_array(gathered.normal), Vec3::Y];
            let direction = candidates.into_iter().find(|n| *n != Vec3::ZERO).unwrap_or(Vec3::Y);
            Aspect { normal: normal::encode(direction), cone: 0, unused: 0 }
        };
        aspects.push(&gathered.par_iter().enumerate().map(aspect).collect::<Vec<_>>())
    })?;
    Ok(aspects)
}

/// Second look at all triangles: how far their normals are from their vertices'.
fn widen_cones(mesh: &Mesh, aspects: &mut Spool<Aspect>, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> io::Result<()> {
    let (mut positions, mut oriented) = (Vec::new(), Vec::new());
    for_each_batch(mesh, plan, |start, triangles| {
        let mut corners = Corners::of(triangles);
        corners.fetch(&mesh.positions, &mut positions)?;
        corners.fetch(aspects, &mut oriented)?;
        let cones: Vec<[u8; 3]> = positions
            .as_chunks::<3>()
            .0
            .par_iter()
            .zip(oriented.as_chunks::<3>().0)
            .map(|(corners, aspects)| {
                let face = face_normal(corners.map(DVec3::from_array));
                // Triangles without an area have no side that could be seen.
                let width = |aspect: &Aspect| cone::encode(normal::decode(aspect.normal).dot(face));
                if face == Vec3::ZERO { [0; 3] } else { aspects.each_ref().map(width) }
            })
            .collect();
        let cones = cones.as_flattened();
        corners.fold(aspects, |aspect, corner| aspect.cone = aspect.cone.max(cones[corner]))?;
        phases.at(start + triangles.len() as u64);
        Ok(())
    })
}

/// Leaves of all referenced vertices, in their order; and whether they have colours.
fn collect(
    mesh: Mesh,
    gathered: Spool<Gathered>,
    aspects: Spool<Aspect>,
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
            let exact = DVec3::from_array(at[vertex]) - origin;
            let center = exact.as_vec3();
            let moved = (center.as_dvec3() - exact).length();
            let radius = round_up((f64::from(gathered.radius) + moved) * (1.0 + 1e-14));
            let Aspect { normal, cone, .. } = aspect[vertex];
            let color = color.get(vertex).copied().unwrap_or_default();
            (gathered.radius >= 0.0).then_some(Leaf {
                center: center.to_array(),
                radius,
                color,
                cone,
                normal,
                unused: 0,
            })
        };
        leaves.push(&gathered.par_iter().enumerate().filter_map(leaf).collect::<Vec<_>>())?;
        phases.at(start + gathered.len() as u64);
        Ok(())
    })?;
    Ok((leaves, has_colors))
}

/// All triangles, as many at a time as the plan allows, in whole strides.
fn for_each_batch(
    mesh: &Mesh,
    plan: &MemoryPlan<'_>,
    mut visit: impl FnMut(u64, &[[u32; 3]]) -> io::Result<()>,
) -> io::Result<()> {
    // In memory more than this at a time gains nothing and leaves the cache.
    let at_once = plan.triangles_at_once().min(if plan.is_in_memory() { 1 << 16 } else { usize::MAX });
    let at_once = (at_once / STRIDE).max(1) * STRIDE;
    let (mut start, total) = (0, mesh.triangles.len());
    let mut triangles = Vec::new();
    while start < total {
        let count = (total - start).min(at_once as u64) as usize;
        mesh.triangles.read_vec(start, count, &mut triangles)?;
        visit(start, &triangles)?;
        start += count as u64;
    }
    Ok(())
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

/// Unit normal; zero for a triangle without an area.
fn face_normal([a, b, c]: [DVec3; 3]) -> Vec3 {
    (b - a).cross(c - a).try_normalize().map_or(Vec3::ZERO, |normal| normal.as_vec3())
}

/// The face normal times the angle at each corner; zero for a triangle without an area.
fn angle_weighted_normals(corners: [DVec3; 3]) -> [Vec3; 3] {
    let normal = face_normal(corners);
    std::array::from_fn(|corner| {
        let to = |other: usize| (corners[(corner + other) % 3] - corners[corner]).as_vec3();
        normal * angle(to(1), to(2))
    })
}

/// Angle between two vectors within 0.0001 radian, without any platform's `libm`: it only weights.
fn angle(u: Vec3, v: Vec3) -> f32 {
    let scale = (u.length_squared() * v.length_squared()).sqrt();
    if scale <= 0.0 || !scale.is_finite() {
        return 0.0;
    }
    let cos = (u.dot(v) / scale).clamp(-1.0, 1.0);
    // acos(|x|) ≈ √(1 − |x|) · (1.5707288 − 0.2121144 |x| + 0.0742610 x² − 0.0187293 |x|³); Abramowitz & Stegun 4.4.45.
    let x = cos.abs();
    let acute = (1.0 - x).sqrt() * (1.570_728_8 + x * (-0.212_114_4 + x * (0.074_261 - 0.018_729_3 * x)));
    if cos < 0.0 { std::f32::consts::PI - acute } else { acute }
}
