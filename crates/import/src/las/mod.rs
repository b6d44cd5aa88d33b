//! LAS 1.0 to 1.4 and LAZ, all point formats: clouds of points, usually from the air. A COPC file is read as the LAZ file
//! that it is.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Points** become vertices, all of them, whatever their class: the integers of the file times its scale plus its offset,
//!   in `f64`, so that coordinates of a country keep their millimetres. The sky is up the z axis.
//! * **Colours** are there where the point format has them and one of the first 65,536 points is not black. They have 16 bits;
//!   where none of those points has a channel above 255, they are taken for 8 bits, as many programs write them.
//! * **Counts**: the header's is believed one point at a time. Before LAS 1.4 it has 32 bits. A stream has fewer than 2³²
//!   points, since that is how vertices are numbered.
//! * **What coordinates mean**: the name, number and text of the system of coordinates and the horizontal unit of lengths, from
//!   the records of WKT or GeoTIFF, which must not lie to be useful and do no harm where they do.
//! * **Everything else** (intensity, classes, times, waveforms) is skipped.
//! * LAZ is not read from gzip.

mod gps;
mod header;
mod laz;
mod records;
mod source;

use self::laz::LazRecords;
use crate::{Attributes, Batch, ImportError, ModelStream, Place, ReferenceSystem, error::Problem, input::Input};
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use glam::DVec3;
use header::Header;

/// Most bytes of records in memory: fewer points make a batch where each has thousands of extra bytes.
const MOST_PIECE_BYTES: usize = 8 << 20;
/// Points that are read at a time after the first batch, few enough to stay in the cache until they are converted.
const RUN: usize = 4096;
/// Most points for each byte of a LAZ file. Real ones have one or less; packed nothings could go on for ever.
const MOST_POINTS_PER_BYTE: u64 = 64;

/// True for a file that begins with the signature.
pub(crate) fn recognises(start: &[u8]) -> bool {
    start.starts_with(b"LASF")
}

/// Reads the header of a file that is [recognised](recognises), and its first points.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    let header = header::read(&mut input)?;
    let total_bytes = input.progress().1;
    let most = (total_bytes * MOST_POINTS_PER_BYTE).max(Batch::TARGET as u64);
    if header.records.laz.is_some() && header.point_count > most {
        let expected = format!("at most {most} points in a LAZ file of {total_bytes} bytes");
        return Err(ImportError::malformed(expected, header.point_count.to_string(), Place::byte(247)));
    }
    let records = match &header.records.laz {
        None => {
            let before = header.points_offset - input.offset();
            if !input.skip(before)? {
                return Err(header.truncated(0, input.offset()));
            }
            Records::Plain(input)
        }
        Some(vlr) => {
            let vlr = vlr.clone();
            Records::Packed(Box::new(LazRecords::new(input.into_source("LAZ")?, &header, vlr)?))
        }
    };
    let mut stream =
        LasStream { header, records, read: 0, piece: Vec::new(), colors: None, total_bytes, is_first: true };
    stream.fill(Batch::TARGET)?;
    stream.decide_colors();
    Ok(Box::new(stream))
}

/// Where records come from.
enum Records {
    Plain(Input),
    Packed(Box<LazRecords>),
}

struct LasStream {
    header: Header,
    records: Records,
    /// Points in `piece` and before.
    read: u64,
    /// Records that come next.
    piece: Vec<u8>,
    colors: Option<Colors>,
    total_bytes: u64,
    /// True until the piece that was read with the header is used up.
    is_first: bool,
}

/// Where colours are in a record, and what stands for 255.
struct Colors {
    offset: usize,
    is_eight_bit: bool,
}

