//! OFF, Geomview's text format, with its variants COFF, NOFF, STOFF and their combinations.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Lines**: `#` begins a comment; blank lines are skipped. The numbers of vertices, faces and edges follow the first word,
//!   on its line or the next; the third may be missing. Then each vertex and each face has its line, and what follows the last
//!   is ignored.
//! * **Vertices** are `x y z`, then `nx ny nz` in NOFF, then a colour in COFF, then `s t` in STOFF. A colour is `r g b` with or
//!   without alpha: from 0 to 1 if the first vertex's is written with a decimal point, else from 0 to 255.
//! * **Faces** are a number of corners, and the corners; colours after them are ignored. Polygons are triangulated by clipping
//!   ears; fewer than three corners make no triangle.
//! * **4OFF and nOFF**, points of other dimensions, and **binary** files are refused.

use crate::{
    Attributes, Batch, CornerBatch, ImportError, ModelStream,
    error::{Problem, shown},
    input::Input,
    polygon::Clipper,
    positions::Positions,
    text::{Lines, Wrong, numbers, word, words},
};
use glam::{DVec3, Vec3};

struct OffStream {
    input: Input,
    lines: Lines,
    /// Which of ST, C and N the first word has.
    tex_coords: bool,
    colors: bool,
    normals: bool,
    vertex_count: u64,
    face_count: u64,
    positions: Positions,
    faces: u64,
    /// What stands for 255; from the first vertex.
    full: Option<f64>,
    corners: Vec<u32>,
    polygon: Vec<DVec3>,
    clipper: Clipper,
}

/// The first word of a file: prefixes, then `OFF`.
struct Keyword {
    tex_coords: bool,
    colors: bool,
    normals: bool,
    dimensions: bool,
}

impl Keyword {
    fn parse(word: &[u8]) -> Option<Self> {
        let mut rest = word.strip_suffix(b"OFF")?;
        let mut take = |prefix: &[u8]| match rest.strip_prefix(prefix) {
            Some(after) => {
                rest = after;
                true
            }
            None => false,
        };
        let (tex_coords, colors, normals) = (take(b"ST"), take(b"C"), take(b"N"));
        let (four, n) = (take(b"4"), take(b"n"));
        rest.is_empty().then_some(Self { tex_coords, colors, normals, dimensions: four || n })
    }
}

/// True for text whose first word is a kind of `OFF`.
pub(crate) fn recognises(start: &[u8]) -> bool {
    let mut lines = start.split(|&byte| byte == b'\n' || byte == b'\r');
    lines.find_map(word).is_some_and(|(word, _)| Keyword::parse(word).is_some())
}

/// Reads the header of a file that is [recognised](recognises).
pub(crate) fn open(mut input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    let mut lines = Lines::new(&input);
    let mut keyword: Option<Keyword> = None;
    let [vertex_count, face_count] = loop {
        let Some(line) = lines.next(&mut input)? else {
            return Err(ImportError::truncated("the numbers of vertices and faces", lines.place()));
        };
        let Some((first, after)) = word(line) else { continue };
        let place = lines.place();
        let counts = match keyword {
            Some(_) => line,
            None => {
                let found = Keyword::parse(first).filter(|keyword| !keyword.dimensions);
                let Some(found) = found else {
                    let found = format!("`{}`", shown(first));
                    return Err(ImportError::malformed("OFF with points of three dimensions", found, place));
                };
                keyword = Some(found);
                match word(after) {
                    Some((b"BINARY", _)) => {
                        return Err(ImportError::malformed("OFF as text", "the word `BINARY`", place));
                    }
                    Some(_) => after,
                    None => continue,
                }
            }
        };
        let wrong = |wrong: Wrong| wrong.error("the numbers of vertices and faces", lines.place());
        let (counts, _) = numbers::<2>(counts).map_err(wrong)?;
        for count in counts {
            if !(0.0..4_294_967_295.0).contains(&count) || count.fract() != 0.0 {
                return Err(ImportError::malformed("a count below 4294967295", count.to_string(), place));
            }
        }
        break counts.map(|count| count as u64);
    };
    let Keyword { tex_coords, colors, normals, .. } = keyword.expect("it was on the way here");
    let positions = Positions::new(lines.line_end(), position_of_line);
    Ok(Box::new(OffStream {
        input,
        lines,
        tex_coords,
        colors,
        normals,
        vertex_count,
        face_count,
        positions,
        faces: 0,
        full: None,
        corners: Vec::new(),
        polygon: Vec::new(),
        clipper: Clipper::default(),
    }))
}

fn position_of_line(line: &[u8]) -> Option<DVec3> {
    numbers::<3>(line).ok().map(|(position, _)| DVec3::from_array(position))
}

