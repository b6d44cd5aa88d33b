//! Walks through what a scene draws and fills batches.
//!
//! What always holds: a step reads a range of bounded length from each accessor; a primitive's vertices come before its
//! triangles, those of an instance before those of the next.

use super::{
    accessors::Data,
    buffers::item,
    draco::{self, Decoded},
    json,
    scene::{self, Draw, Part, Topology},
};
use crate::{
    Attributes, Batch, ByteSource, CornerBatch, ImportError, Material, ModelStream, SideFiles, Texture, error::Problem,
};
use gigalod_geom::LengthUnit;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::collections::{HashMap, hash_map::Entry};
use std::io::Cursor;
use std::ops::Range;
use std::sync::Arc;

/// Vertices or triangles of a step.
const STEP: u64 = 1 << 14;

pub(super) struct GltfStream {
    data: Data,
    side: Box<dyn SideFiles>,
    draws: Vec<Draw>,
    /// Parts of each mesh that is drawn.
    parts: HashMap<u32, Arc<Vec<Part>>>,
    materials: Vec<Material>,
    attributes: Attributes,
    declared: Option<[u64; 2]>,
    /// What is being read: draw, instance and part.
    draw: usize,
    instance: u64,
    part: usize,
    step: Option<Step>,
    /// Vertices and texture coordinates so far.
    vertices: u64,
    tex_coords: u64,
    /// A mesh that was unpacked last: mesh and primitive.
    decoded: Option<([usize; 2], Arc<Decoded>)>,
    /// Vertices that primitives use of those they share.
    used: HashMap<[usize; 2], Range<u64>>,
    rows: Rows,
    indices: Vec<u32>,
    /// Work done and in all, for progress.
    done: u64,
    work: u64,
    total_bytes: u64,
}

/// How far a primitive is.
struct Step {
    matrix: DAffine3,
    /// To turn normals; and whether the transform mirrors.
    normals: DMat3,
    is_mirrored: bool,
    /// Vertices of the primitive that are yet to come.
    vertices: Range<u64>,
    /// Its first vertex that is in the stream, and that vertex's number, and that of its texture coordinate.
    first: u64,
    base: u64,
    tex_base: u64,
    /// Triangles that are yet to come.
    triangles: Range<u64>,
    decoded: Option<Arc<Decoded>>,
}

/// Attributes of some vertices.
#[derive(Default)]
struct Rows {
    positions: Vec<[f64; 4]>,
    normals: Vec<[f64; 4]>,
    colors: Vec<[f64; 4]>,
    tex_coords: Vec<[f64; 4]>,
}

impl GltfStream {
    pub(super) fn new(data: Data, side: Box<dyn SideFiles>, total_bytes: u64) -> Result<Self, ImportError> {
        let draws = scene::draws(&data)?;
        let mut parts: HashMap<u32, Arc<Vec<Part>>> = HashMap::new();
        for draw in &draws {
            if let Entry::Vacant(entry) = parts.entry(draw.mesh) {
                entry.insert(Arc::new(scene::parts(&data, draw.mesh as usize)?));
            }
        }
        let all = || draws.iter().flat_map(|draw| parts[&draw.mesh].iter().map(move |part| (draw, part)));
        let semantics = |part: &Part| data.root.meshes[part.mesh].primitives[part.primitive].attributes;
        let attributes = Attributes {
            normals: all().next().is_some() && all().all(|(_, part)| semantics(part).normal.is_some()),
            colors: all().any(|(_, part)| part.color != [1.0; 3] || semantics(part).color.is_some()),
        };
        let sum = |count: fn(&Part) -> u64| {
            all().fold(0u64, |sum, (draw, part)| sum.saturating_add(count(part).saturating_mul(draw.instances)))
        };
        let [vertices, triangles] = [sum(|part| part.vertices), sum(Part::triangles)];
        let is_exact = all().all(|(_, part)| !part.is_packed && !part.is_shared);
        let declared = is_exact.then_some([vertices, triangles]);
        if is_exact && vertices >= u64::from(u32::MAX) {
            let place = crate::Place::byte(0);
            return Err(ImportError::malformed("fewer than 4294967295 vertices", vertices.to_string(), place));
        }
        let materials = scene::materials(&data.root);
        Ok(Self {
            data,
            side,
            draws,
            parts,
            materials,
            attributes,
            declared,
            draw: 0,
            instance: 0,
            part: 0,
            step: None,
            vertices: 0,
            tex_coords: 0,
            decoded: None,
            used: HashMap::new(),
            rows: Rows::default(),
            indices: Vec::new(),
            done: 0,
            work: vertices.saturating_add(triangles).max(1),
            total_bytes,
        })
    }

