//! The folder beside the output that an out-of-core build works in, so that it can be continued after anything.
//!
//! In: whose build it is, and after each phase what the next one needs. Out: the same, in another process.
//!
//! What always holds: a journal names only spools that are wholly on disk, and replaces its predecessor in one step; what no
//! journal names is worth nothing; one process at a time works in a folder, which a lock says that no crash leaves behind.
//! A build that ends without a finished phase removes the folder, and so does one that succeeds.

use crate::BuildError;
use crate::input::{SideFile, SideLog};
use crate::journal::{Extent, Header, Journal};
use crate::output::{behind_links, folder_of, sync_folder};
use crate::unfinished::{self, Active, SPOOL_SUFFIX, registry};
use serde_json::Value;
use std::fs::{File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// A work folder that this process has locked.
#[derive(Debug)]
pub(crate) struct Work {
    folder: PathBuf,
    header: Header,
    side: SideLog,
    found: Option<Journal>,
    /// Locked as long as it is open.
    _lock: File,
}

/// Where builds of `output` that do not fit into memory keep what they have, from one run to the next.
pub fn work_folder(output: &Path) -> PathBuf {
    let output = behind_links(output);
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    folder_of(&output).join(format!(".{name}.build"))
}

/// True where an interrupted build of `output` can be continued.
pub fn can_continue(output: &Path) -> bool {
    work_folder(output).join("journal").is_file()
}

impl Work {
    /// Opens the work folder of `output`; none where nothing is to be continued and `is_needed` says that memory suffices.
    /// `note` is told why a build that was to be continued begins anew.
    ///
    /// # Errors
    /// Another process works in it; or the build in it is of another input or of other options.
    pub(crate) fn open(
        output: &Path,
        header: Header,
        side: SideLog,
        resume: bool,
        is_needed: bool,
        note: impl Fn(&str),
    ) -> Result<Option<Self>, BuildError> {
        let folder = work_folder(output);
        let again = |why: &str| {
            if resume {
                note(&format!("{}: {why}, starting from the beginning", folder.display()));
            }
        };
        if !is_needed && !folder.exists() {
            again("nothing to continue");
            return Ok(None);
        }
        let existed = folder.exists();
        let mut registry = registry();
        let lock = lock(&folder)?;
        let found = if resume { Found::read(&folder).checked(&folder) } else { Found::Nothing("not asked for") };
        let found = match found {
            Found::Journal(journal) => match journal.header.difference(&header) {
                Some((what, expected, found)) => {
                    return Err(BuildError::OtherBuild { folder, what, expected, found });
                }
                None => match journal.side.iter().find_map(SideFile::change) {
                    Some((expected, found)) => {
                        return Err(BuildError::OtherBuild { folder, what: "with other materials", expected, found });
                    }
                    None => {
                        // They are not asked for again.
                        journal.side.iter().for_each(|file| side.note(file.path()));
                        Some(journal)
                    }
                },
            },
            Found::Nothing(why) => {
                again(if existed { why } else { "nothing to continue" });
                None
            }
        };
        // Without its journal first, the rest is worth nothing whenever the power goes.
        if found.is_none() {
            let _ = std::fs::remove_file(folder.join("journal"));
        }
        unfinished::sweep(&folder, |name| found.as_ref().is_some_and(|journal| journal.needs(name)));
        if found.is_none() && !is_needed {
            unfinished::remove_folder(&folder);
            return Ok(None);
        }
        registry.works.push(Active { folder: folder.clone(), can_continue: found.is_some() });
        Ok(Some(Self { folder, header, side, found, _lock: lock }))
    }

    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// What an earlier run has left, if anything.
    pub(crate) fn found(&self) -> Option<&Journal> {
        self.found.as_ref()
    }

    /// Creates the file of a spool; one that the journal names must not have its name.
    pub(crate) fn create(&self, name: &str) -> io::Result<File> {
        let _names = registry();
        File::options().read(true).write(true).create(true).truncate(true).open(self.path_of(name))
    }

    /// True where the journal names a spool.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.found.as_ref().is_some_and(|journal| journal.spools.contains_key(name))
    }

    /// Opens the file of a spool that the journal names.
    pub(crate) fn reopen(&self, name: &str, record_bytes: u64) -> io::Result<(File, Extent)> {
        let extent = self.found.as_ref().and_then(|journal| journal.spools.get(name));
        match extent {
            Some(extent) if extent.record_bytes == record_bytes => {
                Ok((File::options().read(true).write(true).open(self.path_of(name))?, *extent))
            }
            _ => Err(io::Error::new(io::ErrorKind::InvalidData, format!("the journal names no such spool: {name}"))),
        }
    }

    /// A phase is finished: `spools`, which are on disk, and `state` are what comes after it needs. All else is removed.
    pub(crate) fn finish(
        &self,
        phase: &str,
        spools: impl IntoIterator<Item = (String, Extent)>,
        state: Value,
    ) -> io::Result<()> {
        let spools = spools.into_iter().collect();
        let side = match &self.found {
            // As they were when they were read.
            Some(journal) => journal.side.clone(),
            None => self.side.paths().iter().map(|path| SideFile::now(path)).collect(),
        };
        let journal = Journal { header: self.header.clone(), side, phase: phase.into(), spools, state };
        let mut registry = registry();
        let new = self.folder.join("journal.new");
        let mut file = File::create(&new)?;
        file.write_all(&journal.to_bytes())?;
        file.sync_all()?;
        sync_folder(&self.folder)?;
        std::fs::rename(&new, self.folder.join("journal"))?;
        sync_folder(&self.folder)?;
        for work in registry.works.iter_mut().filter(|work| work.folder == self.folder) {
            work.can_continue = true;
        }
        unfinished::sweep(&self.folder, |name| name == "pages.part" || journal.needs(name));
        Ok(())
    }

    /// The output has its name; nothing here is needed any more.
    pub(crate) fn done(self) {
        let mut registry = registry();
        for work in registry.works.iter_mut().filter(|work| work.folder == self.folder) {
            work.can_continue = false;
        }
        // Dropping removes.
    }

    fn path_of(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}{SPOOL_SUFFIX}"))
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        let mut registry = registry();
        let own = registry.works.iter().position(|work| work.folder == self.folder);
        if let Some(own) = own {
            leave(&registry.works.swap_remove(own));
        }
    }
}

