//! Files that appear under their name only when they are complete.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::NamedTempFile;

/// Files that have no final name yet; a program that is interrupted can remove them.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file beside its final place; gone when dropped before [`Output::publish`].
#[derive(Debug)]
pub struct Output {
    temporary: NamedTempFile,
    path: PathBuf,
}

impl Drop for Output {
    fn drop(&mut self) {
        unfinished().retain(|path| path != self.temporary.path());
    }
}

impl Output {
    /// Removes all files of this process that have no final name yet: for a program that is about to end in the middle of
    /// its work. What is being written to them is lost.
    pub fn remove_unfinished() {
        for path in unfinished().drain(..) {
            // It may have got its name, or have been removed, a moment ago.
            let _ = std::fs::remove_file(path);
        }
    }

    /// Creates the file under a name of its own in the folder of `path`.
    ///
    /// # Errors
    /// What the system says; and where `path` is a folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        if path.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "there is a folder of that name"));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        let name = path.file_name().map(|name| format!(".{}.", name.to_string_lossy())).unwrap_or_default();
        builder.prefix(&name).suffix(".part");
        #[cfg(unix)]
        {
            // What a plain `File::create` would ask for; the user's mask takes away what it will.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let temporary = builder.tempfile_in(folder)?;
        unfinished().push(temporary.path().to_owned());
        Ok(Self { temporary, path: path.to_owned() })
    }

    /// To write to.
    pub fn file(&self) -> &File {
        self.temporary.as_file()
    }

    /// Gives the file its name, replacing what was there, once all of it is on disk.
    ///
    /// # Errors
    /// What the system says.
    pub fn publish(self) -> io::Result<()> {
        self.temporary.as_file().sync_all()?;
        std::fs::rename(self.temporary.path(), &self.path)
    }
}
