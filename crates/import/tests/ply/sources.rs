//! Reads a whole file through the public interface, holding every batch to its promises.

use gigalod_import::{Attributes, Batch, ByteSource, ImportError, open};
use std::io::{Cursor, Read, Result, Seek, SeekFrom};

/// Everything that a stream gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Model {
    pub positions: Vec<[f64; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub colors: Vec<[u8; 3]>,
    pub triangles: Vec<[u32; 3]>,
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
    let mut stream = open(source)?;
    let Attributes { normals, colors } = stream.attributes();
    let (mut model, mut batch) = (Model::default(), Batch::default());
    let mut progress = stream.bytes_consumed();
    while stream.next(&mut batch)? {
        let Batch { vertices, triangles } = &batch;
        let count = vertices.positions.len();
        assert!(count <= Batch::TARGET && triangles.len() < Batch::TARGET + FAN, "{count}, {}", triangles.len());
        assert!(count + triangles.len() > 0, "an empty batch before the end");
        assert_eq!(vertices.normals.len(), if normals { count } else { 0 });
        assert_eq!(vertices.colors.len(), if colors { count } else { 0 });
        assert!(vertices.positions.iter().all(|position| position.is_finite()));
        assert!(vertices.normals.iter().all(|normal| normal.is_finite()));
        model.positions.extend(vertices.positions.iter().map(|position| position.to_array()));
        model.normals.extend(vertices.normals.iter().map(|normal| normal.to_array()));
        model.colors.extend(&vertices.colors);
        model.triangles.extend(triangles);
        let (before, (consumed, total)) = (progress, stream.bytes_consumed());
        assert!(before.0 <= consumed && consumed <= total && total == before.1, "{before:?}, {consumed} of {total}");
        progress = (consumed, total);
    }
    assert!(batch.vertices.positions.is_empty() && batch.triangles.is_empty(), "no batch after the last");
    assert_eq!(stream.declared_vertices(), Some(model.positions.len() as u64));
    let vertex_count = model.positions.len();
    assert!(model.triangles.iter().flatten().all(|&corner| (corner as usize) < vertex_count));
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
