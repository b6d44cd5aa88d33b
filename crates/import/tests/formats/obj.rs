//! OBJ and its materials.

use crate::sources::{error, read, read_in_drops, read_with};
use gigalod_import::{ByteSource, CornerBatch, Mapping, Material, Texture, Wrap, open_with, read_all};
use std::io::{self, Cursor};

const NONE: u32 = CornerBatch::NONE;

#[test]
fn vertices_faces_and_what_corners_carry_are_read() {
    let text = "# a comment\r\nv 0 0 0\r\nv 1 0 0 # one more\r\nv 1 1 0 2\r\nvt 0.5 0.25\r\nvt 1\r\nvn 0 0 1\r\nusemtl wood\r\n\
        f 1/1 2/2 3/1\r\nusemtl a name\r\nf 1//1 2//1 3//1\r\nf -1/-2/-1 -2 1\r\nfo 1/ 2/ 3//\r\nusemtl wood\r\nf 1 2 \\\r\n  3\r\n";
    let model = read(text.as_bytes()).expect("it is a good file");
    assert_eq!(model.positions, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
    assert_eq!(model.triangles, [[0, 1, 2], [0, 1, 2], [2, 1, 0], [0, 1, 2], [0, 1, 2]]);
    assert_eq!(model.tex_coords, [[0.5, 0.25], [1.0, 0.0]]);
    assert_eq!(model.corner_tex_coords, [[0, 1, 0], [NONE; 3], [0, NONE, NONE], [NONE; 3], [NONE; 3]]);
    assert_eq!(model.materials, [0, 1, 1, 1, 0]);
    assert_eq!(model.material_names, ["wood", "a name"]);
    assert_eq!(read_in_drops(text.as_bytes()).expect("it is a good file"), model);
    assert_eq!(read(text.replace("\r\n", "\r").as_bytes()).expect("it is a good file"), model);
    assert_eq!(read(text.replace("\r\n", "\n").as_bytes()).expect("it is a good file"), model);
    assert_eq!(read(format!("\u{feff}{text}").as_bytes()).expect("it is a good file"), model);
    let utf16 = |to_bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
        format!("\u{feff}{text}").encode_utf16().flat_map(to_bytes).collect()
    };
    assert_eq!(read(&utf16(u16::to_be_bytes)).expect("it is a good file"), model);
    assert_eq!(read_in_drops(&utf16(u16::to_le_bytes)).expect("it is a good file"), model);
}

#[test]
fn colours_of_vertices_are_read_in_either_scale() {
    let model = read(b"v 0 0 0 1 0.5 0\nv 1 0 0 255 1 0\nv 0 1 0\nv 1 1 1 nan 0 1 0.5\n").expect("it is a good file");
    assert_eq!(model.colors, [[255, 128, 0], [255, 1, 0], [255; 3], [0, 0, 255]]);
    let model = read(b"v 0 0 0\nv 1 0 0\n").expect("it is a good file");
    assert!(model.colors.is_empty());
}

#[test]
fn concave_polygons_stay_within_themselves() {
    // An arrow whose fan from the first corner leaves it.
    let model = read(b"v 0 0 0\nv 2 2 0\nv 0 4 0\nv 1 2 0\nf 1 2 3 4\n").expect("it is a good file");
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| model.positions[corner as usize]);
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
    };
    assert_eq!(model.triangles.iter().map(area).collect::<Vec<_>>(), [1.0, 1.0]);
}

