//! PCD, the format of the Point Cloud Library: text, binary and compressed.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Points** become vertices, but for those that the format calls invalid: a position that is not finite. So a stream may
//!   have fewer than are declared, and declares nothing.
//! * **Fields** `x y z` of any number type; `normal_x normal_y normal_z`; `rgb` or `rgba`, four bytes blue, green, red and
//!   alpha, or `r g b`. Others are skipped.
//! * **Compressed** files have one block for each field: all of it is unpacked in memory, at most 512 MiB.
//! * The sky is up the z axis; the viewpoint is ignored.

use crate::{
    Attributes, Batch, ImportError, ModelStream, Place,
    error::shown,
    input::Input,
    number,
    text::{Lines, word, words},
};
use gigalod_geom::camera::UpAxis;
use glam::{DVec3, Vec3};

/// Most fields of a point, and most bytes.
const MOST_FIELDS: usize = 256;
const MOST_POINT_BYTES: usize = 64 << 10;
/// Most bytes of a compressed file's points.
const MOST_BYTES: usize = 512 << 20;

#[derive(Clone, Copy)]
struct Field {
    kind: u8,
    size: usize,
    count: usize,
    /// Where it is in a record of a binary file.
    offset: usize,
    /// Its word in a line.
    column: usize,
}

struct PcdStream {
    input: Input,
    lines: Lines,
    data: Data,
    position: [Field; 3],
    normal: Option<[Field; 3]>,
    color: Option<Color>,
    /// Bytes, and words, of a point.
    point_bytes: usize,
    point_words: usize,
    count: u64,
    read: u64,
}

enum Color {
    Packed(Field),
    Channels([Field; 3]),
}

enum Data {
    Text,
    Binary,
    /// Field after field, each for all points.
    Compressed(Vec<u8>),
}

/// True for text whose first word is one of the header's, or whose first comment says `.PCD`.
pub(crate) fn recognises(start: &[u8]) -> bool {
    let mut lines = start.split(|&byte| byte == b'\n' || byte == b'\r').filter(|line| !line.trim_ascii().is_empty());
    match lines.clone().find_map(word) {
        Some((b"VERSION", after)) => {
            word(after).is_some_and(|(version, _)| matches!(version, b"0.7" | b".7" | b"0.6" | b".6" | b"0.5" | b".5"))
        }
        Some((b"FIELDS" | b"COLUMNS", _)) => true,
        _ => lines.next().is_some_and(|line| line.starts_with(b"# .PCD")),
    }
}

