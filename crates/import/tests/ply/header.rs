//! Oddities of real headers.

use crate::sources::{Model, error, read};
use gigalod_import::{Attributes, open};
use std::io::Cursor;

const TRIANGLE: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

fn triangle() -> Model {
    read(TRIANGLE.as_bytes()).expect("it is a good file")
}

#[test]
fn a_plain_triangle_is_read() {
    let model = triangle();
    assert_eq!(model.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(model.triangles, [[0, 1, 2]]);
    assert!(model.normals.is_empty() && model.colors.is_empty());
}

#[test]
fn any_line_ends_blank_lines_and_comments_make_no_difference() {
    let with_comments = TRIANGLE.replace("element", "comment element vertex 7\n\nobj_info \n  \nelement");
    let indented = TRIANGLE.replace('\n', "  \n\t").replace("element vertex 3", "element   vertex\t3");
    for text in [TRIANGLE, &with_comments, &indented, &format!("\n\n{TRIANGLE}"), TRIANGLE.trim_end()] {
        for line_end in ["\n", "\r\n", "\r"] {
            let text = text.replace('\n', line_end);
            assert_eq!(read(text.as_bytes()).expect("it is a good file"), triangle(), "{text:?}");
        }
    }
}

#[test]
fn comments_need_not_be_utf8() {
    let bytes = [b"ply\ncomment caf\xe9 \xff\xfe\n", &TRIANGLE.as_bytes()[4..]].concat();
    assert_eq!(read(&bytes).expect("it is a good file"), triangle());
}

#[test]
fn binary_data_may_start_with_what_looks_like_a_line_end() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\n\
        property uchar z\nend_header\n";
    for line_end in ["\n", "\r\n", "\r"] {
        for body in [*b"\n\r\n", *b"\r\n\r", *b"   "] {
            let bytes = [header.replace('\n', line_end).as_bytes(), &body].concat();
            let model = read(&bytes).expect("it is a good file");
            assert_eq!(model.positions, [body.map(f64::from)], "{line_end:?}");
        }
    }
    let one_crlf = [header.replace("end_header\n", "end_header\r\n").as_bytes(), b"\n\r\n"].concat();
    assert_eq!(read(&one_crlf).expect("it is a good file").positions, [[10.0, 13.0, 10.0]]);
}

#[test]
fn the_stream_knows_its_counts_and_attributes_before_the_first_batch() {
    let text = TRIANGLE.replace("float z", "float z\nproperty float nx\nproperty float ny\nproperty float nz");
    let stream = open(Box::new(Cursor::new(text.clone()))).expect("it is a good header");
    assert_eq!(stream.attributes(), Attributes { normals: true, colors: false });
    assert_eq!((stream.declared_vertices(), stream.declared_faces()), (Some(3), Some(1)));
    let (consumed, total) = stream.bytes_consumed();
    assert_eq!((consumed, total), (text.find("0 0 0").expect("the first vertex") as u64, text.len() as u64));

    let strips = TRIANGLE.replace("face", "tristrips");
    assert_eq!(open(Box::new(Cursor::new(strips))).expect("it is a good header").declared_faces(), None);
    let points = TRIANGLE.replace("face 1", "edge 1");
    assert_eq!(open(Box::new(Cursor::new(points))).expect("it is a good header").declared_faces(), Some(0));
}

#[test]
fn a_face_element_without_faces_needs_no_list() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\n\
        element face 0\nend_header\n1 2 3\n";
    assert_eq!(read(text.as_bytes()).expect("it is a good file").positions, [[1.0, 2.0, 3.0]]);
}

#[test]
fn elements_without_properties_take_no_time_however_many() {
    let text = TRIANGLE.replace("element face", "element nothing 18446744073709551615\nelement face");
    assert_eq!(read(text.as_bytes()).expect("it is a good file"), triangle());
}

#[test]
fn headers_are_bounded() {
    let long_line = TRIANGLE.replace("element face", &format!("comment {}\nelement face", "x".repeat(20_000)));
    let long = "expected a header of at most 1048576 bytes in lines of at most 16384, found more";
    assert_eq!(error(long_line.as_bytes()), format!("{long} (line 7)"));
    let endless = format!("ply\n{}", "comment x\n".repeat(200_000));
    assert_eq!(error(endless.as_bytes()), format!("{long} (line 104859)"));
    let endless_line = format!("ply {}", "x".repeat(1_000_000));
    assert_eq!(error(endless_line.as_bytes()), format!("{long} (line 2)"));
    let elements: String = (0..300).map(|number| format!("element e{number} 0\n")).collect();
    assert_eq!(
        error(format!("ply\n{elements}").as_bytes()),
        "expected at most 256 elements, found `element e256 0` (line 258)"
    );
    let properties: String = (0..2000).map(|number| format!("property int p{number}\n")).collect();
    assert_eq!(
        error(format!("ply\nelement e 0\n{properties}").as_bytes()),
        "expected at most 1024 properties in an element, found `property int p1024` (line 1027)"
    );
}
