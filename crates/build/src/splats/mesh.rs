//! The whole mesh, read from a stream once, in memory or spooled to disk.

use super::plan::MemoryPlan;
use crate::BuildError;
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_import::{Batch, ModelStream};
use glam::Vec3;

/// An indexed mesh as it was read.
pub(super) struct Mesh {
    pub(super) positions: Spool<[f64; 3]>,
    /// One for each vertex, or empty.
    pub(super) normals: Spool<[f32; 3]>,
    /// 8-bit sRGB, one for each vertex, or empty.
    pub(super) colors: Spool<[u8; 3]>,
    pub(super) triangles: Spool<[u32; 3]>,
}

pub(super) fn read(input: &mut dyn ModelStream, plan: &MemoryPlan, phases: &Phases<'_>) -> Result<Mesh, BuildError> {
    phases.begin("read", input.bytes_consumed().1);
    let place = plan.place();
    let mut mesh = Mesh {
        positions: Spool::named(&place, "positions").map_err(BuildError::Scratch)?,
        normals: Spool::named(&place, "normals").map_err(BuildError::Scratch)?,
        colors: Spool::named(&place, "colors").map_err(BuildError::Scratch)?,
        triangles: Spool::named(&place, "triangles").map_err(BuildError::Scratch)?,
    };
    if let (Some(vertices), Some(faces)) = (input.declared_vertices(), input.declared_faces()) {
        // A header's word, believed only as far as the plan found room for it.
        mesh.positions.expect(vertices.min(plan.most_vertices()));
        mesh.triangles.expect(faces.min(plan.most_triangles()));
    }
    let mut batch = Batch::default();
    let mut normals: Vec<[f32; 3]> = Vec::new();
    let mut positions: Vec<[f64; 3]> = Vec::new();
    while input.next(&mut batch)? {
        positions.clear();
        positions.extend(batch.vertices.positions.iter().map(|position| position.to_array()));
        normals.clear();
        normals.extend(batch.vertices.normals.iter().map(Vec3::to_array));
        let mut push = || {
            mesh.positions.push(&positions)?;
            mesh.normals.push(&normals)?;
            mesh.colors.push(&batch.vertices.colors)?;
            mesh.triangles.push(&batch.triangles)
        };
        push().map_err(BuildError::Scratch)?;
        phases.at(input.bytes_consumed().0);
    }
    if mesh.triangles.len() == 0 {
        return Err(BuildError::NoTriangles { vertices: mesh.positions.len() });
    }
    if mesh.positions.len() >= 1 << 31 {
        return Err(BuildError::TooManyVertices { found: mesh.positions.len() });
    }
    Ok(mesh)
}
