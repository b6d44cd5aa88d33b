//! The bytes of a LAZ file, buffered for an unpacker that takes them one at a time.
//!
//! In: the file. Out: [`Read`], whose way for what is in the buffer is short enough to become a part of the unpacker's loops; and
//! [`Seek`]. The standard library's buffer does the same by calls.

use crate::ByteSource;
use std::io::{self, Read, Seek, SeekFrom};

const BUFFER_BYTES: usize = 64 << 10;

pub(super) struct Source {
    file: Box<dyn ByteSource>,
    buffer: Box<[u8]>,
    /// The bytes that come next, within `buffer`.
    start: usize,
    end: usize,
    /// Where the file stands: behind the buffer's last byte.
    offset: u64,
}

impl Source {
    /// Stands where the file begins.
    pub(super) fn new(mut file: Box<dyn ByteSource>) -> io::Result<Self> {
        file.rewind()?;
        Ok(Self { file, buffer: vec![0; BUFFER_BYTES].into_boxed_slice(), start: 0, end: 0, offset: 0 })
    }

    /// Where the next byte lies in the file.
    pub(super) fn position(&self) -> u64 {
        self.offset - (self.end - self.start) as u64
    }

    /// Four bytes that come after the next `skipped`; none where the file ends before.
    pub(super) fn ahead(&mut self, skipped: usize) -> io::Result<Option<[u8; 4]>> {
        if let Some(bytes) = self.buffer[self.start..self.end].get(skipped..).and_then(|rest| rest.first_chunk()) {
            return Ok(Some(*bytes));
        }
        let here = self.position();
        self.seek(SeekFrom::Start(here.saturating_add(skipped as u64)))?;
        let mut bytes = [0; 4];
        let found = match self.read_exact(&mut bytes) {
            Ok(()) => Some(bytes),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => None,
            Err(error) => return Err(error),
        };
        self.seek(SeekFrom::Start(here))?;
        Ok(found)
    }

    #[cold]
    #[inline(never)]
    fn refill(&mut self, into: &mut [u8]) -> io::Result<()> {
        let mut done = 0;
        while done < into.len() {
            match self.read(&mut into[done..]) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => done += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

impl Read for Source {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
            self.end = self.file.read(&mut self.buffer)?;
            self.offset += self.end as u64;
        }
        let count = into.len().min(self.end - self.start);
        into[..count].copy_from_slice(&self.buffer[self.start..self.start + count]);
        self.start += count;
        Ok(count)
    }

    #[inline]
    fn read_exact(&mut self, into: &mut [u8]) -> io::Result<()> {
        match self.buffer[..self.end].get(self.start..self.start + into.len()) {
            Some(bytes) => {
                into.copy_from_slice(bytes);
                self.start += into.len();
                Ok(())
            }
            None => self.refill(into),
        }
    }
}

impl Seek for Source {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let to = match to {
            SeekFrom::Current(by) => SeekFrom::Start(
                self.position().checked_add_signed(by).ok_or(io::Error::from(io::ErrorKind::InvalidInput))?,
            ),
            to => to,
        };
        (self.start, self.end) = (0, 0);
        self.offset = self.file.seek(to)?;
        Ok(self.offset)
    }

    fn stream_position(&mut self) -> io::Result<u64> {
        Ok(self.position())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn bytes_come_as_from_the_file_however_they_are_asked_for() {
        let bytes: Vec<u8> = (0..3 * BUFFER_BYTES + 17).map(|at| ((at * at) >> 7) as u8).collect();
        let mut source = Source::new(Box::new(Cursor::new(bytes.clone()))).unwrap();
        let mut plain = Cursor::new(&bytes[..]);
        let (mut state, mut ends) = (7u64, 0);
        for step in 0..20_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let random = (state >> 33) as usize;
            let mut into = vec![0; [1, 1, 1, 4, 100, BUFFER_BYTES + 5][random % 6]];
            let mut expected = into.clone();
            let at = plain.position() as usize;
            let skipped = random % 70_000;
            let four = bytes.get(at + skipped..).and_then(|rest| rest.first_chunk()).copied();
            assert_eq!(source.ahead(skipped).unwrap(), four);
            let outcome = source.read_exact(&mut into).map_err(|error| error.kind());
            assert_eq!(outcome, plain.read_exact(&mut expected).map_err(|error| error.kind()));
            if outcome.is_err() || step % 100 == 99 {
                ends += usize::from(outcome.is_err());
                let to = SeekFrom::Start((random / 6 % bytes.len()) as u64);
                assert_eq!(source.seek(to).unwrap(), plain.seek(to).unwrap());
            } else {
                assert_eq!(into, expected);
                assert_eq!(source.stream_position().unwrap(), plain.position());
            }
        }
        assert!(ends > 10);
        assert_eq!(source.seek(SeekFrom::End(-3)).unwrap() + 3, bytes.len() as u64);
        assert_eq!(source.seek(SeekFrom::Current(-2)).unwrap() + 5, bytes.len() as u64);
        assert!(source.seek(SeekFrom::Current(-1 << 40)).is_err());
    }
}
