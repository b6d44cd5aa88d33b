//! Unpacks the points of LAZ, a chunk after the other, with the crate `laz` for what is inside a chunk.
//!
//! In: the source, from the first chunk on. Out: records, one at a time.
//!
//! What always holds: the table of chunks, which says how large they are, is read only where a file of old point formats has
//! chunks of varying size; everything else is found on the way. Sizes are checked against the file before anything is
//! allocated: memory is that of a chunk.

use super::gps::GpsTimes;
use super::header::Header;
use super::source::Source;
use crate::{ByteSource, ImportError, Place, error::Problem};
use laz::laszip::ChunkTable;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};
use std::io::{self, Cursor, Read, Seek, SeekFrom};

/// Largest chunk of layers, packed. Usual ones have a few hundred kilobytes.
const MOST_CHUNK_BYTES: u64 = 256 << 20;
/// Most extra bytes of a point: each has its own models.
const MOST_EXTRA_BYTES: u16 = 1024;
/// Most chunks in a table that must be read.
const MOST_CHUNKS: u32 = 1 << 22;

pub(super) struct LazRecords {
    unpacker: Unpacker,
    vlr: LazVlr,
    record_bytes: usize,
    point_count: u64,
    /// Where the file ends.
    end: u64,
    /// Points that the chunk still has.
    left: u64,
    /// Number of the next chunk.
    chunk: usize,
}

