//! A picture becomes tiles: itself, and halved again and again down to one texel.
//!
//! In: a PNG or JPEG file. Out: for each level its size and where its tiles are in the spool. Means are taken in linear light, and
//! where alpha counts, by opacity; the opacity of a mean is the greatest, so that what is thin does not vanish.

use super::Texel;
use crate::spool::Spool;
use gigalod_geom::color::{LINEAR_OF_SRGB8, srgb8_of_linear};
use gigalod_import::ByteSource;
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageFormat, ImageReader, Limits};
use serde::{Deserialize, Serialize};
use std::io::{self, BufReader};

/// Texels along a side of a tile.
pub(in super::super) const TILE: usize = 64;

/// Longest side of a picture.
const MOST_SIDE: u32 = 1 << 16;

/// Levels of a picture, finest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in super::super) struct Picture {
    pub(in super::super) levels: Vec<Level>,
}

/// A picture at one size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in super::super) struct Level {
    pub(in super::super) size: [u32; 2],
    /// The first tile of each row of tiles.
    rows: Vec<u64>,
}

impl Level {
    /// The tile that has a texel.
    pub(in super::super) fn tile(&self, x: u32, y: u32) -> u64 {
        self.rows[y as usize / TILE] + u64::from(x) / TILE as u64
    }
}

/// Why there is no picture.
#[derive(Debug)]
pub(super) enum Failure {
    /// Its file is no good.
    Damaged(String),
    /// So many bytes are needed to decode it.
    TooLarge(u64),
    Scratch(io::Error),
}

/// Decodes a picture within so many bytes, and appends its tiles. `has_alpha` says whether its opacity counts.
pub(super) fn read(
    source: Box<dyn ByteSource>,
    has_alpha: bool,
    most_bytes: u64,
    texels: &mut Spool<Texel>,
) -> Result<Picture, Failure> {
    let image = decode(source, most_bytes)?;
    let (width, height) = image.dimensions();
    let mut levels = Levels::new([width, height], texels);
    let mut row = Vec::with_capacity(width as usize);
    for y in 0..height {
        row.clear();
        row.extend((0..width).map(|x| {
            let [r, g, b, a] = image.get_pixel(x, y).0;
            [r, g, b, if has_alpha { a } else { 255 }]
        }));
        levels.push(&row).map_err(Failure::Scratch)?;
    }
    Ok(levels.finish())
}

fn decode(source: Box<dyn ByteSource>, most_bytes: u64) -> Result<DynamicImage, Failure> {
    let damaged = |error: &dyn std::fmt::Display| Failure::Damaged(error.to_string());
    let reader = ImageReader::new(BufReader::new(source)).with_guessed_format().map_err(|error| damaged(&error))?;
    let format = reader.format();
    let mut limits = Limits::no_limits();
    (limits.max_image_width, limits.max_image_height) = (Some(MOST_SIDE), Some(MOST_SIDE));
    let mut reader = reader;
    reader.limits(limits.clone());
    let decoder = reader.into_decoder().map_err(|error| damaged(&error))?;
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(Failure::Damaged("a picture without a texel".into()));
    }
    let texels = u64::from(width) * u64::from(height);
    // A progressive JPEG keeps its coefficients, 16 bits each; a PNG what a row or a pass needs.
    let working = if format == Some(ImageFormat::Jpeg) { texels * 6 } else { 0 };
    let needed = decoder.total_bytes().saturating_add(working).saturating_add(u64::from(width) * 2048);
    if needed > most_bytes {
        return Err(Failure::TooLarge(needed));
    }
    let mut decoder = decoder;
    limits.max_alloc = Some(most_bytes);
    decoder.set_limits(limits).map_err(|error| damaged(&error))?;
    DynamicImage::from_decoder(decoder).map_err(|error| damaged(&error))
}

/// A mean of texels.
#[derive(Clone, Copy, Default)]
struct Mean {
    /// Linear, times the weight.
    color: [f32; 3],
    weight: f32,
    alpha: f32,
}

impl Mean {
    fn of([r, g, b, a]: Texel) -> Self {
        let weight = f32::from(a) / 255.0;
        let linear = [r, g, b].map(|value| LINEAR_OF_SRGB8[usize::from(value)] * weight);
        Self { color: linear, weight, alpha: f32::from(a) }
    }

    fn add(&mut self, other: &Self, share: f32) {
        for (sum, value) in self.color.iter_mut().zip(other.color) {
            *sum += value * share;
        }
        self.weight += other.weight * share;
        self.alpha = self.alpha.max(other.alpha);
    }

    fn texel(&self) -> Texel {
        let unit = if self.weight > 0.0 { 1.0 / self.weight } else { 0.0 };
        let [r, g, b] = self.color.map(|sum| srgb8_of_linear(sum * unit));
        [r, g, b, self.alpha as u8]
    }
}

