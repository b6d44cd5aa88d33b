//! Files that appear under their name only when they are complete.

use crate::unfinished::registry;
use crate::work::Work;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// A file beside its final place; gone when dropped before [`Output::publish`].
#[derive(Debug)]
pub struct Output {
    file: File,
    temporary: PathBuf,
    path: PathBuf,
}

impl Drop for Output {
    fn drop(&mut self) {
        let mut registry = registry();
        // Published, it has gone; then this finds nothing.
        let _ = std::fs::remove_file(&self.temporary);
        registry.files.retain(|path| *path != self.temporary);
    }
}

impl Output {
    /// Creates the file under a name of its own in the folder of `path`.
    ///
    /// # Errors
    /// What the system says; and where `path` is a folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        expect_no_folder(path)?;
        let path = &behind_links(path);
        let mut builder = tempfile::Builder::new();
        // With more of a long name, what comes besides would make it too long.
        const MOST: usize = 64;
        let start = |name: &std::ffi::OsStr| name.to_string_lossy().chars().take(MOST).collect::<String>();
        let name = path.file_name().map(|name| format!(".{}.", start(name))).unwrap_or_default();
        builder.prefix(&name).suffix(".part");
        #[cfg(unix)]
        {
            // What a plain `File::create` would ask for; the user's mask takes away what it will.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let mut registry = registry();
        let (file, temporary) = builder.tempfile_in(folder_of(path))?.keep().map_err(|error| error.error)?;
        registry.files.push(temporary.clone());
        Ok(Self { file, temporary, path: path.to_owned() })
    }

    /// Creates the file in a work folder.
    pub(crate) fn create_in(work: &Work, path: &Path) -> io::Result<Self> {
        let _names = registry();
        let temporary = work.folder().join("pages.part");
        Ok(Self { file: File::create(&temporary)?, temporary, path: path.to_owned() })
    }

    /// To write to.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Gives the file its name, replacing what was there, once all of it is on disk.
    ///
    /// # Errors
    /// What the system says.
    pub fn publish(self) -> io::Result<()> {
        // Who may read what was there may read what takes its place, and nobody else.
        if let Ok(before) = std::fs::metadata(&self.path) {
            self.file.set_permissions(before.permissions())?;
        }
        self.file.sync_all()?;
        let names = registry();
        std::fs::rename(&self.temporary, &self.path)?;
        sync_folder(folder_of(&self.path))?;
        drop(names);
        Ok(())
    }
}

/// The file that a name stands for: a link is followed, so that its target is replaced and not the link.
pub(crate) fn behind_links(path: &Path) -> PathBuf {
    let is_link = std::fs::symlink_metadata(path).is_ok_and(|there| there.is_symlink());
    // A link to nowhere is itself replaced.
    let target = if is_link { path.canonicalize().ok() } else { None };
    target.unwrap_or_else(|| path.to_owned())
}

/// A file cannot take the place of a folder.
pub(crate) fn expect_no_folder(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "there is a folder of that name"));
    }
    Ok(())
}

/// The folder that a file lies in: `.` for a bare name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Names in `folder` are on disk when this returns, where the system knows such a thing.
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}
