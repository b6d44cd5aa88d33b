//! STL, binary and text.

use crate::sources::{error, read, read_in_drops};

/// A tetrahedron: four facets of three corners.
const FACETS: [[[f32; 3]; 3]; 4] = {
    let [a, b, c, d] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    [[a, c, b], [a, b, d], [b, c, d], [c, a, d]]
};

const TRIANGLES: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]];

fn binary(title: &str, count: u32) -> Vec<u8> {
    let mut bytes = title.as_bytes().to_vec();
    bytes.resize(80, b' ');
    bytes.extend(count.to_le_bytes());
    for facet in FACETS {
        bytes.extend([0; 12]);
        bytes.extend(facet.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn text() -> String {
    let mut text = String::from("solid a facet of the world\n");
    for facet in FACETS {
        text.push_str("  facet normal 0 0 0\n    outer loop\n");
        for [x, y, z] in facet {
            text.push_str(&format!("      vertex {x:e} {y} {z}\n"));
        }
        text.push_str("    endloop\n  endfacet\n");
    }
    text + "endsolid a facet of the world\n"
}

#[test]
fn both_kinds_are_welded_into_one_surface() {
    let upper = text().to_uppercase();
    let on_one_line = format!(
        "solid\n{}",
        text()
            .split_once('\n')
            .expect("it has lines")
            .1
            .replace('\n', " ")
            .replace("endsolid a facet of the world", "\nendsolid")
    );
    for bytes in [
        binary("made by a program", 4),
        binary("solid, says the header, and facet", 4),
        [binary("more follows", 4), vec![7; 30]].concat(),
        text().into_bytes(),
        text().replace('\n', "\r\n").into_bytes(),
        text().replace('\n', "\r").into_bytes(),
        upper.into_bytes(),
        on_one_line.into_bytes(),
    ] {
        let model = read(&bytes).unwrap_or_else(|error| panic!("{error}: {}", bytes.escape_ascii()));
        assert_eq!(model.positions, [[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(model.triangles, TRIANGLES);
        assert_eq!(read_in_drops(&bytes).expect("it is a good file"), model);
    }
    let twice = read(text().repeat(2).as_bytes()).expect("two solids are good");
    assert_eq!((twice.positions.len(), twice.triangles.len()), (4, 8));
}

#[test]
fn errors_name_the_line_or_the_byte() {
    assert_eq!(error(&binary("cut", 5)), "the file ends before facet 4 of 5 is complete (byte 284)");
    let mut infinite = binary("wild", 4);
    infinite[84 + 50 + 12..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert_eq!(error(&infinite), "expected a finite position, found (inf, 0, 0) (byte 134, facet 1)");
    for (from, to, expected) in [
        ("vertex 0e0 1 0", "vertex 0e0 1", "expected three numbers after `vertex`, found fewer (line 5)"),
        ("vertex 0e0 1 0", "vertex 0e0 1 z", "expected three numbers after `vertex`, found `z` (line 5)"),
        ("      vertex 0e0 1 0\n", "", "expected three vertices in a facet, found 2 of them (line 7)"),
        ("endloop", "vertex 1 1 1", "expected three vertices in a facet, found more (line 7)"),
        ("outer", "inner", "expected `outer loop` or `endfacet`, found `inner` (line 3)"),
        ("endsolid a facet of the world\n", "", "the file ends before the line `endsolid` (line 30)"),
        ("endsolid", "and", "expected `facet` or `endsolid`, found `and` (line 30)"),
        ("0e0 1 0", "0e0 nan 0", "expected a finite position, found (0, NaN, 0) (line 8, facet 0)"),
    ] {
        assert_eq!(error(text().replacen(from, to, 1).as_bytes()), expected);
    }
    assert_eq!(error(b"solid\nendsolid\nmore\n"), "expected `solid`, or the end of the file, found `more` (line 3)");
}