    /// Does a step; false after the last.
    fn advance(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        let Some(draw) = self.draws.get(self.draw) else { return Ok(false) };
        let parts = self.parts[&draw.mesh].clone();
        let Some(part) = parts.get(self.part) else {
            (self.part, self.instance) = (0, self.instance + 1);
            if self.instance >= draw.instances || parts.is_empty() {
                (self.draw, self.instance) = (self.draw + 1, 0);
            }
            return Ok(true);
        };
        if draw.instances == 0 {
            (self.draw, self.part) = (self.draw + 1, 0);
            return Ok(true);
        }
        let mut step = match self.step.take() {
            Some(step) => step,
            None => self.begin(part)?,
        };
        if !step.vertices.is_empty() {
            self.add_vertices(part, &mut step, batch)?;
        } else if !step.triangles.is_empty() {
            self.add_triangles(part, &mut step, batch)?;
        } else {
            self.part += 1;
            return Ok(true);
        }
        self.step = Some(step);
        Ok(true)
    }

    fn primitive(&self, part: &Part) -> &json::Primitive {
        &self.data.root.meshes[part.mesh].primitives[part.primitive]
    }

    /// Prepares a primitive of an instance.
    fn begin(&mut self, part: &Part) -> Result<Step, ImportError> {
        let draw = &self.draws[self.draw];
        let mut matrix = draw.matrix;
        if let Some(attributes) = scene::instancing(&self.data.root.nodes[draw.node as usize]) {
            let mut row = |accessor: Option<usize>, default: [f64; 4]| -> Result<[f64; 4], ImportError> {
                let Some(accessor) = accessor else { return Ok(default) };
                self.data.read(accessor, self.instance, 1, &mut self.rows.positions)?;
                Ok(self.rows.positions[0])
            };
            let [tx, ty, tz, _] = row(attributes.translation, [0.0; 4])?;
            let rotation = row(attributes.rotation, [0.0, 0.0, 0.0, 1.0])?;
            let [sx, sy, sz, _] = row(attributes.scale, [1.0; 4])?;
            matrix = draw.matrix * scene::transform([tx, ty, tz], rotation, [sx, sy, sz]);
            if !matrix.is_finite() {
                let place = item("instance", self.instance as usize);
                return Err(ImportError::malformed("a finite transform", "another", place));
            }
        }
        let decoded = if part.is_packed { Some(self.decode(part)?) } else { None };
        let (mut vertices, triangles) = match &decoded {
            Some(decoded) => (0..decoded.positions.len() as u64, 0..decoded.triangles.len() as u64),
            None => (0..part.vertices, 0..part.triangles()),
        };
        if part.is_shared {
            vertices = self.used_vertices(part)?;
        }
        let count = vertices.end - vertices.start;
        if self.vertices + count >= u64::from(u32::MAX) {
            let found = (self.vertices + count).to_string();
            return Err(ImportError::malformed("fewer than 4294967295 vertices", found, item("mesh", part.mesh)));
        }
        let linear = matrix.matrix3;
        let determinant = linear.determinant();
        // The inverse transpose, but for its length.
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let normals = DMat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        ) * sign;
        Ok(Step {
            matrix,
            normals,
            is_mirrored: determinant < 0.0,
            first: vertices.start,
            vertices,
            base: self.vertices,
            tex_base: self.tex_coords,
            triangles,
            decoded,
        })
    }

    fn decode(&mut self, part: &Part) -> Result<Arc<Decoded>, ImportError> {
        let key = [part.mesh, part.primitive];
        if let Some((of, decoded)) = &self.decoded
            && *of == key
        {
            return Ok(decoded.clone());
        }
        self.decoded = None;
        let extensions = self.data.root.meshes[part.mesh].primitives[part.primitive].extensions.take();
        let draco = extensions.as_ref().and_then(|it| it.draco.as_ref()).expect("it is packed");
        let result = draco::decode(&mut self.data, draco, part.tex_coord);
        self.data.root.meshes[part.mesh].primitives[part.primitive].extensions = extensions;
        let decoded = Arc::new(result?);
        self.decoded = Some((key, decoded.clone()));
        Ok(decoded)
    }

    /// From the least to the greatest vertex that a primitive names.
    fn used_vertices(&mut self, part: &Part) -> Result<Range<u64>, ImportError> {
        let key = [part.mesh, part.primitive];
        if let Some(range) = self.used.get(&key) {
            return Ok(range.clone());
        }
        let Some(accessor) = self.primitive(part).indices else { return Ok(0..part.vertices) };
        let (mut low, mut high) = (u64::MAX, 0);
        for first in (0..part.indices).step_by(STEP as usize) {
            let count = STEP.min(part.indices - first) as usize;
            self.data.read_indices(accessor, first, count, part.vertices, &mut self.indices)?;
            for &index in &self.indices {
                low = low.min(index.into());
                high = high.max(u64::from(index) + 1);
            }
        }
        self.used.insert(key, low..high);
        Ok(low..high)
    }

    fn add_vertices(&mut self, part: &Part, step: &mut Step, batch: &mut Batch) -> Result<(), ImportError> {
        let room = (Batch::TARGET - batch.vertices.positions.len()) as u64;
        let count = STEP.min(room).min(step.vertices.end - step.vertices.start);
        let first = step.vertices.start;
        let attributes = self.primitive(part).attributes;
        let Self { data, rows, .. } = self;
        match &step.decoded {
            Some(decoded) => rows.take(decoded, first as usize..(first + count) as usize),
            None => {
                let mut read = |accessor: Option<usize>, rows: &mut Vec<[f64; 4]>| match accessor {
                    Some(accessor) => data.read(accessor, first, count as usize, rows),
                    None => {
                        rows.clear();
                        Ok(())
                    }
                };
                read(attributes.position, &mut rows.positions)?;
                read(attributes.normal.filter(|_| self.attributes.normals), &mut rows.normals)?;
                read(attributes.color, &mut rows.colors)?;
                read(part.tex_coord, &mut rows.tex_coords)?;
            }
        }
        let vertices = &mut batch.vertices;
        for (number, &[x, y, z, _]) in (first..).zip(&rows.positions) {
            let position = step.matrix.transform_point3(DVec3::new(x, y, z));
            if !position.is_finite() {
                let place = item("mesh", part.mesh).of_item("position", number);
                return Err(ImportError::new(Problem::NotFinite { position: [x, y, z] }, Some(place)));
            }
            vertices.positions.push(position);
        }
        if self.attributes.normals {
            let turned = |&[x, y, z, _]: &[f64; 4]| {
                let normal = (step.normals * DVec3::new(x, y, z)).as_vec3();
                if normal.is_finite() { normal } else { Vec3::ZERO }
            };
            vertices.normals.extend(rows.normals.iter().map(turned));
            vertices.normals.resize(vertices.positions.len(), Vec3::ZERO);
        }
        if self.attributes.colors {
            let color = |row: &[f64; 4]| std::array::from_fn(|axis| scene::srgb8(row[axis] * part.color[axis]));
            vertices.colors.extend(rows.colors.iter().map(color));
            vertices.colors.resize(vertices.positions.len(), color(&[1.0; 4]));
        }
        batch.tex_coords.extend(rows.tex_coords.iter().map(|&[u, v, ..]| part.transform.apply(u, v)));
        self.tex_coords += rows.tex_coords.len() as u64;
        self.vertices += count;
        self.done += count;
        step.vertices.start += count;
        Ok(())
    }

    fn add_triangles(&mut self, part: &Part, step: &mut Step, batch: &mut Batch) -> Result<(), ImportError> {
        let room = (Batch::TARGET - batch.triangles.len()) as u64;
        let count = STEP.min(room).min(step.triangles.end - step.triangles.start);
        let first = step.triangles.start;
        step.triangles.start += count;
        self.done += count;
        let has_tex_coords = self.tex_coords > step.tex_base;
        let (base, tex_base) = (step.base, step.tex_base);
        let (start, is_mirrored, material) = (step.first, step.is_mirrored, part.material);
        let mut push = |mut corners: [u64; 3]| {
            if is_mirrored {
                corners.swap(1, 2);
            }
            let number = |base: u64| corners.map(|corner| (corner - start + base) as u32);
            let carried = if has_tex_coords { number(tex_base) } else { [CornerBatch::NONE; 3] };
            batch.push_triangle(number(base), carried, material);
        };
        if let Some(decoded) = &step.decoded {
            let range = first as usize..(first + count) as usize;
            decoded.triangles[range].iter().for_each(|corners| push(corners.map(u64::from)));
            return Ok(());
        }
        // Indices of the range: for a fan, the first of all comes first.
        let (from, length) = match part.topology {
            Topology::List => (3 * first, 3 * count),
            Topology::Strip => (first, count + 2),
            Topology::Fan | Topology::Points => (first + 1, count + 1),
        };
        let mut hub = 0;
        match self.primitive(part).indices {
            Some(accessor) => {
                if part.topology == Topology::Fan {
                    self.data.read_indices(accessor, 0, 1, part.vertices, &mut self.indices)?;
                    hub = self.indices[0].into();
                }
                self.data.read_indices(accessor, from, length as usize, part.vertices, &mut self.indices)?;
            }
            None => {
                self.indices.clear();
                self.indices.extend((from..from + length).map(|index| index as u32));
            }
        }
        let index = |at: u64| u64::from(self.indices[at as usize]);
        for triangle in 0..count {
            match part.topology {
                Topology::List => push([index(3 * triangle), index(3 * triangle + 1), index(3 * triangle + 2)]),
                Topology::Strip => {
                    let [a, b, c] = [index(triangle), index(triangle + 1), index(triangle + 2)];
                    if a != b && b != c && a != c {
                        push(if (first + triangle).is_multiple_of(2) { [a, b, c] } else { [b, a, c] });
                    }
                }
                Topology::Fan | Topology::Points => push([hub, index(triangle), index(triangle + 1)]),
            }
        }
        Ok(())
    }
}