/// Removes a folder with which nothing can be done any more; of another, what its journal does not name.
pub(crate) fn leave(work: &Active) {
    if !work.can_continue {
        unfinished::remove_folder(&work.folder);
    } else if let Found::Journal(journal) = Found::read(&work.folder) {
        unfinished::sweep(&work.folder, |name| journal.needs(name));
    }
}

/// What lies in a folder.
enum Found {
    Journal(Journal),
    /// Why there is nothing.
    Nothing(&'static str),
}

impl Found {
    fn read(folder: &Path) -> Self {
        let Ok(bytes) = std::fs::read(folder.join("journal")) else { return Self::Nothing("no phase was finished") };
        let Some(journal) = Journal::of(&bytes) else { return Self::Nothing("its journal is damaged") };
        let is_there = |(name, extent): (&String, &Extent)| {
            let file = folder.join(format!("{name}{SPOOL_SUFFIX}"));
            let bytes = extent.records.checked_mul(extent.record_bytes);
            file.metadata().is_ok_and(|file| bytes.is_some_and(|bytes| file.len() >= bytes))
        };
        if journal.spools.iter().all(is_there) { Self::Journal(journal) } else { Self::Nothing("files are missing") }
    }
}

impl Found {
    /// The same, if the bytes that the journal names are still those that were written.
    fn checked(self, folder: &Path) -> Self {
        match self {
            Self::Journal(journal) => {
                let is_whole = |(name, extent): (&String, &Extent)| {
                    checksum_of(&folder.join(format!("{name}{SPOOL_SUFFIX}")), extent.records * extent.record_bytes)
                        .is_ok_and(|found| found == extent.checksum)
                };
                if journal.spools.iter().all(is_whole) {
                    Self::Journal(journal)
                } else {
                    Self::Nothing("its files are damaged")
                }
            }
            nothing => nothing,
        }
    }
}

/// CRC-32C of the first bytes of a file.
fn checksum_of(path: &Path, bytes: u64) -> io::Result<u32> {
    let (mut file, mut left, mut checksum) = (File::open(path)?, bytes, 0);
    let mut piece = vec![0; 1 << 20];
    while left > 0 {
        let now = left.min(piece.len() as u64) as usize;
        file.read_exact(&mut piece[..now])?;
        checksum = crc32c::crc32c_append(checksum, &piece[..now]);
        left -= now as u64;
    }
    Ok(checksum)
}

/// Creates and locks the folder.
fn lock(folder: &Path) -> Result<File, BuildError> {
    loop {
        match std::fs::create_dir(folder) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(BuildError::Output(error)),
            _ => {}
        }
        let path = folder.join("lock");
        let file = match File::options().write(true).create(true).truncate(false).open(&path) {
            // Whoever worked in it has just finished, and removed it.
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            other => other.map_err(BuildError::Scratch)?,
        };
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(BuildError::Busy { folder: folder.to_owned() }),
            // Some network file systems have no locks; two builds at once would then harm each other, one does not.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(BuildError::Scratch(error)),
        }
        if is_still(&file, &path) {
            return Ok(file);
        }
    }
}

/// False where the file was removed between opening and locking it.
#[cfg(unix)]
fn is_still(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |metadata: io::Result<std::fs::Metadata>| metadata.map(|file| (file.dev(), file.ino())).ok();
    id(file.metadata()) == id(std::fs::metadata(path))
}

/// An open file cannot be removed.
#[cfg(not(unix))]
fn is_still(_file: &File, _path: &Path) -> bool {
    true
}
