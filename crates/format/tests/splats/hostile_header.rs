//! Headers that lie, each with its exact message.

use crate::forgery::{Forgery, header};
use crate::tree::open;

const HUGE: u64 = 1 << 63;

#[test]
fn other_files_are_named_as_such() {
    let expected = r#"expected "\x89GLOD\r\n\x1a""#;
    for (bytes, found) in [
        (&b""[..], "nothing"),
        (b"ply\nformat ascii 1.0\n", r#""ply\nform""#),
        (b"\x89GLOD\n\x1a and a transfer that mended line ends", r#""\x89GLOD\n\x1a ""#),
    ] {
        let message = open(bytes).unwrap_err().to_string();
        assert_eq!(message, format!("not a .glod file: it begins with {found}, {expected}"));
    }
}

#[test]
fn what_a_later_program_wrote_is_refused_by_name() {
    assert_eq!(Forgery::new().u32(header::VERSION, 2).refused(), "format version 2 (this program reads version 1)");
    // Whatever else a later version changes, the header's checksum included.
    let mut bytes = Forgery::new().u32(header::VERSION, 7).bytes;
    bytes[100] = 1;
    assert_eq!(open(&bytes).unwrap_err().to_string(), "format version 7 (this program reads version 1)");
    for (bits, named) in [(1u64, 0), (0b110_0000, 5), (HUGE, 63)] {
        assert_eq!(
            Forgery::new().u64(header::FEATURES, bits).refused(),
            format!("the file needs feature bit {named}, which this program does not know")
        );
    }
    assert_eq!(
        Forgery::new().u32(header::KIND, 3).refused(),
        "the file holds representation 3, expected 1 (splats) or 2 (hybrid)"
    );
    assert_eq!(Forgery::new().u32(header::KIND, 2).refused(), "the file holds hybrid, expected splats");
}

#[test]
fn sections_beyond_the_end_are_refused_before_anything_is_read() {
    let len = Forgery::new().bytes.len();
    for (field, value, part, end) in [
        (header::FILE_BYTES, HUGE, "the file, by its header,", HUGE),
        (header::FILE_BYTES, 0, "the file, by its header,", 0),
        (header::SKELETON_OFFSET, u64::MAX, "the skeleton", u64::MAX),
        (header::SKELETON_BYTES, HUGE, "the skeleton", HUGE + 128),
        (header::METADATA_OFFSET, u64::MAX - 1, "the metadata", u64::MAX),
        (header::METADATA_BYTES, u64::MAX, "the metadata", u64::MAX),
        (header::PAGES_OFFSET, HUGE, "the first page", HUGE),
    ] {
        let message = forge_header(field, value);
        assert_eq!(message, format!("{part} ends at byte {end} but the file has {len}"));
    }
}

/// Only the header's checksum is made right: with such fields nothing else can be found.
fn forge_header(field: usize, value: u64) -> String {
    let mut bytes = Forgery::new().u64(field, value).bytes;
    let sum = gigalod_format::checksum(&bytes[..header::CHECKSUM]);
    bytes[header::CHECKSUM..128].copy_from_slice(&sum.to_le_bytes());
    open(&bytes).unwrap_err().to_string()
}

#[test]
fn metadata_that_is_no_metadata_is_an_error_of_the_metadata_alone() {
    let start = |file: &Forgery| {
        let at = header::METADATA_OFFSET;
        u64::from_le_bytes(file.bytes[at..at + 8].try_into().unwrap()) as usize
    };
    for (new, expected) in [
        (&b"[1,"[..], "the metadata: invalid type: integer `1`, expected a string at line 1 column 2"),
        (b"\0", "the metadata: expected value at line 1 column 1"),
        (b"{\"generator\":7,", "the metadata: invalid type: integer `7`, expected a string at line 1 column 14"),
        (b"{\"nodes\":-1,\"x\":", "the metadata: invalid value: integer `-1`, expected u64 at line 1 column 11"),
    ] {
        let forgery = Forgery::new();
        let at = start(&forgery);
        let file = open(&forgery.put(at, new).seal()).unwrap();
        assert_eq!(file.container().read_metadata().unwrap_err().to_string(), expected);
        file.read_page(gigalod_format::splats::PageId(0)).unwrap();
    }
    // As deep as it is long: the parser's own limit, not our stack.
    let forgery = Forgery::new();
    let at = start(&forgery);
    let deep = vec![b'['; forgery.bytes.len() - at];
    let error = open(&forgery.put(at, &deep).seal()).unwrap().container().read_metadata().unwrap_err();
    assert!(error.to_string().starts_with("the metadata: "), "{error}");
}