impl Rows {
    /// Takes a range of a mesh that is in memory.
    fn take(&mut self, decoded: &Decoded, range: Range<usize>) {
        fn fill<const N: usize>(rows: &mut Vec<[f64; 4]>, values: &[[f32; N]], range: Range<usize>) {
            rows.clear();
            let values = values.get(range).unwrap_or_default();
            rows.extend(values.iter().map(|value| {
                let mut row = [0.0; 4];
                row.iter_mut().zip(value).for_each(|(row, &value)| *row = value.into());
                row
            }));
        }
        fill(&mut self.positions, &decoded.positions, range.clone());
        fill(&mut self.normals, &decoded.normals, range.clone());
        fill(&mut self.colors, &decoded.colors, range.clone());
        fill(&mut self.tex_coords, &decoded.tex_coords, range);
    }
}

impl ModelStream for GltfStream {
    fn attributes(&self) -> Attributes {
        self.attributes
    }

    fn unit(&self) -> Option<LengthUnit> {
        Some(LengthUnit::Metre)
    }

    fn materials(&self) -> &[Material] {
        &self.materials
    }

    fn open_picture(&mut self, _material: u32, texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        match texture {
            Texture::File(name) => {
                self.side.open(name).map_err(|source| ImportError::new(Problem::Io { source }, None))
            }
            Texture::Embedded(number) => {
                let bytes = self.data.buffers.picture(&self.data.root, *number as usize)?;
                Ok(Box::new(Cursor::new(bytes)))
            }
        }
    }

    fn declared_vertices(&self) -> Option<u64> {
        self.declared.map(|[vertices, _]| vertices)
    }

    fn declared_faces(&self) -> Option<u64> {
        self.declared.map(|[_, faces]| faces)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while !batch.is_full() && self.advance(batch)? {}
        Ok(!batch.is_empty())
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        let share = (self.done as f64 / self.work as f64).min(1.0);
        ((self.total_bytes as f64 * share) as u64, self.total_bytes)
    }
}
