//! PTS, XYZ and their like: a point a line, as text.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Lines** with at least three numbers, separated by blanks, commas or semicolons, are points. Blank lines and those that
//!   begin with `#` are skipped, and so are lines with a single whole number: PTS files have the number of points there.
//! * **Columns**: a first line of words names them (`x y z r g b nx ny nz intensity`, in any order and case, with `//` or `"`
//!   around). Without it, x, y and z come first, and up to 1,000 lines at the beginning of the file tell what follows: three
//!   whole numbers from 0 to 255 are a colour, three numbers that make a unit vector a normal; the rest is skipped.
//! * **Colours** that are named and written with decimal points in the first line are from 0 to 1, others to 255.
//! * All points have the columns of the first; more are ignored. The sky is up the z axis. A position that is not finite is an
//!   error.

use crate::{
    Attributes, Batch, ImportError, ModelStream,
    error::{Problem, shown},
    input::Input,
    number::{self, is_blank},
    text::Lines,
};
use gigalod_geom::camera::UpAxis;
use glam::{DVec3, Vec3};

/// Columns that are looked at.
const MOST_COLUMNS: usize = 32;
/// Lines that tell what the columns are.
const SAMPLED_LINES: usize = 1000;

/// Which column is what.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Columns {
    position: [usize; 3],
    color: Option<[usize; 3]>,
    normal: Option<[usize; 3]>,
    /// Columns that a line must have.
    least: usize,
    /// What a colour is multiplied with for 255 to be full.
    color_scale: f64,
}

struct XyzStream {
    input: Input,
    lines: Lines,
    columns: Columns,
    points: u64,
    /// Line of the names of columns, if there is one; it is skipped.
    names_line: Option<u64>,
}

/// The words of a line.
fn fields(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|&byte| is_blank(byte) || byte == b',' || byte == b';').filter(|word| !word.is_empty())
}

fn is_comment(line: &[u8]) -> bool {
    line.trim_ascii_start().first().is_none_or(|&byte| byte == b'#')
}

/// The numbers of a line; none where one of its words is not a number.
fn numbers_of(line: &[u8]) -> Option<Vec<f64>> {
    fields(line).take(MOST_COLUMNS).map(number::parse).collect()
}

/// True for text whose first lines are points, perhaps after the names of columns or the number of points.
pub(crate) fn recognises(start: &[u8]) -> bool {
    let line_end = if start.contains(&b'\n') { b'\n' } else { b'\r' };
    let mut lines = start.split(|&byte| byte == line_end).filter(|line| !is_comment(line));
    let Some(first) = lines.next() else { return false };
    let is_point = |line: &[u8]| numbers_of(line).is_some_and(|numbers| numbers.len() >= 3);
    if is_point(first) {
        return true;
    }
    let count = numbers_of(first).filter(|numbers| numbers.len() == 1).map(|numbers| numbers[0]);
    let is_named = named_columns(first).is_some();
    match lines.find(|line| !line.is_empty()) {
        Some(second) => (count.is_some() || is_named) && is_point(second),
        // Any file with a number in it would be a count of points that do not come.
        None => count == Some(0.0) || is_named,
    }
}

/// Opens a file that is [recognised](recognises).
pub(crate) fn open(input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    let lines = Lines::new(&input);
    let window = input.window();
    let start = &window[..window.len().min(crate::open::START_BYTES)];
    let mut numbered = (1..).zip(start.split(|&byte| byte == lines.line_end())).filter(|(_, line)| !is_comment(line));
    let mut names_line = None;
    let mut named = None;
    let mut sample = Vec::new();
    for (number, line) in numbered.by_ref().take(SAMPLED_LINES) {
        match numbers_of(line) {
            None if named.is_none() && sample.is_empty() => {
                named = named_columns(line);
                names_line = named.is_some().then_some(number);
            }
            Some(numbers) if numbers.len() >= 3 => {
                if sample.is_empty()
                    && let Some(Columns { color: Some(color), color_scale, .. }) = &mut named
                {
                    let words: Vec<_> = fields(line).collect();
                    let is_unit =
                        color.iter().any(|&column| words.get(column).is_some_and(|word| word.contains(&b'.')));
                    *color_scale = if is_unit { 255.0 } else { 1.0 };
                }
                sample.push(numbers);
            }
            _ => {}
        }
    }
    // The last line of the window may be cut.
    if sample.len() > 1 && window.len() > start.len() {
        sample.pop();
    }
    let columns = named.unwrap_or_else(|| guessed_columns(&sample));
    Ok(Box::new(XyzStream { input, lines, columns, points: 0, names_line }))
}

