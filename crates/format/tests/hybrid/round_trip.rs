//! What was written comes back: root, records, and each page, in the order that its coder said.

use crate::made::{Made, NORMAL_BITS, Random, file, open, soups, tree};
use crate::stranger::{self, Read};
use gigalod_format::hybrid::{Model, NodeId, NodeRecord, Page, Prepared, Statistics};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// What a stranger would read.
fn by_the_document(page: &Page) -> Read {
    Read {
        positions: page.positions.clone(),
        normals: page.normals.iter().map(|normal| [normal & 0xFFFF, normal >> 16]).collect(),
        colors: page.colors.iter().map(|[red, green, blue, _]| [*red, *green, *blue]).collect(),
        triangles: page.triangles.clone(),
        borders: page.borders.clone(),
    }
}

/// Writes a file of one page, reads it, and compares.
fn comes_back(made: &Made) {
    let parts = tree(std::slice::from_ref(made), &mut Random(1));
    let bytes = file(&parts);
    let read = open(&bytes).unwrap().read_page(NodeId(0)).unwrap();
    assert_eq!(stranger::read(&bytes), [by_the_document(&read)]);
    assert_eq!(read, Prepared::new(&made.page, made.vertices, NORMAL_BITS).into_page());
    assert_eq!(Made { page: read.clone(), vertices: made.vertices }.meaning(), made.meaning());
    let mut borders = Page::borders_of(&read.triangles);
    let mut found = read.borders;
    borders.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, borders);
    assert_eq!(borders.len(), Page::borders_of(&made.page.triangles).len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]
    #[test]
    fn any_page_comes_back(made in soups()) {
        comes_back(&made);
    }

    #[test]
    fn any_page_comes_back_under_any_model(made in soups(), other in soups()) {
        let mut statistics = Statistics::default();
        statistics.count(&Prepared::new(&other.page, other.vertices, NORMAL_BITS));
        let (root, mut nodes, _, _) = tree(std::slice::from_ref(&made), &mut Random(1));
        for model in [Model::default(), Model::of(&statistics)] {
            prop_assert_eq!(&Model::parse(&model.to_bytes()).unwrap(), &model);
            let (bytes, page) = made.page.encode(made.vertices, NORMAL_BITS, &model);
            nodes[0].bytes = bytes.len() as u32;
            nodes[0].checksum = gigalod_format::checksum(&bytes);
            let file = open(&file(&(root, nodes.clone(), vec![bytes], model))).unwrap();
            prop_assert_eq!(file.read_page(NodeId(0)).unwrap(), page);
        }
    }

    #[test]
    fn borders_are_the_edges_of_just_one_triangle(made in soups()) {
        let mut sides = BTreeMap::new();
        for [a, b, c] in &made.page.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *sides.entry((from.min(to), from.max(to))).or_insert(0) += 1;
            }
        }
        let expected: Vec<_> = sides.into_iter().filter(|((a, b), n)| a != b && *n == 1).map(|(side, _)| side).collect();
        let borders = Page::borders_of(&made.page.triangles);
        let mut found: Vec<_> = borders.iter().map(|[a, b]| (a.min(b), a.max(b))).collect();
        found.sort_unstable();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn root_and_records_come_back_rounded_never_to_less(count in 1usize..40, seed: u64) {
        let mut random = Random(seed);
        let pages: Vec<Made> = (0..count).map(|_| Made::grid(2, 1, 20, false, &mut random)).collect();
        let parts = tree(&pages, &mut random);
        let file = open(&file(&parts)).unwrap();
        prop_assert_eq!(*file.skeleton().root(), parts.0);
        let stored: Vec<NodeRecord> = parts.1.iter().map(NodeRecord::as_stored).collect();
        prop_assert_eq!(file.skeleton().nodes(), &stored[..]);
        for (stored, node) in stored.iter().zip(&parts.1) {
            prop_assert!(stored.error_total >= node.error_total && stored.error_total <= node.error_total * 1.0001);
            prop_assert!(stored.error_geo >= node.error_geo && stored.error_geo <= stored.error_total);
            prop_assert!(stored.spacing >= node.spacing && stored.spacing <= node.spacing * 1.0001);
        }
        for node in 0..count as u32 {
            file.read_page(NodeId(node)).unwrap();
        }
    }

    #[test]
    fn a_stored_cone_holds_the_cone(axis in prop::array::uniform3(-1f32..1.0), sine in 0f32..1.1, seed: u64) {
        let axis = glam::Vec3::from_array(axis).normalize_or(glam::Vec3::X);
        let node = NodeRecord { cone_axis: axis.to_array(), cone_sine: sine, ..template() };
        let stored = node.as_stored();
        let around = glam::Vec3::from_array(stored.cone_axis);
        prop_assert!((around.length() - 1.0).abs() < 1e-5);
        if stored.cone_sine < 1.0 {
            prop_assert!(sine < 1.0);
            // A direction on the rim of the cone.
            let mut random = Random(seed);
            let side = axis.any_orthonormal_pair();
            let angle = random.below(360) as f32;
            let rim = axis * (1.0 - sine * sine).sqrt() + sine * (side.0 * angle.to_radians().cos() + side.1 * angle.to_radians().sin());
            prop_assert!(rim.cross(around).length() <= stored.cone_sine + 1e-4, "{} {}", rim.cross(around).length(), stored.cone_sine);
            prop_assert!(rim.dot(around) > 0.0);
        }
    }
}