/// Reads the header of a file that is [recognised](recognises).
pub(crate) fn open(mut input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    let mut lines = Lines::new(&input);
    let mut names: Vec<String> = Vec::new();
    let (mut sizes, mut kinds, mut counts): (Vec<usize>, Vec<u8>, Vec<usize>) = Default::default();
    let (mut size, mut points) = ([1u64; 2], None);
    let kind = loop {
        let Some(line) = lines.next(&mut input)? else {
            return Err(ImportError::truncated("the line `DATA`", lines.place()));
        };
        let Some((keyword, rest)) = word(line) else { continue };
        let malformed = |expected: &str| ImportError::malformed(expected, format!("`{}`", shown(line)), lines.place());
        let integers = |most: u64| -> Result<Vec<u64>, ImportError> {
            let parse = |word: &[u8]| std::str::from_utf8(word).ok()?.parse().ok().filter(|&value| value <= most);
            let list: Option<Vec<_>> = words(rest).take(MOST_FIELDS + 1).map(parse).collect();
            list.ok_or_else(|| malformed("whole numbers"))
        };
        let narrow = |list: Vec<u64>| list.into_iter().map(|value| value as usize).collect();
        match keyword {
            b"FIELDS" | b"COLUMNS" => {
                names =
                    words(rest).take(MOST_FIELDS + 1).map(|word| String::from_utf8_lossy(word).into_owned()).collect();
            }
            b"SIZE" => sizes = narrow(integers(8)?),
            b"TYPE" => kinds = words(rest).take(MOST_FIELDS + 1).map(|word| word[0]).collect(),
            b"COUNT" => counts = narrow(integers(MOST_POINT_BYTES as u64)?),
            b"WIDTH" | b"HEIGHT" => {
                let value = *integers(u64::from(u32::MAX))?.first().ok_or_else(|| malformed("a whole number"))?;
                size[usize::from(keyword == b"HEIGHT")] = value;
            }
            b"POINTS" => points = integers(u64::from(u32::MAX - 1))?.first().copied(),
            b"VERSION" | b"VIEWPOINT" => {}
            b"DATA" => match word(rest) {
                Some((kind @ (b"ascii" | b"binary" | b"binary_compressed"), _)) => break kind.to_vec(),
                _ => return Err(malformed("`DATA`, then ascii, binary or binary_compressed")),
            },
            _ => return Err(malformed("a line of the header of PCD")),
        }
    };
    if counts.is_empty() {
        counts = vec![1; names.len()];
    }
    let place = lines.place();
    if [sizes.len(), kinds.len(), counts.len()] != [names.len(); 3] || names.len() > MOST_FIELDS {
        let found = format!("{}, {}, {} and {}", names.len(), sizes.len(), kinds.len(), counts.len());
        return Err(ImportError::malformed("as many FIELDS as SIZE, TYPE and COUNT, at most 256", found, place));
    }
    let count = points.unwrap_or(size[0].saturating_mul(size[1]));
    if count >= u64::from(u32::MAX) {
        return Err(ImportError::malformed("fewer than 4294967295 points", count.to_string(), place));
    }
    let (mut point_bytes, mut point_words) = (0, 0);
    let mut fields = Vec::new();
    for ((size, kind), count) in sizes.into_iter().zip(kinds).zip(counts) {
        let is_known = matches!((kind, size), (b'F', 4 | 8) | (b'U' | b'I', 1 | 2 | 4 | 8));
        if !is_known {
            let found = format!("`{}` of {size}", shown(&[kind]));
            return Err(ImportError::malformed("TYPE F, U or I of SIZE 1, 2, 4 or 8 bytes", found, place));
        }
        fields.push(Field { kind, size, count, offset: point_bytes, column: point_words });
        point_bytes += size * count;
        point_words += count;
    }
    if point_bytes > MOST_POINT_BYTES {
        let expected = format!("points of at most {MOST_POINT_BYTES} bytes");
        return Err(ImportError::malformed(expected, point_bytes.to_string(), place));
    }
    let field = |name: &str| {
        let index = names.iter().position(|found| found == name)?;
        Some(fields[index]).filter(|field| field.count > 0)
    };
    let triple = |[a, b, c]: [&str; 3]| Some([field(a)?, field(b)?, field(c)?]);
    let Some(position) = triple(["x", "y", "z"]) else {
        let found = format!("`{}`", shown(names.join(" ").as_bytes()));
        return Err(ImportError::malformed("the fields `x`, `y` and `z`", found, place));
    };
    let packed = field("rgb").or(field("rgba")).filter(|field| field.size == 4).map(Color::Packed);
    let color = packed.or(triple(["r", "g", "b"]).map(Color::Channels));
    let normal = triple(["normal_x", "normal_y", "normal_z"]);
    lines.finish_line(&mut input);
    let data = match &kind[..] {
        b"ascii" => Data::Text,
        b"binary" => Data::Binary,
        _ => Data::Compressed(unpack(&mut input, point_bytes, count)?),
    };
    Ok(Box::new(PcdStream { input, lines, data, position, normal, color, point_bytes, point_words, count, read: 0 }))
}

/// Reads and unpacks the points of a compressed file.
fn unpack(input: &mut Input, point_bytes: usize, count: u64) -> Result<Vec<u8>, ImportError> {
    let place = Place::byte(input.offset());
    let ends = |input: &Input| {
        let end = Place::byte(input.offset() + input.window().len() as u64);
        ImportError::truncated("its compressed points are complete", end)
    };
    if !input.has(8)? {
        return Err(ends(input));
    }
    let word =
        |at: usize| u32::from_le_bytes(*input.window()[at..].first_chunk().expect("eight bytes are there")) as usize;
    let (packed_bytes, bytes) = (word(0), word(4));
    let needed = count.saturating_mul(point_bytes as u64);
    if bytes as u64 != needed {
        let expected = format!("{count} points of {point_bytes} bytes, {needed} bytes in all");
        return Err(ImportError::malformed(expected, bytes.to_string(), place));
    }
    if bytes > MOST_BYTES {
        let expected = format!("compressed points of at most {MOST_BYTES} bytes");
        return Err(ImportError::malformed(expected, bytes.to_string(), place));
    }
    input.consume(8);
    let mut packed = Packed { input, left: packed_bytes };
    // Not more than twice what comes is set aside.
    let mut out = Vec::new();
    let damaged = |at: u64| ImportError::malformed("sound LZF data", "damage", Place::byte(at));
    while out.len() < bytes {
        let Some(control) = packed.byte()? else { return Err(ends(packed.input)) };
        let at = packed.input.offset();
        if control < 32 {
            for _ in 0..=control {
                let Some(byte) = packed.byte()? else { return Err(ends(packed.input)) };
                out.push(byte);
            }
        } else {
            let mut length = usize::from(control >> 5);
            if length == 7 {
                let Some(more) = packed.byte()? else { return Err(ends(packed.input)) };
                length += usize::from(more);
            }
            let Some(low) = packed.byte()? else { return Err(ends(packed.input)) };
            let distance = (usize::from(control & 31) << 8) + usize::from(low) + 1;
            let Some(start) = out.len().checked_sub(distance) else { return Err(damaged(at)) };
            for from in start..start + length + 2 {
                out.push(out[from]);
            }
        }
        if out.len() > bytes {
            return Err(damaged(at));
        }
    }
    Ok(out)
}

