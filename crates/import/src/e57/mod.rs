//! E57, the exchange format of laser scanners: one or more clouds of points.
//!
//! Files come in through [`open`](crate::open()). What this reader makes of them:
//!
//! * **Scans** follow each other in one stream, each moved to its place by its pose.
//! * **Points** are `cartesianX`, `Y`, `Z`, or where there are none, spherical coordinates. Those that the scanner calls
//!   invalid, and those that are not finite, are left out: so a stream may have fewer points than are declared, and declares
//!   nothing. The sky is up the z axis.
//! * **Colours** are there if all scans with points have them: from the limits that the scan declares for them, or those of
//!   the number type, to 0…255.
//! * **Lengths** are metres, as the format asks for; what it says about the system of coordinates is passed on.
//! * **Pages** are checked against their checksums as they are read.
//! * The description, an XML text, has at most 16 MiB. It is read by the crate `e57`; points are unpacked here, column by
//!   column, since the crate's reader of points cannot outlive a call. Pictures are ignored. Not read from gzip.

mod columns;
mod pages;

use crate::{
    Attributes, Batch, ImportError, ModelStream, Place, ReferenceSystem,
    error::{Problem, said},
    input::Input,
    reference,
};
use ::e57::{E57Reader, PointCloud, RecordDataType, RecordName, RecordValue};
use columns::Column;
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use glam::{DQuat, DVec3};
use pages::Pages;
use std::collections::VecDeque;
use std::io::SeekFrom;

/// Largest description.
const MOST_XML_BYTES: u64 = 16 << 20;
/// Most values that a point may have.
const MOST_COLUMNS: usize = 256;

/// True for a file that begins with the signature.
pub(crate) fn recognises(start: &[u8]) -> bool {
    start.starts_with(b"ASTM-E57")
}

/// Reads the description of a file that is [recognised](recognises).
pub(crate) fn open(mut input: Input) -> Result<Box<dyn ModelStream>, ImportError> {
    let total_bytes = input.progress().1;
    if !input.has(48)? {
        return Err(ImportError::truncated("the header is complete", Place::byte(input.window().len() as u64)));
    }
    let xml_bytes = u64::from_le_bytes(*input.window()[32..].first_chunk().expect("the header has 48 bytes"));
    if xml_bytes > MOST_XML_BYTES.min(total_bytes) {
        let expected = format!("a description of at most {} bytes", MOST_XML_BYTES.min(total_bytes));
        return Err(ImportError::malformed(expected, xml_bytes.to_string(), Place::byte(32)));
    }
    let mut source = input.into_source("E57")?;
    source.seek(SeekFrom::Start(0)).map_err(|source| ImportError::new(Problem::Io { source }, None))?;
    let place = Place::byte(0);
    let reader = E57Reader::new(&mut source)
        .map_err(|error| ImportError::malformed("an E57 file", said(error), place.clone()))?;
    // What E57 asks for here is WKT; some programs write names.
    let system = reader.coordinate_metadata().and_then(|text| match reference::of_wkt(text) {
        (Some(system), _) => Some(system),
        (None, _) => ReferenceSystem { name: reference::name(text), ..ReferenceSystem::default() }.known(),
    });
    let clouds: VecDeque<PointCloud> = reader.pointclouds().into_iter().filter(|cloud| cloud.records > 0).collect();
    let points: u64 = clouds.iter().fold(0, |sum, cloud| sum.saturating_add(cloud.records));
    if points >= u64::from(u32::MAX) {
        return Err(ImportError::malformed("fewer than 4294967295 points", points.to_string(), place));
    }
    let has_color = |cloud: &PointCloud| COLOR.iter().all(|name| column_of(cloud, name).is_some());
    let colors = !clouds.is_empty() && clouds.iter().all(has_color);
    let mut stream = E57Stream {
        pages: Pages::new(source),
        clouds,
        scan: None,
        colors,
        system,
        read: 0,
        points,
        total_bytes,
        scans: 0,
    };
    // What is wrong with the first scan is said at once.
    stream.begin_scan()?;
    Ok(Box::new(stream))
}

const COLOR: [RecordName; 3] = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
const CARTESIAN: [RecordName; 3] = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
const SPHERICAL: [RecordName; 3] =
    [RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation];

fn column_of(cloud: &PointCloud, name: &RecordName) -> Option<usize> {
    cloud.prototype.iter().position(|record| record.name == *name)
}

fn columns_of(cloud: &PointCloud, names: &[RecordName; 3]) -> Option<[usize; 3]> {
    let [a, b, c] = names.each_ref().map(|name| column_of(cloud, name));
    Some([a?, b?, c?])
}

struct E57Stream {
    pages: Pages,
    /// Scans that were not begun.
    clouds: VecDeque<PointCloud>,
    scan: Option<Scan>,
    colors: bool,
    system: Option<ReferenceSystem>,
    /// Points read, and of all scans.
    read: u64,
    points: u64,
    total_bytes: u64,
    /// Scans begun.
    scans: u64,
}

