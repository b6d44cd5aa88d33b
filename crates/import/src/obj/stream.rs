//! Walks the lines of a file and fills batches.

use super::{
    face::{self, Corner, Counts, out_of_range},
    has_colors,
    material::Materials,
};
use crate::{
    Attributes, Batch, ByteSource, CornerBatch, ImportError, Material, ModelStream, Place, SideFiles, Texture,
    error::Problem,
    input::Input,
    polygon::Clipper,
    positions::Positions,
    text::{Lines, numbers, word},
};
use glam::DVec3;

pub(super) struct ObjStream {
    input: Input,
    lines: Lines,
    side: Box<dyn SideFiles>,
    colors: bool,
    positions: Positions,
    /// Counts of `vt` and `vn`.
    tex_coords: u64,
    normals: u64,
    materials: Materials,
    /// Number of the material in use, or [`CornerBatch::NONE`].
    material: u32,
    /// The greatest vertex and texture coordinate that a corner named before it came, and where; checked at the end.
    ahead: [Option<(u32, u64)>; 2],
    corners: Vec<Corner>,
    polygon: Vec<DVec3>,
    clipper: Clipper,
}

/// What a line of the file was.
enum Line {
    Done,
    /// A polygon of more than three corners, which are in `corners`: yet to be triangulated.
    Polygon,
    End,
}

impl ObjStream {
    /// `input` stands at the start of the file, with its first part in the window.
    pub(super) fn new(input: Input, side: Box<dyn SideFiles>) -> Self {
        let lines = Lines::continued(&input);
        let window = input.window();
        let colors = has_colors(&window[..window.len().min(crate::open::START_BYTES)], lines.line_end());
        let positions = Positions::new(lines.line_end(), position_of_line);
        Self {
            input,
            lines,
            side,
            colors,
            positions,
            tex_coords: 0,
            normals: 0,
            materials: Materials::default(),
            material: CornerBatch::NONE,
            ahead: [None; 2],
            corners: Vec::new(),
            polygon: Vec::new(),
            clipper: Clipper::default(),
        }
    }

    fn read_line(&mut self, batch: &mut Batch) -> Result<Line, ImportError> {
        let Self { input, lines, positions, .. } = self;
        lines.finish_line(input);
        let offset = input.offset();
        let Some(line) = lines.next(input)? else { return Ok(Line::End) };
        match line {
            [b'v', b' ' | b'\t', rest @ ..] => vertex(rest, self.colors, offset, positions, batch, lines)?,
            [b'f', b' ' | b'\t', rest @ ..] => {
                let counts = Counts { vertices: positions.len(), tex_coords: self.tex_coords, normals: self.normals };
                let place = lines.place();
                face::parse(rest, &counts, &mut self.corners, &place)?;
                return self.face(batch);
            }
            _ => {
                let Some((word, rest)) = word(line) else { return Ok(Line::Done) };
                match word {
                    b"v" => vertex(rest, self.colors, offset, positions, batch, lines)?,
                    b"vt" => {
                        let wrong =
                            |wrong: crate::text::Wrong| wrong.error("one to three numbers after `vt`", lines.place());
                        let ([u], rest) = numbers::<1>(rest).map_err(wrong)?;
                        let v = numbers::<1>(rest).map_or(0.0, |([v], _)| v);
                        let coord = [u as f32, v as f32];
                        batch.tex_coords.push(if coord.iter().all(|value| value.is_finite()) {
                            coord
                        } else {
                            [0.0; 2]
                        });
                        self.tex_coords += 1;
                        check_count(self.tex_coords, "texture coordinates", lines.place())?;
                    }
                    b"vn" => self.normals += 1,
                    b"f" | b"fo" => {
                        let counts =
                            Counts { vertices: positions.len(), tex_coords: self.tex_coords, normals: self.normals };
                        let place = lines.place();
                        face::parse(rest, &counts, &mut self.corners, &place)?;
                        return self.face(batch);
                    }
                    b"usemtl" => self.material = self.materials.number(rest).unwrap_or(CornerBatch::NONE),
                    b"mtllib" => self.materials.read_library(rest, &mut *self.side),
                    _ => {}
                }
            }
        }
        Ok(Line::Done)
    }

