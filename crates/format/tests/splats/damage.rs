//! Damage to a good file: whatever changes a byte that is drawn from is an error, by its place.

use crate::tree::{Growth, Random, Tree, open, page_ids};
use gigalod_format::{FormatError, Kind, Writer};
use std::io::Cursor;

/// Three pages, colours, 60-odd nodes: small enough to try everything.
fn small_file() -> Vec<u8> {
    let bytes = Tree::grow(12, Growth::Random, true, &mut Random(11)).write(16);
    assert_eq!(open(&bytes).unwrap().skeleton().pages().len(), 3);
    bytes
}

type PageWords = Result<Vec<u32>, FormatError>;

/// Everything there is to read: each page's words or its error, and what is wrong with the metadata.
fn read_all(bytes: &[u8]) -> Result<(Vec<PageWords>, Option<FormatError>), FormatError> {
    let file = open(bytes)?;
    let pages = page_ids(&file).map(|page| Ok(file.read_page(page)?.words().to_vec())).collect();
    Ok((pages, file.container().read_metadata().err()))
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = small_file();
    for end in 0..bytes.len() {
        let error = read_all(&bytes[..end]).expect_err("a truncated file");
        let expected = match end {
            0..8 => "not a .glod file: it begins with".into(),
            8..128 => format!("the header ends at byte 128 but the file has {end}"),
            _ => format!("the file, by its header, ends at byte {} but the file has {end}", bytes.len()),
        };
        assert!(error.to_string().starts_with(&expected), "{end}: {error}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(open(&longer), Err(FormatError::Truncated { .. })), "nor may anything follow");
}

#[test]
fn a_file_whose_writer_was_interrupted_is_none() {
    let mut out = Cursor::new(Vec::new());
    Writer::new(&mut out, Kind::Splats, 144).unwrap().page(&[1, 2, 3]).unwrap();
    assert_eq!(out.get_ref().len(), 128 + 144 + 3);
    assert!(matches!(open(out.get_ref()), Err(FormatError::Magic { .. })));
}

#[test]
fn every_changed_byte_is_found_where_it_is() {
    let bytes = small_file();
    let file = open(&bytes).unwrap();
    let (good_pages, no_error) = read_all(&bytes).unwrap();
    assert!(no_error.is_none());
    let skeleton_end = file.container().pages_offset() as usize;
    let page_of = |at: usize| page_ids(&file).filter(|page| file.skeleton().page_offset(*page) <= at as u64).last();
    let last = good_pages.len() - 1;
    let metadata_start = (file.skeleton().page_offset(page_ids(&file).last().unwrap())
        + u64::from(file.skeleton().pages()[last].bytes)) as usize;

    let mut damaged = bytes.clone();
    for at in 0..bytes.len() {
        for flip in 1..=255u8 {
            damaged[at] = bytes[at] ^ flip;
            let found = read_all(&damaged);
            if at < skeleton_end {
                let error = found.expect_err("a damaged header or skeleton");
                let expected = match at {
                    0..8 => matches!(error, FormatError::Magic { .. }),
                    8..12 => matches!(error, FormatError::Version { .. }),
                    12..128 => error.to_string().starts_with("the header has checksum 0x"),
                    _ => error.to_string().starts_with("the skeleton has checksum 0x"),
                };
                assert!(expected, "byte {at}: {error}");
                continue;
            }
            let (pages, metadata_error) = found.expect("damage of a page or of the metadata does not hide the others");
            assert_eq!(metadata_error.is_some(), at >= metadata_start, "byte {at}");
            for (number, (page, good)) in pages.iter().zip(&good_pages).enumerate() {
                let hit = at < metadata_start && page_of(at).is_some_and(|page| page.0 as usize == number);
                match page {
                    Ok(words) => assert!(!hit && words == good.as_ref().unwrap(), "byte {at}, page {number}"),
                    Err(error) => {
                        assert!(hit && error.to_string().starts_with(&format!("page {number} has checksum 0x")));
                    }
                }
            }
        }
        damaged[at] = bytes[at];
    }
}
