//! Reads a whole file through the public interface, holding every batch to its promises.

use gigalod_import::{
    Attributes, Batch, ByteSource, CornerBatch, ImportError, ModelStream, NoSideFiles, SideFiles, open_with,
};
use std::io::{Cursor, Read, Result, Seek, SeekFrom};

/// Everything that a stream gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Model {
    pub positions: Vec<[f64; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub colors: Vec<[u8; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub tex_coords: Vec<[f32; 2]>,
    /// Of batches that have any.
    pub corner_tex_coords: Vec<[u32; 3]>,
    /// Numbers, of batches that have any.
    pub materials: Vec<u32>,
    pub material_names: Vec<String>,
}

/// More than the longest list that the fast path takes whole.
const FAN: usize = 256;

pub(crate) fn read(bytes: &[u8]) -> std::result::Result<Model, ImportError> {
    read_source(Box::new(Cursor::new(bytes.to_vec())))
}

/// Like [`read`], from a source that gives few bytes at a time.
pub(crate) fn read_in_drops(bytes: &[u8]) -> std::result::Result<Model, ImportError> {
    read_source(Box::new(Drops { bytes: Cursor::new(bytes.to_vec()), reads: 0 }))
}

/// The message of the error that `bytes` must give.
pub(crate) fn error(bytes: &[u8]) -> String {
    match read(bytes) {
        Err(error) => error.to_string(),
        Ok(model) => panic!("expected an error, found {} vertices", model.positions.len()),
    }
}

pub(crate) fn read_source(source: Box<dyn ByteSource>) -> std::result::Result<Model, ImportError> {
    read_with(source, Box::new(NoSideFiles))
}

/// With other files that the model may name.
pub(crate) fn read_with(
    source: Box<dyn ByteSource>,
    side: Box<dyn SideFiles>,
) -> std::result::Result<Model, ImportError> {
    read_stream(open_with(source, side)?)
}

pub(crate) fn read_stream(mut stream: Box<dyn ModelStream>) -> std::result::Result<Model, ImportError> {
    let Attributes { normals, colors } = stream.attributes();
    let (mut model, mut batch) = (Model::default(), Batch::default());
    let mut progress = stream.bytes_consumed();
    while stream.next(&mut batch)? {
        let Batch { vertices, triangles, tex_coords, corners } = &batch;
        let count = vertices.positions.len();
        assert!(count <= Batch::TARGET + 2 && triangles.len() < Batch::TARGET + FAN, "{count}, {}", triangles.len());
        assert!(count + triangles.len() + tex_coords.len() > 0, "an empty batch before the end");
        assert_eq!(vertices.normals.len(), if normals { count } else { 0 });
        assert_eq!(vertices.colors.len(), if colors { count } else { 0 });
        assert!(vertices.positions.iter().all(|position| position.is_finite()));
        assert!(vertices.normals.iter().all(|normal| normal.is_finite()));
        model.positions.extend(vertices.positions.iter().map(|position| position.to_array()));
        model.normals.extend(vertices.normals.iter().map(|normal| normal.to_array()));
        model.colors.extend(&vertices.colors);
        let of_corners = [corners.tex_coords.len(), corners.materials.len()];
        assert!(of_corners.iter().all(|&length| length == 0 || length == triangles.len()), "{of_corners:?}");
        model.corner_tex_coords.extend(&corners.tex_coords);
        model.materials.extend(&corners.materials);
        assert!(tex_coords.as_flattened().iter().all(|value| value.is_finite()));
        model.tex_coords.extend(tex_coords);
        model.triangles.extend(triangles);
        let (before, (consumed, total)) = (progress, stream.bytes_consumed());
        assert!(before.0 <= consumed && consumed <= total && total == before.1, "{before:?}, {consumed} of {total}");
        progress = (consumed, total);
    }
    assert!(
        batch.vertices.positions.is_empty() && batch.tex_coords.is_empty() && batch.triangles.is_empty(),
        "no batch after the last"
    );
    assert_eq!(stream.declared_vertices().unwrap_or(model.positions.len() as u64), model.positions.len() as u64);
    let vertex_count = model.positions.len();
    assert!(model.triangles.iter().flatten().all(|&corner| (corner as usize) < vertex_count));
    let known = |number: &u32, count: usize| (*number as usize) < count || *number == CornerBatch::NONE;
    assert!(model.corner_tex_coords.iter().flatten().all(|number| known(number, model.tex_coords.len())));
    let materials = stream.materials();
    assert!(model.materials.iter().all(|number| known(number, materials.len())));
    model.material_names = materials.iter().map(|material| material.name.clone()).collect();
    Ok(model)
}

/// Reads return 1 to 7 bytes.
struct Drops {
    bytes: Cursor<Vec<u8>>,
    reads: usize,
}

impl Read for Drops {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        self.reads += 1;
        let most = into.len().min(1 + self.reads * 5 % 7);
        self.bytes.read(&mut into[..most])
    }
}

impl Seek for Drops {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.bytes.seek(to)
    }
}
