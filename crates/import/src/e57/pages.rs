//! The bytes of a file without the checksums that end its pages.
//!
//! What always holds: bytes are given only from pages whose checksum is right.

use crate::{ByteSource, ImportError, Place, error::Problem};
use std::io::{self, Read, SeekFrom};

/// Bytes of a page, and those of its checksum, its last.
const PAGE_BYTES: usize = 1024;
const SUM_BYTES: usize = 4;
const CONTENT_BYTES: u64 = (PAGE_BYTES - SUM_BYTES) as u64;
/// Pages read at a time.
const BLOCK_PAGES: u64 = 64;

pub(super) struct Pages {
    source: Box<dyn ByteSource>,
    /// Content of the pages from `first` on.
    block: Vec<u8>,
    first: u64,
    /// Where the next byte is, checksums not counted.
    at: u64,
}

impl Pages {
    pub(super) fn new(source: Box<dyn ByteSource>) -> Self {
        Self { source, block: Vec::new(), first: 0, at: 0 }
    }

    /// Goes to an offset in the file itself, checksums counted.
    pub(super) fn seek(&mut self, offset: u64) {
        let page = offset / PAGE_BYTES as u64;
        self.at = page * CONTENT_BYTES + (offset % PAGE_BYTES as u64).min(CONTENT_BYTES);
    }

    /// Where the next byte is, checksums not counted.
    pub(super) fn position(&self) -> u64 {
        self.at
    }

    /// Goes to what [`Self::position`] was, or will be.
    pub(super) fn set_position(&mut self, at: u64) {
        self.at = at;
    }

    /// Where the next byte is in the file itself.
    pub(super) fn place(&self) -> Place {
        let page = (self.at / CONTENT_BYTES).saturating_mul(PAGE_BYTES as u64);
        Place::byte(page.saturating_add(self.at % CONTENT_BYTES))
    }

    /// The next bytes; `what` says what they are a part of.
    pub(super) fn read(&mut self, into: &mut [u8], what: &str) -> Result<(), ImportError> {
        let mut filled = 0;
        while filled < into.len() {
            let start = self.first * CONTENT_BYTES;
            let in_block = self.at.checked_sub(start).filter(|&offset| offset < self.block.len() as u64);
            let Some(offset) = in_block else {
                self.read_block(what)?;
                continue;
            };
            let rest = &self.block[offset as usize..];
            let count = rest.len().min(into.len() - filled);
            into[filled..filled + count].copy_from_slice(&rest[..count]);
            filled += count;
            self.at += count as u64;
        }
        Ok(())
    }

    /// Reads the pages from that of the next byte on; at least one.
    fn read_block(&mut self, what: &str) -> Result<(), ImportError> {
        self.first = self.at / CONTENT_BYTES;
        self.block.clear();
        let Some(offset) = self.first.checked_mul(PAGE_BYTES as u64) else {
            return Err(ImportError::truncated(what, self.place()));
        };
        let mut pages = Vec::with_capacity(BLOCK_PAGES as usize * PAGE_BYTES);
        let mut read = |source: &mut dyn ByteSource| -> io::Result<usize> {
            source.seek(SeekFrom::Start(offset))?;
            source.take(BLOCK_PAGES * PAGE_BYTES as u64).read_to_end(&mut pages)
        };
        read(&mut *self.source).map_err(|source| ImportError::new(Problem::Io { source }, Some(self.place())))?;
        for (number, page) in pages.chunks_exact(PAGE_BYTES).enumerate() {
            let (content, sum) = page.split_at(PAGE_BYTES - SUM_BYTES);
            if crc32c::crc32c(content).to_be_bytes() != *sum {
                if number > 0 {
                    break; // Perhaps nobody asks for it.
                }
                let found = "another";
                return Err(ImportError::malformed("a page with its checksum", found, Place::byte(offset)));
            }
            self.block.extend_from_slice(content);
        }
        if self.block.is_empty() {
            return Err(ImportError::truncated(what, self.place()));
        }
        Ok(())
    }
}
