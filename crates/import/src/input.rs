//! A file's bytes, unpacked, through a window that slides forward.
//!
//! In: a [`ByteSource`], plain, gzip or text in UTF-16 (told apart by content). Out: [`Input::window`], the bytes not yet consumed that are
//! in memory; [`Input::fill`] lengthens it, [`Input::consume`] shortens it from the front.
//!
//! What always holds: memory is [`Input::CAPACITY`] bytes; the source is read front to back, once, but for what
//! [`Input::reread`] asks for.

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
    Utf16(Box<Utf16>),
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
            [0xfe, 0xff] => Reader::Utf16(Box::new(Utf16::new(source, u16::from_be_bytes))),
            [0xff, 0xfe] => Reader::Utf16(Box::new(Utf16::new(source, u16::from_le_bytes))),
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
                Reader::Utf16(text) => text.read(free),
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
            Reader::Plain(_) | Reader::Utf16(_) => Ok(()),
            Reader::Gzip(_) => self.skip(u64::MAX).map(|_| ()),
        }
    }

    /// Length of the unpacked file, where that is known.
    pub(crate) fn known_bytes(&self) -> Option<u64> {
        matches!(self.reader, Reader::Plain(_)).then_some(self.source_bytes)
    }

    /// True where any part of the file can be had at any time.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(self.reader, Reader::Plain(_))
    }

    /// Reads bytes from `offset` on, as many as there are and fit, wherever the window is; the window stays.
    pub(crate) fn reread(&mut self, offset: u64, into: &mut [u8]) -> Result<usize, ImportError> {
        let window_end = self.offset + (self.end - self.start) as u64;
        let mut read = |source: &mut dyn ByteSource| -> io::Result<usize> {
            source.seek(SeekFrom::Start(offset))?;
            let mut count = 0;
            while count < into.len() {
                match source.read(&mut into[count..]) {
                    Ok(0) => break,
                    Ok(more) => count += more,
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                }
            }
            source.seek(SeekFrom::Start(window_end))?;
            Ok(count)
        };
        let result = match &mut self.reader {
            Reader::Plain(source) => read(source),
            _ => Err(io::Error::other("packed files are read from front to back")),
        };
        result.map_err(|source| ImportError::new(Problem::Io { source }, Some(Place::byte(offset))))
    }

    /// The source itself, for readers that jump about in it.
    ///
    /// # Errors
    /// The file is packed.
    pub(crate) fn into_source(self, format: &str) -> Result<Box<dyn ByteSource>, ImportError> {
        match self.reader {
            Reader::Plain(source) => Ok(source),
            _ => Err(ImportError::malformed(
                format!("{format} as it is, since it is not read from front to back"),
                "it packed",
                Place::byte(0),
            )),
        }
    }

    /// Bytes of the source consumed, and in all.
    pub(crate) fn progress(&self) -> (u64, u64) {
        let consumed = match &self.reader {
            Reader::Plain(_) => self.offset,
            Reader::Gzip(decoder) => decoder.get_ref().bytes,
            Reader::Utf16(text) => text.bytes,
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

/// UTF-16 to UTF-8. What is no text becomes U+FFFD.
struct Utf16 {
    source: io::BufReader<Box<dyn ByteSource>>,
    unit: fn([u8; 2]) -> u16,
    /// A unit that was read too far: what came after half a pair.
    kept: Option<u16>,
    /// Encoded, not yet given.
    ready: [u8; 4],
    ready_bytes: usize,
    bytes: u64,
}

impl Utf16 {
    fn new(source: Box<dyn ByteSource>, unit: fn([u8; 2]) -> u16) -> Self {
        let source = io::BufReader::new(source);
        Self { source, unit, kept: None, ready: [0; 4], ready_bytes: 0, bytes: 0 }
    }

    /// The next unit; a lone last byte is dropped.
    fn unit(&mut self) -> io::Result<Option<u16>> {
        if let Some(kept) = self.kept.take() {
            return Ok(Some(kept));
        }
        let mut bytes = [0; 2];
        match self.source.read_exact(&mut bytes) {
            Ok(()) => {
                self.bytes += 2;
                Ok(Some((self.unit)(bytes)))
            }
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn character(&mut self) -> io::Result<Option<char>> {
        let Some(first) = self.unit()? else { return Ok(None) };
        if !(0xd800..0xdc00).contains(&first) {
            return Ok(Some(char::from_u32(first.into()).unwrap_or(char::REPLACEMENT_CHARACTER)));
        }
        let second = self.unit()?;
        match second.map(|second| char::decode_utf16([first, second]).next()) {
            Some(Some(Ok(character))) => Ok(Some(character)),
            _ => {
                self.kept = second;
                Ok(Some(char::REPLACEMENT_CHARACTER))
            }
        }
    }
}

impl Read for Utf16 {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut count = 0;
        loop {
            let taken = self.ready_bytes.min(into.len() - count);
            into[count..count + taken].copy_from_slice(&self.ready[..taken]);
            self.ready.copy_within(taken..self.ready_bytes, 0);
            self.ready_bytes -= taken;
            count += taken;
            if count == into.len() {
                return Ok(count);
            }
            match self.character()? {
                Some('\u{feff}') => {} // The mark of the byte order.
                Some(character) => self.ready_bytes = character.encode_utf8(&mut self.ready).len(),
                None => return Ok(count),
            }
        }
    }
}
