//! Point clouds for tests: written as PLY, made from meshes by dropping their faces.
#![allow(dead_code, reason = "each test file uses its own part")]

use gigalod::import::{VertexBatch, read_all};
use glam::DVec3;
use std::fs::File;
use std::path::Path;

/// A binary PLY of points in full precision, with what attributes there are.
pub(crate) fn ply(points: &VertexBatch) -> Vec<u8> {
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.positions.len());
    for axis in ["x", "y", "z"] {
        header += &format!("property double {axis}\n");
    }
    if !points.normals.is_empty() {
        header += "property float nx\nproperty float ny\nproperty float nz\n";
    }
    if !points.colors.is_empty() {
        header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    let mut bytes = (header + "end_header\n").into_bytes();
    for (number, position) in points.positions.iter().enumerate() {
        bytes.extend(position.to_array().iter().flat_map(|value| value.to_le_bytes()));
        if let Some(normal) = points.normals.get(number) {
            bytes.extend(normal.to_array().iter().flat_map(|value| value.to_le_bytes()));
        }
        if let Some(color) = points.colors.get(number) {
            bytes.extend(color);
        }
    }
    bytes
}

/// Points without attributes.
pub(crate) fn plain(positions: impl IntoIterator<Item = DVec3>) -> VertexBatch {
    VertexBatch { positions: positions.into_iter().collect(), ..VertexBatch::default() }
}

/// The vertices of a model, with what attributes it has.
pub(crate) fn vertices(model: &Path) -> VertexBatch {
    let mut stream = gigalod::import::open(Box::new(File::open(model).unwrap())).unwrap();
    read_all(&mut *stream, &mut |_, _| {}).unwrap().vertices
}

/// Writes the vertices of a model that triangles use, positions only.
pub(crate) fn drop_faces(model: &Path, cloud: &Path) {
    let mut stream = gigalod::import::open(Box::new(File::open(model).unwrap())).unwrap();
    let all = read_all(&mut *stream, &mut |_, _| {}).unwrap();
    let mut used = vec![false; all.vertices.positions.len()];
    all.triangles.as_flattened().iter().for_each(|vertex| used[*vertex as usize] = true);
    let positions = all.vertices.positions.iter().zip(used).filter(|(_, used)| *used).map(|(position, _)| *position);
    std::fs::write(cloud, ply(&plain(positions))).unwrap();
}

/// The same points in no order.
pub(crate) fn shuffled(points: &VertexBatch) -> VertexBatch {
    // A step without a common factor visits all.
    let order: Vec<usize> =
        (0..points.positions.len()).map(|i| (i * 1_000_003 + 17) % points.positions.len()).collect();
    VertexBatch {
        positions: order.iter().map(|at| points.positions[*at]).collect(),
        normals: order.iter().filter_map(|at| points.normals.get(*at)).copied().collect(),
        colors: order.iter().filter_map(|at| points.colors.get(*at)).copied().collect(),
    }
}