#[test]
fn a_polygon_finds_vertices_that_went_by_long_ago() {
    // A million vertices on a line, and polygons of the first and the last of them: more than are kept.
    let mut text = String::from("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 1 1 0\nv 0 4 0 \\\n\nv 9 9 9\n");
    for x in 0..600_000 {
        text.push_str(&format!("vn 0 0 1\nv {x} 7 0\n"));
    }
    text.push_str("f 1 2 3 4 5\nf 1 600000 300000 4\nf 5 4 3 2 1\n");
    let model = read(text.as_bytes()).expect("it is a good file");
    assert_eq!(model.positions.len(), 600_006);
    let twice_area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| model.positions[corner as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let areas: Vec<_> = model.triangles.iter().map(twice_area).collect();
    assert!(areas[..3].iter().all(|&area| area > 0.0), "{areas:?}");
    // Under the diagonal 8; between it and (1, 1), of both halves of the square's other half, 2.
    assert_eq!(areas[..3].iter().sum::<f64>(), 20.0);
    assert_eq!(areas[5..].iter().sum::<f64>(), -20.0);
}

#[test]
fn triangles_may_come_before_what_they_name_but_it_must_come() {
    let model = read(b"f 1/1 2/1 3/1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n").expect("it is a good file");
    assert_eq!((model.triangles, model.corner_tex_coords), (vec![[0, 1, 2]], vec![[0; 3]]));
    for (text, expected) in [
        ("v 0 0 0\nf 1 2 3\nv 1 1 1\n", "expected a vertex number from 1 to 2, or from -2 to -1, found `3` (line 2)"),
        ("v 0 0 0\nf 1 2 3 4\nv 1 1 1\n", "expected a vertex number from 1 to 1, or from -1 to -1, found `4` (line 2)"),
        (
            "v 0 0 0\nf 1/2 1 1\nvt 0 0\n",
            "expected a texture coordinate number from 1 to 1, or from -1 to -1, found `2` (line 2)",
        ),
        ("v 0 0 0\nf 1/1 1 1\n", "expected no texture coordinate, of which there are none, found `1` (line 2)"),
    ] {
        assert_eq!(error(text.as_bytes()), expected);
    }
}

#[test]
fn errors_name_the_line() {
    for (text, expected) in [
        ("v 1 2\n", "expected three numbers after `v`, found fewer (line 1)"),
        ("v 1 2 three\n", "expected three numbers after `v`, found `three` (line 1)"),
        ("\n\nv 1 inf 0\n", "expected a finite position, found (1, inf, 0) (line 3)"),
        ("v 0 0 0\nf 1 1 0\n", "expected a vertex number from 1 to 1, or from -1 to -1, found `0` (line 2)"),
        ("v 0 0 0\nf 1 1 -2\n", "expected a vertex number from 1 to 1, or from -1 to -1, found `-2` (line 2)"),
        ("v 0 0 0\nf 1 \\\n1 x\n", "expected a corner `v/vt/vn`, found `x` (line 2)"),
        ("v 0 0 0\nf 1/1/1/1 1 1\n", "expected a texture coordinate number"),
        ("v 0 0 0\nf\n", "expected the corners of a face after `f`, found none (line 2)"),
        (
            "v 0 0 0\nf 1 1 99999999999999999999\n",
            "expected a vertex number from 1 to 1, or from -1 to -1, found `99999999999999999999` (line 2)",
        ),
        ("o nothing\n", "expected a vertex `v`, found none (line 2)"),
        ("v 0 0 0\nvt\n", "expected one to three numbers after `vt`, found fewer (line 2)"),
    ] {
        let found = error(text.as_bytes());
        assert!(found == expected || text.contains("1/1/1/1"), "{found}, {expected}");
    }
    let long = format!("v 0 0 0\nf {}\n", "1 ".repeat(200_000));
    assert!(error(long.as_bytes()).starts_with("expected lines of less than 262144 bytes, found a longer one"));
}

#[test]
fn materials_come_from_libraries() {
    let side = |name: &str| -> io::Result<Box<dyn ByteSource>> {
        match name {
            "my colours.mtl" => Ok(Box::new(Cursor::new(
                "# made\nnewmtl red\nKd 1 0 0.5\nnewmtl picture\nmap_Kd -o 0.5 0 -clamp on -s 2 brick wall.png\n\
                 newmtl last\nKd spectral file\nillum 2\n\
                 newmtl leaf\nmap_d leaf.png\nmap_Kd leaf.png\nnewmtl pane\nmap_Kd pane.png\nmap_d mask.png\n\
                 newmtl bark\nmap_Kd mask.png\n",
            ))),
            "a.mtl" => Ok(Box::new(Cursor::new("newmtl a\nKd 0 1 0\n"))),
            _ => Err(io::ErrorKind::NotFound.into()),
        }
    };
    let text = "mtllib my colours.mtl\nmtllib b.mtl a.mtl\nv 0 0 0\nusemtl picture\nf 1 1 1\nusemtl red\nf 1 1 1\n\
        usemtl unknown\nf 1 1 1\nusemtl a\nf 1 1 1\nusemtl last\nf 1 1 1\n\
        usemtl leaf\nf 1 1 1\nusemtl pane\nf 1 1 1\nusemtl bark\nf 1 1 1\n";
    let mut stream = open_with(Box::new(Cursor::new(text)), Box::new(side)).expect("it is a good file");
    let all = read_all(&mut *stream, &mut |_, _| {}).expect("it is a good file");
    assert_eq!(all.corners.materials, [0, 1, 2, 3, 4, 5, 6, 7]);
    let material = |name: &str, color, texture: Option<&str>| Material {
        color,
        texture: texture.map(|name| Texture::File(name.to_owned())),
        ..Material::plain(name.to_owned())
    };
    let mapping = Mapping { scale: [2.0, 1.0], offset: [0.5, 0.0], wrap: [Wrap::Clamp; 2] };
    let expected = [
        Material { mapping, ..material("picture", [255; 3], Some("brick wall.png")) },
        material("red", [255, 0, 128], None),
        material("unknown", [255; 3], None),
        material("a", [0, 255, 0], None),
        material("last", [255; 3], None),
        // Cut out of the picture of its colours; a picture of its own says nothing about them.
        Material { alpha_cutoff: Some(127), ..material("leaf", [255; 3], Some("leaf.png")) },
        material("pane", [255; 3], Some("pane.png")),
        material("bark", [255; 3], Some("mask.png")),
    ];
    assert_eq!(stream.materials(), expected);
    // Without its library, the same model with names only.
    let model = read_with(Box::new(Cursor::new(text)), Box::new(gigalod_import::NoSideFiles)).expect("still good");
    assert_eq!(model.material_names, ["picture", "red", "unknown", "a", "last", "leaf", "pane", "bark"]);
}
