//! The sample of `docs/format.md`: its bytes are what the writer writes and what readers understand, and its tables are true.

use crate::stranger::{self, child_ball, sphere_codes};
use crate::tree::{Layout, Tree, TreeNode, open};
use gigalod_format::splats::{PageId, Root};
use gigalod_format::{Bounds, InputCounts, LevelSummary, Metadata};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::quantise::{cone, normal};
use gigalod_geom::{Aabb, Sphere};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::fmt::Write;

const DOCUMENT: &str = include_str!("../../../../docs/format.md");

/// The hex block: on each line an offset, bytes, and after a semicolon what they are.
pub(crate) fn bytes_of_the_document() -> Vec<u8> {
    let block = DOCUMENT.split("```hex\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a hex block");
    let mut bytes = Vec::new();
    for line in block.lines().map(|line| line.split(';').next().unwrap().trim()).filter(|line| !line.is_empty()) {
        let (offset, rest) = line.split_once(' ').expect("an offset, then bytes");
        assert_eq!(usize::from_str_radix(offset, 16).unwrap(), bytes.len(), "offset of the line {line:?}");
        bytes.extend(rest.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()));
    }
    bytes
}

/// Five leaves on three levels: the root has a leaf and an inner node, which has four leaves.
fn sample() -> (Tree, Root, Metadata) {
    let code_of = |s, corner| sphere_codes().iter().position(|code| *code == (s, corner)).unwrap() as u16;
    let node = |children: &[usize], s, corner, direction: [f32; 3], cone: u8, color| TreeNode {
        children: children.to_vec(),
        sphere: code_of(s, corner),
        normal: normal::encode(Vec3::from_array(direction)),
        cone,
        color,
    };
    let tree = Tree {
        nodes: vec![
            node(&[1, 2], 13, [0, 0, 0], [1.0, 0.0, 0.0], 3, 0xC5F5),
            node(&[], 5, [0, 4, 4], [-1.0, 0.0, 0.0], 1, 0xF800),
            node(&[3, 4, 5, 6], 8, [5, 3, 2], [1.0, 0.0, 0.0], 3, 0x07FF),
            node(&[], 6, [6, 6, 6], [0.5, 0.6, 0.7], 0, 0x001F),
            node(&[], 6, [6, 1, 1], [0.7, -0.5, -0.6], 1, 0x07E0),
            node(&[], 6, [1, 6, 1], [-0.6, 0.7, -0.5], 2, 0xFFE0),
            node(&[], 6, [1, 1, 6], [-0.5, -0.7, 0.6], 1, 0xFFFF),
        ],
        has_colors: true,
    };
    let origin = DVec3::new(100.0, 200.0, 300.0);
    let half = DVec3::new(8.0, 3.0, 3.0);
    let root = Root {
        origin,
        sphere: Sphere { center: Vec3::new(0.0, -1.0, 1.0), radius: 13.0 },
        overhang: 1.25,
        bounds: Aabb { min: origin - half, max: origin + half },
        nodes: 7,
        leaves: 5,
        levels: 3,
        has_colors: true,
        closed: false,
        up: UpAxis::Y,
    };
    let level =
        |level, nodes, bytes, max_error| LevelSummary { level, nodes, triangles: 0, points: nodes, bytes, max_error };
    let metadata = Metadata {
        generator: "a sample".into(),
        input: InputCounts { triangles: 4, vertices: 5, points: 0 },
        options: BTreeMap::from([("as".into(), "splats".into()), ("up".into(), "y".into())]),
        nodes: 7,
        levels: 3,
        leaves: 5,
        repeated: 0,
        raw_bytes: 144 + 58,
        closed: false,
        bounds: Bounds { min: root.bounds.min.to_array(), max: root.bounds.max.to_array() },
        reference_system: None,
        attributes: vec!["normals".into(), "colors".into()],
        dicing: None,
        per_level: vec![level(0, 1, 6, 26.0), level(1, 2, 13, 16.0), level(2, 4, 26, 7.384_615_421_295_166)],
    };
    (tree, root, metadata)
}

#[test]
fn the_sample_is_what_the_writer_writes() {
    let (tree, root, metadata) = sample();
    let written = tree.write_with(Layout::default(), &root, &metadata);
    let mut dump = String::new();
    for (line, bytes) in written.chunks(16).enumerate() {
        let hex: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let _ = writeln!(dump, "{:04x}  {:47}  ; {}", line * 16, hex.join(" "), bytes.escape_ascii());
    }
    assert!(bytes_of_the_document() == written, "expected in the document:\n{dump}");
}

