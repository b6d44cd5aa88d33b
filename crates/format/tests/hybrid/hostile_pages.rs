//! Pages of whatever bytes, with right checksums: a page that keeps what the record says, or an error.

use crate::made::{Made, Random, file, open, soups, tree};
use gigalod_format::hybrid::{HybridFile, NodeId, Page, Skeleton};
use proptest::prelude::*;

/// Decodes bytes in place of a page and checks what always holds.
fn holds(file: &HybridFile, bytes: &[u8]) {
    let record = *file.skeleton().record(NodeId(0));
    let Ok(page) = Page::decode(bytes, file.skeleton(), NodeId(0)) else { return };
    let count = (record.vertices + record.points) as usize;
    assert_eq!((page.positions.len(), page.normals.len()), (count, count));
    assert_eq!(page.colors.len(), if file.skeleton().root().has_colors { count } else { 0 });
    assert_eq!((page.triangles.len(), page.borders.len()), (record.triangles as usize, record.borders as usize));
    for vertex in page.triangles.as_flattened().iter().chain(page.borders.as_flattened()) {
        assert!(*vertex < record.vertices);
    }
    for position in &page.positions {
        assert!((0..3).all(|axis| position[axis] <= record.extent_steps[axis]));
    }
    assert!(page.normals.iter().all(|normal| normal & !0x01FF_01FF == 0));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]
    #[test]
    fn changed_bytes_are_a_page_or_an_error(
        made in soups(), changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut: Option<prop::sample::Index>,
    ) {
        let parts = tree(std::slice::from_ref(&made), &mut Random(1));
        let file = open(&file(&parts)).unwrap();
        let mut bytes = parts.2[0].clone();
        for (at, value) in &changes {
            let at = at.index(bytes.len());
            bytes[at] = *value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        holds(&file, &bytes);
    }

    #[test]
    fn any_bytes_are_a_page_or_an_error(made in soups(), bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let parts = tree(std::slice::from_ref(&made), &mut Random(1));
        let file = open(&file(&parts)).unwrap();
        holds(&file, &bytes);
        // The head of a true page, so that it comes to more.
        let head = parts.2[0].len().min(45);
        holds(&file, &[&parts.2[0][..head], &bytes[..]].concat());
    }

    #[test]
    fn records_that_promise_something_else_are_an_error(made in soups(), which in 0usize..4, more in 1u32..9) {
        let mut parts = tree(std::slice::from_ref(&made), &mut Random(1));
        let node = &mut parts.1[0];
        let count = [&mut node.vertices, &mut node.triangles, &mut node.points, &mut node.borders].into_iter().nth(which).unwrap();
        *count += more;
        if let Ok(file) = open(&file(&parts)) {
            prop_assert_eq!(file.read_page(NodeId(0)).unwrap_err().to_string(), "page 0: its code makes no sense");
        }
    }
}

#[test]
fn every_truncation_of_a_page_is_an_error() {
    let made = Made::grid(5, 5, 10, true, &mut Random(2));
    let parts = tree(std::slice::from_ref(&made), &mut Random(1));
    let file = open(&file(&parts)).unwrap();
    for end in 0..parts.2[0].len() {
        assert!(Page::decode(&parts.2[0][..end], file.skeleton(), NodeId(0)).is_err(), "{end}");
    }
}

#[test]
fn positions_beyond_the_records_extent_are_an_error() {
    let mut made = Made::grid(3, 3, 0, false, &mut Random(2));
    made.page.positions[4] = [30, 40, 50];
    made.page.positions.iter_mut().for_each(|position| *position = position.map(|x| x.min(60)));
    let (root, mut nodes, pages, model) = tree(std::slice::from_ref(&made), &mut Random(1));
    let most = nodes[0].extent_steps;
    nodes[0].extent_steps = [most[0], most[1] - 1, most[2]];
    let skeleton = Skeleton::new(root, nodes, 0).with_model(model);
    let message = Page::decode(&pages[0], &skeleton, NodeId(0)).unwrap_err().to_string();
    assert_eq!(message, "page 0: its code makes no sense");
}

#[test]
fn a_damaged_page_is_an_error_and_others_are_read() {
    let mut random = Random(9);
    let pages: Vec<Made> = (0..3).map(|_| Made::grid(4, 4, 0, false, &mut random)).collect();
    let bytes = file(&tree(&pages, &mut random));
    let good = open(&bytes).unwrap();
    let (start, length) =
        (good.skeleton().page_offset(NodeId(1)) as usize, good.skeleton().record(NodeId(1)).bytes as usize);
    for at in start..start + length {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        let file = open(&damaged).unwrap();
        assert!(file.read_page(NodeId(1)).unwrap_err().to_string().starts_with("page 1 has checksum 0x"));
        for other in [0, 2] {
            assert_eq!(file.read_page(NodeId(other)).unwrap(), good.read_page(NodeId(other)).unwrap());
        }
    }
}
