//! Makes small files of points, LAS, LAZ and E57, with writers that share no line with the readers.

use e57::{E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation};
use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlrBuilder};
use std::io::Cursor;

/// Records of a point format: positions (n, 2n, 3n), and a colour where there is one.
fn las_records(format: u8, extra: usize, count: usize) -> Vec<Vec<u8>> {
    let bytes = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67][usize::from(format)];
    let color = [0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30][usize::from(format)];
    (0..count)
        .map(|number| {
            let mut record = vec![0; bytes + extra];
            for axis in 0..3 {
                let value = (number * (axis + 1)) as i32;
                record[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
            }
            record[12] = (number % 251) as u8;
            if format > 5 {
                // One return of one, in one of two scanner channels.
                record[14] = 0x11;
                record[15] = ((number / 100 % 2) as u8) << 4;
            }
            if color > 0 {
                for channel in 0..3 {
                    let value = ((number * 7 + channel) % 256 * 257) as u16;
                    record[color + 2 * channel..][..2].copy_from_slice(&value.to_le_bytes());
                }
            }
            record
        })
        .collect()
}

/// A LAS file of version 1.4, or LAZ with chunks of a given number of points; 0 for varying ones.
pub(crate) fn las(format: u8, extra: usize, count: usize, chunk: Option<u32>) -> Vec<u8> {
    let records = las_records(format, extra, count);
    let record_bytes = records.first().map_or(20, Vec::len);
    let mut bytes = vec![0; 375];
    bytes[..4].copy_from_slice(b"LASF");
    bytes[24..26].copy_from_slice(&[1, 4]);
    bytes[94..96].copy_from_slice(&375u16.to_le_bytes());
    bytes[104] = format | if chunk.is_some() { 0x80 } else { 0 };
    bytes[105..107].copy_from_slice(&(record_bytes as u16).to_le_bytes());
    bytes[107..111].copy_from_slice(&(count as u32).to_le_bytes());
    for axis in 0..3 {
        bytes[131 + 8 * axis..][..8].copy_from_slice(&0.001f64.to_le_bytes());
        bytes[155 + 8 * axis..][..8].copy_from_slice(&500_000.0f64.to_le_bytes());
    }
    bytes[247..255].copy_from_slice(&(count as u64).to_le_bytes());
    let mut points = Vec::new();
    if let Some(chunk) = chunk {
        let items = LazItemRecordBuilder::default_for_point_format_id(format, extra as u16).expect("it is a format");
        let builder = LazVlrBuilder::new(items);
        let builder =
            if chunk == 0 { builder.with_variable_chunk_size() } else { builder.with_fixed_chunk_size(chunk) };
        let vlr = builder.build();
        let mut data = Vec::new();
        vlr.write_to(&mut data).expect("memory takes all");
        let mut head = [0; 54];
        head[2..16].copy_from_slice(b"laszip encoded");
        head[18..20].copy_from_slice(&22204u16.to_le_bytes());
        head[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
        bytes[100..104].copy_from_slice(&2u32.to_le_bytes());
        // Another record first: one that must be skipped.
        bytes.extend([0; 20]);
        bytes.extend(5u16.to_le_bytes());
        bytes.extend([0; 32 + 5]);
        bytes.extend(head);
        bytes.extend(data);
        let start = bytes.len() as u64;
        let mut out = Cursor::new(vec![0; start as usize]);
        out.set_position(start);
        let mut compressor = LasZipCompressor::new(&mut out, vlr).expect("it is a known kind");
        for (number, record) in records.iter().enumerate() {
            compressor.compress_one(record).expect("memory takes all");
            if chunk == 0 && number % 70 == 69 {
                compressor.finish_current_chunk().expect("memory takes all");
            }
        }
        compressor.done().expect("memory takes all");
        drop(compressor);
        points.extend(&out.into_inner()[start as usize..]);
    } else {
        points.extend(records.concat());
    }
    let offset = bytes.len() as u32;
    bytes[96..100].copy_from_slice(&offset.to_le_bytes());
    bytes.extend(points);
    bytes
}

/// Two scans, the second moved, with invalid points.
pub(crate) fn e57(points: usize) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "a file").expect("memory takes all");
    let scaled = |name| Record {
        name,
        data_type: RecordDataType::ScaledInteger { min: -5000, max: 100_000, scale: 0.001, offset: 2.0 },
    };
    let color = |name| Record { name, data_type: RecordDataType::Integer { min: 0, max: 255 } };
    let prototype = vec![
        scaled(RecordName::CartesianX),
        Record::CARTESIAN_Y_F32,
        Record::CARTESIAN_Z_F64,
        Record { name: RecordName::CartesianInvalidState, data_type: RecordDataType::Integer { min: 0, max: 2 } },
        Record { name: RecordName::RowIndex, data_type: RecordDataType::Integer { min: 0, max: 1000 } },
        color(RecordName::ColorRed),
        color(RecordName::ColorGreen),
        Record { name: RecordName::ColorBlue, data_type: RecordDataType::Integer { min: 7, max: 7 } },
    ];
    for scan in 0..2 {
        let mut cloud = writer.add_pointcloud(&format!("scan {scan}"), prototype.clone()).expect("memory takes all");
        if scan == 1 {
            // A quarter turn about z.
            let half = std::f64::consts::FRAC_1_SQRT_2;
            cloud.set_transform(Some(Transform {
                rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
                translation: Translation { x: 600_000.0, y: 0.0, z: 0.0 },
            }));
        }
        for number in 0..points {
            let values = vec![
                RecordValue::ScaledInteger(number as i64),
                RecordValue::Single(number as f32 * 0.5),
                RecordValue::Double(number as f64 * 0.25),
                RecordValue::Integer(i64::from(number % 10 == 3)),
                RecordValue::Integer(number as i64 % 1000),
                RecordValue::Integer(number as i64 % 256),
                RecordValue::Integer(255),
                RecordValue::Integer(7),
            ];
            cloud.add_point(values).expect("memory takes all");
        }
        cloud.finalize().expect("memory takes all");
    }
    writer.finalize().expect("memory takes all");
    drop(writer);
    bytes.into_inner()
}