impl LasStream {
    /// Reads the next records, so many at most.
    fn fill(&mut self, most: usize) -> Result<(), ImportError> {
        let Self { header, records, piece, .. } = self;
        let most = most.min(MOST_PIECE_BYTES / header.record_bytes) as u64;
        let count = (header.point_count - self.read).min(most) as usize;
        let bytes = count * header.record_bytes;
        match records {
            Records::Plain(input) => {
                piece.clear();
                while piece.len() < bytes {
                    if input.window().is_empty() && !input.fill()? {
                        let whole = (piece.len() / header.record_bytes) as u64;
                        return Err(header.truncated(self.read + whole, input.offset()));
                    }
                    let taken = input.window().len().min(bytes - piece.len());
                    piece.extend_from_slice(&input.window()[..taken]);
                    input.consume(taken);
                }
            }
            Records::Packed(records) => {
                piece.resize(bytes, 0);
                for (number, record) in (self.read..).zip(piece.chunks_exact_mut(header.record_bytes)) {
                    records.next(number, record)?;
                }
            }
        }
        self.read += count as u64;
        Ok(())
    }

    /// Looks at the first piece.
    fn decide_colors(&mut self) {
        let Some(offset) = self.header.color_offset else { return };
        let channels = || {
            let records = self.piece.chunks_exact(self.header.record_bytes);
            records.flat_map(|record| color16(&record[offset..]))
        };
        if channels().any(|channel| channel > 0) {
            self.colors = Some(Colors { offset, is_eight_bit: channels().all(|channel| channel < 256) });
        }
    }
}

impl LasStream {
    /// Appends the points of the piece.
    fn convert(&self, batch: &mut Batch) -> Result<(), ImportError> {
        let Self { header, piece, .. } = self;
        let positions = &mut batch.vertices.positions;
        let before = positions.len();
        positions.extend(piece.chunks_exact(header.record_bytes).map(|record| {
            let axis = |axis: usize| {
                let bytes = *record[4 * axis..].first_chunk().expect("a record has three integers");
                f64::from(i32::from_le_bytes(bytes)) * header.scale[axis] + header.offset[axis]
            };
            DVec3::new(axis(0), axis(1), axis(2))
        }));
        let positions = &positions[before..];
        if let Some(number) = positions.iter().position(|position| !position.is_finite()) {
            let position = positions[number].to_array();
            let first = self.read - positions.len() as u64;
            let place = Place::byte(header.points_offset).of_item("point", first + number as u64);
            return Err(ImportError::new(Problem::NotFinite { position }, Some(place)));
        }
        if let Some(Colors { offset, is_eight_bit }) = self.colors {
            let shift = if is_eight_bit { 0 } else { 8 };
            batch.vertices.colors.extend(piece.chunks_exact(header.record_bytes).map(|record| {
                // Exact where a byte was written twice, or in the upper half.
                color16(&record[offset..]).map(|channel| (channel >> shift).min(255) as u8)
            }));
        }
        Ok(())
    }
}

fn color16(bytes: &[u8]) -> [u16; 3] {
    std::array::from_fn(|channel| u16::from_le_bytes([bytes[2 * channel], bytes[2 * channel + 1]]))
}

impl ModelStream for LasStream {
    fn attributes(&self) -> Attributes {
        Attributes { normals: false, colors: self.colors.is_some() }
    }

    fn up_axis(&self) -> UpAxis {
        UpAxis::Z
    }

    fn unit(&self) -> Option<LengthUnit> {
        self.header.records.unit
    }

    fn reference_system(&self) -> Option<&ReferenceSystem> {
        self.header.records.system.as_ref()
    }

    fn declared_vertices(&self) -> Option<u64> {
        Some(self.header.point_count)
    }

    fn declared_faces(&self) -> Option<u64> {
        Some(0)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while !batch.is_full() {
            let is_first = std::mem::take(&mut self.is_first);
            if !is_first {
                self.fill(RUN.min(Batch::TARGET - batch.vertices.positions.len()))?;
            }
            self.convert(batch)?;
            if is_first || self.piece.is_empty() {
                break;
            }
        }
        let more = !batch.is_empty();
        if !more && let Records::Plain(input) = &mut self.records {
            input.finish()?;
        }
        Ok(more)
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        match &self.records {
            Records::Plain(input) => input.progress(),
            // Chunks are read whole; points are as good a measure.
            Records::Packed(_) => {
                let share = self.read as f64 / self.header.point_count.max(1) as f64;
                ((self.total_bytes as f64 * share) as u64, self.total_bytes)
            }
        }
    }
}
