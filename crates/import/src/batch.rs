//! The unit that streams: a bounded number of vertices and triangles, its buffers reused from one batch to the next.

use crate::{ImportError, ModelStream};
use glam::{DVec3, Vec3};

/// What the vertices of a stream carry besides positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attributes {
    /// A direction for each vertex.
    pub normals: bool,
    /// A colour for each vertex.
    pub colors: bool,
}

/// Vertices, structure of arrays. Attribute arrays are as long as `positions`, or empty where the stream has none.
#[derive(Clone, Debug, Default)]
pub struct VertexBatch {
    /// Model space; finite.
    pub positions: Vec<DVec3>,
    /// As in the file: not normalised, perhaps zero, but finite.
    pub normals: Vec<Vec3>,
    /// 8-bit sRGB.
    pub colors: Vec<[u8; 3]>,
}

/// What the corners of triangles carry, in the order of [`Batch::triangles`]. Each array is as long as that one, or empty
/// where no triangle of the batch has any.
#[derive(Clone, Debug, Default)]
pub struct CornerBatch {
    /// Numbers of texture coordinates, counted through the stream as vertices are, or [`CornerBatch::NONE`].
    pub tex_coords: Vec<[u32; 3]>,
    /// For each triangle, its place in [`ModelStream::materials`], or [`CornerBatch::NONE`].
    pub materials: Vec<u32>,
}

impl CornerBatch {
    /// Stands for no texture coordinate, or no material.
    pub const NONE: u32 = u32::MAX;
}

/// Vertices and triangles that follow each other in the file; either may be empty.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// The next vertices.
    pub vertices: VertexBatch,
    /// The next texture coordinates: u to the right, v upwards, from the picture's lower left corner; finite. A format that
    /// shares them between corners, as OBJ does, numbers them apart from its vertices, so they stream apart.
    pub tex_coords: Vec<[f32; 2]>,
    /// Corners by vertex number, in the file's winding.
    pub triangles: Vec<[u32; 3]>,
    /// What the corners of `triangles` carry.
    pub corners: CornerBatch,
}

/// How a surface looks, as far as this crate reads it.
///
/// What shows is the product, in linear light, of the vertices' colours, `color` and the texture, of those that there are.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As in the file; perhaps empty.
    pub name: String,
    /// 8-bit sRGB.
    pub color: [u8; 3],
    /// True where the vertices' colours have `color` in them already.
    pub is_in_vertices: bool,
    /// A picture of colours. Two materials of a model with equal ones have the same picture.
    pub texture: Option<Texture>,
    /// How texture coordinates name places of the picture.
    pub mapping: Mapping,
    /// What is less opaque in the picture, from 0 to 255, is not there at all. Without it everything is opaque.
    pub alpha_cutoff: Option<u8>,
}

impl Material {
    /// White, without a picture.
    pub fn plain(name: String) -> Self {
        let (color, mapping) = ([255; 3], Mapping::default());
        Self { name, color, is_in_vertices: false, texture: None, mapping, alpha_cutoff: None }
    }
}

/// From texture coordinates to places of a picture: `scale · coordinate + offset`, then `wrap`, along u and v. Within the picture
/// both are from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    /// A factor to each coordinate; finite.
    pub scale: [f32; 2],
    /// Added after that; finite.
    pub offset: [f32; 2],
    /// What is outside the picture.
    pub wrap: [Wrap; 2],
}

impl Default for Mapping {
    fn default() -> Self {
        Self { scale: [1.0; 2], offset: [0.0; 2], wrap: [Wrap::Repeat; 2] }
    }
}

/// What is outside a picture, along one of its axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture again, every other time mirrored.
    Mirror,
    /// The picture's border.
    Clamp,
}

/// Where the picture of a texture is.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Texture {
    /// A file beside the model, by the name that the model has for it.
    File(String),
    /// A picture inside the model, PNG or JPEG, by its number in the model's list of pictures.
    Embedded(u32),
}

impl Batch {
    /// A batch ends at the first element that reaches this many vertices or triangles.
    pub const TARGET: usize = 1 << 16;

    /// Empties it, keeping its buffers.
    pub fn clear(&mut self) {
        self.vertices.positions.clear();
        self.vertices.normals.clear();
        self.vertices.colors.clear();
        self.tex_coords.clear();
        self.triangles.clear();
        self.corners.tex_coords.clear();
        self.corners.materials.clear();
    }

    /// True when it holds as much as a batch should.
    pub fn is_full(&self) -> bool {
        let most = self.vertices.positions.len().max(self.triangles.len()).max(self.tex_coords.len());
        most >= Self::TARGET
    }

    /// True without a vertex, texture coordinate or triangle.
    pub(crate) fn is_empty(&self) -> bool {
        self.vertices.positions.is_empty() && self.tex_coords.is_empty() && self.triangles.is_empty()
    }

    /// Appends a triangle with what its corners carry, if anything.
    #[inline]
    pub(crate) fn push_triangle(&mut self, triangle: [u32; 3], tex_coords: [u32; 3], material: u32) {
        let before = self.triangles.len();
        self.triangles.push(triangle);
        let Self { corners, .. } = self;
        if !corners.tex_coords.is_empty() || tex_coords != [CornerBatch::NONE; 3] {
            corners.tex_coords.resize(before, [CornerBatch::NONE; 3]);
            corners.tex_coords.push(tex_coords);
        }
        if !corners.materials.is_empty() || material != CornerBatch::NONE {
            corners.materials.resize(before, CornerBatch::NONE);
            corners.materials.push(material);
        }
    }
}

/// A whole model in one batch, for those that need all of it at once: the judge, and copies of a scan. `progress` is told
/// [`ModelStream::bytes_consumed`]. Memory grows with the model.
///
/// # Errors
/// The first thing that is wrong with the file.
pub fn read_all(stream: &mut dyn ModelStream, progress: &mut dyn FnMut(u64, u64)) -> Result<Batch, ImportError> {
    let (mut all, mut batch) = (Batch::default(), Batch::default());
    while stream.next(&mut batch)? {
        all.vertices.positions.append(&mut batch.vertices.positions);
        all.vertices.normals.append(&mut batch.vertices.normals);
        all.vertices.colors.append(&mut batch.vertices.colors);
        all.tex_coords.append(&mut batch.tex_coords);
        append_corners(&mut all.corners.tex_coords, &mut batch.corners.tex_coords, [CornerBatch::NONE; 3], {
            [all.triangles.len(), batch.triangles.len()]
        });
        append_corners(&mut all.corners.materials, &mut batch.corners.materials, CornerBatch::NONE, {
            [all.triangles.len(), batch.triangles.len()]
        });
        all.triangles.append(&mut batch.triangles);
        let (done, total) = stream.bytes_consumed();
        progress(done, total);
    }
    Ok(all)
}

/// Appends what `after` triangles carry to what `before` triangles do; either may be empty, for nothing.
fn append_corners<T: Copy>(all: &mut Vec<T>, more: &mut Vec<T>, none: T, [before, after]: [usize; 2]) {
    if all.is_empty() && more.is_empty() {
        return;
    }
    all.resize(before, none);
    all.append(more);
    all.resize(before + after, none);
}