impl OffStream {
    /// Takes the next vertex or face.
    fn read(&mut self, batch: &mut Batch) -> Result<(), ImportError> {
        let Self { input, lines, .. } = self;
        let offset = loop {
            lines.finish_line(input);
            let offset = input.offset();
            match lines.next(input)? {
                None => {
                    let vertex = self.positions.len();
                    let before = if vertex < self.vertex_count {
                        format!("vertex {vertex} of {} is complete", self.vertex_count)
                    } else {
                        format!("face {} of {} is complete", self.faces, self.face_count)
                    };
                    return Err(ImportError::truncated(before, lines.place()));
                }
                Some(line) if word(line).is_none() => {}
                Some(_) => break offset,
            }
        };
        let line = lines.current(input);
        if self.positions.len() < self.vertex_count {
            let place = lines.place().of_item("vertex", self.positions.len());
            let wrong = |expected: &'static str| {
                let place = place.clone();
                move |wrong: Wrong| wrong.error(expected, place)
            };
            let (position, mut rest) = numbers::<3>(line).map_err(wrong("three numbers of a position"))?;
            let finite = DVec3::from_array(position);
            if !finite.is_finite() {
                return Err(ImportError::new(Problem::NotFinite { position }, Some(place)));
            }
            if self.normals {
                let (normal, after) = numbers::<3>(rest).map_err(wrong("three numbers of a normal"))?;
                let normal = Vec3::from_array(normal.map(|value| value as f32));
                batch.vertices.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
                rest = after;
            }
            if self.colors {
                let full = *self.full.get_or_insert_with(|| {
                    let is_unit = words(rest).take(3).any(|word| word.contains(&b'.'));
                    if is_unit { 255.0 } else { 1.0 }
                });
                let (color, after) = numbers::<3>(rest).map_err(wrong("three numbers of a colour"))?;
                batch.vertices.colors.push(color.map(|value| (value * full + 0.5) as u8));
                // Alpha is there if more follows than the texture coordinates.
                let follow = words(after).count();
                let alpha = follow > if self.tex_coords { 2 } else { 0 };
                rest = if alpha { word(after).map_or(after, |(_, rest)| rest) } else { after };
            }
            if self.tex_coords {
                let (coord, _) = numbers::<2>(rest).map_err(wrong("two numbers of a texture coordinate"))?;
                let coord = coord.map(|value| value as f32);
                batch.tex_coords.push(if coord.iter().all(|value| value.is_finite()) { coord } else { [0.0; 2] });
            }
            self.positions.push(finite, offset);
            batch.vertices.positions.push(finite);
            return Ok(());
        }
        let place = lines.place().of_item("face", self.faces);
        let malformed = |expected: &str, found: String| Err(ImportError::malformed(expected, found, place.clone()));
        let mut words = words(line);
        let length = words.next().and_then(integer);
        let Some(length) = length else {
            return malformed("a number of corners", format!("`{}`", shown(line)));
        };
        self.corners.clear();
        for corner in 0..length {
            let Some(word) = words.next() else {
                return malformed(&format!("{length} corners"), corner.to_string());
            };
            match integer(word) {
                Some(vertex) if vertex < self.vertex_count => self.corners.push(vertex as u32),
                _ => {
                    let expected = format!("a vertex number below {}", self.vertex_count);
                    return malformed(&expected, format!("`{}`", shown(word)));
                }
            }
        }
        drop(words);
        self.faces += 1;
        lines.finish_line(input);
        self.polygon.clear();
        if self.corners.len() > 3 {
            for &vertex in &self.corners {
                self.polygon.push(self.positions.get(vertex, input, &place)?);
            }
        } else {
            self.polygon.resize(self.corners.len(), DVec3::ZERO);
        }
        let Self { corners, clipper, tex_coords, .. } = self;
        clipper.triangulate(&self.polygon, |triangle| {
            let triangle = triangle.map(|corner| corners[corner]);
            let carried = if *tex_coords { triangle } else { [CornerBatch::NONE; 3] };
            batch.push_triangle(triangle, carried, CornerBatch::NONE);
        });
        Ok(())
    }
}

/// A whole number of at most nine digits.
fn integer(word: &[u8]) -> Option<u64> {
    let is_number = (1..11).contains(&word.len()) && word.iter().all(u8::is_ascii_digit);
    is_number.then(|| word.iter().fold(0, |number, digit| number * 10 + u64::from(digit - b'0')))
}

impl ModelStream for OffStream {
    fn attributes(&self) -> Attributes {
        Attributes { normals: self.normals, colors: self.colors }
    }

    fn declared_vertices(&self) -> Option<u64> {
        Some(self.vertex_count)
    }

    fn declared_faces(&self) -> Option<u64> {
        Some(self.face_count)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while !batch.is_full() && (self.positions.len() < self.vertex_count || self.faces < self.face_count) {
            self.read(batch)?;
        }
        if batch.is_empty() {
            self.input.finish()?;
        }
        Ok(!batch.is_empty())
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        self.input.progress()
    }
}