fn template() -> NodeRecord {
    tree(&[Made::grid(1, 1, 0, false, &mut Random(0))], &mut Random(0)).1[0]
}

#[test]
fn the_smallest_pages_come_back() {
    let mut random = Random(3);
    comes_back(&Made::of(vec![], 0, 0, false, &mut random));
    comes_back(&Made::of(vec![], 0, 1, true, &mut random));
    comes_back(&Made::of(vec![], 4, 0, true, &mut random));
    comes_back(&Made::of(vec![[2, 0, 1]], 3, 0, false, &mut random));
    comes_back(&Made::of(vec![[0, 0, 0]], 1, 0, false, &mut random));
    comes_back(&Made::of(vec![[0, 0, 0]; 5], 1, 3, true, &mut random));
    comes_back(&Made::of(vec![], 0, 3000, true, &mut random));
}

#[test]
fn a_page_of_many_vertices_comes_back() {
    let mut random = Random(4);
    for faults in [0, 3] {
        let made = Made::grid(300, 250, faults, false, &mut random);
        assert!(made.vertices > 1 << 16);
        comes_back(&made);
    }
}

#[test]
fn a_fan_and_a_book_of_many_triangles_do_not_take_forever() {
    let mut random = Random(5);
    let count = 20_000;
    comes_back(&Made::of((1..count).map(|at| [0, at, at + 1]).collect(), count + 1, 0, false, &mut random));
    comes_back(&Made::of((2..count).map(|at| [0, 1, at]).collect(), count, 0, false, &mut random));
    comes_back(&Made::of(vec![[0, 1, 2]; count as usize], 3, 0, false, &mut random));
}

#[test]
fn smooth_meshes_take_few_bytes() {
    let mut made = Made::grid(60, 40, 0, false, &mut Random(6));
    for (at, position) in made.page.positions.iter_mut().enumerate() {
        let (x, y) = (at % 61, at / 61);
        *position =
            [40 * x as u16, 40 * y as u16, (1000.0 + 200.0 * (x as f32 / 9.0).sin() * (y as f32 / 7.0).cos()) as u16];
    }
    made.page.normals.fill(255 | 255 << 16);
    let bytes = &tree(std::slice::from_ref(&made), &mut Random(1)).2[0];
    // Connectivity hardly anything, positions most of it; raw it would be 17 bytes a triangle.
    assert!(2 * bytes.len() < 3 * made.page.triangles.len(), "{} bytes", bytes.len());
}

#[test]
fn the_same_page_gives_the_same_bytes_whatever_the_order_of_its_points() {
    let made = Made::of(vec![[0, 1, 2]], 3, 500, true, &mut Random(7));
    let bytes = made.page.encode(3, NORMAL_BITS, &Model::default()).0;
    let mut other = made.clone();
    other.page.positions[3..].reverse();
    other.page.normals[3..].reverse();
    other.page.colors[3..].reverse();
    assert_eq!(other.page.encode(3, NORMAL_BITS, &Model::default()).0, bytes);
}

#[test]
fn low_bits_that_no_point_uses_cost_nothing() {
    let mut made = Made::of(vec![], 0, 2000, false, &mut Random(8));
    for position in &mut made.page.positions {
        *position = position.map(|coordinate| coordinate % 512);
    }
    let bytes = made.page.encode(0, NORMAL_BITS, &Model::default()).0;
    for position in &mut made.page.positions {
        *position = position.map(|coordinate| coordinate << 5);
    }
    assert_eq!(made.page.encode(0, NORMAL_BITS, &Model::default()).0.len(), bytes.len());
    comes_back(&made);
}
