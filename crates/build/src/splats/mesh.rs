//! The whole mesh, read from a stream into memory, as long as the budget allows.

use crate::BuildError;
use crate::progress::Phases;
use gigalod_import::{Batch, ModelStream};
use glam::{DVec3, Vec3};

/// An indexed mesh as it was read.
pub(super) struct Mesh {
    pub(super) positions: Vec<DVec3>,
    /// One for each vertex, or empty.
    pub(super) normals: Vec<Vec3>,
    /// 8-bit sRGB, one for each vertex, or empty.
    pub(super) colors: Vec<[u8; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Bytes that building takes for each vertex and triangle, all phases considered: the mesh itself (24 + 12 + 3 and 12), then
/// leaves and two binary nodes a vertex beside it.
const BYTES_PER_VERTEX: u64 = 240;
const BYTES_PER_TRIANGLE: u64 = 12;

pub(super) fn read(input: &mut dyn ModelStream, memory_bytes: u64, phases: &Phases<'_>) -> Result<Mesh, BuildError> {
    phases.begin("read", input.bytes_consumed().1);
    let mut mesh = Mesh { positions: Vec::new(), normals: Vec::new(), colors: Vec::new(), triangles: Vec::new() };
    let mut batch = Batch::default();
    while input.next(&mut batch)? {
        mesh.positions.extend_from_slice(&batch.vertices.positions);
        mesh.normals.extend_from_slice(&batch.vertices.normals);
        mesh.colors.extend_from_slice(&batch.vertices.colors);
        mesh.triangles.extend_from_slice(&batch.triangles);
        let needed = mesh.positions.len() as u64 * BYTES_PER_VERTEX + mesh.triangles.len() as u64 * BYTES_PER_TRIANGLE;
        if needed > memory_bytes {
            return Err(BuildError::OverBudget {
                elements: format!("{} vertices and {} triangles", mesh.positions.len(), mesh.triangles.len()),
                needed: format!("{} MiB", needed >> 20),
                budget: format!("{} MiB", memory_bytes >> 20),
            });
        }
        phases.at(input.bytes_consumed().0);
    }
    if mesh.triangles.is_empty() {
        return Err(BuildError::NoTriangles { vertices: mesh.positions.len() as u64 });
    }
    Ok(mesh)
}
