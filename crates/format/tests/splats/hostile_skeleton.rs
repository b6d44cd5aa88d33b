//! Skeletons that contradict themselves, each with its exact message.

use crate::forgery::{Forgery, SKELETON, header};
use crate::stranger::Bytes;
use crate::tree::open;
use gigalod_format::splats::Skeleton;
use proptest::prelude::*;

fn refused(at: usize, new: impl AsRef<[u8]>) -> String {
    Forgery::new().put(SKELETON + at, new.as_ref()).refused()
}

#[test]
fn a_root_that_is_no_sphere_is_refused() {
    let expected = "expected finite numbers, a radius ≥ 0, an overhang of 1–64";
    let center = "[0.25, -0.5, 0.3]";
    for (at, value, found) in [
        (36, f32::NAN, format!("{center} with radius NaN and overhang 1.75")),
        (36, -1.0, format!("{center} with radius -1 and overhang 1.75")),
        (36, f32::INFINITY, format!("{center} with radius inf and overhang 1.75")),
        (24, f32::INFINITY, "[inf, -0.5, 0.3] with radius 10.7 and overhang 1.75".into()),
        (40, f32::NAN, format!("{center} with radius 10.7 and overhang NaN")),
        (40, 0.5, format!("{center} with radius 10.7 and overhang 0.5")),
        (40, 64.5, format!("{center} with radius 10.7 and overhang 64.5")),
    ] {
        let message = refused(at, value.to_le_bytes());
        assert_eq!(message, format!("the skeleton: a root sphere at {found}, {expected}"));
    }
    let bounds = "[999990, -2000010, -9.9] to [1000010, -1999990, 10.1]";
    let expected = "expected finite numbers, the smaller first";
    assert_eq!(
        refused(0, f64::NAN.to_le_bytes()),
        format!("the skeleton: an origin at [NaN, -2000000, 0.1] and bounds from {bounds}, {expected}")
    );
    assert_eq!(
        refused(44, 2e9f64.to_le_bytes()),
        format!(
            "the skeleton: an origin at [1000000, -2000000, 0.1] and bounds from {}, {expected}",
            bounds.replacen("999990", "2000000000", 1)
        )
    );
}

#[test]
fn counts_that_do_not_add_up_are_refused() {
    let good = Forgery::new();
    let file = Bytes(&good.bytes);
    let (nodes, leaves, levels) = (file.u64(220), file.u64(228), file.u32(244));
    assert_eq!(good.page_count(), 3);
    for (at, value, expected) in [
        (92, nodes + 1, format!("the skeleton: pages of {nodes} nodes in all, expected {}", nodes + 1)),
        (92, 1 << 63, format!("the skeleton: pages of {nodes} nodes in all, expected {}", 1u64 << 63)),
        (100, nodes + 1, format!("the skeleton: {} leaves on {levels} levels, expected 1–{nodes} of each", nodes + 1)),
        (100, 0, format!("the skeleton: 0 leaves on {levels} levels, expected 1–{nodes} of each")),
        (108, 0, "the skeleton: 0 pages in 176 bytes of skeleton".into()),
        (108, 4, "the skeleton: 4 pages in 176 bytes of skeleton".into()),
        (108, 1 << 63, format!("the skeleton: {} pages in 176 bytes of skeleton", 1u64 << 63)),
        (108, u64::MAX / 16 + 1, format!("the skeleton: {} pages in 176 bytes of skeleton", u64::MAX / 16 + 1)),
    ] {
        assert_eq!(refused(at, value.to_le_bytes()), expected);
    }
    assert_eq!(
        refused(116, 0u32.to_le_bytes()),
        format!("the skeleton: {leaves} leaves on 0 levels, expected 1–{nodes} of each")
    );
    assert_eq!(refused(120, 9u32.to_le_bytes()), "the skeleton: flags 0x9, expected none beyond 0x7");
}

