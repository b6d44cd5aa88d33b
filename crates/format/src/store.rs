//! Where the bytes of a container lie: anything that can be read at a position.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that can be read at any position, by several threads at once, without a cursor.
pub trait PageStore: Send + Sync {
    /// Number of bytes there are.
    fn len(&self) -> u64;

    /// True when there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Fills `buffer` with the bytes from `offset` on.
    ///
    /// # Errors
    /// `UnexpectedEof` where the bytes end before the buffer does; else what the system says.
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()>;

    /// Bytes handed out since the store was opened.
    fn bytes_read(&self) -> u64;
}

/// A file, read by position. It is not mapped: a mapping dies with a signal when the file shrinks.
#[derive(Debug)]
pub struct FileStore {
    #[cfg(any(unix, windows))]
    file: std::fs::File,
    bytes: u64,
    bytes_read: AtomicU64,
}

#[cfg(any(unix, windows))]
impl FileStore {
    /// Opens `path` for reading.
    ///
    /// # Errors
    /// What the system says.
    pub fn open(path: &std::path::Path) -> io::Result<Self> {
        // Before opening, because opening a named pipe waits for its other end.
        if !std::fs::metadata(path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
        }
        let file = std::fs::File::open(path)?;
        Ok(Self { bytes: file.metadata()?.len(), file, bytes_read: AtomicU64::new(0) })
    }
}

impl PageStore for FileStore {
    fn len(&self) -> u64 {
        self.bytes
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        #[cfg(unix)]
        std::os::unix::fs::FileExt::read_exact_at(&self.file, buffer, offset)?;
        #[cfg(windows)]
        {
            let mut done = 0;
            while done < buffer.len() {
                let read =
                    std::os::windows::fs::FileExt::seek_read(&self.file, &mut buffer[done..], offset + done as u64)?;
                if read == 0 {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                done += read;
            }
        }
        #[cfg(not(any(unix, windows)))]
        {
            let _ = (offset, buffer);
            return Err(io::ErrorKind::Unsupported.into());
        }
        #[cfg(any(unix, windows))]
        {
            self.bytes_read.fetch_add(buffer.len() as u64, Ordering::Relaxed);
            Ok(())
        }
    }

    fn bytes_read(&self) -> u64 {
        self.bytes_read.load(Ordering::Relaxed)
    }
}

/// Bytes in memory.
#[derive(Debug, Default)]
pub struct MemoryStore {
    bytes: Vec<u8>,
    bytes_read: AtomicU64,
}

impl MemoryStore {
    /// A store of these bytes.
    pub fn new(bytes: Vec<u8>) -> Self {
        Self { bytes, bytes_read: AtomicU64::new(0) }
    }
}

impl PageStore for MemoryStore {
    fn len(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).map_err(|_| io::ErrorKind::UnexpectedEof)?;
        let end = start.checked_add(buffer.len()).ok_or(io::ErrorKind::UnexpectedEof)?;
        buffer.copy_from_slice(self.bytes.get(start..end).ok_or(io::ErrorKind::UnexpectedEof)?);
        self.bytes_read.fetch_add(buffer.len() as u64, Ordering::Relaxed);
        Ok(())
    }

    fn bytes_read(&self) -> u64 {
        self.bytes_read.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What every store must do, whatever it is made of.
    fn behaves(store: &dyn PageStore, contents: &[u8]) {
        assert_eq!(store.len(), contents.len() as u64);
        let mut middle = [0; 4];
        store.read_at(3, &mut middle).unwrap();
        assert_eq!(middle, contents[3..7]);
        store.read_at(contents.len() as u64, &mut []).unwrap();
        for (offset, bytes) in [(contents.len() as u64 - 2, 3), (u64::MAX, 1), (u64::MAX - 1, 8)] {
            assert!(store.read_at(offset, &mut vec![0; bytes]).is_err(), "{bytes} bytes at {offset}");
        }
        assert_eq!(store.bytes_read(), 4);
    }

    #[test]
    fn all_stores_behave_alike() {
        let contents = b"twelve bytes";
        behaves(&MemoryStore::new(contents.to_vec()), contents);
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), contents).unwrap();
        behaves(&FileStore::open(file.path()).unwrap(), contents);
        assert!(FileStore::open(std::path::Path::new("/")).is_err(), "a folder is not a store");
    }
}
