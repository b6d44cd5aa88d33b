//! OFF and its variants.

use crate::sources::{error, read, read_in_drops};
use gigalod_import::CornerBatch;

#[test]
fn vertices_and_faces_are_read_in_every_layout() {
    for text in [
        "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n",
        "OFF 4 2\n# comment\n\n0 0 0 # here, too\r\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n4 0 1 2 3 0.5 0.5 0.5 1\n",
        "OFF\n# first\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3",
    ] {
        let model = read(text.as_bytes()).expect("it is a good file");
        assert_eq!(model.positions, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(model.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
        assert!(model.colors.is_empty() && model.normals.is_empty() && model.corner_tex_coords.is_empty());
        assert_eq!(read_in_drops(text.as_bytes()).expect("it is a good file"), model);
    }
}

#[test]
fn variants_have_normals_colours_and_texture_coordinates() {
    let model = read(b"COFF\n2 0 0\n0 0 0 255 128 0 255\n1 1 1 1 2 3 255\n").expect("it is a good file");
    assert_eq!(model.colors, [[255, 128, 0], [1, 2, 3]]);
    let model = read(b"COFF\n2 0 0\n0 0 0 1.0 0.5 0\n1 1 1 1 0 0\n").expect("it is a good file");
    assert_eq!(model.colors, [[255, 128, 0], [255, 0, 0]]);
    let model = read(b"NOFF\n1 0 0\n0 0 0 0 nan 1\n").expect("it is a good file");
    assert_eq!(model.normals, [[0.0; 3]]);
    let model = read(b"STCNOFF\n3 2 0\n0 0 0 0 0 1 9 8 7 0.5 0.25\n1 0 0 0 0 1 9 8 7 255 1 0\n0 1 0 0 0 1 9 8 7 0 1\n3 0 1 2\n2 0 1\n")
        .expect("it is a good file");
    assert_eq!(model.normals, [[0.0, 0.0, 1.0]; 3]);
    assert_eq!(model.colors, [[9, 8, 7]; 3]);
    assert_eq!(model.tex_coords, [[0.5, 0.25], [1.0, 0.0], [0.0, 1.0]]);
    assert_eq!((model.triangles, model.corner_tex_coords), (vec![[0, 1, 2]], vec![[0, 1, 2]]));
    assert_ne!(CornerBatch::NONE, 0);
}

#[test]
fn errors_name_the_line() {
    for (text, expected) in [
        ("OFF BINARY\n\0\0\0\x01", "expected OFF as text, found the word `BINARY` (line 1)"),
        ("4OFF\n1 0 0\n", "expected OFF with points of three dimensions, found `4OFF` (line 1)"),
        ("STnOFF\n4\n1 0 0\n", "expected OFF with points of three dimensions, found `STnOFF` (line 1)"),
        ("OFF\n", "the file ends before the numbers of vertices and faces (line 2)"),
        ("OFF\n3\n", "expected the numbers of vertices and faces, found fewer (line 2)"),
        ("OFF\n3 x\n", "expected the numbers of vertices and faces, found `x` (line 2)"),
        ("OFF\n-3 1\n", "expected a count below 4294967295, found -3 (line 2)"),
        ("OFF\n3e30 1\n", "expected a count below 4294967295, found 3000000000000000000000000000000 (line 2)"),
        ("OFF\n2 0 0\n0 0 0\n", "the file ends before vertex 1 of 2 is complete (line 4)"),
        ("OFF\n1 4000000000 0\n0 0 0\n1 0\n", "the file ends before face 1 of 4000000000 is complete (line 5)"),
        ("OFF\n1 0 0\n0 0\n", "expected three numbers of a position, found fewer (line 3, vertex 0)"),
        ("OFF\n1 0 0\n0 inf 0\n", "expected a finite position, found (0, inf, 0) (line 3, vertex 0)"),
        ("COFF\n1 0 0\n0 0 0 1\n", "expected three numbers of a colour, found fewer (line 3, vertex 0)"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0 1\n", "expected a vertex number below 1, found `1` (line 4, face 0)"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0 -1\n", "expected a vertex number below 1, found `-1` (line 4, face 0)"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0\n", "expected 3 corners, found 2 (line 4, face 0)"),
        ("OFF\n1 1 0\n0 0 0\nthree\n", "expected a number of corners, found `three` (line 4, face 0)"),
    ] {
        assert_eq!(error(text.as_bytes()), expected);
    }
}