/// From a line of names, if it has those of a position.
fn named_columns(line: &[u8]) -> Option<Columns> {
    let names: Vec<String> = fields(line)
        .take(MOST_COLUMNS)
        .map(|word| String::from_utf8_lossy(word).trim_matches(['/', '"', '\'', '#']).to_ascii_lowercase())
        .filter(|name| !name.is_empty())
        .collect();
    let column = |options: &[&str]| names.iter().position(|name| options.contains(&name.as_str()));
    let triple = |[a, b, c]: [&[&str]; 3]| Some([column(a)?, column(b)?, column(c)?]);
    let position = triple([&["x", "easting"], &["y", "northing"], &["z", "height", "elevation"]])?;
    let color = triple([&["r", "red"], &["g", "green"], &["b", "blue"]]);
    let normal =
        triple([&["nx", "normal_x", "normalx"], &["ny", "normal_y", "normaly"], &["nz", "normal_z", "normalz"]]);
    Some(Columns::new(position, color, normal))
}

/// From the values of some lines.
fn guessed_columns(sample: &[Vec<f64>]) -> Columns {
    let count = sample.iter().map(Vec::len).min().unwrap_or(3);
    let all = |test: &dyn Fn(&[f64]) -> bool, first: usize| {
        !sample.is_empty() && sample.iter().all(|line| test(&line[first..first + 3]))
    };
    let is_color = |triple: &[f64]| triple.iter().all(|&value| (0.0..=255.0).contains(&value) && value.fract() == 0.0);
    let is_normal = |triple: &[f64]| {
        let square: f64 = triple.iter().map(|value| value * value).sum();
        (0.97..1.03).contains(&square)
    };
    let triples = || (3..count.saturating_sub(2).max(3)).map(|first| [first, first + 1, first + 2]);
    let normal = triples().find(|&[first, ..]| all(&is_normal, first));
    let overlaps = |a: [usize; 3], b: [usize; 3]| a[0].abs_diff(b[0]) < 3;
    let color = triples()
        .filter(|&triple| normal.is_none_or(|normal| !overlaps(normal, triple)))
        // With an intensity before it that is a small whole number, too, the colour is the later one.
        .filter(|&[first, ..]| all(&is_color, first))
        .max_by_key(|&[first, ..]| first.min(4));
    Columns::new([0, 1, 2], color, normal)
}

impl Columns {
    fn new(position: [usize; 3], color: Option<[usize; 3]>, normal: Option<[usize; 3]>) -> Self {
        let used = position.iter().chain(color.iter().flatten()).chain(normal.iter().flatten());
        Self { position, color, normal, least: used.max().map_or(3, |&last| last + 1), color_scale: 1.0 }
    }
}

impl XyzStream {
    /// Takes a line; false after the last.
    fn read(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        let Self { input, lines, columns, .. } = self;
        let Some(line) = lines.next(input)? else { return Ok(false) };
        if is_comment(line) || self.names_line == Some(lines.number()) {
            return Ok(true);
        }
        let mut values = [0.0; MOST_COLUMNS];
        let mut count = 0;
        for word in fields(line).take(columns.least) {
            values[count] = number::parse(word).ok_or_else(|| {
                ImportError::malformed("numbers of a point", format!("`{}`", shown(word)), lines.place())
            })?;
            count += 1;
        }
        if count == 1 && values[0].fract() == 0.0 {
            return Ok(true);
        }
        if count < columns.least {
            let expected = format!("a point of {} numbers, as the first", columns.least);
            return Err(ImportError::malformed(expected, format!("{count} of them"), lines.place()));
        }
        let position = columns.position.map(|column| values[column]);
        let finite = DVec3::from_array(position);
        if !finite.is_finite() {
            return Err(ImportError::new(Problem::NotFinite { position }, Some(lines.place())));
        }
        self.points += 1;
        if self.points >= u64::from(u32::MAX) {
            return Err(ImportError::malformed("fewer than 4294967295 points", "more", lines.place()));
        }
        let vertices = &mut batch.vertices;
        vertices.positions.push(finite);
        if let Some(normal) = columns.normal {
            let normal = Vec3::from_array(normal.map(|column| values[column] as f32));
            vertices.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
        }
        if let Some(color) = columns.color {
            vertices.colors.push(color.map(|column| (values[column] * columns.color_scale + 0.5) as u8));
        }
        Ok(true)
    }
}

impl ModelStream for XyzStream {
    fn attributes(&self) -> Attributes {
        Attributes { normals: self.columns.normal.is_some(), colors: self.columns.color.is_some() }
    }

    fn up_axis(&self) -> UpAxis {
        UpAxis::Z
    }

    fn declared_faces(&self) -> Option<u64> {
        Some(0)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while !batch.is_full() && self.read(batch)? {}
        Ok(!batch.is_empty())
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        self.input.progress()
    }
}
