//! What files say of their coordinates: systems of reference and units.

use crate::make::{e57, las, square};
use gigalod_geom::LengthUnit;
use gigalod_import::{ReferenceSystem, open};
use std::io::Cursor;
use std::path::PathBuf;

/// A LAS file with these variable-length records: number and contents.
fn las_with(records: &[(u16, &[u8])], late: &[(u16, &[u8])]) -> Vec<u8> {
    let plain = las(3, 0, 10, None);
    let (header, points) = plain.split_at(375);
    let mut bytes = header.to_vec();
    for (record, content) in records {
        bytes.extend([0; 2]);
        bytes.extend(b"LASF_Projection\0");
        bytes.extend(record.to_le_bytes());
        bytes.extend((content.len() as u16).to_le_bytes());
        bytes.extend([0; 32]);
        bytes.extend(*content);
    }
    let offset = bytes.len() as u32;
    bytes[96..100].copy_from_slice(&offset.to_le_bytes());
    bytes[100..104].copy_from_slice(&(records.len() as u32).to_le_bytes());
    bytes.extend(points);
    let end = bytes.len() as u64;
    bytes[235..243].copy_from_slice(&end.to_le_bytes());
    bytes[243..247].copy_from_slice(&(late.len() as u32).to_le_bytes());
    for (record, content) in late {
        bytes.extend([0; 2]);
        bytes.extend(b"LASF_Projection\0");
        bytes.extend(record.to_le_bytes());
        bytes.extend((content.len() as u64).to_le_bytes());
        bytes.extend([0; 32]);
        bytes.extend(*content);
    }
    bytes
}

fn words(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn of(bytes: Vec<u8>) -> (Option<ReferenceSystem>, Option<LengthUnit>) {
    let stream = open(Box::new(Cursor::new(bytes))).expect("it is a good file");
    (stream.reference_system().cloned(), stream.unit())
}

fn system(name: &str, epsg: Option<u32>, wkt: Option<&str>) -> Option<ReferenceSystem> {
    let name = (!name.is_empty()).then(|| name.to_owned());
    Some(ReferenceSystem { name, epsg, wkt: wkt.map(str::to_owned) })
}

#[test]
fn keys_of_geotiff_tell_the_system_and_the_unit() {
    let keys = words(&[1, 1, 0, 4, 1024, 0, 1, 1, 1026, 34737, 7, 2, 3072, 0, 1, 2994, 3076, 0, 1, 9003]);
    let texts = b"x|Oregon||\0";
    assert_eq!(
        of(las_with(&[(34735, &keys), (34737, texts)], &[])),
        (system("Oregon", Some(2994), None), Some(LengthUnit::UsSurveyFoot))
    );
    // A unit of one's own, by its length; numbers that are none; degrees.
    let keys = words(&[1, 1, 0, 3, 3072, 0, 1, 32767, 3076, 0, 1, 32767, 3077, 34736, 1, 1]);
    let doubles: Vec<u8> = [7.0f64, 0.3048].iter().flat_map(|value| value.to_le_bytes()).collect();
    assert_eq!(of(las_with(&[(34735, &keys), (34736, &doubles)], &[])), (None, Some(LengthUnit::Foot)));
    let degrees = words(&[1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326]);
    assert_eq!(of(las_with(&[(34735, &degrees)], &[])), (system("", Some(4326), None), None));
    // Places that are not there, and half a key.
    let wild = words(&[1, 1, 0, 9, 1026, 34737, 60000, 60000, 3077, 34736, 1, 9, 3072, 0]);
    assert_eq!(of(las_with(&[(34735, &wild), (34737, texts)], &[])), (None, None));
    assert_eq!(of(las_with(&[(34735, &[1])], &[])), (None, None));
}

#[test]
fn well_known_text_goes_before_keys_wherever_it_stands() {
    let text = r#"PROJCS["UTM",GEOGCS["WGS 84",UNIT["degree",0.0174]],UNIT["metre",1]]"#;
    let keys = words(&[1, 1, 0, 2, 3072, 0, 1, 32610, 3076, 0, 1, 9002]);
    let expected = (system("UTM", Some(32610), Some(text)), Some(LengthUnit::Metre));
    assert_eq!(of(las_with(&[(34735, &keys), (2112, text.as_bytes())], &[])), expected);
    let nul = format!("{text}\0");
    assert_eq!(of(las_with(&[(34735, &keys)], &[(7, b"else"), (2112, nul.as_bytes())])), expected);
    // Text that is none.
    assert_eq!(of(las_with(&[(2112, b"EPSG:4326")], &[])), (None, None));
}

#[test]
fn records_that_promise_more_than_there_is_are_no_errors() {
    let mut bytes = las_with(&[(2112, b"PROJCS[\"a\"]")], &[(2112, b"x")]);
    // The record goes beyond the first point; those behind the points are beyond the file.
    bytes[375 + 20..375 + 22].fill(255);
    bytes[235..243].fill(255);
    assert_eq!(of(bytes), (None, None));
}

#[test]
fn formats_that_have_a_unit_say_so() {
    assert_eq!(of(square().glb()), (None, Some(LengthUnit::Metre)));
    assert_eq!(of(e57(3)), (None, Some(LengthUnit::Metre)));
    assert_eq!(of(b"1 2 3\n".to_vec()), (None, None));
}

#[test]
fn real_files_say_what_pdal_finds_in_them() {
    let Some(data) = std::env::var_os("GIGALOD_DATA").map(PathBuf::from) else {
        println!("skipped: GIGALOD_DATA not set");
        return;
    };
    let of = |name: &str| of(std::fs::read(data.join("points").join(name)).expect("it is there"));
    let (system, unit) = of("autzen_trim.las");
    let system = system.expect("it has keys and a text");
    assert_eq!((system.name.as_deref(), system.epsg), (Some("NAD_1983_HARN_Lambert_Conformal_Conic"), None));
    let wkt = system.wkt.expect("it has a text");
    assert!(wkt.starts_with("PROJCS[\"NAD") && wkt.ends_with("AUTHORITY[\"EPSG\",\"9002\"]]]"), "{wkt}");
    assert_eq!(unit, Some(LengthUnit::Foot));
    assert_eq!(of("lion_takanawa.copc.laz"), (None, None));
}
