//! Every kind of error, with its exact message.

use crate::sources::{error, read, read_source};
use gigalod_import::{Item, Place, Position, Problem};
use std::io::{Cursor, Error, Read, Result, Seek, SeekFrom};

/// A header from its lines after `ply`.
fn header(lines: &[&str]) -> Vec<u8> {
    format!("ply\n{}\n", lines.join("\n")).into_bytes()
}

/// A text file of two vertices and a face, with its body.
fn text(body: &str) -> Vec<u8> {
    let lines = [
        "format ascii 1.0",
        "element vertex 2",
        "property float x",
        "property float y",
        "property float z",
        "element face 1",
        "property list uchar int vertex_indices",
        "end_header",
        body,
    ];
    header(&lines)
}

/// The same in binary, `int` indices replaced by `index`.
fn binary(index: &str, vertices: [[f32; 3]; 2], face: &[u8]) -> Vec<u8> {
    let text = String::from_utf8(text("")).expect("it is text").replace("ascii", "binary_little_endian");
    let text = text.replace("uchar int", &format!("uchar {index}"));
    let vertices = vertices.as_flattened().iter().flat_map(|value| value.to_le_bytes());
    text.trim_end().bytes().chain([b'\n']).chain(vertices).chain(face.iter().copied()).collect()
}

#[test]
fn files_that_are_no_models_are_refused() {
    assert_eq!(error(b""), "expected a model, found an empty file");
    let known = "expected a model in a known format (PLY, glTF, LAS, E57, PCD, OFF, STL, OBJ, XYZ or PTS; plain or in gzip), \
        found a file that starts with";
    assert_eq!(error(b"\x89PNG\r\n\x1a\n\0\0"), format!("{known} `\\x89PNG\\r\\n\\x1a\\n\\x00\\x00`"));
    assert_eq!(error(b"plywood is no mesh, however thin"), format!("{known} `plywood is no me`"));
    assert_eq!(error(b"\n \n"), format!("{known} `\\n \\n`"));
}

#[test]
fn wrong_headers_are_refused_with_their_line() {
    let property = "expected `property TYPE NAME` or `property list TYPE TYPE NAME`, \
        with types among char uchar short ushort int uint float double, found";
    let keyword = "expected a line with `element`, `property`, `comment`, `obj_info` or `end_header`, found";
    let format = "expected `format`, then ascii, binary_little_endian or binary_big_endian, then 1.0, found";
    let vertex = "element vertex 1";
    let xyz = "property int x\nproperty int y\nproperty int z";
    let cases: &[(&[&str], String)] = &[
        (&["format utf8 1.0"], format!("{format} `format utf8 1.0` (line 2)")),
        (&["format ascii 2.0"], format!("{format} `format ascii 2.0` (line 2)")),
        (
            &["format ascii 1.0", "format ascii 1.0"],
            "expected one `format` line, found `format ascii 1.0` (line 3)".into(),
        ),
        (
            &[vertex, xyz, "end_header"],
            "expected a `format` line before the end of the header, found `end_header` (line 6)".into(),
        ),
        (&["element vertex"], "expected `element NAME COUNT`, found `element vertex` (line 2)".into()),
        (&["element vertex -1"], "expected `element NAME COUNT`, found `element vertex -1` (line 2)".into()),
        (&["element a 1", "element a 1"], "expected each element once, found `element a 1` (line 3)".into()),
        (
            &["property int x"],
            "expected an `element` line before the first `property`, found `property int x` (line 2)".into(),
        ),
        (&[vertex, "property half x"], format!("{property} `property half x` (line 3)")),
        (&[vertex, "property list int x"], format!("{property} `property list int x` (line 3)")),
        (&[vertex, "property \u{0}\u{7}"], format!("{property} `property \\x00\\x07` (line 3)")),
        (&["elephant 3"], format!("{keyword} `elephant 3` (line 2)")),
        (&["format ascii 1.0", vertex], "the file ends before the line `end_header` (line 4)".into()),
        (&["format ascii 1.0", "end_header"], "expected an element `vertex`, found none (line 3)".into()),
        (
            &["format ascii 1.0", "element face 1", "end_header"],
            "expected an element `vertex`, found `face` (line 4)".into(),
        ),
        (
            &["format ascii 1.0", vertex, "property int x", "property list int int y", "end_header"],
            "expected single numbers `x`, `y` and `z` in the element `vertex`, found `x y` (line 3)".into(),
        ),
        (
            &["format ascii 1.0", vertex, "end_header"],
            "expected single numbers `x`, `y` and `z` in the element `vertex`, found no properties (line 3)".into(),
        ),
        (
            &["format ascii 1.0", "element vertex 4294967296", xyz, "end_header"],
            "expected fewer than 4294967296 vertices, found 4294967296 (line 3)".into(),
        ),
        (
            &["format ascii 1.0", vertex, xyz, "element face 1", "property int vertex_indices", "end_header"],
            "expected a list `vertex_indices` or `vertex_index` in the element `face`, found `vertex_indices` (line 7)"
                .into(),
        ),
    ];
    for (lines, expected) in cases {
        assert_eq!(&error(&header(lines)), expected);
    }
    assert_eq!(error(b"ply"), "the file ends before the line `end_header` (line 2)");
}

