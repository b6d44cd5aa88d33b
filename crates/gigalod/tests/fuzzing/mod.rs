//! What is done with hostile `.glod` files: by fuzzers (`fuzz/`), and by tests with damaged copies of good files.

use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FormatError, MemoryStore, checksum};
use std::sync::Arc;

/// Opens a file and looks at all of it, as `info` and `verify` do; whether it is sound.
pub(crate) fn glod(bytes: &[u8]) -> bool {
    match look(bytes) {
        Ok(is_sound) => is_sound,
        Err(error) => {
            let line = error.to_string();
            assert!(!line.contains(['\n', '\r']) && line.len() < 600, "{line}");
            false
        }
    }
}

fn look(bytes: &[u8]) -> Result<bool, FormatError> {
    let file = SplatFile::open(Container::open(Arc::new(MemoryStore::new(bytes.to_vec())))?)?;
    let metadata = file.container().read_metadata();
    let (_, problems) = gigalod::verify::check(&file, &mut |_| {});
    Ok(metadata.is_ok() && problems.count == 0)
}

/// The same bytes with all checksums right that are where the header says, so that what is behind them is seen. By
/// `docs/format.md`, not by the code.
pub(crate) fn mended(bytes: &[u8]) -> Vec<u8> {
    const HEADER_BYTES: usize = 128;
    /// Of the skeleton, before its records.
    const HEAD_BYTES: usize = 128;
    const RECORD_BYTES: usize = 16;
    let mut bytes = bytes.to_vec();
    if bytes.len() < HEADER_BYTES {
        return bytes;
    }
    let length = bytes.len() as u64;
    bytes[..16].copy_from_slice(b"\x89GLOD\r\n\x1a\x01\0\0\0\x01\0\0\0");
    bytes[24..32].copy_from_slice(&length.to_le_bytes());
    let field = |bytes: &[u8], at: usize| u64::from_le_bytes(*bytes[at..].first_chunk().expect("it is in the header"));
    let part = |bytes: &[u8], offset: usize, size: usize| {
        let start = usize::try_from(field(bytes, offset)).ok()?;
        let end = start.checked_add(usize::try_from(field(bytes, size)).ok()?)?;
        (end <= bytes.len()).then_some(start..end)
    };
    if let Some(skeleton) = part(&bytes, 32, 40) {
        let mut page = field(&bytes, 72);
        let pages = if skeleton.len() < HEAD_BYTES { 0 } else { field(&bytes, skeleton.start + 108) };
        let records = skeleton.clone().skip(HEAD_BYTES).step_by(RECORD_BYTES);
        for record in records.take(usize::try_from(pages).unwrap_or(usize::MAX)) {
            let Some(size) = bytes[..skeleton.end].get(record..record + RECORD_BYTES).and_then(|it| it.first_chunk())
            else {
                break;
            };
            let end = page.saturating_add(u64::from(u32::from_le_bytes(*size)));
            if end > length {
                break;
            }
            let sum = checksum(&bytes[page as usize..end as usize]);
            bytes[record + 4..record + 8].copy_from_slice(&sum.to_le_bytes());
            page = end;
        }
        let sum = checksum(&bytes[skeleton]);
        bytes[48..52].copy_from_slice(&sum.to_le_bytes());
    }
    if let Some(metadata) = part(&bytes, 56, 64) {
        let sum = checksum(&bytes[metadata]);
        bytes[52..56].copy_from_slice(&sum.to_le_bytes());
    }
    let sum = checksum(&bytes[..124]);
    bytes[124..128].copy_from_slice(&sum.to_le_bytes());
    bytes
}
