//! From a mesh to pieces: triangles that have all that belongs to them with them, and need no vertices any more.
//!
//! In: the mesh as it was read. Out: pieces in the order of its triangles, and what holds for the whole model. Normals are the mesh's own,
//! or else gathered from the triangles around each vertex.

use super::octree::Piece;
use super::weld::code_of;
use crate::BuildError;
use crate::progress::Phases;
use crate::splats::gather::{self, Gathered, Survey};
use crate::splats::join::Corners;
use crate::splats::mesh::{Corner, Mesh, Positions};
use crate::splats::plan::MemoryPlan;
use crate::spool::Spool;
use gigalod_format::InputCounts;
use gigalod_geom::Aabb;
use glam::{DVec3, Vec3};
use std::io;

/// What is known of the model as a whole.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Facts {
    pub(super) counts: InputCounts,
    /// Smallest corner and edge of the root's cell.
    pub(super) origin: [f64; 3],
    pub(super) edge: f64,
    pub(super) min: [f64; 3],
    pub(super) max: [f64; 3],
    pub(super) closed: bool,
    pub(super) has_colors: bool,
}

/// Name of the spool.
pub(super) const PIECES: &str = "pieces";

/// Makes pieces of all triangles.
pub(super) fn of_mesh(
    mesh: Mesh,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> Result<(Facts, Spool<Piece>), BuildError> {
    phases.begin("normals", mesh.triangles.len());
    let gathering = gather::gather(&mesh, None, plan, phases).map_err(BuildError::Scratch)?;
    let Survey { bounds, .. } = gather::survey(&mesh, &gathering.gathered).map_err(BuildError::Scratch)?;
    let extent = bounds.extent().max_element();
    if extent.is_nan() || extent > 1e30 {
        return Err(BuildError::TooWide { extent });
    }
    let has_colors = mesh.colors.len() > 0;
    let facts = Facts {
        counts: InputCounts { triangles: mesh.triangles.len(), vertices: mesh.positions.len(), points: 0 },
        origin: bounds.min.to_array(),
        edge: root_edge(bounds),
        min: bounds.min.to_array(),
        max: bounds.max.to_array(),
        closed: gathering.orientation.is_closed(),
        has_colors,
    };
    drop(gathering.faces);
    phases.begin("triangles", mesh.triangles.len());
    let gathered = gathering.gathered;
    let pieces = match &mesh.positions {
        Positions::Narrow(positions) => join(&mesh, positions, gathered, bounds.min, plan, phases),
        Positions::Wide(positions) => join(&mesh, positions, gathered, bounds.min, plan, phases),
    };
    Ok((facts, pieces.map_err(BuildError::Scratch)?))
}

/// So large that rounding puts nothing outside; of a single point, something.
fn root_edge(bounds: Aabb) -> f64 {
    let size = bounds.min.abs().max(bounds.max.abs()).max_element();
    let edge = bounds.extent().max_element() * (1.0 + 1e-6) + size * 1e-12;
    if edge > 0.0 { edge } else { 1.0 }
}

fn join<C: Corner>(
    mesh: &Mesh,
    positions: &Spool<C>,
    gathered: Spool<Gathered>,
    origin: DVec3,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Spool<Piece>> {
    let mut pieces = Spool::named(&plan.place(), PIECES)?;
    pieces.expect(mesh.triangles.len());
    let (mut at, mut own, mut sums, mut colors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let has_own = mesh.normals.len() > 0;
    gather::for_each_batch(&mesh.triangles, plan, |start, triangles| {
        let mut corners = Corners::of(triangles);
        corners.fetch(positions, &mut at)?;
        corners.fetch(&gathered, &mut sums)?;
        if has_own {
            corners.fetch(&mesh.normals, &mut own)?;
        }
        if mesh.colors.len() > 0 {
            corners.fetch(&mesh.colors, &mut colors)?;
        }
        let normal = |corner: usize| {
            let own = own.get(corner).map_or(Vec3::ZERO, |own| Vec3::from_array(*own).normalize_or_zero());
            if own != Vec3::ZERO {
                return code_of(own);
            }
            code_of(Vec3::from_array(sums[corner].normal.map(|sum| sum as f32)).normalize_or(Vec3::Z))
        };
        let piece = |triangle: usize| {
            let corners = [0, 1, 2].map(|side| triangle * 3 + side);
            Piece {
                at: corners.map(|corner| (at[corner].exact() - origin).as_vec3().to_array()),
                normals: corners.map(normal),
                colors: corners.map(|corner| colors.get(corner).copied().unwrap_or_default()),
                cuts: 0,
                unused: [0; 2],
            }
        };
        let batch: Vec<Piece> = (0..triangles.len()).map(piece).collect();
        pieces.push(&batch)?;
        phases.at(start + triangles.len() as u64);
        Ok(())
    })?;
    Ok(pieces)
}
