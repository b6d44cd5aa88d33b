//! What this process has on disk without a final name, so that a program that is interrupted can clean up.
//!
//! What always holds: names of unfinished files are made, changed and removed only by who holds the [`Registry`]; after
//! [`abandon`] nobody ever does again.

use crate::work;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Everything that has no final name yet.
#[derive(Debug)]
pub(crate) struct Registry {
    /// Files outside work folders.
    pub(crate) files: Vec<PathBuf>,
    /// Work folders in use.
    pub(crate) works: Vec<Active>,
}

/// A work folder in use.
#[derive(Debug)]
pub(crate) struct Active {
    pub(crate) folder: PathBuf,
    /// Its journal names a finished phase.
    pub(crate) can_continue: bool,
}

static REGISTRY: Mutex<Registry> = Mutex::new(Registry { files: Vec::new(), works: Vec::new() });

/// The registry, for as long as names are made or removed.
pub(crate) fn registry() -> MutexGuard<'static, Registry> {
    REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// For a program that is about to end in the middle of its work, and does so right after: removes all unfinished files of
/// this process, except what `--resume` can continue; returns the folders of that. From here on threads that want to name or
/// publish a file wait for the end.
pub fn abandon() -> Vec<PathBuf> {
    let mut registry = registry();
    for path in registry.files.drain(..) {
        // It may have got its name, or have been removed, a moment ago.
        let _ = std::fs::remove_file(path);
    }
    registry.works.iter().for_each(work::leave);
    let kept = registry.works.drain(..).filter(|work| work.can_continue).map(|work| work.folder).collect();
    std::mem::forget(registry);
    kept
}

/// Files of a work folder end in one of these or are called so; anything else in it is not ours.
const OURS: [&str; 4] = ["journal", "journal.new", "pages.part", "lock"];
pub(crate) const SPOOL_SUFFIX: &str = ".spool";

/// Removes the builder's own files in `folder`, but for the lock and those that `keep`.
pub(crate) fn sweep(folder: &Path, keep: impl Fn(&str) -> bool) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let is_ours = OURS.contains(&name) || name.ends_with(SPOOL_SUFFIX);
        if is_ours && name != "lock" && !keep(name) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Removes a work folder; the journal first, so that what is left after a crash is not taken for a build to continue, the
/// lock last. A file in it that is not the builder's keeps it alive.
pub(crate) fn remove_folder(folder: &Path) {
    let _ = std::fs::remove_file(folder.join("journal"));
    sweep(folder, |_| false);
    let _ = std::fs::remove_file(folder.join("lock"));
    let _ = std::fs::remove_dir(folder);
}
