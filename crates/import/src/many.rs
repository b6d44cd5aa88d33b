//! Several files as one model.
//!
//! In: how to open each of them. Out: one [`ModelStream`] over all, in the order given: vertices, texture coordinates and
//! materials are numbered on from one file to the next. A file is opened once for what its header says, closed, and opened again
//! when its turn comes, so that one is open at a time however many there are; a third time, when its pictures are asked for.
//!
//! What always holds: the files are all meshes or all point clouds, say the same direction for the sky (unless it is given), the
//! same unit, and the same system of coordinates as far as they say one; else the first that differs is refused by name.
//! Errors say which file they are of. What [`ModelStream`] promises holds for the whole.

use crate::{
    Attributes, Batch, ByteSource, CornerBatch, ImportError, Material, ModelStream, ReferenceSystem, Shared, Texture,
    error::Problem,
};
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use glam::Vec3;

/// Opens a file; asked twice, and again for pictures.
pub type OpenPart = Box<dyn FnMut() -> Result<Box<dyn ModelStream>, ImportError> + Send>;

/// One of several files.
pub struct Part {
    /// What errors call it.
    pub name: String,
    /// Opens it, from its beginning.
    pub open: OpenPart,
}

/// What holds for all files together.
#[derive(Clone, Copy, Debug)]
pub struct Together {
    /// The direction of the sky, whatever the files say.
    pub up: Option<UpAxis>,
    /// What a length of 1 is, whatever the files say.
    pub unit: Option<LengthUnit>,
    /// 8-bit sRGB: of vertices from files without colours, where others have them.
    pub plain_color: [u8; 3],
}

/// Opens several files as one model. A single one is what [`Part::open`] gives, but for what [`ImportError::file`] says.
///
/// # Errors
/// One of them cannot be opened, or does not go with those before.
pub fn open_all(mut parts: Vec<Part>, together: &Together) -> Result<Box<dyn ModelStream>, ImportError> {
    let mut facts = Facts::new(*together);
    for part in &mut parts {
        let stream = (part.open)().map_err(|error| error.of_file(&part.name))?;
        facts.add(&*stream, &part.name).map_err(|error| error.of_file(&part.name))?;
    }
    parts.reverse();
    Ok(Box::new(Many {
        to_come: parts,
        facts,
        materials: Vec::new(),
        textures: Vec::new(),
        current: None,
        done: Vec::new(),
        asked: None,
        vertices: 0,
        tex_coords: 0,
        bytes: 0,
    }))
}

/// What the headers say.
struct Facts {
    together: Together,
    colors: bool,
    /// Of any file, and of all that may have vertices.
    any_normals: bool,
    all_normals: bool,
    may_be_mesh: bool,
    up: Option<(UpAxis, String)>,
    unit: Option<(LengthUnit, String)>,
    epsg: Option<(u32, String)>,
    /// The first that says most.
    system: Option<ReferenceSystem>,
    kind: Option<(Kind, String)>,
    vertices: Option<u64>,
    faces: Option<u64>,
    bytes: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Mesh,
    Cloud,
}

/// Notes what a file says, or compares it with what an earlier one did.
fn agree<T: PartialEq>(
    known: &mut Option<(T, String)>,
    found: T,
    name: &str,
    what: Shared,
    words: impl Fn(&T) -> String,
) -> Result<(), ImportError> {
    match known {
        Some((expected, first)) if *expected != found => {
            let (expected, found, first) = (words(expected), words(&found), first.clone());
            Err(ImportError::new(Problem::Differs { what, expected, first, found }, None))
        }
        Some(_) => Ok(()),
        None => {
            *known = Some((found, name.to_owned()));
            Ok(())
        }
    }
}

impl Facts {
    fn new(together: Together) -> Self {
        Self {
            together,
            colors: false,
            any_normals: false,
            all_normals: true,
            may_be_mesh: false,
            up: None,
            unit: None,
            epsg: None,
            system: None,
            kind: None,
            vertices: Some(0),
            faces: Some(0),
            bytes: 0,
        }
    }

