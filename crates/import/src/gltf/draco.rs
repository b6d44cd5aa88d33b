//! Meshes packed by Draco: the extension KHR_draco_mesh_compression, unpacked by the crate `draco-core`, which is safe Rust
//! and bounds what it allocates.

use super::{accessors::Data, buffers::item, json};
use crate::{ImportError, error::said};
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

/// Largest mesh.
const MOST_POINTS: u64 = 1 << 24;
const MOST_FACES: u64 = 1 << 25;
const MOST_BYTES: u64 = 512 << 20;

/// A mesh in memory. Arrays are as long as `positions`, or empty.
pub(super) struct Decoded {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) colors: Vec<[f32; 3]>,
    pub(super) tex_coords: Vec<[f32; 2]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Unpacks a mesh; `tex_coord` is the number of the texture coordinates in it that are wanted.
pub(super) fn decode(data: &mut Data, draco: &json::Draco, tex_coord: Option<usize>) -> Result<Decoded, ImportError> {
    let bytes = data.buffers.whole(&data.root, draco.buffer_view)?;
    let wrong = |found: String| {
        ImportError::malformed("sound KHR_draco_mesh_compression", found, item("bufferView", draco.buffer_view))
    };
    let limits = DecodeLimits::default()
        .with_max_points(MOST_POINTS)
        .with_max_faces(MOST_FACES)
        .with_max_decoded_bytes(MOST_BYTES);
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(&bytes).with_limits(limits), &mut mesh)
        .map_err(|error| wrong(said(error)))?;
    let count = mesh.num_points();
    let attribute = |number: Option<usize>| {
        let number = u32::try_from(number?).ok()?;
        mesh.attribute_by_unique_id(number)
    };
    // Whole numbers stand for shares of their largest where colours and texture coordinates are not floating.
    let values = |number: Option<usize>, components: usize, is_share: bool| -> Option<Vec<f32>> {
        let attribute = attribute(number)?;
        let full = match (is_share, attribute.data_type().byte_length()) {
            (true, 1) => 255.0,
            (true, 2) => 65535.0,
            _ => 1.0,
        };
        let values = attribute.read_f32s(count, components);
        Some(values.into_iter().map(|value| value / full).collect())
    };
    let Some(positions) = values(draco.attributes.position, 3, false) else {
        return Err(wrong("no positions".to_owned()));
    };
    let rows = |values: Option<Vec<f32>>| values.map_or(Vec::new(), |values| values.as_chunks().0.to_vec());
    let triangles = mesh.faces().iter().map(|face| face.map(|point| point.0)).collect::<Vec<_>>();
    if triangles.iter().flatten().any(|&corner| corner as usize >= count) {
        return Err(wrong("corners of vertices that are not there".to_owned()));
    }
    Ok(Decoded {
        positions: rows(Some(positions)),
        normals: rows(values(draco.attributes.normal, 3, false)),
        colors: rows(values(draco.attributes.color, 3, true)),
        tex_coords: values(tex_coord, 2, true).map_or(Vec::new(), |values| values.as_chunks().0.to_vec()),
        triangles,
    })
}
