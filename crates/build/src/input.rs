//! Which files a build is of, as far as it can be told without reading all of them.

use gigalod_format::checksum;
use gigalod_import::utc;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Tells one input from another, and from itself after a change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputIdentity {
    /// Its files, in order.
    pub files: Vec<FileIdentity>,
}

/// Tells one file from another, and from itself after a change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileIdentity {
    /// Where it lies, from the root.
    pub path: String,
    /// Its length.
    pub bytes: u64,
    /// When it was last written to: seconds and nanoseconds since 1970.
    pub modified: (u64, u32),
    /// Checksums of its first and last 64 KiB.
    pub ends: [u32; 2],
}

/// Bytes of an end.
const END_BYTES: u64 = 64 << 10;

impl FileIdentity {
    /// Of a file as it is now, which lies at `path`. Afterwards it stands anywhere.
    ///
    /// # Errors
    /// What the system says.
    pub fn of(path: &Path, mut file: &File) -> io::Result<Self> {
        let metadata = file.metadata()?;
        let since = metadata.modified()?.duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut end = |start: u64| -> io::Result<u32> {
            file.seek(SeekFrom::Start(start))?;
            let mut bytes = Vec::new();
            file.by_ref().take(END_BYTES).read_to_end(&mut bytes)?;
            Ok(checksum(&bytes))
        };
        let ends = [end(0)?, end(metadata.len().saturating_sub(END_BYTES))?];
        Ok(Self {
            path: path.canonicalize()?.to_string_lossy().into_owned(),
            bytes: metadata.len(),
            modified: (since.as_secs(), since.subsec_nanos()),
            ends,
        })
    }

    fn modified_time(&self) -> SystemTime {
        // What was read back from a journal may be any number.
        let (seconds, nanoseconds) = (self.modified.0, self.modified.1.min(999_999_999));
        UNIX_EPOCH.checked_add(Duration::new(seconds, nanoseconds)).unwrap_or(UNIX_EPOCH)
    }

    /// The first thing by which two files differ, of this one and of the other.
    fn difference(&self, other: &Self) -> Option<(String, String)> {
        let facts = |input: &Self| {
            [
                input.path.clone(),
                format!("{} bytes", input.bytes),
                format!("checksums {:08x} and {:08x} of its ends", input.ends[0], input.ends[1]),
                format!("modified {}", utc(input.modified_time())),
            ]
        };
        facts(self).into_iter().zip(facts(other)).find(|(own, others)| own != others)
    }
}

/// Files that the input names, such as its materials and textures, as far as they were asked for; shared with who opens them.
#[derive(Clone, Debug, Default)]
pub struct SideLog(Arc<Mutex<BTreeSet<PathBuf>>>);

/// Most files that are remembered: names may be hostile.
const MOST_SIDE_FILES: usize = 1 << 16;

impl SideLog {
    /// A file was asked for, whether it is there or not.
    pub fn note(&self, path: &Path) {
        let mut paths = self.0.lock().expect("nobody panics while holding it");
        if paths.len() < MOST_SIDE_FILES {
            paths.insert(path.to_owned());
        }
    }

    /// All of them, sorted.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.0.lock().expect("nobody panics while holding it").iter().cloned().collect()
    }
}

/// A file that the input names, as it was when it was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SideFile {
    path: String,
    /// None where there was none to be read.
    identity: Option<FileIdentity>,
}

impl SideFile {
    pub(crate) fn now(path: &Path) -> Self {
        let path = path.to_string_lossy().into_owned();
        let file = File::open(&path).and_then(|file| FileIdentity::of(Path::new(&path), &file));
        Self { path, identity: file.ok() }
    }

    pub(crate) fn path(&self) -> &Path {
        Path::new(&self.path)
    }

    /// What it was, and what it is now, where that is not the same.
    pub(crate) fn change(&self) -> Option<(String, String)> {
        let now = Self::now(self.path());
        let (there, gone) = (format!("{} there", self.path), format!("{} not there", self.path));
        match (&self.identity, &now.identity) {
            (Some(then), Some(now)) => {
                let of = |what: String| if what == self.path { what } else { format!("{} with {what}", self.path) };
                then.difference(now).map(|(then, now)| (of(then), of(now)))
            }
            (Some(_), None) => Some((there, gone)),
            (None, Some(_)) => Some((gone, there)),
            (None, None) => None,
        }
    }
}

impl InputIdentity {
    /// The first thing by which two inputs differ, of this one and of the other.
    pub(crate) fn difference(&self, other: &Self) -> Option<(String, String)> {
        let of_file = self.files.iter().zip(&other.files).find_map(|(own, others)| own.difference(others));
        let count = |input: &Self| format!("{} files", input.files.len());
        of_file.or_else(|| (self.files.len() != other.files.len()).then(|| (count(self), count(other))))
    }
}
