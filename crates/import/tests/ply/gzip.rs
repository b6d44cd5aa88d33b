//! Compressed files.

use crate::{
    document::{Document, Flavour, Random},
    sources::{error, read, read_in_drops},
};
use flate2::{Compression, write::GzEncoder};
use gigalod_import::{Batch, Problem, open};
use std::io::{Cursor, Write};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("memory takes all")
}

fn document() -> (Vec<u8>, crate::sources::Model) {
    let document = Document::random(&mut Random(5), 2000);
    (document.bytes(Flavour::Big, "\n"), document.model())
}

#[test]
fn gzip_reads_like_the_plain_file_in_one_part_or_more() {
    let (bytes, model) = document();
    let (first, second) = bytes.split_at(bytes.len() / 3);
    for packed in [gzip(&bytes), [gzip(first), gzip(second)].concat()] {
        assert_eq!(read(&packed).expect("it is a good file"), model);
        assert_eq!(read_in_drops(&packed).expect("it is a good file"), model);
    }
}

#[test]
fn progress_counts_compressed_bytes() {
    let packed = gzip(&document().0);
    let size = packed.len() as u64;
    let mut stream = open(Box::new(Cursor::new(packed))).expect("it is a good file");
    while stream.next(&mut Batch::default()).expect("it is a good file") {}
    assert_eq!(stream.bytes_consumed(), (size, size));
}

#[test]
fn a_cut_is_an_error_wherever_it_is() {
    let (bytes, _) = document();
    let packed = gzip(&bytes);
    for cut in [3, 10, 11, packed.len() / 2, packed.len() - 9, packed.len() - 8, packed.len() - 1] {
        let error = read(&packed[..cut]).expect_err("the file is cut");
        assert_eq!(error.what().to_string(), "the file ends before its gzip data is complete", "{cut}");
    }
    let end = bytes.len();
    assert_eq!(
        error(&packed[..packed.len() - 1]),
        format!("the file ends before its gzip data is complete (byte {end})")
    );
}

#[test]
fn a_wrong_checksum_is_an_error_though_the_model_is_complete() {
    let (bytes, _) = document();
    let mut packed = gzip(&bytes);
    let checksum = packed.len() - 8;
    packed[checksum] ^= 1;
    let end = bytes.len();
    assert_eq!(
        error(&packed),
        format!(
            "expected sound gzip data, found damage: corrupt gzip stream does not have a matching checksum (byte {end})"
        )
    );
}

#[test]
fn damaged_gzip_never_panics_and_never_passes_for_a_whole_file() {
    let (bytes, model) = document();
    let packed = gzip(&bytes);
    let mut random = Random(3);
    for _ in 0..300 {
        let mut damaged = packed.clone();
        // Past the header, whose time stamp and flags are not covered by the checksum.
        let at = 10 + random.below(packed.len() - 10);
        damaged[at] ^= 1 << random.below(8);
        if let Ok(read) = read(&damaged) {
            assert!(read == model, "a flip of byte {at} went unseen");
        }
    }
    let inside = gzip(&packed);
    assert!(matches!(read(&inside).map_err(|e| matches!(e.what(), Problem::UnknownFormat { .. })), Err(true)));
}

#[test]
fn an_empty_gzip_is_an_empty_file() {
    assert_eq!(error(&gzip(b"")), "expected a model, found an empty file");
}
