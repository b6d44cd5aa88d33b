//! Sequences of plain records that live in memory when there is room, else in a temporary file.
//!
//! What always holds: a spool says the same, wherever it lives, and is read and written by position, in large pieces. Its file
//! has a name only where a build that is continued may need it; what becomes of that, the work folder knows.

use crate::journal::Extent;
use crate::unfinished::registry;
use crate::work::Work;
use bytemuck::Pod;
use std::fs::File;
use std::io;
use std::path::Path;

/// Where spools live.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place<'a> {
    /// In memory.
    Memory,
    /// In files without a name, in this folder.
    Folder(&'a Path),
    /// In files in a work folder.
    Work(&'a Work),
}

/// A sequence of records.
#[derive(Debug)]
pub(crate) enum Spool<T> {
    Memory(Vec<T>),
    File {
        file: File,
        len: u64,
        /// For what a later step needs: its name, and the CRC-32C of all that was pushed.
        kept: Option<(String, u32)>,
    },
}

impl<T: Pod> Spool<T> {
    /// For what no later phase needs.
    pub(crate) fn new(place: &Place<'_>) -> io::Result<Self> {
        let folder = match place {
            Place::Memory => return Ok(Self::Memory(Vec::new())),
            Place::Folder(folder) => folder,
            Place::Work(work) => work.folder(),
        };
        let _names = registry();
        Ok(Self::File { file: tempfile::tempfile_in(folder)?, len: 0, kept: None })
    }

    /// For what a later step needs. No two steps in a row use the same name for different things.
    pub(crate) fn named(place: &Place<'_>, name: &str) -> io::Result<Self> {
        match place {
            Place::Work(work) => Ok(Self::File { file: work.create(name)?, len: 0, kept: Some((name.to_string(), 0)) }),
            other => Self::new(other),
        }
    }

    /// As an earlier process left it.
    pub(crate) fn reopen(work: &Work, name: &str) -> io::Result<Self> {
        let (file, extent) = work.reopen(name, size_of::<T>() as u64)?;
        Ok(Self::File { file, len: extent.records, kept: Some((name.to_string(), extent.checksum)) })
    }

    /// Puts all of it on disk, for [`Work::finish`].
    pub(crate) fn secure(&self) -> io::Result<(String, Extent)> {
        match self {
            Self::File { file, len, kept: Some((name, checksum)) } => {
                file.sync_all()?;
                let record_bytes = size_of::<T>() as u64;
                Ok((name.clone(), Extent { records: *len, record_bytes, checksum: *checksum }))
            }
            _ => Err(io::Error::other("a spool without a name cannot be kept")),
        }
    }

    /// Room for so many records, so that a vector in memory never holds twice what it needs.
    pub(crate) fn expect(&mut self, records: u64) {
        if let Self::Memory(all) = self {
            all.reserve_exact(records as usize);
        }
    }

    pub(crate) fn len(&self) -> u64 {
        match self {
            Self::Memory(all) => all.len() as u64,
            Self::File { len, .. } => *len,
        }
    }

    pub(crate) fn push(&mut self, records: &[T]) -> io::Result<()> {
        match self {
            Self::Memory(all) => all.extend_from_slice(records),
            Self::File { file, len, kept } => {
                let bytes = bytemuck::cast_slice(records);
                write_at(file, *len * size_of::<T>() as u64, bytes)?;
                *len += records.len() as u64;
                if let Some((_, checksum)) = kept {
                    *checksum = crc32c::crc32c_append(*checksum, bytes);
                }
            }
        }
        Ok(())
    }

    /// Fills `out` with the records from `start` on.
    pub(crate) fn read(&self, start: u64, out: &mut [T]) -> io::Result<()> {
        match self {
            Self::Memory(all) => out.copy_from_slice(&all[start as usize..][..out.len()]),
            Self::File { file, .. } => read_at(file, start * size_of::<T>() as u64, bytemuck::cast_slice_mut(out))?,
        }
        Ok(())
    }

    /// The records from `start` on, as many as `count`, replacing what `out` held.
    pub(crate) fn read_vec(&self, start: u64, count: usize, out: &mut Vec<T>) -> io::Result<()> {
        out.clear();
        out.resize(count, T::zeroed());
        self.read(start, out)
    }

    /// Overwrites records from `start` on, of a spool that no later step needs.
    pub(crate) fn write(&mut self, start: u64, records: &[T]) -> io::Result<()> {
        match self {
            Self::Memory(all) => all[start as usize..][..records.len()].copy_from_slice(records),
            Self::File { file, kept, .. } => {
                debug_assert!(kept.is_none(), "what is kept is only added to, or its checksum were wrong");
                write_at(file, start * size_of::<T>() as u64, bytemuck::cast_slice(records))?;
            }
        }
        Ok(())
    }

    /// Everything, piece by piece, in order.
    pub(crate) fn for_each_piece(
        &self,
        records: usize,
        mut visit: impl FnMut(u64, &[T]) -> io::Result<()>,
    ) -> io::Result<()> {
        match self {
            // Pieces here too: what is made of one stays in the cache, and its memory is used again for the next.
            Self::Memory(all) => {
                all.chunks(records).enumerate().try_for_each(|(number, piece)| visit((number * records) as u64, piece))
            }
            Self::File { len, .. } => {
                let mut piece = Vec::new();
                let mut start = 0;
                while start < *len {
                    let count = (*len - start).min(records as u64) as usize;
                    self.read_vec(start, count, &mut piece)?;
                    visit(start, &piece)?;
                    start += count as u64;
                }
                Ok(())
            }
        }
    }
}

#[cfg(unix)]
fn read_at(file: &File, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(unix)]
fn write_at(file: &File, offset: u64, bytes: &[u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_at(file: &File, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
    let mut done = 0;
    while done < buffer.len() {
        match std::os::windows::fs::FileExt::seek_read(file, &mut buffer[done..], offset + done as u64)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            read => done += read,
        }
    }
    Ok(())
}

#[cfg(windows)]
fn write_at(file: &File, offset: u64, bytes: &[u8]) -> io::Result<()> {
    let mut done = 0;
    while done < bytes.len() {
        match std::os::windows::fs::FileExt::seek_write(file, &bytes[done..], offset + done as u64)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            written => done += written,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spool_says_the_same_in_memory_and_in_a_file() {
        let folder = tempfile::tempdir().unwrap();
        for place in [Place::Memory, Place::Folder(folder.path())] {
            let mut spool = Spool::<u32>::new(&place).unwrap();
            spool.expect(10);
            spool.push(&[1, 2, 3]).unwrap();
            spool.push(&[4, 5, 6, 7]).unwrap();
            spool.write(2, &[30, 40]).unwrap();
            let mut some = [0; 3];
            spool.read(1, &mut some).unwrap();
            assert_eq!((spool.len(), some), (7, [2, 30, 40]));
            let mut all = Vec::new();
            spool
                .for_each_piece(3, |start, piece| {
                    assert_eq!(start as usize, all.len());
                    all.extend_from_slice(piece);
                    Ok(())
                })
                .unwrap();
            assert_eq!(all, [1, 2, 30, 40, 5, 6, 7]);
            assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "no name is left behind");
        }
    }
}
