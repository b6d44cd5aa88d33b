//! A file's bytes, unpacked, through a window that slides forward.
//!
//! In: a [`ByteSource`], plain or gzip (told apart by content). Out: [`Input::window`], the bytes not yet consumed that are
//! in memory; [`Input::fill`] lengthens it, [`Input::consume`] shortens it from the front.
//!
//! What always holds: memory is [`Input::CAPACITY`] bytes; the source is read front to back, once.

use crate::{ByteSource, ImportError, Place, error::Problem};
use flate2::read::MultiGzDecoder;
use std::io::{self, Read, SeekFrom};

pub(crate) struct Input {
    reader: Reader,
    buffer: Box<[u8]>,
    /// The window within `buffer`.
    start: usize,
    end: usize,
    /// Unpacked bytes consumed: where the window starts in the unpacked file.
    offset: u64,
    source_bytes: u64,
}

enum Reader {
    Plain(Box<dyn ByteSource>),
    Gzip(Box<MultiGzDecoder<Counted>>),
}

/// Counts the compressed bytes that the unpacker takes.
struct Counted {
    source: Box<dyn ByteSource>,
    bytes: u64,
}

impl Read for Counted {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(into)?;
        self.bytes += count as u64;
        Ok(count)
    }
}

impl Input {
    /// Bytes in memory; also the most that a caller can ask to see at once. 256 KiB: system calls no longer show, and it
    /// stays in the second-level cache.
    pub(crate) const CAPACITY: usize = 256 << 10;

    /// Reads `source` from its beginning, wherever it stands.
    pub(crate) fn new(mut source: Box<dyn ByteSource>) -> Result<Self, ImportError> {
        let failed = |source| ImportError::new(Problem::Io { source }, None);
        let source_bytes = source.seek(SeekFrom::End(0)).map_err(failed)?;
        source.rewind().map_err(failed)?;
        let mut magic = Vec::new();
        source.by_ref().take(2).read_to_end(&mut magic).map_err(failed)?;
        source.rewind().map_err(failed)?;
        let reader = match magic[..] {
            [0x1f, 0x8b] => Reader::Gzip(Box::new(MultiGzDecoder::new(Counted { source, bytes: 0 }))),
            _ => Reader::Plain(source),
        };
        let buffer = vec![0; Self::CAPACITY].into_boxed_slice();
        Ok(Self { reader, buffer, start: 0, end: 0, offset: 0, source_bytes })
    }

    /// The bytes that come next, as far as they are in memory.
    #[inline]
    pub(crate) fn window(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// Offset of the window's first byte in the unpacked file.
    #[inline]
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Steps over the first `count` bytes of the window, which has them.
    #[inline]
    pub(crate) fn consume(&mut self, count: usize) {
        debug_assert!(count <= self.end - self.start, "{count} of {}", self.end - self.start);
        self.start += count;
        self.offset += count as u64;
    }

    /// Lengthens the window, which is shorter than [`Self::CAPACITY`], by at least a byte; false at the end of the file.
    #[cold]
    pub(crate) fn fill(&mut self) -> Result<bool, ImportError> {
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        assert!(self.end < Self::CAPACITY, "the window is full");
        loop {
            let free = &mut self.buffer[self.end..];
            let result = match &mut self.reader {
                Reader::Plain(source) => source.read(free),
                Reader::Gzip(decoder) => decoder.read(free),
            };
            match result {
                Ok(count) => {
                    self.end += count;
                    return Ok(count > 0);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.failed(error)),
            }
        }
    }

    /// Lengthens the window to `count` bytes, at most [`Self::CAPACITY`]; false where the file has fewer.
    #[inline]
    pub(crate) fn has(&mut self, count: usize) -> Result<bool, ImportError> {
        while self.end - self.start < count {
            if !self.fill()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Steps over `count` bytes; false where the file has fewer.
    pub(crate) fn skip(&mut self, mut count: u64) -> Result<bool, ImportError> {
        loop {
            let here = count.min(self.window().len() as u64);
            self.consume(here as usize);
            count -= here;
            if count == 0 {
                return Ok(true);
            }
            if !self.fill()? {
                return Ok(false);
            }
        }
    }

    /// To be called after the last byte that matters. What follows is ignored, but a compressed file keeps its checksum
    /// there: it is unpacked to its end, so that damage does not go unseen.
    pub(crate) fn finish(&mut self) -> Result<(), ImportError> {
        match self.reader {
            Reader::Plain(_) => Ok(()),
            Reader::Gzip(_) => self.skip(u64::MAX).map(|_| ()),
        }
    }

    /// Bytes of the source consumed, and in all.
    pub(crate) fn progress(&self) -> (u64, u64) {
        let consumed = match &self.reader {
            Reader::Plain(_) => self.offset,
            Reader::Gzip(decoder) => decoder.get_ref().bytes,
        };
        (consumed, self.source_bytes)
    }

    /// The unpacker reports damage as invalid data or input, and a cut as an unexpected end; the rest is the source's.
    fn failed(&self, source: io::Error) -> ImportError {
        let place = Place::byte(self.offset + self.window().len() as u64);
        match (&self.reader, source.kind()) {
            (Reader::Gzip(_), io::ErrorKind::UnexpectedEof) => {
                ImportError::truncated("its gzip data is complete", place)
            }
            (Reader::Gzip(_), io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput) => {
                ImportError::new(Problem::Gzip { reason: source.to_string() }, Some(place))
            }
            _ => ImportError::new(Problem::Io { source }, Some(place)),
        }
    }
}
