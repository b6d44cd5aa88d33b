//! The sample of `docs/format.md`: a file of one node, written and read.

use crate::made::{Made, NORMAL_BITS, file, open, record};
use gigalod_format::hybrid::{Model, NodeId, Page, Root};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use glam::DVec3;

const DOCUMENT: &str = include_str!("../../../../docs/format.md");

/// A square of two triangles with a tooth, and two points.
fn page() -> Page {
    let up = 255 | 255 << 16;
    Page {
        positions: vec![[0, 0, 8], [16, 0, 8], [16, 16, 9], [0, 16, 8], [30, 8, 0], [8, 8, 12], [4, 2, 12]],
        normals: vec![up, up, up + 2, up, up - 3, up, up + 5],
        colors: vec![],
        triangles: vec![[0, 1, 2], [0, 2, 3], [2, 1, 4]],
        borders: vec![],
    }
}

fn sample() -> Vec<u8> {
    let (bytes, page) = page().encode(5, NORMAL_BITS, &Model::default());
    let mut node = record(&Made { page, vertices: 5 }, &bytes);
    (node.first_child, node.min_steps) = (1, [0; 3]);
    let root = Root {
        origin: DVec3::ZERO,
        edge: 16.0,
        bounds: Aabb { min: DVec3::ZERO, max: DVec3::splat(1.0) },
        cell_bits: 8,
        normal_bits: NORMAL_BITS,
        resolution: 64,
        nodes: 1,
        leaves: 1,
        levels: 1,
        preserves_appearance: true,
        has_colors: false,
        closed: false,
        up: UpAxis::Y,
    };
    file(&(root, vec![node], vec![bytes], Model::default()))
}

fn hex(bytes: &[u8], from: usize) -> String {
    let line = |(number, bytes): (usize, &[u8])| {
        let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{:04x}  {}\n", from + 16 * number, bytes.join(" "))
    };
    bytes.chunks(16).enumerate().map(line).collect()
}

#[test]
fn the_documents_sample_is_what_is_written_and_read_as_it_says() {
    let bytes = sample();
    let file = open(&bytes).unwrap();
    let start = file.skeleton().page_offset(NodeId(0)) as usize;
    let length = file.skeleton().record(NodeId(0)).bytes as usize;
    let read = file.read_page(NodeId(0)).unwrap();
    let shown = format!(
        "positions {:?}\nnormals   {:?}\ntriangles {:?}\nborders   {:?}\n",
        read.positions,
        read.normals.iter().map(|normal| [normal & 0xFFFF, normal >> 16]).collect::<Vec<_>>(),
        read.triangles,
        read.borders
    );
    let expected = [hex(&bytes[128..284], 128), hex(&bytes[start..start + length], start), shown];
    let all = expected.iter().all(|text| DOCUMENT.contains(&format!("```text\n{text}```")));
    assert!(all, "expected in the document:\n{}", expected.join("--\n"));
}