/// A scan being read.
struct Scan {
    columns: Vec<Column>,
    position: [usize; 3],
    is_spherical: bool,
    /// Not 0 where a position is none.
    invalid: Option<usize>,
    color: Option<Shades>,
    rotation: DQuat,
    translation: DVec3,
    /// Points that it still has.
    left: u64,
    number: u64,
}

/// Columns of a colour, and what stands for 0 and 255 in each.
struct Shades {
    columns: [usize; 3],
    limits: [[f64; 2]; 3],
}

impl Scan {
    fn new(cloud: &PointCloud, with_colors: bool, number: u64, place: &Place) -> Result<Self, ImportError> {
        let malformed = |expected: &str, found: String| {
            Err(ImportError::malformed(expected, found, place.clone().of_item("scan", number)))
        };
        if cloud.prototype.len() > MOST_COLUMNS {
            return malformed("points of at most 256 values", cloud.prototype.len().to_string());
        }
        let cartesian = columns_of(cloud, &CARTESIAN);
        let Some(position) = cartesian.or(columns_of(cloud, &SPHERICAL)) else {
            return malformed("three cartesian or spherical coordinates", "fewer".to_owned());
        };
        let invalid_name =
            if cartesian.is_some() { RecordName::CartesianInvalidState } else { RecordName::SphericalInvalidState };
        let invalid = column_of(cloud, &invalid_name);
        let color = match columns_of(cloud, &COLOR) {
            Some(columns) if with_colors => Some(Shades { columns, limits: shades(cloud, columns) }),
            _ => None,
        };
        let used = |column: usize| {
            position.contains(&column)
                || invalid == Some(column)
                || color.as_ref().is_some_and(|color| color.columns.contains(&column))
        };
        let records = cloud.prototype.iter().enumerate();
        let columns: Vec<_> = records.map(|(index, record)| Column::new(&record.data_type, used(index))).collect();
        if columns.iter().all(Column::is_constant) {
            return malformed("points that differ", "points without a single bit".to_owned());
        }
        let (mut rotation, mut translation) = (DQuat::IDENTITY, DVec3::ZERO);
        if let Some(pose) = &cloud.transform {
            let quaternion = &pose.rotation;
            rotation = DQuat::from_xyzw(quaternion.x, quaternion.y, quaternion.z, quaternion.w);
            translation = DVec3::new(pose.translation.x, pose.translation.y, pose.translation.z);
            let length = rotation.length();
            if !translation.is_finite() || !(1e-6..1e6).contains(&length) {
                return malformed("a pose with a unit quaternion", format!("one of length {length}"));
            }
            rotation /= length;
        }
        let is_spherical = cartesian.is_none();
        Ok(Self { columns, position, is_spherical, invalid, color, rotation, translation, left: cloud.records, number })
    }

    /// Points whose values have all come.
    fn available(&self) -> u64 {
        self.columns.iter().filter_map(Column::available).min().unwrap_or(0).min(self.left)
    }

    /// Appends the points that have come, at most `most`.
    fn take(&mut self, most: u64, batch: &mut Batch) -> u64 {
        let count = self.available().min(most);
        for index in 0..count {
            if self.invalid.is_some_and(|column| self.columns[column].get(index) != 0.0) {
                continue;
            }
            let [a, b, c] = self.position.map(|column| self.columns[column].get(index));
            let local = if self.is_spherical {
                let (sin_azimuth, cos_azimuth) = (libm::sin(b), libm::cos(b));
                let (sin_elevation, cos_elevation) = (libm::sin(c), libm::cos(c));
                a * DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
            } else {
                DVec3::new(a, b, c)
            };
            let position = self.rotation * local + self.translation;
            if !position.is_finite() {
                continue;
            }
            batch.vertices.positions.push(position);
            if let Some(Shades { columns, limits }) = &self.color {
                let channel = |channel: usize| {
                    let [low, high] = limits[channel];
                    let value = (self.columns[columns[channel]].get(index) - low) / (high - low);
                    (value * 255.0 + 0.5) as u8
                };
                batch.vertices.colors.push([channel(0), channel(1), channel(2)]);
            }
        }
        self.columns.iter_mut().for_each(|column| column.skip(count));
        self.left -= count;
        count
    }