#[test]
fn a_skeleton_too_short_for_its_root_or_for_whole_records_is_refused() {
    for (bytes, expected) in [
        (0, "the skeleton: 0 bytes, expected at least 128"),
        (127, "the skeleton: 127 bytes, expected at least 128"),
        (175, "the skeleton: 3 pages in 175 bytes of skeleton"),
        (128, "the skeleton: 3 pages in 128 bytes of skeleton"),
    ] {
        let sum = gigalod_format::checksum(&Forgery::new().bytes[SKELETON..SKELETON + bytes]);
        let mut forged =
            Forgery::new().u64(header::SKELETON_BYTES, bytes as u64).u32(header::SKELETON_CHECKSUM, sum).bytes;
        let sum = gigalod_format::checksum(&forged[..header::CHECKSUM]);
        forged[header::CHECKSUM..128].copy_from_slice(&sum.to_le_bytes());
        assert_eq!(open(&forged).unwrap_err().to_string(), expected);
    }
    // No pages, and no room for any.
    let mut forged = Forgery::new().u64(SKELETON + 108, 0).bytes;
    let sum = gigalod_format::checksum(&forged[SKELETON..SKELETON + 128]);
    forged[header::SKELETON_BYTES..][..8].copy_from_slice(&128u64.to_le_bytes());
    forged[header::SKELETON_CHECKSUM..][..4].copy_from_slice(&sum.to_le_bytes());
    let sum = gigalod_format::checksum(&forged[..header::CHECKSUM]);
    forged[header::CHECKSUM..128].copy_from_slice(&sum.to_le_bytes());
    assert_eq!(open(&forged).unwrap_err().to_string(), "the skeleton: 0 pages in 128 bytes of skeleton");
}

#[test]
fn records_of_impossible_pages_are_refused() {
    let good = Forgery::new();
    let record = Forgery::record(1);
    let file = Bytes(&good.bytes);
    let at = record as u64;
    let [bytes, nodes, words, families] =
        [file.u32(at), file.u16(at + 8).into(), file.u16(at + 10).into(), file.u16(at + 12).into()];
    let message = |bytes: u32, nodes: u32, words: u32, families: u32| {
        format!(
            "the record of page 1: {bytes} bytes, {nodes} nodes, {words} words, {families} families; \
             expected 1–8192 nodes, up to twice as many words, 1–{} families, at most {} bytes",
            nodes.min(4096),
            104 + 9 * nodes
        )
    };
    let refused = |at: usize, value: u32| Forgery::new().u16(record + at, value as u16).refused();
    assert_eq!(refused(8, 0), message(bytes, 0, words, families));
    assert_eq!(refused(8, 8193), message(bytes, 8193, words, families));
    assert_eq!(refused(10, nodes - 1), message(bytes, nodes, nodes - 1, families));
    assert_eq!(refused(10, 2 * nodes + 1), message(bytes, nodes, 2 * nodes + 1, families));
    for count in [0, nodes + 1, 4097] {
        assert_eq!(refused(12, count), message(bytes, nodes, words, count));
    }
    assert_eq!(Forgery::new().u32(record, u32::MAX).refused(), message(u32::MAX, nodes, words, families));
}

#[test]
fn pages_beyond_the_end_of_the_file_are_refused() {
    let len = Forgery::new().bytes.len() as u64;
    let pages: u64 = (0..3).map(|page| u64::from(Bytes(&Forgery::new().bytes).u32(256 + 16 * page))).sum();
    assert_eq!(
        Forgery::new().u64(header::PAGES_OFFSET, len).refused(),
        format!("the last page ends at byte {} but the file has {len}", len + pages)
    );
    // Whatever a store claims to hold, sums of offsets do not wrap.
    let skeleton = &Forgery::new().bytes[SKELETON..][..176];
    Skeleton::parse(skeleton, u64::MAX - 5, u64::MAX).unwrap();
    assert!(Skeleton::parse(skeleton, u64::MAX - 5, u64::MAX - 1).is_err());
}

proptest! {
    #[test]
    fn no_bytes_make_the_parser_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), offset: u64, file_bytes: u64) {
        let _ = Skeleton::parse(&bytes, offset, file_bytes);
    }
}