#[test]
fn wrong_values_in_text_name_the_line_and_the_item() {
    for (body, expected) in [
        ("0 0 0\n1 one 0", "expected a number for the property `y`, found `one` (line 11, vertex 1)"),
        ("0 0 0\n1 nan inf", "expected a finite position, found (1, NaN, inf) (line 11, vertex 1)"),
        ("0 0 0\n1 1 1\n3 0 1 2", "expected a vertex number below 2, found 2 (line 12, face 0)"),
        ("0 0 0\n1 1 1\n3 0 1 -1", "expected a vertex number below 2, found -1 (line 12, face 0)"),
        ("0 0 0\n1 1 1\n3 0 1 0.5", "expected a whole vertex number, found 0.5 (line 12, face 0)"),
        ("0 0 0\n1 1 1\n3 0 1 nan", "expected a whole vertex number, found NaN (line 12, face 0)"),
        ("0 0 0\n1 1 1\n-3 0 1 0", "expected the length of the list `vertex_indices`, found -3 (line 12, face 0)"),
        (
            "0 0 0\n1 1 1\n1e30",
            "expected the length of the list `vertex_indices`, found 1000000000000000000000000000000 (line 12, face 0)",
        ),
        ("0 0 0\n1 1 1\n3 0 1\n", "the file ends before face 0 of 1 is complete (line 14)"),
        ("0 0 0\n1", "the file ends before vertex 1 of 2 is complete (line 12)"),
    ] {
        assert_eq!(error(&text(body)), expected);
    }
}

#[test]
fn wrong_values_in_binary_name_the_byte_and_the_item() {
    let (zero, one) = ([0.0; 3], [1.0; 3]);
    let start = binary("int", [zero, one], &[]).len();
    let face = |corner: i32| [[3; 1].as_slice(), &[0; 8], &corner.to_le_bytes()].concat();
    let place = format!("(byte {start}, face 0)");
    let expected = format!("expected a vertex number below 2, found -7 {place}");
    assert_eq!(error(&binary("int", [zero, one], &face(-7))), expected);
    let expected = format!("expected a vertex number below 2, found 4294967289 (byte {}, face 0)", start + 1);
    assert_eq!(error(&binary("uint", [zero, one], &face(-7))), expected);
    let expected = format!("expected a finite position, found (1, inf, 1) (byte {}, vertex 1)", start - 12);
    assert_eq!(error(&binary("int", [zero, [1.0, f32::INFINITY, 1.0]], &face(0))), expected);
    let expected = format!("the file ends before face 0 of 1 is complete (byte {})", start + 9);
    assert_eq!(error(&binary("int", [zero, one], &face(0)[..9])), expected);
    let expected = format!("the file ends before vertex 1 of 2 is complete (byte {})", start - 5);
    assert_eq!(error(&binary("int", [zero, one], &[])[..start - 5]), expected);
}

#[test]
fn an_error_can_be_taken_apart() {
    let error = read(&text("0 0 0\n1 1 1\n3 0 1 9")).expect_err("there is no vertex 9");
    assert_eq!(error.what().to_string(), "expected a vertex number below 2, found 9");
    assert!(matches!(error.what(), Problem::IndexOutOfRange { index: 9.0, vertex_count: 2 }));
    let place = error.place().expect("it is in a line");
    assert_eq!(place.to_string(), "line 12, face 0");
    let item = Some(Item { element: "face".to_owned(), index: 0 });
    assert_eq!(place, &Place { position: Position::Line(12), item });
}

#[test]
fn a_failing_source_is_reported_with_its_own_words() {
    struct Failing(Cursor<Vec<u8>>);
    impl Read for Failing {
        fn read(&mut self, into: &mut [u8]) -> Result<usize> {
            match self.0.read(into)? {
                0 => Err(Error::other("the disk is on fire")),
                count => Ok(count),
            }
        }
    }
    impl Seek for Failing {
        fn seek(&mut self, to: SeekFrom) -> Result<u64> {
            self.0.seek(to)
        }
    }
    let bytes = text("0 0 0");
    let place = format!("(byte {})", bytes.len());
    let error = read_source(Box::new(Failing(Cursor::new(bytes)))).expect_err("the source fails");
    assert_eq!(error.to_string(), format!("expected to read on, found an input error: the disk is on fire {place}"));
    assert!(std::error::Error::source(&error).is_some());
}

#[test]
fn hostile_counts_end_with_the_file_and_store_nothing() {
    let vertices = "ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\nproperty int x\nproperty int y\n\
        property int z\nend_header\n0123456789ab";
    assert_eq!(
        error(vertices.as_bytes()),
        format!("the file ends before vertex 1 of 4294967295 is complete (byte {})", vertices.len())
    );
    let lists = "ply\nformat binary_little_endian 1.0\nelement camera 18446744073709551615\n\
        property list uint double view\nelement vertex 0\nproperty int x\nproperty int y\nproperty int z\nend_header\n\
        \u{7f}\u{7f}\u{7f}\u{7f}345678";
    let end = lists.len();
    assert_eq!(
        error(lists.as_bytes()),
        format!("the file ends before camera 0 of 18446744073709551615 is complete (byte {end})")
    );
}
