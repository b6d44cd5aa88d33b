//! Forged files: contents changed at will, checksums right.

use crate::stranger::Bytes;
use crate::tree::{Growth, Random, Tree, open};
use gigalod_format::splats::{Page, PageId};
use gigalod_format::{FormatError, checksum};

/// Where the header's fields lie, as in `docs/format.md`.
pub(crate) mod header {
    pub(crate) const VERSION: usize = 8;
    pub(crate) const KIND: usize = 12;
    pub(crate) const FEATURES: usize = 16;
    pub(crate) const FILE_BYTES: usize = 24;
    pub(crate) const SKELETON_OFFSET: usize = 32;
    pub(crate) const SKELETON_BYTES: usize = 40;
    pub(crate) const SKELETON_CHECKSUM: usize = 48;
    pub(crate) const METADATA_CHECKSUM: usize = 52;
    pub(crate) const METADATA_OFFSET: usize = 56;
    pub(crate) const METADATA_BYTES: usize = 64;
    pub(crate) const PAGES_OFFSET: usize = 72;
    pub(crate) const CHECKSUM: usize = 124;
}

/// Where the skeleton begins in files of ours.
pub(crate) const SKELETON: usize = 128;

/// A good file to be forged.
pub(crate) struct Forgery {
    pub(crate) bytes: Vec<u8>,
}

impl Forgery {
    /// Three pages with colours; page 0 has families in itself, page 1 in page 2.
    pub(crate) fn new() -> Self {
        Self { bytes: Tree::grow(12, Growth::Random, true, &mut Random(11)).write(16) }
    }

    /// Overwrites what lies at `at`.
    pub(crate) fn put(mut self, at: usize, new: &[u8]) -> Self {
        self.bytes[at..at + new.len()].copy_from_slice(new);
        self
    }

    pub(crate) fn u16(self, at: usize, value: u16) -> Self {
        self.put(at, &value.to_le_bytes())
    }

    pub(crate) fn u32(self, at: usize, value: u32) -> Self {
        self.put(at, &value.to_le_bytes())
    }

    pub(crate) fn u64(self, at: usize, value: u64) -> Self {
        self.put(at, &value.to_le_bytes())
    }

    /// Where the record of a page lies.
    pub(crate) fn record(page: usize) -> usize {
        SKELETON + 128 + 16 * page
    }

    /// Where a page lies, by the records as they are now.
    pub(crate) fn page(&self, page: usize) -> usize {
        let file = Bytes(&self.bytes);
        let before: u64 = (0..page).map(|page| u64::from(file.u32(Self::record(page) as u64))).sum();
        (file.u64(header::PAGES_OFFSET as u64) + before) as usize
    }

    /// Where a run of a page lies.
    pub(crate) fn run(&self, page: usize, run: usize) -> usize {
        self.page(page) + 4 + 6 * run
    }

    /// Where the links of a page lie: at its end.
    pub(crate) fn links(&self, page: usize) -> usize {
        let record = Self::record(page) as u64;
        let links = Bytes(&self.bytes).u16(record + 10) - Bytes(&self.bytes).u16(record + 8);
        self.page(page + 1) - 2 * usize::from(links)
    }

    pub(crate) fn page_count(&self) -> usize {
        (Bytes(&self.bytes).u64(header::SKELETON_BYTES as u64) as usize - 128) / 16
    }

    /// Makes all checksums right of what lies within the file.
    pub(crate) fn seal(mut self) -> Vec<u8> {
        for page in 0..self.page_count() {
            let bytes = Bytes(&self.bytes).u32(Self::record(page) as u64) as usize;
            let start = self.page(page);
            if let Some(contents) = self.bytes.get(start..start + bytes) {
                let sum = checksum(contents);
                self = self.u32(Self::record(page) + 4, sum);
            }
        }
        for (offset, length, sum_at) in [
            (header::SKELETON_OFFSET, header::SKELETON_BYTES, header::SKELETON_CHECKSUM),
            (header::METADATA_OFFSET, header::METADATA_BYTES, header::METADATA_CHECKSUM),
        ] {
            let (start, length) = (Bytes(&self.bytes).u64(offset as u64), Bytes(&self.bytes).u64(length as u64));
            let end = start.saturating_add(length);
            if let Some(contents) = self.bytes.get(start as usize..end as usize) {
                let sum = checksum(contents);
                self = self.u32(sum_at, sum);
            }
        }
        let sum = checksum(&self.bytes[..header::CHECKSUM]);
        self.u32(header::CHECKSUM, sum).bytes
    }

    /// What opening says, which must be an error.
    pub(crate) fn refused(self) -> String {
        open(&self.seal()).expect_err("a forged file").to_string()
    }

    /// What reading a page says.
    pub(crate) fn read_page(self, page: u32) -> Result<Page, FormatError> {
        open(&self.seal()).expect("only pages are forged").read_page(PageId(page))
    }
}

#[test]
fn an_unchanged_forgery_is_the_file_itself() {
    let forgery = Forgery::new();
    let bytes = forgery.bytes.clone();
    assert_eq!(forgery.seal(), bytes);
}