enum Unpacker {
    /// One stream of bits for all fields, versions 1 and 2.
    PointWise { records: Box<SequentialPointRecordDecompressor<'static, Source>>, table: Option<ChunkTable> },
    /// A stream for each field, versions 3 and 4: a chunk must be in memory.
    Layered { source: Source, records: Box<LayeredPointRecordDecompressor<'static, Cursor<Vec<u8>>>>, layers: usize },
}

/// Checks that a description is one that can be unpacked, to records of this length. The error says what it is instead.
pub(super) fn check(vlr: &LazVlr, record_bytes: usize) -> Result<(), String> {
    let items = vlr.items();
    let Some(first) = items.first() else { return Err("none".to_owned()) };
    let is_layered = first.version() > 2;
    let has_own_size = |item: &LazItem| match item.item_type() {
        LazItemType::Byte(size) | LazItemType::Byte14(size) => {
            size == item.size() && (1..=MOST_EXTRA_BYTES).contains(&size)
        }
        LazItemType::Point10 => item.size() == 20,
        LazItemType::GpsTime | LazItemType::RGBNIR14 => item.size() == 8,
        LazItemType::RGB12 | LazItemType::RGB14 => item.size() == 6,
        LazItemType::WavePacket13 | LazItemType::WavePacket14 => item.size() == 29,
        LazItemType::Point14 => item.size() == 30,
    };
    let is_of_points = match first.item_type() {
        LazItemType::Point10 => !is_layered,
        LazItemType::Point14 => is_layered,
        _ => false,
    };
    let is_alike = items.iter().all(|item| (item.version() > 2) == is_layered && has_own_size(item));
    let others = items.iter().skip(1);
    let points = |item: &LazItem| matches!(item.item_type(), LazItemType::Point10 | LazItemType::Point14);
    if !is_of_points || !is_alike || others.clone().any(points) || others.count() > 8 {
        return Err(format!("{} items that do not belong together", items.len()));
    }
    match items.iter().map(|item| usize::from(item.size())).sum::<usize>() {
        sum if sum == record_bytes => Ok(()),
        sum => Err(format!("{sum} bytes")),
    }
}

impl LazRecords {
    /// `source` is the whole file.
    pub(super) fn new(mut source: Box<dyn ByteSource>, header: &Header, vlr: LazVlr) -> Result<Self, ImportError> {
        let place = Place::byte(header.points_offset);
        let failed = |source: io::Error| ImportError::new(Problem::Io { source }, Some(place.clone()));
        let end = source.seek(SeekFrom::End(0)).map_err(failed)?;
        let mut source = Source::new(source).map_err(failed)?;
        source.seek(SeekFrom::Start(header.points_offset)).map_err(failed)?;
        let cannot =
            |error: laz::LasZipError| ImportError::malformed("LAZ of a known kind", error.to_string(), place.clone());
        let is_layered = vlr.items().first().is_some_and(|item| item.version() > 2);
        let first_bytes = ChunkTable::OFFSET_SIZE as i64;
        let unpacker = if is_layered {
            source.seek_relative(first_bytes).map_err(failed)?;
            let layers = vlr.items().iter().map(|item| match item.item_type() {
                LazItemType::Point14 => 9,
                LazItemType::RGBNIR14 => 2,
                LazItemType::Byte14(count) => usize::from(count),
                _ => 1,
            });
            let layers = layers.sum();
            let records = Box::new(LayeredPointRecordDecompressor::new(Cursor::new(Vec::new())));
            Unpacker::Layered { source, records, layers }
        } else {
            // Without chunks, the points begin at once.
            let has_chunks = !is_point_wise_in_one(&vlr)?;
            let mut table = None;
            if has_chunks && vlr.uses_variable_size_chunks() {
                check_table(&mut source, header.points_offset, end).map_err(|error| match error.kind() {
                    io::ErrorKind::InvalidData => {
                        ImportError::malformed("a table of chunks", error.to_string(), place.clone())
                    }
                    _ => failed(error),
                })?;
                source.seek(SeekFrom::Start(header.points_offset)).map_err(failed)?;
                table = Some(ChunkTable::read_from(&mut source, &vlr).map_err(cannot)?);
            } else if has_chunks {
                source.seek_relative(first_bytes).map_err(failed)?;
            }
            let records = Box::new(SequentialPointRecordDecompressor::new(source));
            Unpacker::PointWise { records, table }
        };
        let (record_bytes, point_count) = (header.record_bytes, header.point_count);
        Ok(Self { unpacker, vlr, record_bytes, point_count, end, left: 0, chunk: 0 })
    }

    /// Unpacks point `number`.
    pub(super) fn next(&mut self, number: u64, record: &mut [u8]) -> Result<(), ImportError> {
        if self.left == 0 {
            self.left = self.begin_chunk(number)?;
            self.chunk += 1;
        }
        self.left -= 1;
        let result = match &mut self.unpacker {
            Unpacker::PointWise { records, .. } => records.decompress_next(record),
            Unpacker::Layered { records, .. } => records.decompress_next(record),
        };
        result.map_err(|error| self.failed(error, number))
    }

    fn failed(&mut self, error: io::Error, number: u64) -> ImportError {
        let offset = match &mut self.unpacker {
            Unpacker::PointWise { records, .. } => records.get_mut().stream_position(),
            Unpacker::Layered { source, .. } => source.stream_position(),
        };
        let place = Place::byte(offset.unwrap_or_default()).of_item("point", number);
        match error.kind() {
            io::ErrorKind::UnexpectedEof => {
                ImportError::truncated(format!("point {number} of {} is complete", self.point_count), place)
            }
            io::ErrorKind::InvalidData => ImportError::malformed("sound LAZ data", error.to_string(), place),
            _ => ImportError::new(Problem::Io { source: error }, Some(place)),
        }
    }

    /// Prepares the next chunk, which begins where the source stands; returns how many points it has.
    fn begin_chunk(&mut self, number: u64) -> Result<u64, ImportError> {
        let Self { unpacker, vlr, .. } = self;
        let fixed = if vlr.uses_variable_size_chunks() { None } else { Some(u64::from(vlr.chunk_size())) };
        let items = vlr.items().clone();
        let cannot = |error: laz::LasZipError| {
            ImportError::malformed("LAZ of a known kind", error.to_string(), Place::byte(0).of_item("point", number))
        };
        let count = match unpacker {
            Unpacker::PointWise { records, table } => {
                let code = records.get_mut().ahead(self.record_bytes);
                if let Err(error) = code.and_then(|code| code.map_or(Ok(()), check_code)) {
                    return Err(self.failed(error, number));
                }
                records.reset();
                for item in items {
                    match (item.item_type(), item.version()) {
                        (LazItemType::GpsTime, 2) => records.add_field_decompressor(GpsTimes::default()),
                        _ => records.set_fields_from(&vec![item]).map_err(cannot)?,
                    }
                }
                match (is_point_wise_in_one(vlr)?, table) {
                    (true, _) => u64::MAX,
                    (_, Some(table)) => table.as_ref().get(self.chunk).map_or(0, |entry| entry.point_count),
                    (_, None) => fixed.unwrap_or_default(),
                }
            }
            Unpacker::Layered { source, records, layers } => {
                let position = source.stream_position().unwrap_or_default();
                let left = self.end.saturating_sub(position);
                match read_layers(source, self.record_bytes, *layers, left) {
                    Ok((bytes, count)) => {
                        records.reset();
                        *records.get_mut() = Cursor::new(bytes);
                        records.set_fields_from(&items).map_err(cannot)?;
                        records.set_selection(
                            DecompressionSelection::xy_returns_channel().decompress_z().decompress_rgb(),
                        );
                        fixed.map_or(count, |fixed| fixed.min(count.max(1)))
                    }
                    Err(error) => return Err(self.failed(error, number)),
                }
            }
        };
        if count == 0 {
            let error = io::Error::new(io::ErrorKind::InvalidData, "a chunk without points");
            return Err(self.failed(error, number));
        }
        Ok(count)
    }
}

/// True where all points are in one chunk, with no table.
fn is_point_wise_in_one(vlr: &LazVlr) -> Result<bool, ImportError> {
    let mut bytes = Vec::new();
    let written = vlr.write_to(&mut bytes);
    // The crate keeps this field to itself: it is the first of the record.
    match (written, bytes.first_chunk()) {
        (Ok(()), Some(kind)) => Ok(u16::from_le_bytes(*kind) == 1),
        _ => Err(ImportError::malformed("LAZ of a known kind", "no kind", Place::byte(0))),
    }
}

/// Reads a chunk of layers: the first point, the number of points, the sizes of the layers, the layers.
fn read_layers(source: &mut Source, record_bytes: usize, layers: usize, left: u64) -> io::Result<(Vec<u8>, u64)> {
    let head_bytes = record_bytes + 4 + 4 * layers;
    let mut bytes = vec![0; head_bytes];
    source.read_exact(&mut bytes)?;
    let (words, _) = bytes[record_bytes..].as_chunks::<4>();
    let mut words = words.iter().map(|word| u64::from(u32::from_le_bytes(*word)));
    let count = words.next().unwrap_or_default();
    let layer_bytes: u64 = words.clone().sum();
    if layer_bytes > left.saturating_sub(head_bytes as u64) {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    if layer_bytes > MOST_CHUNK_BYTES {
        let message = format!("a chunk of {layer_bytes} bytes, more than {MOST_CHUNK_BYTES}");
        return Err(io::Error::new(io::ErrorKind::InvalidData, message));
    }
    let sizes: Vec<usize> = words.map(|size| size as usize).collect();
    bytes.resize(head_bytes + layer_bytes as usize, 0);
    source.read_exact(&mut bytes[head_bytes..])?;
    let mut rest = &bytes[head_bytes..];
    for size in sizes {
        let (layer, after) = rest.split_at(size);
        layer.first_chunk().map_or(Ok(()), |code| check_code(*code))?;
        rest = after;
    }
    Ok((bytes, count))
}

/// Looks at the first bytes of an arithmetic code: it is a number below one. The unpacker relies on that, and never finds back
/// from a code that is not.
fn check_code(first: [u8; 4]) -> io::Result<()> {
    match first {
        [255, 255, 255, 255] => Err(io::Error::new(io::ErrorKind::InvalidData, "a code that nothing is packed to")),
        _ => Ok(()),
    }
}

/// Looks at the number of chunks that a table declares, before it is read.
fn check_table(source: &mut Source, points_offset: u64, end: u64) -> io::Result<()> {
    let invalid = |message: &str| io::Error::new(io::ErrorKind::InvalidData, message.to_owned());
    let mut word = [0; 8];
    source.seek(SeekFrom::Start(points_offset))?;
    source.read_exact(&mut word)?;
    let mut table = u64::from_le_bytes(word);
    if i64::from_le_bytes(word) <= points_offset as i64 {
        source.seek(SeekFrom::End(-8))?;
        source.read_exact(&mut word)?;
        table = u64::from_le_bytes(word);
    }
    if table <= points_offset || table > end {
        return Err(invalid("none"));
    }
    source.seek(SeekFrom::Start(table))?;
    source.read_exact(&mut word)?;
    let [.., a, b, c, d] = word;
    if u32::from_le_bytes([a, b, c, d]) > MOST_CHUNKS {
        return Err(invalid("one of too many chunks"));
    }
    Ok(())
}
