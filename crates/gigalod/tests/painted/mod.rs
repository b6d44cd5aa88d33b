//! Models with materials and textures for tests: in memory as a stream, and real ones with the files beside them.
#![allow(dead_code, reason = "each test file uses its own part")]

use gigalod::import::{
    Attributes, Batch, ByteSource, CornerBatch, ImportError, Material, ModelStream, NoSideFiles, Texture, read_all,
};
use gigalod::verify;
use gigalod_reference::Mesh;
use glam::{DVec3, Vec3};
use std::fs::File;
use std::io::{self, Cursor};
use std::path::Path;
use std::sync::Arc;

/// A model, whole.
#[derive(Clone, Debug, Default)]
pub(crate) struct Painted {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) tex_coords: Vec<[f32; 2]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// None, or one for each triangle.
    pub(crate) corners: Vec<[u32; 3]>,
    pub(crate) materials: Vec<u32>,
    pub(crate) looks: Vec<Material>,
    /// Files of embedded pictures.
    pub(crate) pictures: Vec<Arc<[u8]>>,
    /// Says how much there is before it comes.
    pub(crate) is_declared: bool,
    pub(crate) sent: usize,
}

impl Painted {
    /// Adds a parallelogram of two triangles with a material, its texture coordinates from 0 to 1 along both sides.
    pub(crate) fn wall(&mut self, corner: DVec3, sides: [DVec3; 2], material: u32) {
        let (first, first_coord) = (self.positions.len() as u32, self.tex_coords.len() as u32);
        self.positions.extend([corner, corner + sides[0], corner + sides[0] + sides[1], corner + sides[1]]);
        self.tex_coords.extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        for corners in [[0, 1, 2], [0, 2, 3]] {
            self.triangles.push(corners.map(|corner| first + corner));
            self.corners.push(corners.map(|corner| first_coord + corner));
            self.materials.push(material);
        }
    }

    /// Adds a picture of this size, and a material that shows it; returns the material's number.
    pub(crate) fn picture(&mut self, size: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> u32 {
        let mut picture = image::RgbaImage::new(size, size);
        picture.enumerate_pixels_mut().for_each(|(x, y, pixel)| pixel.0 = texel(x, y));
        let mut file = Cursor::new(Vec::new());
        picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
        let texture = Some(Texture::Embedded(self.pictures.len() as u32));
        self.pictures.push(file.into_inner().into());
        self.looks.push(Material { texture, ..Material::plain(String::new()) });
        self.looks.len() as u32 - 1
    }

    pub(crate) fn batch(&self) -> Batch {
        read_all(&mut self.clone(), &mut |_, _| {}).unwrap()
    }

    /// For the judge.
    pub(crate) fn mesh(&self) -> Mesh {
        let mesh = verify::mesh_of(self.batch()).unwrap();
        match verify::skin_of(&mut self.clone(), &self.batch()) {
            Some(skin) => mesh.with_skin(skin).unwrap(),
            None => mesh,
        }
    }

    /// The same, its vertices, texture coordinates and triangles in another order.
    pub(crate) fn shuffled(&self) -> Self {
        // A step without a common factor visits all.
        fn visit(count: usize) -> impl Iterator<Item = usize> {
            (0..count).map(move |at| (at * 1_000_003 + 17) % count)
        }
        fn ranks(count: usize) -> Vec<u32> {
            let mut ranks = vec![0; count];
            visit(count).zip(0..).for_each(|(at, rank)| ranks[at] = rank);
            ranks
        }
        fn permuted<T: Copy>(all: &[T]) -> Vec<T> {
            visit(all.len()).map(|at| all[at]).collect()
        }
        let renamed = |corners: &[[u32; 3]], ranks: &[u32]| -> Vec<[u32; 3]> {
            let name = |corner: u32| if corner == CornerBatch::NONE { corner } else { ranks[corner as usize] };
            permuted(corners).into_iter().map(|corners| corners.map(name)).collect()
        };
        Self {
            positions: permuted(&self.positions),
            normals: permuted(&self.normals),
            colors: permuted(&self.colors),
            tex_coords: permuted(&self.tex_coords),
            triangles: renamed(&self.triangles, &ranks(self.positions.len())),
            corners: renamed(&self.corners, &ranks(self.tex_coords.len())),
            materials: permuted(&self.materials),
            ..self.clone()
        }
    }
}

impl ModelStream for Painted {
    fn attributes(&self) -> Attributes {
        Attributes { normals: !self.normals.is_empty(), colors: !self.colors.is_empty() }
    }