    /// Takes the face whose corners were parsed.
    #[inline]
    fn face(&mut self, batch: &mut Batch) -> Result<Line, ImportError> {
        let counts = [self.positions.len(), self.tex_coords];
        let mut is_ahead = false;
        for corner in &self.corners {
            for part in 0..2 {
                if u64::from(corner[part]) >= counts[part] && corner[part] != CornerBatch::NONE {
                    is_ahead |= part == 0;
                    let here = Some((corner[part], self.lines.number()));
                    self.ahead[part] = self.ahead[part].filter(|&(number, _)| number >= corner[part]).or(here);
                }
            }
        }
        match *self.corners {
            [a, b, c] => {
                batch.push_triangle([a[0], b[0], c[0]], [a[1], b[1], c[1]], self.material);
                Ok(Line::Done)
            }
            [_, _] | [_] => Ok(Line::Done),
            _ if is_ahead => {
                let most = self.corners.iter().map(|corner| u64::from(corner[0]) + 1).max().unwrap_or_default();
                let found = format!("{most}");
                Err(out_of_range("vertex", counts[0], &found, self.lines.place()))
            }
            _ => Ok(Line::Polygon),
        }
    }

    fn polygon(&mut self, batch: &mut Batch) -> Result<(), ImportError> {
        let place = self.lines.place();
        self.lines.finish_line(&mut self.input);
        self.polygon.clear();
        for corner in &self.corners {
            self.polygon.push(self.positions.get(corner[0], &mut self.input, &place)?);
        }
        let Self { corners, clipper, material, .. } = self;
        clipper.triangulate(&self.polygon, |triangle| {
            let [a, b, c] = triangle.map(|corner| corners[corner]);
            batch.push_triangle([a[0], b[0], c[0]], [a[1], b[1], c[1]], *material);
        });
        Ok(())
    }

    /// Corners that were ahead of what they name: it must have come.
    fn check_ahead(&self) -> Result<(), ImportError> {
        let counts = [("vertex", self.positions.len()), ("texture coordinate", self.tex_coords)];
        for (ahead, (what, count)) in self.ahead.into_iter().zip(counts) {
            if let Some((number, line)) = ahead
                && u64::from(number) >= count
            {
                let found = (u64::from(number) + 1).to_string();
                return Err(out_of_range(what, count, &found, Place::line(line)));
            }
        }
        Ok(())
    }
}

/// Appends a vertex from what follows `v`.
#[inline]
fn vertex(
    line: &[u8],
    colors: bool,
    offset: u64,
    positions: &mut Positions,
    batch: &mut Batch,
    lines: &Lines,
) -> Result<(), ImportError> {
    let (position, rest) = numbers::<3>(line).map_err(|wrong| wrong.error("three numbers after `v`", lines.place()))?;
    let finite = DVec3::from_array(position);
    if !finite.is_finite() {
        return Err(ImportError::new(Problem::NotFinite { position }, Some(lines.place())));
    }
    positions.push(finite, offset);
    check_count(positions.len(), "vertices", lines.place())?;
    batch.vertices.positions.push(finite);
    if colors {
        batch.vertices.colors.push(numbers::<3>(rest).map_or([255; 3], |(color, _)| color8(color)));
    }
    Ok(())
}

/// From 0 to 1, or to 255 where any is above 1; NaN casts to 0.
fn color8(color: [f64; 3]) -> [u8; 3] {
    let full = if color.iter().any(|&value| value > 1.0) { 1.0 } else { 255.0 };
    color.map(|value| (value * full + 0.5) as u8)
}

fn check_count(count: u64, what: &str, place: Place) -> Result<(), ImportError> {
    if count < 1 << 32 {
        return Ok(());
    }
    Err(ImportError::malformed(format!("fewer than 4294967296 {what}"), "more", place))
}

fn position_of_line(line: &[u8]) -> Option<DVec3> {
    let (b"v", rest) = word(line)? else { return None };
    numbers::<3>(rest).ok().map(|(position, _)| DVec3::from_array(position))
}

impl ModelStream for ObjStream {
    fn attributes(&self) -> Attributes {
        Attributes { normals: false, colors: self.colors }
    }

    fn materials(&self) -> &[Material] {
        &self.materials.used
    }

    fn open_picture(&mut self, material: u32, texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        match texture {
            Texture::File(name) => {
                self.side.open(name).map_err(|source| ImportError::new(Problem::Io { source }, None))
            }
            Texture::Embedded(_) => Err(ImportError::no_picture(material)),
        }
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while !batch.is_full() {
            match self.read_line(batch)? {
                Line::Done => {}
                Line::Polygon => self.polygon(batch)?,
                Line::End => {
                    self.check_ahead()?;
                    if self.positions.len() == 0 {
                        return Err(ImportError::malformed("a vertex `v`", "none", self.lines.place()));
                    }
                    break;
                }
            }
        }
        Ok(!batch.is_empty())
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        self.input.progress()
    }
}
