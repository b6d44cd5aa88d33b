//! Clouds of points: XYZ and PTS, PCD, LAS and LAZ, E57.

use crate::make::{e57, las};
use crate::sources::{Model, error, read, read_in_drops};
use std::io::Cursor;

/// A text, and the positions, colours and normals of its points.
type Columns = (&'static str, &'static [[f64; 3]], &'static [[u8; 3]], &'static [[f32; 3]]);

#[test]
fn a_number_alone_is_no_cloud_unless_it_says_that_there_are_no_points() {
    let recognised = |text: &'static str| gigalod_import::format_of(Box::new(Cursor::new(text.as_bytes()))).unwrap();
    for text in ["17295\n", "17295", "\n42\n\n", "3\na line of words\n"] {
        assert_eq!(recognised(text), None, "{text:?}");
    }
    for text in ["0\n", "1\n\n1 2 3\n", "1\n1 2 3", "//X Y Z\n"] {
        assert_eq!(recognised(text), Some("XYZ or PTS"), "{text:?}");
    }
}

#[test]
fn columns_of_text_are_told_by_their_values() {
    let cases: &[Columns] = &[
        ("1 2 3\n4 5 6\n", &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], &[], &[]),
        ("1;2;3\r\n4;5;6\r\n", &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], &[], &[]),
        (
            "# made\n2\n1.5,2,3,10,20,30\n4,5,6,1,2,255",
            &[[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]],
            &[[10, 20, 30], [1, 2, 255]],
            &[],
        ),
        (
            "2\n1 2 3 -1200 10 20 30\n4 5 6 800 1 2 3\n",
            &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            &[[10, 20, 30], [1, 2, 3]],
            &[],
        ),
        ("1 2 3 77 10 20 30\n", &[[1.0, 2.0, 3.0]], &[[10, 20, 30]], &[]),
        (
            "1 2 3 0 0.6 0.8\n4 5 6 1 0 0\n",
            &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            &[],
            &[[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]],
        ),
        ("1 2 3 9 8 7 0 0 1\n", &[[1.0, 2.0, 3.0]], &[[9, 8, 7]], &[[0.0, 0.0, 1.0]]),
        ("1 2 3 0.5\n4 5 6 0.25\n", &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], &[], &[]),
        ("//X Y Z R G B\n4 5 6 1.0 0.5 0\n", &[[4.0, 5.0, 6.0]], &[[255, 128, 0]], &[]),
        ("\"b\",\"g\",\"r\",\"z\",\"y\",\"x\"\n1,2,3,4,5,6\n", &[[6.0, 5.0, 4.0]], &[[3, 2, 1]], &[]),
        ("636001.77 848935.203 406.589 1\n", &[[636_001.77, 848_935.203, 406.589]], &[], &[]),
    ];
    for &(text, positions, colors, normals) in cases {
        let model = read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(
            (&model.positions[..], &model.colors[..], &model.normals[..]),
            (positions, colors, normals),
            "{text}"
        );
        assert!(model.triangles.is_empty());
        assert_eq!(read_in_drops(text.as_bytes()).expect("it is a good file"), model);
    }
}

#[test]
fn wrong_lines_of_text_are_errors() {
    for (text, expected) in [
        ("1 2 3\n4 5 six\n", "expected numbers of a point, found `six` (line 2)"),
        ("1 2 3 9 9 9\n4 5 6 9\n", "expected a point of 6 numbers, as the first, found 4 of them (line 2)"),
        ("1 2 3\n4 inf 6\n", "expected a finite position, found (4, inf, 6) (line 2)"),
    ] {
        // The columns are those of all lines at the beginning: many good ones come first.
        let first = text.split_once('\n').expect("it has lines").0;
        let many = format!("{}{text}", format!("{first}\n").repeat(1000));
        let found = error(many.as_bytes());
        assert_eq!(found.replace("1002", "2"), expected);
    }
}

const PCD_HEADER: &str = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb normal_x normal_y normal_z\n\
    SIZE 4 4 4 4 4 4 4\nTYPE F F F U F F F\nCOUNT 1 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n";

fn pcd_values() -> [[f32; 3]; 3] {
    [[1.0, 2.0, 3.0], [f32::NAN, 0.0, 0.0], [4.0, 5.0, 6.0]]
}