/// Takes the rows of a picture one after the other, from the top, and makes those of all levels.
struct Levels<'a> {
    texels: &'a mut Spool<Texel>,
    levels: Vec<Growing>,
}

/// A level that is not complete.
struct Growing {
    level: Level,
    /// Rows of texels so far.
    done: u32,
    /// A row of tiles, row by row of texels.
    band: Vec<Texel>,
    /// The next row, of which some rows of the finer level are in.
    next: Vec<Mean>,
}

impl<'a> Levels<'a> {
    fn new(size: [u32; 2], texels: &'a mut Spool<Texel>) -> Self {
        let mut sizes = vec![size];
        while let Some(last) = sizes.last()
            && *last != [1, 1]
        {
            sizes.push(last.map(|side| side.div_ceil(2)));
        }
        let growing = |size: [u32; 2]| {
            let next = vec![Mean::default(); size[0] as usize];
            Growing { level: Level { size, rows: Vec::new() }, done: 0, band: Vec::new(), next }
        };
        Self { texels, levels: sizes.into_iter().map(growing).collect() }
    }

    fn push(&mut self, row: &[Texel]) -> io::Result<()> {
        self.put(0, row)?;
        let means: Vec<Mean> = row.iter().map(|texel| Mean::of(*texel)).collect();
        self.coarsen(1, &means)
    }

    /// A row of a level is complete.
    fn put(&mut self, at: usize, row: &[Texel]) -> io::Result<()> {
        let growing = &mut self.levels[at];
        growing.band.extend_from_slice(row);
        growing.done += 1;
        let is_last = growing.done == growing.level.size[1];
        if growing.band.len() == row.len() * TILE || is_last {
            growing.level.rows.push(self.texels.len() / (TILE * TILE) as u64);
            let mut tile = vec![[0; 4]; TILE * TILE];
            for left in (0..row.len()).step_by(TILE) {
                for (into, from) in tile.chunks_mut(TILE).zip(growing.band.chunks(row.len())) {
                    let from = &from[left..from.len().min(left + TILE)];
                    into[..from.len()].copy_from_slice(from);
                }
                self.texels.push(&tile)?;
            }
            growing.band.clear();
        }
        Ok(())
    }

    /// The finer level's next row goes into a level, if there is one: texels are means of what they cover, parts of texels included.
    fn coarsen(&mut self, at: usize, finer: &[Mean]) -> io::Result<()> {
        let row = self.levels[at - 1].done - 1;
        let Some([width, height]) = self.levels.get(at).map(|growing| growing.level.size) else { return Ok(()) };
        let across = shares(finer.len() as u32, width);
        let rows = self.levels[at - 1].level.size[1];
        for (target, share) in overlaps(row, rows, height).into_iter().filter(|(_, share)| *share > 0.0) {
            if target > self.levels[at].done {
                let empty = vec![Mean::default(); width as usize];
                let complete = std::mem::replace(&mut self.levels[at].next, empty);
                self.complete(at, &complete)?;
            }
            let next = &mut self.levels[at].next;
            for (mean, parts) in finer.iter().zip(&across) {
                for (column, part) in parts.iter().copied() {
                    if part > 0.0 {
                        next[column as usize].add(mean, part * share);
                    }
                }
            }
        }
        if row + 1 == rows {
            let complete = std::mem::take(&mut self.levels[at].next);
            self.complete(at, &complete)?;
        }
        Ok(())
    }

    fn complete(&mut self, at: usize, row: &[Mean]) -> io::Result<()> {
        let texels: Vec<Texel> = row.iter().map(Mean::texel).collect();
        self.put(at, &texels)?;
        // As shares of a whole texel.
        self.coarsen(at + 1, row)
    }

    fn finish(self) -> Picture {
        Picture { levels: self.levels.into_iter().map(|growing| growing.level).collect() }
    }
}

/// Into which of fewer places a place falls, and by which share of theirs; the second may be nothing.
fn overlaps(place: u32, places: u32, fewer: u32) -> [(u32, f32); 2] {
    // In units in which both are whole.
    let (begin, end) = (u64::from(place) * u64::from(fewer), u64::from(place + 1) * u64::from(fewer));
    let (wide, first) = (u64::from(places), begin / u64::from(places));
    let border = (first + 1) * wide;
    let share = |from: u64, to: u64| to.saturating_sub(from) as f32 / wide as f32;
    let second = (first + 1).min(u64::from(fewer) - 1);
    [(first as u32, share(begin, end.min(border))), (second as u32, share(border, end))]
}

fn shares(places: u32, fewer: u32) -> Vec<[(u32, f32); 2]> {
    (0..places).map(|place| overlaps(place, places, fewer)).collect()
}
