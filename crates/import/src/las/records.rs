//! The variable-length records of LAS, as far as they matter: how LAZ is packed, and what the coordinates are.
//!
//! In: the input behind the header. Out: [`Records`]; the input stands at or before the points. A system of coordinates that
//! is told in WKT goes before one told in keys of GeoTIFF, since 1.4 says so and older files have it more complete.
//!
//! What always holds: what is said about coordinates is never an error; without the description of LAZ packed points are one.

use crate::{ImportError, Place, ReferenceSystem, input::Input, reference};
use gigalod_geom::LengthUnit;
use laz::LazVlr;

/// Most variable-length records that are looked through.
const MOST_RECORDS: u32 = 1 << 16;
/// Most records behind the points.
const MOST_LATE_RECORDS: u32 = 64;
/// A record of LAZ has a few items of 6 bytes.
const MOST_LAZ_BYTES: usize = 1 << 12;
/// Bytes before the contents of a record, and of one behind the points.
const HEAD_BYTES: usize = 54;
const LATE_HEAD_BYTES: usize = 60;

const PROJECTION: &[u8] = b"LASF_Projection\0";
const WKT: u16 = 2112;
const KEYS: u16 = 34735;
const DOUBLES: u16 = 34736;
const TEXTS: u16 = 34737;

/// What the records say.
#[derive(Default)]
pub(super) struct Records {
    pub(super) laz: Option<LazVlr>,
    pub(super) system: Option<ReferenceSystem>,
    pub(super) unit: Option<LengthUnit>,
}

/// Where the records are.
pub(super) struct Extent {
    pub(super) count: u32,
    pub(super) points_offset: u64,
    /// Where those behind the points begin, and how many there are.
    pub(super) late: Option<(u64, u32)>,
}

/// Contents of the records about coordinates.
#[derive(Default)]
struct Projection {
    wkt: Vec<u8>,
    keys: Vec<u8>,
    doubles: Vec<u8>,
    texts: Vec<u8>,
}

impl Projection {
    fn place(&mut self, user: &[u8], record: u16) -> Option<&mut Vec<u8>> {
        match (user.starts_with(PROJECTION), record) {
            (true, WKT) => Some(&mut self.wkt),
            (true, KEYS) => Some(&mut self.keys),
            (true, DOUBLES) => Some(&mut self.doubles),
            (true, TEXTS) => Some(&mut self.texts),
            _ => None,
        }
    }
}

/// Reads the records behind the header; `packed` is the length of packed points, where they are.
pub(super) fn read(input: &mut Input, extent: &Extent, packed: Option<usize>) -> Result<Records, ImportError> {
    let mut records = Records::default();
    let mut projection = Projection::default();
    for _ in 0..extent.count.min(MOST_RECORDS) {
        let place = Place::byte(input.offset());
        if input.offset() + HEAD_BYTES as u64 > extent.points_offset || !input.has(HEAD_BYTES)? {
            break;
        }
        let head = input.window();
        let (record, bytes) = (u16_at(head, 18), usize::from(u16_at(head, 20)));
        let is_laz = head[2..].starts_with(LazVlr::USER_ID.as_bytes()) && record == LazVlr::RECORD_ID;
        let kept = projection.place(&head[2..18], record);
        let end = input.offset() + (HEAD_BYTES + bytes) as u64;
        if end > extent.points_offset {
            break;
        }
        input.consume(HEAD_BYTES);
        if !input.has(bytes)? {
            break;
        }
        let content = &input.window()[..bytes];
        if let Some(kept) = kept {
            *kept = content.to_vec();
        }
        if let (true, Some(record_bytes), None) = (is_laz && bytes <= MOST_LAZ_BYTES, packed, &records.laz) {
            let vlr = LazVlr::from_buffer(content).map_err(|error| {
                ImportError::malformed("a record that describes LAZ", error.to_string(), place.clone())
            })?;
            super::laz::check(&vlr, record_bytes).map_err(|found| {
                let expected = format!("items of LAZ that make up points of {record_bytes} bytes");
                ImportError::malformed(expected, found, place)
            })?;
            records.laz = Some(vlr);
        }
        input.consume(bytes);
    }
    if packed.is_some() && records.laz.is_none() {
        let place = Place::byte(input.offset());
        return Err(ImportError::malformed("a record `laszip encoded` before the packed points", "none", place));
    }
    if let Some(late) = extent.late
        && projection.wkt.is_empty()
        && input.is_plain()
    {
        read_late(input, late, &mut projection)?;
    }
    (records.system, records.unit) = understand(&projection);
    Ok(records)
}

