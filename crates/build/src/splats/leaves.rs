//! From a mesh to leaves: for each referenced vertex a sphere, a normal, a cone and a colour.
//!
//! The sphere is centred on the vertex and as large as the largest bounding sphere of the triangles around it, so the spheres
//! at a triangle's corners cover it (splats paper, section 2.2). The normal is the mesh's own, or else the mean of the
//! triangles' normals weighted by their angles at the vertex (Thürmer & Wüthrich, *Computing vertex normals from polygonal
//! facets*, JGT 1998). The cone holds the normals of all triangles around the vertex, seen from the normal as quantised.
//!
//! Triangles that are diced (`dice/`) give nothing to their vertices; a vertex of no other triangle is no leaf.

use super::dice::{self, Dice, Dicing, Kind, Sizes};
use super::facets::{self, Facet};
use super::join::Corners;
use super::mesh::{Corner, Mesh, Positions};
use super::orientation::Orientation;
use super::paint::{self, Paint};
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

/// What a vertex gathers from its triangles.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Gathered {
    /// [`UNREFERENCED`] until a triangle that is not diced has come.
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

/// Radius of what no triangle has come to yet.
const UNREFERENCED: f32 = -1.0;

/// A triangle's normal in steps of 1/32767; zero where it has no area.
type FaceNormal = [i16; 3];

/// Rounded to the nearest: without `round`, which is a call where the processor is not known to have it.
fn steps_of(value: f32) -> i16 {
    ((value * 32_767.0 + 32_768.5) as i32 - 32_768) as i16
}

/// More than the steps of a [`FaceNormal`] can change a cosine by.
pub(super) const STEPS: f32 = 6e-5;

/// Triangles that add up their volumes one after the other; batches hold whole strides, so that the sum does not depend on them.
const STRIDE: usize = 4096;

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
        Some(paint) => count_texels(paint, plan).map_err(BuildError::Scratch)?,
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

/// Texels that triangles show, each as often as it is shown.
fn count_texels(paint: &Paint, plan: &MemoryPlan<'_>) -> io::Result<u64> {
    let (mut looks, mut coords, mut texels) = (Vec::new(), Vec::new(), 0u64);
    if paint.tex_coords.len() == 0 {
        return Ok(0);
    }
    paint.corners.for_each_piece(plan.diced_at_once(), |start, corners| {
        paint.materials.read_vec(start, corners.len(), &mut looks)?;
        let known = corners.as_flattened().iter().map(|number| if *number == paint::NONE { 0 } else { *number });
        Corners::of_vertices(known.collect()).fetch(&paint.tex_coords, &mut coords)?;
        for ((coords, look), numbers) in coords.as_chunks::<3>().0.iter().zip(&looks).zip(corners) {
            let Some(look) = paint.looks.get(*look as usize) else { continue };
            let Some(picture) = look.picture.filter(|_| !numbers.contains(&paint::NONE)) else { continue };
            let size = paint.pictures[picture as usize].levels[0].size;
            let [[ax, ay], [bx, by], [cx, cy]] = coords.map(|coord| look.texel(coord.map(f64::from), size));
            let area = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).abs() * 0.5;
            // In whole numbers, so that their order does not show; casting saturates.
            texels = texels.saturating_add(area as u64);
        }
        Ok(())
    })?;
    Ok(texels)
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
struct Gathering {
    gathered: Spool<Gathered>,
    faces: Spool<FaceNormal>,
    orientation: Orientation,
    /// Of all triangles, until it is known what is diced.
    sizes: Sizes,
}

fn gather(mesh: &Mesh, diced: Option<Dicing>, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> io::Result<Gathering> {
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
struct Survey {
    /// Of all that are referenced.
    bounds: Aabb,
    /// Share of them that lie inside a smooth surface: triangles all around, in about one direction.
    smooth_share: f64,
}

/// Sum of the normals of triangles around a vertex, weighted by their angles in radians, from which on it is inside a smooth surface:
/// of a flat one, the sum is a full turn; at the corner of a house, less than half of one.
const SMOOTH: f32 = 0.75 * std::f32::consts::TAU * 65_536.0;

fn survey(mesh: &Mesh, gathered: &Spool<Gathered>) -> io::Result<Survey> {
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
