//! Skeletons that contradict themselves, each with its exact message.

use crate::made::{Made, Random, file, open, tree};
use gigalod_format::checksum;
use proptest::prelude::*;

/// Where things lie, as in `docs/format.md`.
const SKELETON: usize = 128;
const RECORDS: usize = SKELETON + 112;
const RECORD: usize = 44;

/// Four nodes: the root has two children, the first of these one.
fn good() -> Vec<u8> {
    let mut random = Random(9);
    let pages: Vec<Made> = (0..4).map(|_| Made::grid(2, 2, 0, false, &mut random)).collect();
    let mut parts = tree(&pages, &mut random);
    for (at, (level, children, first)) in [(0, 2, 1), (1, 1, 3), (1, 0, 4), (2, 0, 4)].into_iter().enumerate() {
        let node = &mut parts.1[at];
        (node.level, node.children, node.first_child) = (level, children, first);
        (node.min_steps, node.error_total, node.error_geo) = ([0; 3], 1.0 / (1 + level) as f32, 0.125);
    }
    (parts.0.leaves, parts.0.levels) = (2, 3);
    file(&parts)
}

/// Makes the checksums of skeleton and header right.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[40..48].try_into().unwrap()) as usize;
    if let Some(skeleton) = bytes.get(SKELETON..SKELETON.saturating_add(length)) {
        let sum = checksum(skeleton);
        bytes[48..52].copy_from_slice(&sum.to_le_bytes());
    }
    let sum = checksum(&bytes[..124]);
    bytes[124..128].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn refused(at: usize, new: impl AsRef<[u8]>) -> String {
    let mut bytes = good();
    bytes[at..at + new.as_ref().len()].copy_from_slice(new.as_ref());
    open(&sealed(bytes)).expect_err("a forged file").to_string()
}

fn record(node: usize, at: usize, new: impl AsRef<[u8]>) -> String {
    refused(RECORDS + RECORD * node + at, new)
}

#[test]
fn the_good_file_is_good() {
    let file = open(&sealed(good())).unwrap();
    let shape: Vec<_> =
        file.skeleton().nodes().iter().map(|node| (node.level, node.children, node.first_child)).collect();
    assert_eq!(shape, [(0, 2, 1), (1, 1, 3), (1, 0, 4), (2, 0, 4)]);
}

#[test]
fn a_root_that_cannot_be_is_refused() {
    for (at, value) in [(0, f64::NAN), (24, 0.0), (24, f64::INFINITY), (24, -1.0), (32, 1e9), (56, f64::NEG_INFINITY)] {
        let message = refused(SKELETON + at, value.to_le_bytes());
        assert!(message.starts_with("the skeleton: a cell of "), "{message}");
        assert!(message.ends_with("expected finite numbers, an edge > 0, the smaller first"), "{message}");
    }
    let expected = "expected 4–14, 6–12, at least 1";
    for (at, new, found) in [
        (100, &[3u8][..], "3 bits of cells, 9 of normals, a resolution of 100"),
        (100, &[15], "15 bits of cells, 9 of normals, a resolution of 100"),
        (101, &[13], "12 bits of cells, 13 of normals, a resolution of 100"),
        (104, &[0; 4], "12 bits of cells, 9 of normals, a resolution of 0"),
    ] {
        assert_eq!(refused(SKELETON + at, new), format!("the skeleton: {found}, {expected}"));
    }
    assert_eq!(refused(SKELETON + 102, [0x19]), "the skeleton: flags 0x19, expected none beyond 0xf");
}

#[test]
fn counts_that_do_not_add_up_are_refused() {
    for (at, value, expected) in [
        (88, 1u64, "the skeleton: 1 leaves on 3 levels, expected 2 on 3"),
        (88, u64::MAX, "the skeleton: 18446744073709551615 leaves on 3 levels, expected 2 on 3"),
    ] {
        assert_eq!(refused(SKELETON + at, value.to_le_bytes()), expected);
    }
    assert_eq!(refused(SKELETON + 96, [4]), "the skeleton: 2 leaves on 4 levels, expected 2 on 3");
    for nodes in [0u64, 3, 5, 1 << 40, u64::MAX] {
        let message = refused(SKELETON + 80, nodes.to_le_bytes());
        assert!(message.starts_with(&format!("the skeleton: {nodes} nodes and ")), "{message}");
    }
    let message = refused(SKELETON + 108, [255; 4]);
    assert!(message.starts_with("the skeleton: 4 nodes and 4294967295 bytes of model in "), "{message}");
    for bytes in [0u64, 111] {
        let message = refused(40, bytes.to_le_bytes());
        assert_eq!(message, format!("the skeleton: {bytes} bytes, expected at least 112"));
    }
}