fn assert_is_pcd(model: &Model) {
    assert_eq!(model.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(model.colors, [[10, 20, 30]; 2]);
    assert_eq!(model.normals, [[0.0, 0.0, 1.0]; 2]);
}

#[test]
fn pcd_is_read_in_its_three_encodings() {
    let color = 10 << 16 | 20 << 8 | 30u32;
    let mut text = format!("{PCD_HEADER}DATA ascii\n");
    let mut binary = format!("{PCD_HEADER}DATA binary\n").into_bytes();
    for [x, y, z] in pcd_values() {
        text.push_str(&format!("{x} {y} {z} {color} 0 0 1\n"));
        for word in [x.to_bits(), y.to_bits(), z.to_bits(), color, 0, 0, 1f32.to_bits()] {
            binary.extend(word.to_le_bytes());
        }
    }
    // Field after field, packed as bytes that stand for themselves, then three points of a constant field as a repetition.
    let mut fields = Vec::new();
    for axis in 0..3 {
        fields.extend(pcd_values().iter().flat_map(|point| point[axis].to_le_bytes()));
    }
    fields.extend([color; 3].iter().flat_map(|word| word.to_le_bytes()));
    let mut packed: Vec<u8> =
        fields.chunks(32).flat_map(|run| [vec![run.len() as u8 - 1], run.to_vec()].concat()).collect();
    packed.extend([0, 0]); // A zero; then 23 more: length 7 + 14 + 2 of distance 1.
    packed.extend([7 << 5, 14, 0]);
    let one = 1f32.to_le_bytes();
    packed.extend([&[3][..], &one[..]].concat());
    packed.extend([6 << 5, 3]); // 8 bytes of distance 4.
    let mut compressed = format!("{PCD_HEADER}DATA binary_compressed\n").into_bytes();
    compressed.extend((packed.len() as u32).to_le_bytes());
    compressed.extend((3 * 28u32).to_le_bytes());
    compressed.extend(&packed);
    for bytes in [text.as_bytes(), &binary, &compressed] {
        assert_is_pcd(&read(bytes).expect("it is a good file"));
        assert_is_pcd(&read_in_drops(bytes).expect("it is a good file"));
    }
    // Older files have the colour as the f32 of the same bits.
    let old =
        text.replace("TYPE F F F U", "TYPE F F F F").replace(&color.to_string(), &f32::from_bits(color).to_string());
    assert_is_pcd(&read(old.as_bytes()).expect("it is a good file"));
}

#[test]
fn wrong_pcd_is_refused() {
    let with = |from: &str, to: &str| format!("{PCD_HEADER}DATA binary\n").replace(from, to);
    for (text, expected) in [
        (with("SIZE 4", "SIZE 3"), "expected TYPE F, U or I of SIZE 1, 2, 4 or 8 bytes, found `F` of 3 (line 11)"),
        (
            with("SIZE 4 ", "SIZE "),
            "expected as many FIELDS as SIZE, TYPE and COUNT, at most 256, found 7, 6, 7 and 7 (line 11)",
        ),
        (
            with("x y", "x w"),
            "expected the fields `x`, `y` and `z`, found `x w z rgb normal_x normal_y normal_z` (line 11)",
        ),
        (
            with("DATA binary", "DATA packed"),
            "expected `DATA`, then ascii, binary or binary_compressed, found `DATA packed` (line 11)",
        ),
        (with("DATA binary\n", ""), "the file ends before the line `DATA` (line 11)"),
        (with("binary", "binary"), "the file ends before point 0 of 3 is complete (byte 219)"),
        (with("binary", "ascii"), "the file ends before point 0 of 3 is complete (line 12)"),
        (with("binary", "binary_compressed"), "the file ends before its compressed points are complete (byte 230)"),
        (with("COUNT 1", "COUNT 9999999"), "expected whole numbers, found `COUNT 9999999 1 1 1 1 1 1` (line 6)"),
    ] {
        assert_eq!(error(text.as_bytes()), expected);
    }
    let mut lies = with("binary", "binary_compressed").into_bytes();
    lies.extend([255, 255, 255, 255, 84, 0, 0, 0, 5 << 5, 9]);
    assert_eq!(error(&lies), "expected sound LZF data, found damage (byte 239)");
}

#[test]
fn every_point_format_is_read_plain_and_packed() {
    for format in 0..=10 {
        for (extra, chunk) in [(0, None), (3, None), (0, Some(50_000)), (2, Some(100)), (0, Some(0))] {
            let bytes = las(format, extra, 333, chunk);
            let model = read(&bytes).unwrap_or_else(|error| panic!("{format}, {extra}, {chunk:?}: {error}"));
            let is_right = |(number, position): (usize, &[f64; 3])| {
                (0..3).all(|axis| position[axis] == (number * (axis + 1)) as f64 * 0.001 + 500_000.0)
            };
            assert_eq!(model.positions.len(), 333);
            assert!(model.positions.iter().enumerate().all(is_right), "{format}, {extra}, {chunk:?}");
            let has_color = matches!(format, 2 | 3 | 5 | 7 | 8 | 10);
            assert_eq!(model.colors.len(), if has_color { 333 } else { 0 });
            let is_right = |(number, color): (usize, &[u8; 3])| {
                (0..3).all(|channel| usize::from(color[channel]) == (number * 7 + channel) % 256)
            };
            assert!(model.colors.iter().enumerate().all(is_right), "{format}, {extra}, {chunk:?}");
        }
    }
}

#[test]
fn colours_of_eight_bits_in_sixteen_are_recognised() {
    let mut bytes = las(2, 0, 2, None);
    for record in [375, 375 + 26] {
        bytes[record + 20..record + 26].copy_from_slice(&[10, 0, 255, 0, 0, 0]);
    }
    assert_eq!(read(&bytes).expect("it is a good file").colors, [[10, 255, 0]; 2]);
    bytes[375 + 20..375 + 26].copy_from_slice(&[0, 1, 0, 0, 255, 255]);
    assert_eq!(read(&bytes).expect("it is a good file").colors, [[1, 0, 255], [0, 0, 0]]);
    // Black everywhere: no colours.
    bytes[375..].fill(0);
    assert!(read(&bytes).expect("it is a good file").colors.is_empty());
}

#[test]
fn wrong_las_is_refused() {
    let with = |at: usize, bytes: &[u8], chunk: Option<u32>| {
        let mut file = las(7, 0, 10, chunk);
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    for (file, expected) in [
        (with(24, &[2, 0], None), "expected LAS 1.0 to 1.4, found version 2.0 (byte 24)"),
        (with(104, &[11], None), "expected a point format from 0 to 10, found 11 (byte 104)"),
        (with(105, &[20, 0], None), "expected at least 36 bytes for a point of format 7, found 20 (byte 105)"),
        (with(96, &[1, 0, 0, 0], None), "expected points after the 375 bytes of the header, found 1 (byte 96)"),
        (with(94, &[1, 0], None), "expected a header of at least 227 bytes, found 1 (byte 94)"),
        (with(247, &[255; 8], None), "expected fewer than 4294967295 points, found 18446744073709551615 (byte 247)"),
        (with(247, &[11], None), "the file ends before point 10 of 11 is complete (byte 735)"),
        (
            with(131, &f64::NAN.to_le_bytes(), None),
            "expected a finite position, found (NaN, 500000, 500000) (byte 375, point 0)",
        ),
        (
            with(104, &[0x87], None),
            "expected a record `laszip encoded` before the packed points, found none (byte 375)",
        ),
        (
            with(105, &[40, 0], Some(5)),
            "expected items of LAZ that make up points of 40 bytes, found 36 bytes (byte 434)",
        ),
    ] {
        assert_eq!(error(&file), expected);
    }
    assert_eq!(error(&las(1, 0, 1, None)[..100]), "the file ends before the header is complete (byte 100)");
}

#[test]
fn scans_of_e57_are_put_in_their_places() {
    let count = 20_000;
    let model = read(&e57(count)).expect("it is a good file");
    let expected: Vec<[f64; 3]> = (0..count)
        .filter(|number| number % 10 != 3)
        .map(|number| number as f64)
        .map(|number| [number * 0.001 + 2.0, number * 0.5, number * 0.25])
        .collect();
    let (first, second) = model.positions.split_at(expected.len());
    assert_eq!(first, expected);
    assert_eq!(second.len(), expected.len());
    for (moved, [x, y, z]) in second.iter().zip(&expected) {
        let there = [600_000.0 - y, *x, *z];
        assert!((0..3).all(|axis| (moved[axis] - there[axis]).abs() < 1e-6), "{moved:?}, {there:?}");
    }
    assert_eq!(model.colors.len(), 2 * expected.len());
    assert_eq!(model.colors[..4], [[0, 255, 7], [1, 255, 7], [2, 255, 7], [4, 255, 7]]);
}

#[test]
fn damaged_e57_names_what_is_wrong() {
    let good = e57(1000);
    let mut damaged = good.clone();
    damaged[1100] ^= 1;
    assert_eq!(error(&damaged), "expected a page with its checksum, found another (byte 1024)");
    assert_eq!(error(&good[..40]), "the file ends before the header is complete (byte 40)");
    let mut lies = good.clone();
    lies[32..40].copy_from_slice(&[255; 8]);
    let most = good.len();
    assert_eq!(
        error(&lies),
        format!("expected a description of at most {most} bytes, found 18446744073709551615 (byte 32)")
    );
    let cut = error(&good[..good.len() - 1024]);
    assert!(cut.starts_with("expected an E57 file, found ") && cut.ends_with("(byte 0)"), "{cut}");
}