    fn add(&mut self, stream: &dyn ModelStream, name: &str) -> Result<(), ImportError> {
        let Attributes { normals, colors } = stream.attributes();
        let [vertices, faces] = [stream.declared_vertices(), stream.declared_faces()];
        self.bytes += stream.bytes_consumed().1;
        let sum = |sum: Option<u64>, more: Option<u64>| sum?.checked_add(more?);
        (self.vertices, self.faces) = (sum(self.vertices, vertices), sum(self.faces, faces));
        if vertices == Some(0) {
            return Ok(()); // Nothing that could differ.
        }
        self.colors |= colors;
        self.any_normals |= normals;
        self.all_normals &= normals;
        self.may_be_mesh |= faces != Some(0);
        match faces {
            Some(0) => self.is_kind(Kind::Cloud, name)?,
            Some(_) => self.is_kind(Kind::Mesh, name)?,
            None => {}
        }
        if self.together.up.is_none() {
            agree(&mut self.up, stream.up_axis(), name, Shared::Up, |up| format!("{up:?} upwards").to_lowercase())?;
        }
        if let (Some(unit), None) = (stream.unit(), self.together.unit) {
            agree(&mut self.unit, unit, name, Shared::Unit, |unit| format!("lengths in {}", unit.symbol()))?;
        }
        if let Some(system) = stream.reference_system() {
            // Names and texts differ with the program that wrote them.
            if let Some(epsg) = system.epsg {
                let what = Shared::ReferenceSystem;
                agree(&mut self.epsg, epsg, name, what, |epsg| format!("coordinates of EPSG:{epsg}"))?;
            }
            if self.system.as_ref().is_none_or(|known| known.epsg.is_none() && system.epsg.is_some()) {
                self.system = Some(system.clone());
            }
        }
        Ok(())
    }

    fn is_kind(&mut self, kind: Kind, name: &str) -> Result<(), ImportError> {
        agree(&mut self.kind, kind, name, Shared::Kind, |kind| match kind {
            Kind::Mesh => "triangles".to_owned(),
            Kind::Cloud => "points without triangles".to_owned(),
        })
    }

    /// A vertex of a mesh that has no normal gets it from its triangles; points are better off without any than with some.
    fn normals(&self) -> bool {
        if self.may_be_mesh { self.any_normals } else { self.any_normals && self.all_normals }
    }
}

struct Many {
    /// The next one last.
    to_come: Vec<Part>,
    facts: Facts,
    materials: Vec<Material>,
    /// What each of them has as its file says it, and which file that is.
    textures: Vec<(Option<Texture>, usize)>,
    current: Option<Current>,
    /// Files that are done, to be asked for pictures; and the one that was asked last.
    done: Vec<Part>,
    asked: Option<(usize, Box<dyn ModelStream>)>,
    /// Of files that are done.
    vertices: u64,
    tex_coords: u64,
    bytes: u64,
}

/// The file that is being read.
struct Current {
    part: Part,
    stream: Box<dyn ModelStream>,
    vertices: u64,
    tex_coords: u64,
    triangles: u64,
    /// Where its materials begin in those of all.
    first_material: usize,
}

impl Many {
    /// Makes a file's batch a part of the whole.
    fn place(&mut self, batch: &mut Batch) -> Result<(), ImportError> {
        let (colors, normals) = (self.facts.colors, self.facts.normals());
        let Self { current, materials, textures, done, vertices, tex_coords, facts, .. } = self;
        let Some(current) = current else { return Ok(()) };
        let count = batch.vertices.positions.len();
        if colors {
            batch.vertices.colors.resize(count, facts.together.plain_color);
        }
        match normals {
            true => batch.vertices.normals.resize(count, Vec3::ZERO),
            false => batch.vertices.normals.clear(),
        }
        current.vertices += count as u64;
        current.tex_coords += batch.tex_coords.len() as u64;
        current.triangles += batch.triangles.len() as u64;
        for (sum, what) in
            [(*vertices + current.vertices, "vertices"), (*tex_coords + current.tex_coords, "texture coordinates")]
        {
            if sum >= u64::from(u32::MAX) {
                let expected = format!("fewer than 4294967295 {what} in all files together");
                return Err(ImportError::new(Problem::Malformed { expected, found: format!("{sum} and more") }, None));
            }
        }
        // Corners name what the file has, perhaps later: below its own limits, and checked by its end.
        let add = |numbers: &mut [[u32; 3]], first: u64| {
            for number in numbers.as_flattened_mut().iter_mut().filter(|number| **number != CornerBatch::NONE) {
                *number = u32::try_from(first + u64::from(*number)).unwrap_or(CornerBatch::NONE);
            }
        };
        if *vertices > 0 {
            add(&mut batch.triangles, *vertices);
        }
        add(&mut batch.corners.tex_coords, *tex_coords);
        let of_file = current.stream.materials();
        for material in of_file.iter().skip(materials.len() - current.first_material) {
            textures.push((material.texture.clone(), done.len()));
            let texture = material.texture.clone().map(|texture| texture_of(texture, done.len(), &current.part.name));
            materials.push(Material { texture, ..material.clone() });
        }
        for material in batch.corners.materials.iter_mut().filter(|material| **material != CornerBatch::NONE) {
            *material += current.first_material as u32;
        }
        Ok(())
    }