#[test]
fn children_that_are_no_tree_are_refused() {
    // The number of children is in bits 54–57 of a record's first eight bytes.
    let children = |node: usize, count: u8| {
        let place = u64::from_le_bytes(good()[RECORDS + RECORD * node..][..8].try_into().unwrap());
        record(node, 0, (place & !(1023 << 54) | u64::from(count) << 54).to_le_bytes())
    };
    assert_eq!(children(0, 9), "the record of node 0: 9 children, expected at most 8, and 3 that are left");
    assert_eq!(children(0, 4), "the record of node 0: 4 children, expected at most 8, and 3 that are left");
    assert_eq!(children(1, 2), "the record of node 1: 2 children, expected at most 8, and 1 that are left");
    assert_eq!(children(0, 0), "the record of node 1: a child of none, expected nodes before it to have more children");
    assert_eq!(children(1, 0), "the record of node 3: a child of none, expected nodes before it to have more children");
    assert_eq!(children(3, 1), "the record of node 3: 1 children, expected at most 8, and 0 that are left");
    assert_eq!(children(3, 64), "the record of node 3: 64 children, expected at most 8, and 0 that are left");
}

#[test]
fn numbers_out_of_range_are_refused_by_record() {
    assert_eq!(record(1, 18, [0, 0, 0x40]), "the record of node 1: an error of 2, expected at most its parent's 1");
    let numbers = "expected finite numbers ≥ 0";
    assert_eq!(
        record(0, 18, [0, 0x80, 0x7F]),
        format!("the record of node 0: an error of inf and a spacing of 0, {numbers}")
    );
    assert_eq!(
        record(0, 18, [0, 0x80, 0xBF]),
        format!("the record of node 0: an error of -1 and a spacing of 0, {numbers}")
    );
    assert_eq!(
        record(2, 21, [0, 0x80, 0x3F]),
        "the record of node 2: a spacing of 1, expected 0 where there are no points"
    );
    let most = "vertices, triangles, points and borders, expected at most [1048576, 4194304, 1048576, 24]";
    assert_eq!(record(2, 24, [1, 0, 0x10]), format!("the record of node 2: [1048577, 8, 0, 8] {most}"));
    assert_eq!(record(2, 33, [25, 0, 0]), format!("the record of node 2: [9, 8, 0, 25] {most}"));
    assert_eq!(record(2, 24, [0, 0, 0]), format!("the record of node 2: [0, 8, 0, 8] {most}"));
    let message = record(2, 24, [0, 0, 0x10]);
    assert!(message.starts_with("the record of node 2: 1048584 vertices, triangles and points in "), "{message}");
    assert!(message.ends_with(" bytes, expected at most 256 a byte"), "{message}");
    let message = record(2, 36, u32::MAX.to_le_bytes());
    assert!(message.starts_with("the last page ends at byte 42949"), "{message}");
}

#[test]
fn damage_to_the_model_is_refused() {
    let bytes = good();
    let message = refused(RECORDS + 4 * RECORD + 3, [0xFF]);
    assert!(message.starts_with("the model: table 0 has symbols "), "{message}");
    assert!(bytes.len() > RECORDS + 4 * RECORD);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]
    #[test]
    fn whatever_is_forged_a_skeleton_is_a_tree_or_an_error(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
    ) {
        let mut bytes = good();
        for (at, value) in &changes {
            bytes[SKELETON + at.index(112 + 4 * RECORD + 40)] = *value;
        }
        let Ok(file) = open(&sealed(bytes)) else { return Ok(()) };
        let nodes = file.skeleton().nodes();
        let mut parents = vec![0; nodes.len()];
        for (at, node) in nodes.iter().enumerate() {
            for child in node.first_child..node.first_child + node.children {
                prop_assert!(child as usize > at && nodes[child as usize].level == node.level + 1);
                prop_assert!(nodes[child as usize].error_total <= node.error_total);
                parents[child as usize] += 1;
            }
            prop_assert!(node.error_geo <= node.error_total && node.cone_sine <= 1.0);
        }
        prop_assert!(parents[0] == 0 && parents[1..].iter().all(|count| *count == 1));
        for node in 0..nodes.len() as u32 {
            let _ = file.read_page(gigalod_format::hybrid::NodeId(node));
        }
    }
}