#[test]
fn the_sample_reads_back_with_the_nodes_the_document_lists() {
    let (tree, root, metadata) = sample();
    let bytes = bytes_of_the_document();
    let file = open(&bytes).unwrap();
    assert_eq!(*file.skeleton().root(), root);
    assert_eq!(file.container().read_metadata().unwrap(), metadata);
    let page = file.read_page(PageId(0)).unwrap();
    let seen = stranger::read(&bytes);
    assert_eq!(seen, stranger::expected(&tree, root.sphere));
    let codes = sphere_codes();
    let mut rows = String::new();
    for ((index, seen), word) in seen.iter().enumerate().zip([0usize, 2, 3, 5, 6, 7, 8]) {
        let (bits, code, color) = (page.words()[word], tree.nodes[index].sphere, page.colors()[word]);
        assert_eq!(Some(color), seen.color);
        let (s, [x, y, z]) = codes[usize::from(code)];
        let ([cx, cy, cz], r) = (seen.center, seen.radius);
        let row = format!(
            "| {word} | `{bits:08x}` | {code} | {s}, ({x}, {y}, {z}) | {} | {} | {} | `{color:04x}` | ({cx}, {cy}, {cz}) | {r} |",
            seen.normal, seen.cone, seen.children
        );
        assert!(!rows.contains(&row));
        let _ = writeln!(rows, "{row}");
    }
    assert!(DOCUMENT.contains(&rows), "expected in the document:\n{rows}");
    let pointers = [1, 4].map(|word| page.family(page.words()[word]));
    assert_eq!(pointers.map(|place| (place.page.0, place.family)), [(0, 1), (0, 2)]);
    let words = [0, 1, 2, 3].map(|family| page.family_word(family).map(|word| word.0));
    assert_eq!(words, [Some(0), Some(2), Some(5), None]);
}

#[test]
fn the_sample_keeps_the_promises_of_the_document() {
    let (tree, root, _) = sample();
    // Overhang: no descendant reaches farther than 1.25 radii. Cones: a child's lies within its parent's.
    let balls: Vec<_> =
        stranger::read(&bytes_of_the_document()).iter().map(|seen| (seen.center, seen.radius)).collect();
    for (above, below) in [(0, 1..7), (2, 3..7)] {
        for below in below {
            let apart = Vec3::from_array(balls[above].0).distance(Vec3::from_array(balls[below].0));
            assert!(apart + balls[below].1 <= root.overhang * balls[above].1, "{above} {below}");
        }
        assert_eq!(tree.nodes[above].cone, 3);
    }
    assert!(balls[6].1 > 3.6, "the arithmetic was worth showing");
}

#[test]
fn the_tables_of_codes_are_true() {
    let codes = sphere_codes();
    let mut rows = String::new();
    for s in 1..=13i64 {
        let first = codes.iter().position(|code| code.0 == s).unwrap();
        let count = codes.iter().filter(|code| code.0 == s).count();
        let _ = writeln!(rows, "| {s} | {} | {count} | {first} |", (14 - s).pow(3));
    }
    assert!(DOCUMENT.contains(&rows), "expected in the document:\n{rows}");
    let mut rows = String::new();
    for code in [0, 1, 1000, 3000, 5000, 7000, 7600, 7620] {
        let (s, [x, y, z]) = codes[code];
        let ([cx, cy, cz], r) = child_ball([0.0; 3], 1.0, codes[code]);
        let _ = writeln!(rows, "| {code} | {s} | ({x}, {y}, {z}) | ({cx}, {cy}, {cz}) | {r} |");
    }
    assert!(DOCUMENT.contains(&rows), "expected in the document:\n{rows}");
    let mut rows = String::new();
    for code in [0u16, 51, 2652, 4082, 9490, 16_223] {
        let (face, row, column) = (code / 2704, code / 52 % 52, code % 52);
        let [x, y, z] = normal::decode(code).to_array();
        let _ = writeln!(rows, "| {code} | {face} | {row} | {column} | ({x:.5}, {y:.5}, {z:.5}) |");
    }
    assert!(DOCUMENT.contains(&rows), "expected in the document:\n{rows}");
    assert_eq!(cone::SINES, [0.0625, 0.25, 0.5625, 1.0]);
}