    /// Reads the next packet: values for some of the columns, or none.
    fn read_packet(&mut self, pages: &mut Pages) -> Result<(), ImportError> {
        let (start, place) = (pages.position(), pages.place().of_item("scan", self.number));
        let what = format!("the points of scan {} are complete", self.number);
        let mut head = [0; 4];
        pages.read(&mut head, &what)?;
        let bytes = u64::from(u16::from_le_bytes([head[2], head[3]])) + 1;
        match head[0] {
            0 | 2 => {} // An index, or nothing.
            1 => {
                let mut count = [0; 2];
                pages.read(&mut count, &what)?;
                let count = usize::from(u16::from_le_bytes(count));
                if count != self.columns.len() {
                    let expected = format!("a packet of {} columns", self.columns.len());
                    return Err(ImportError::malformed(expected, count.to_string(), place));
                }
                let mut sizes = vec![0; 2 * count];
                pages.read(&mut sizes, &what)?;
                let sizes: Vec<_> =
                    sizes.as_chunks().0.iter().map(|size| usize::from(u16::from_le_bytes(*size))).collect();
                let sum = 6 + 2 * count as u64 + sizes.iter().sum::<usize>() as u64;
                if sum > bytes {
                    let expected = format!("a packet of at least {sum} bytes");
                    return Err(ImportError::malformed(expected, bytes.to_string(), place));
                }
                for (column, size) in self.columns.iter_mut().zip(sizes) {
                    if column.is_kept() {
                        pages.read(column.extend(size), &what)?;
                    } else {
                        column.pass(size);
                        pages.set_position(pages.position() + size as u64);
                    }
                }
            }
            kind => {
                return Err(ImportError::malformed("a packet of kind 0, 1 or 2", kind.to_string(), place));
            }
        }
        // Packets are multiples of four bytes.
        pages.set_position(start + bytes.next_multiple_of(4));
        Ok(())
    }
}

fn value_of(value: &RecordValue) -> f64 {
    match *value {
        RecordValue::Single(value) => value.into(),
        RecordValue::Double(value) => value,
        RecordValue::ScaledInteger(value) | RecordValue::Integer(value) => value as f64,
    }
}

/// What stands for 0 and 255 in the columns of a colour.
fn shades(cloud: &PointCloud, columns: [usize; 3]) -> [[f64; 2]; 3] {
    let declared = cloud.color_limits.as_ref().map(|limits| {
        [
            (&limits.red_min, &limits.red_max),
            (&limits.green_min, &limits.green_max),
            (&limits.blue_min, &limits.blue_max),
        ]
        .map(|(low, high)| Some([value_of(low.as_ref()?), value_of(high.as_ref()?)]))
    });
    std::array::from_fn(|channel| {
        let of_type = match cloud.prototype[columns[channel]].data_type {
            RecordDataType::Integer { min, max } if max.checked_sub(min).is_some_and(|range| range <= 0xffff) => {
                [min as f64, max as f64]
            }
            RecordDataType::Integer { .. } | RecordDataType::ScaledInteger { .. } => [0.0, 255.0],
            _ => [0.0, 1.0],
        };
        let limits = declared.and_then(|declared| declared[channel]).unwrap_or(of_type);
        if limits[1] > limits[0] && limits.iter().all(|limit| limit.is_finite()) { limits } else { [0.0, 255.0] }
    })
}

impl E57Stream {
    /// Goes to the next scan, if there is one.
    fn begin_scan(&mut self) -> Result<(), ImportError> {
        let Some(cloud) = self.clouds.pop_front() else { return Ok(()) };
        self.pages.seek(cloud.file_offset);
        let place = self.pages.place();
        let scan = Scan::new(&cloud, self.colors, self.scans, &place)?;
        let mut head = [0; 32];
        self.pages.read(&mut head, &format!("the points of scan {} are complete", self.scans))?;
        if head[0] != 1 {
            let place = place.of_item("scan", self.scans);
            return Err(ImportError::malformed("a section of kind 1", head[0].to_string(), place));
        }
        self.pages.seek(u64::from_le_bytes(*head[16..].first_chunk().expect("it has 32 bytes")));
        self.scan = Some(scan);
        self.scans += 1;
        Ok(())
    }
}

impl ModelStream for E57Stream {
    fn attributes(&self) -> Attributes {
        Attributes { normals: false, colors: self.colors }
    }

    fn up_axis(&self) -> UpAxis {
        UpAxis::Z
    }

    fn unit(&self) -> Option<LengthUnit> {
        Some(LengthUnit::Metre)
    }

    fn reference_system(&self) -> Option<&ReferenceSystem> {
        self.system.as_ref()
    }

    fn declared_faces(&self) -> Option<u64> {
        Some(0)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while let Some(scan) = &mut self.scan
            && !batch.is_full()
        {
            if scan.left == 0 {
                self.scan = None;
                self.begin_scan()?;
            } else if scan.available() == 0 {
                scan.read_packet(&mut self.pages)?;
            } else {
                let room = (Batch::TARGET - batch.vertices.positions.len()) as u64;
                self.read += scan.take(room, batch);
            }
        }
        Ok(!batch.is_empty())
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        // Scans may lie in the file in any order; points are as good a measure.
        let share = self.read as f64 / self.points.max(1) as f64;
        ((self.total_bytes as f64 * share) as u64, self.total_bytes)
    }
}
