//! What is written in any flavour is what is read.

use crate::{
    document::{Document, FLAVOURS, Random},
    sources::{read, read_in_drops},
};
use gigalod_import::Batch;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_document_reads_back_in_every_flavour(seed in any::<u64>(), vertices in 1..40_usize) {
        let document = Document::random(&mut Random(seed), vertices);
        let expected = document.model();
        for flavour in FLAVOURS {
            for line_end in ["\n", "\r\n", "\r"] {
                let bytes = document.bytes(flavour, line_end);
                let model = read(&bytes).map_err(|error| TestCaseError::fail(format!("{flavour:?}: {error}")))?;
                prop_assert_eq!(&model, &expected, "{:?} {:?}", flavour, line_end);
                let model = read_in_drops(&bytes).expect("read just now");
                prop_assert_eq!(&model, &expected, "{:?} {:?} in drops", flavour, line_end);
            }
        }
    }
}

#[test]
fn a_model_of_many_batches_reads_back_across_all_window_boundaries() {
    let vertices = Batch::TARGET + 4321;
    let document = Document::random(&mut Random(11), vertices);
    let expected = document.model();
    assert_eq!(expected.positions.len(), vertices);
    for flavour in FLAVOURS {
        assert!(read(&document.bytes(flavour, "\n")).expect("it is a good file") == expected, "{flavour:?}");
    }
}

#[test]
fn a_polygon_larger_than_a_batch_is_cut_between_batches() {
    let corners = 3 * Batch::TARGET as u32;
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty uchar x\nproperty uchar y\n\
        property uchar z\nelement face 1\nproperty list uint uint vertex_indices\nend_header\n"
        .to_vec();
    bytes.extend([7; 15]);
    bytes.extend(corners.to_le_bytes());
    (0..corners).for_each(|corner| bytes.extend((corner % 5).to_le_bytes()));
    let model = read(&bytes).expect("it is a good file");
    assert_eq!(model.triangles.len(), corners as usize - 2);
    for (number, triangle) in (0..).zip(model.triangles) {
        assert_eq!(triangle, [0, (number + 1) % 5, (number + 2) % 5], "triangle {number}");
    }
}