    fn materials(&self) -> &[Material] {
        &self.looks
    }

    fn open_picture(&mut self, material: u32, texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        match texture {
            Texture::Embedded(number) if (*number as usize) < self.pictures.len() => {
                Ok(Box::new(Cursor::new(self.pictures[*number as usize].clone())))
            }
            // As another stream says it.
            _ => gigalod::import::open_with(Box::new(Cursor::new("v 0 0 0\n")), Box::new(NoSideFiles))?
                .open_picture(material, texture),
        }
    }

    fn declared_vertices(&self) -> Option<u64> {
        self.is_declared.then_some(self.positions.len() as u64)
    }

    fn declared_faces(&self) -> Option<u64> {
        self.is_declared.then_some(self.triangles.len() as u64)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        fn part<T: Copy>(all: &[T], sent: usize) -> &[T] {
            &all[sent.min(all.len())..(sent + 1000).min(all.len())]
        }
        batch.clear();
        let sent = self.sent;
        batch.vertices.positions.extend(part(&self.positions, sent));
        batch.vertices.normals.extend(part(&self.normals, sent));
        batch.vertices.colors.extend(part(&self.colors, sent));
        batch.tex_coords.extend(part(&self.tex_coords, sent));
        batch.triangles.extend(part(&self.triangles, sent));
        batch.corners.tex_coords.extend(part(&self.corners, sent));
        batch.corners.materials.extend(part(&self.materials, sent));
        self.sent += 1000;
        Ok(sent < self.positions.len().max(self.triangles.len()).max(self.tex_coords.len()))
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        (0, 0)
    }
}

/// A model that stays when a build is done with it: what a build allocates is then counted from the same base all the way.
pub(crate) struct Lent(pub(crate) &'static mut Painted);

impl ModelStream for Lent {
    fn attributes(&self) -> Attributes {
        self.0.attributes()
    }

    fn materials(&self) -> &[Material] {
        self.0.materials()
    }

    fn open_picture(&mut self, material: u32, texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        self.0.open_picture(material, texture)
    }

    fn declared_vertices(&self) -> Option<u64> {
        self.0.declared_vertices()
    }

    fn declared_faces(&self) -> Option<u64> {
        self.0.declared_faces()
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        self.0.next(batch)
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        self.0.bytes_consumed()
    }
}

/// Opens a model with the files in its folder.
pub(crate) fn open_beside(path: &Path) -> Box<dyn ModelStream> {
    let folder = path.parent().unwrap().to_owned();
    let side = move |name: &str| -> io::Result<Box<dyn ByteSource>> { Ok(Box::new(File::open(folder.join(name))?)) };
    gigalod::import::open_with(Box::new(File::open(path).unwrap()), Box::new(side)).unwrap()
}

/// A whole model with its textures. Where it has no normals of its own, triangles are flat, as where they are diced.
pub(crate) fn skinned_mesh(path: &Path) -> Mesh {
    let mut stream = open_beside(path);
    let mut all = read_all(&mut *stream, &mut |_, _| {}).unwrap();
    let skin = verify::skin_of(&mut *stream, &all).unwrap();
    if all.vertices.normals.is_empty() {
        let corners = || all.triangles.as_flattened().iter().map(|vertex| *vertex as usize);
        if !all.vertices.colors.is_empty() {
            all.vertices.colors = corners().map(|vertex| all.vertices.colors[vertex]).collect();
        }
        all.vertices.positions = corners().map(|vertex| all.vertices.positions[vertex]).collect();
        all.triangles = (0..all.triangles.len() as u32).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect();
    }
    verify::mesh_of(all).unwrap().with_skin(skin).unwrap()
}