/// Looks for the description behind the points.
fn read_late(
    input: &mut Input,
    (mut offset, count): (u64, u32),
    projection: &mut Projection,
) -> Result<(), ImportError> {
    for _ in 0..count.min(MOST_LATE_RECORDS) {
        let mut head = [0; LATE_HEAD_BYTES];
        if input.reread(offset, &mut head)? < head.len() {
            break;
        }
        let bytes = u64::from_le_bytes(*head[20..].first_chunk().expect("it has 60 bytes"));
        let content = offset.saturating_add(LATE_HEAD_BYTES as u64);
        if let Some(kept) = projection.place(&head[2..18], u16_at(&head, 18)) {
            kept.resize(bytes.min(1 << 16) as usize, 0);
            let read = input.reread(content, kept)?;
            kept.truncate(read);
        }
        offset = content.saturating_add(bytes);
    }
    Ok(())
}

fn understand(projection: &Projection) -> (Option<ReferenceSystem>, Option<LengthUnit>) {
    let of_keys = of_keys(projection);
    match reference::of_wkt(&String::from_utf8_lossy(&projection.wkt)) {
        (Some(system), unit) => {
            let (epsg, unit_of_keys) = (of_keys.0.and_then(|system| system.epsg), of_keys.1);
            (Some(ReferenceSystem { epsg: system.epsg.or(epsg), ..system }), unit.or(unit_of_keys))
        }
        (None, _) => of_keys,
    }
}

/// What the keys of a GeoTIFF say (GeoTIFF 1.1, chapter 7).
fn of_keys(projection: &Projection) -> (Option<ReferenceSystem>, Option<LengthUnit>) {
    const GEOTIFF_CITATION: u16 = 1026;
    const GEOGRAPHIC: u16 = 2048;
    const GEOGRAPHIC_CITATION: u16 = 2049;
    const PROJECTED: u16 = 3072;
    const PROJECTED_CITATION: u16 = 3073;
    const LINEAR_UNIT: u16 = 3076;
    const LINEAR_UNIT_METRES: u16 = 3077;
    const USER_DEFINED: u16 = 32767;
    let words: Vec<u16> = projection.keys.as_chunks().0.iter().map(|word| u16::from_le_bytes(*word)).collect();
    let keys = || words.as_chunks::<4>().0.iter().skip(1);
    let of = |wanted: u16| keys().find(|[key, ..]| *key == wanted);
    let number = |wanted| of(wanted).filter(|[_, place, ..]| *place == 0).map(|[.., value]| *value);
    let is_registered = |epsg: &u16| *epsg != 0 && *epsg != USER_DEFINED;
    let text = |wanted| {
        let [_, _, count, start] = of(wanted).filter(|[_, place, ..]| *place == TEXTS)?.map(usize::from);
        let text = String::from_utf8_lossy(projection.texts.get(start..start + count)?).into_owned();
        reference::name(text.trim_end_matches(['|', '\0']))
    };
    let length = || {
        let [_, _, _, start] = *of(LINEAR_UNIT_METRES).filter(|[_, place, ..]| *place == DOUBLES)?;
        let bytes = projection.doubles.as_chunks::<8>().0.get(usize::from(start))?;
        LengthUnit::of_metres(f64::from_le_bytes(*bytes))
    };
    let unit = match number(LINEAR_UNIT) {
        Some(9001) => Some(LengthUnit::Metre),
        Some(9002) => Some(LengthUnit::Foot),
        Some(9003) => Some(LengthUnit::UsSurveyFoot),
        Some(9036) => Some(LengthUnit::Kilometre),
        Some(1033) => Some(LengthUnit::Centimetre),
        Some(1025) => Some(LengthUnit::Millimetre),
        _ => length(),
    };
    let projected = number(PROJECTED);
    let epsg = match projected {
        Some(_) => projected,
        None => number(GEOGRAPHIC),
    };
    let citations = [PROJECTED_CITATION, GEOTIFF_CITATION, GEOGRAPHIC_CITATION];
    let system = ReferenceSystem {
        name: citations.into_iter().find_map(text),
        epsg: epsg.filter(is_registered).map(u32::from),
        wkt: None,
    };
    (system.known(), unit)
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(*bytes[at..].first_chunk().expect("it is in the record's head"))
}