/// Bytes of a compressed block.
struct Packed<'a> {
    input: &'a mut Input,
    left: usize,
}

impl Packed<'_> {
    #[inline]
    fn byte(&mut self) -> Result<Option<u8>, ImportError> {
        if self.left == 0 || !self.input.has(1)? {
            return Ok(None);
        }
        let byte = self.input.window()[0];
        self.input.consume(1);
        self.left -= 1;
        Ok(Some(byte))
    }
}

impl Field {
    /// The number in the bytes of one.
    fn decode(self, bytes: &[u8]) -> f64 {
        let mut wide = [0; 8];
        wide[..self.size].copy_from_slice(&bytes[..self.size]);
        let shift = 64 - 8 * self.size as u32;
        match (self.kind, self.size) {
            (b'F', 4) => f64::from(f32::from_le_bytes([wide[0], wide[1], wide[2], wide[3]])),
            (b'F', _) => f64::from_le_bytes(wide),
            (b'U', _) => u64::from_le_bytes(wide) as f64,
            _ => ((i64::from_le_bytes(wide) << shift) >> shift) as f64,
        }
    }

    /// The four bytes of a packed colour that was written as text: as a whole number, or as the `f32` of the same bits.
    fn packed(self, number: f64) -> [u8; 4] {
        if self.kind == b'F' { (number as f32).to_le_bytes() } else { (number as i64 as u32).to_le_bytes() }
    }
}

impl PcdStream {
    /// Takes a point whose fields `get` has, and whose packed colour `packed`.
    fn push(&self, get: impl Fn(Field) -> f64, packed: impl Fn(Field) -> [u8; 4], batch: &mut Batch) {
        let position = DVec3::from_array(self.position.map(&get));
        if !position.is_finite() {
            return;
        }
        let vertices = &mut batch.vertices;
        vertices.positions.push(position);
        if let Some(normal) = self.normal {
            let normal = Vec3::from_array(normal.map(|field| get(field) as f32));
            vertices.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
        }
        vertices.colors.extend(match &self.color {
            Some(Color::Packed(field)) => {
                let [blue, green, red, _] = packed(*field);
                Some([red, green, blue])
            }
            Some(Color::Channels(fields)) => Some(fields.map(|field| {
                let full = if field.kind == b'F' { 255.0 } else { 1.0 };
                (get(field) * full + 0.5) as u8
            })),
            None => None,
        });
    }

    fn truncated(&self, place: Place) -> ImportError {
        ImportError::truncated(format!("point {} of {} is complete", self.read, self.count), place)
    }

    /// Takes a point of a text file.
    fn read_line(&mut self, batch: &mut Batch) -> Result<(), ImportError> {
        let Self { input, lines, .. } = self;
        let Some(line) = lines.next(input)? else {
            let place = self.lines.place();
            return Err(self.truncated(place));
        };
        if word(line).is_none() {
            return Ok(());
        }
        let place = lines.place().of_item("point", self.read);
        let mut values = Vec::with_capacity(self.point_words);
        for word in words(line).take(self.point_words) {
            let value = number::parse(word).ok_or_else(|| {
                ImportError::malformed("numbers of a point", format!("`{}`", shown(word)), place.clone())
            })?;
            values.push(value);
        }
        if values.len() < self.point_words {
            let expected = format!("{} numbers of a point", self.point_words);
            return Err(ImportError::malformed(expected, values.len().to_string(), place));
        }
        self.push(|field| values[field.column], |field| field.packed(values[field.column]), batch);
        self.read += 1;
        Ok(())
    }
}

impl ModelStream for PcdStream {
    fn attributes(&self) -> Attributes {
        Attributes { normals: self.normal.is_some(), colors: self.color.is_some() }
    }

    fn up_axis(&self) -> UpAxis {
        UpAxis::Z
    }

    fn declared_faces(&self) -> Option<u64> {
        Some(0)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while self.read < self.count && !batch.is_full() {
            match &self.data {
                Data::Text => self.read_line(batch)?,
                Data::Binary => {
                    let bytes = self.point_bytes;
                    if !self.input.has(bytes)? {
                        let end = self.input.offset() + self.input.window().len() as u64;
                        return Err(self.truncated(Place::byte(end)));
                    }
                    let record = &self.input.window()[..bytes];
                    let four = |field: Field| *record[field.offset..].first_chunk().expect("it has four bytes");
                    self.push(|field| field.decode(&record[field.offset..]), four, batch);
                    self.input.consume(bytes);
                    self.read += 1;
                }
                Data::Compressed(all) => {
                    let at = |field: Field| {
                        let start = field.offset as u64 * self.count + self.read * (field.size * field.count) as u64;
                        &all[start as usize..]
                    };
                    let four = |field: Field| *at(field).first_chunk().expect("it has four bytes");
                    self.push(|field| field.decode(at(field)), four, batch);
                    self.read += 1;
                }
            }
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