    /// Reads on in the file that is open; false where it is at its end.
    fn read(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        let Some(current) = &mut self.current else { return Ok(false) };
        if current.stream.next(batch)? {
            self.place(batch)?;
            return Ok(true);
        }
        let Current { part, stream, vertices, tex_coords, triangles, .. } = current;
        self.vertices += *vertices;
        self.tex_coords += *tex_coords;
        self.bytes += stream.bytes_consumed().1;
        let (has_vertices, has_triangles, name) = (*vertices > 0, *triangles > 0, part.name.clone());
        self.done.extend(self.current.take().map(|current| current.part));
        match (has_vertices, has_triangles) {
            (false, _) => {}
            (_, true) => self.facts.is_kind(Kind::Mesh, &name).map_err(|error| error.of_file(&name))?,
            (_, false) => self.facts.is_kind(Kind::Cloud, &name).map_err(|error| error.of_file(&name))?,
        }
        Ok(false)
    }
}

/// What a file's texture is called among those of all: other files may have others under the same name.
fn texture_of(texture: Texture, part: usize, name: &str) -> Texture {
    match texture {
        texture if part == 0 => texture,
        Texture::File(file) => Texture::File(format!("{file} of {name}")),
        Texture::Embedded(number) => Texture::File(format!("{number} of {name}")),
    }
}

impl ModelStream for Many {
    fn attributes(&self) -> Attributes {
        Attributes { normals: self.facts.normals(), colors: self.facts.colors }
    }

    fn up_axis(&self) -> UpAxis {
        self.facts.together.up.or(self.facts.up.as_ref().map(|(up, _)| *up)).unwrap_or(UpAxis::Y)
    }

    fn unit(&self) -> Option<LengthUnit> {
        self.facts.together.unit.or(self.facts.unit.as_ref().map(|(unit, _)| *unit))
    }

    fn reference_system(&self) -> Option<&ReferenceSystem> {
        self.facts.system.as_ref()
    }

    fn materials(&self) -> &[Material] {
        &self.materials
    }

    fn open_picture(&mut self, material: u32, _texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        let Some((Some(texture), part)) = self.textures.get(material as usize) else {
            return Err(ImportError::no_picture(material));
        };
        if self.asked.as_ref().is_none_or(|(asked, _)| asked != part) {
            let Some(opened) = self.done.get_mut(*part).map(|part| (part.open)()) else {
                return Err(ImportError::no_picture(material));
            };
            self.asked = Some((*part, opened?));
        }
        match &mut self.asked {
            Some((_, stream)) => stream.open_picture(material, texture),
            None => Err(ImportError::no_picture(material)),
        }
    }

    fn declared_vertices(&self) -> Option<u64> {
        self.facts.vertices
    }

    fn declared_faces(&self) -> Option<u64> {
        self.facts.faces
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        loop {
            if self.current.is_none() {
                let Some(mut part) = self.to_come.pop() else {
                    batch.clear();
                    return Ok(false);
                };
                let stream = (part.open)().map_err(|error| error.of_file(&part.name))?;
                self.current = Some(Current {
                    part,
                    stream,
                    vertices: 0,
                    tex_coords: 0,
                    triangles: 0,
                    first_material: self.materials.len(),
                });
            }
            match self.read(batch) {
                Ok(true) => return Ok(true),
                Ok(false) => {}
                Err(error) => {
                    return Err(match &self.current {
                        Some(current) => error.of_file(&current.part.name),
                        None => error,
                    });
                }
            }
        }
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        let current = self.current.as_ref().map_or(0, |current| current.stream.bytes_consumed().0);
        ((self.bytes + current).min(self.facts.bytes), self.facts.bytes)
    }
}
