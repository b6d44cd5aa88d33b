//! Raw models built on the way to a picture are kept in the user's cache, keyed by their contents and the build options.
//!
//! Which other files a model names, such as textures, is known when it is built. So beside each built file lies a list of them with
//! their checksums: what was built counts only as long as these are the same, and is built again under the same name otherwise.

use super::args::BuildOptions;
use super::build::{Recovery, build};
use super::error::CliError;
use super::files;
use super::inputs::{Inputs, Sense};
use super::progress::Console;
use gigalod_build::{GENERATOR, Progress, SideLog};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A `.glod` file for `file`: itself, or what it builds into.
pub(crate) fn container_of(file: &Path, options: &BuildOptions, console: &Console) -> Result<PathBuf, CliError> {
    let work = console.work(&file.file_name().unwrap_or_default().to_string_lossy());
    let mut has_begun = false;
    let found = find(file, options, &mut |done, total| {
        if !std::mem::replace(&mut has_begun, true) {
            work.begin("read", total);
        }
        work.at(done);
        true
    })?;
    work.finish();
    match found {
        Found::Itself => Ok(file.to_owned()),
        Found::Built(cached) => {
            console.detail(|| format!("{}: built before as {}", file.display(), cached.display()));
            Ok(cached)
        }
        Found::NotBuilt(cached) => {
            build(&Inputs::one(file), &cached, options, Sense::default(), Recovery::Lost, console)?;
            console.detail(|| format!("{}: built as {}", file.display(), cached.display()));
            Ok(cached)
        }
    }
}

/// What there is of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// It is a `.glod` file.
    Itself,
    /// It was built before, as this.
    Built(PathBuf),
    /// It is to be built, as this; the folder is there.
    NotBuilt(PathBuf),
}

/// Looks a file up that would be built with these options; `at` is told how many bytes of how many were read, and says whether to go on.
pub(crate) fn find(
    file: &Path,
    options: &BuildOptions,
    at: &mut dyn FnMut(u64, u64) -> bool,
) -> Result<Found, CliError> {
    if files::is_container(file)? {
        return Ok(Found::Itself);
    }
    let folder = folder()?;
    let cached = folder.join(format!("{}.glod", key(file, options, at)?));
    if cached.is_file() && files::open_built(&cached).is_ok() && names_the_same(file, &list_of(&cached)) {
        return Ok(Found::Built(cached));
    }
    std::fs::create_dir_all(&folder).map_err(|error| {
        let what = format!("could not make the cache of built models: {error}");
        CliError::in_file(&folder, what).hint("XDG_CACHE_HOME says where it lies")
    })?;
    Ok(Found::NotBuilt(cached))
}

/// Notes what a file is built as, so that [`was_built`] need not read it. Where that cannot be noted, nothing depends on it.
#[cfg(feature = "view")]
pub(crate) fn note_place(file: &Path, cached: &Path) {
    let _ = folder().ok().and_then(|folder| note_place_in(&folder, file, cached));
}

/// True where a file was remembered, has not been written to since, and what it builds into is there. Told by its name and stamp: good
/// enough for a list.
#[cfg(feature = "view")]
pub(crate) fn was_built(file: &Path) -> bool {
    folder().is_ok_and(|folder| was_built_in(&folder, file))
}

#[cfg(feature = "view")]
fn note_place_in(folder: &Path, file: &Path, cached: &Path) -> Option<()> {
    let note = note_of(folder, file)?;
    std::fs::create_dir_all(note.parent()?).ok()?;
    std::fs::write(note, cached.file_name()?.as_encoded_bytes()).ok()
}

#[cfg(feature = "view")]
fn was_built_in(folder: &Path, file: &Path) -> bool {
    let cached = note_of(folder, file).and_then(|note| std::fs::read_to_string(note).ok());
    cached.is_some_and(|name| folder.join(name).is_file())
}

/// Where it is noted what a file is built as.
#[cfg(feature = "view")]
fn note_of(folder: &Path, file: &Path) -> Option<PathBuf> {
    let stamp = files::stamp(&files::open(file).ok()?).ok()?;
    let path = file.canonicalize().ok()?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(path.as_os_str().as_encoded_bytes()).update(format!("{GENERATOR} {stamp:?}").as_bytes());
    Some(folder.join("seen").join(&hasher.finalize().to_hex()[..32]))
}

/// The list beside a built file.
fn list_of(cached: &Path) -> PathBuf {
    cached.with_extension("files.json")
}

/// By names relative to the model: checksums of their contents; none of those that could not be read.
type SideSums = BTreeMap<String, Option<String>>;

/// Writes the list of files that a model named while it was built, if it was built into the cache.
pub(crate) fn remember(inputs: &Inputs, output: &Path, side: &SideLog) -> Result<(), CliError> {
    let ([model], Ok(folder)) = (&inputs.files()[..], folder()) else { return Ok(()) };
    if output.parent() != Some(&folder) {
        return Ok(());
    }
    let beside = model.parent().unwrap_or(Path::new(""));
    let name = |path: &PathBuf| path.strip_prefix(beside).ok().map(|name| name.to_string_lossy().into_owned());
    let names = side.paths().iter().filter_map(name).collect::<Vec<_>>();
    let sums: SideSums = names.into_iter().map(|name| (name.clone(), sum_of(&beside.join(&name)))).collect();
    let list = list_of(output);
    let text = serde_json::to_vec(&sums).expect("names and sums are plain data");
    files::write_atomically(&list, |out| out.write_all(&text).map_err(|error| CliError::write(&list, &error)))
}

/// True where all files that a model names are what they were when it was built.
fn names_the_same(model: &Path, list: &Path) -> bool {
    let Some(sums) = std::fs::read(list).ok().and_then(|text| serde_json::from_slice::<SideSums>(&text).ok()) else {
        return false;
    };
    let beside = model.parent().unwrap_or(Path::new(""));
    sums.into_iter().all(|(name, sum)| sum_of(&beside.join(name)) == sum)
}

fn sum_of(path: &Path) -> Option<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(files::open(path).ok()?).ok()?;
    Some(hasher.finalize().to_hex()[..32].to_string())
}

fn folder() -> Result<PathBuf, CliError> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = variable("XDG_CACHE_HOME")
        .or_else(|| variable("HOME").map(|home| home.join(".cache")))
        .or_else(|| variable("LOCALAPPDATA"));
    base.map(|base| base.join("gigalod")).ok_or_else(|| {
        CliError::new("no folder for the cache").hint("set XDG_CACHE_HOME, or use `gigalod build` first")
    })
}

/// Depends on all bytes of the file, the options that count and the builder's revision; memory and threads do not change what is built.
fn key(file: &Path, options: &BuildOptions, at: &mut dyn FnMut(u64, u64) -> bool) -> Result<String, CliError> {
    let wrong = |error| CliError::in_file(file, error);
    let mut source = files::open(file)?;
    let total = source.metadata().map_err(wrong)?.len();
    let mut hasher = blake3::Hasher::new();
    hasher.update(format!("{GENERATOR}\n").as_bytes());
    hasher.update(options.recipe().as_bytes());
    let mut buffer = vec![0; 1 << 20];
    let mut done = 0;
    loop {
        if !at(done, total) {
            return Err(CliError::in_file(file, "cancelled"));
        }
        let read = source.read(&mut buffer).map_err(wrong)?;
        if read == 0 {
            return Ok(hasher.finalize().to_hex()[..32].to_string());
        }
        hasher.update(&buffer[..read]);
        done += read as u64;
    }
}

#[cfg(all(test, feature = "view"))]
mod tests {
    use super::*;

    #[test]
    fn what_was_built_is_known_until_it_is_written_to_or_its_model_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        let (raw, other, built) = (place("scan.ply"), place("other.ply"), place("0123.glod"));
        for (name, contents) in [(&raw, "one"), (&other, "one"), (&built, "built")] {
            std::fs::write(name, contents).unwrap();
        }
        assert!(!was_built_in(folder.path(), &raw));
        note_place_in(folder.path(), &raw, &built).unwrap();
        assert!(was_built_in(folder.path(), &raw) && !was_built_in(folder.path(), &other));
        std::fs::write(&raw, "longer").unwrap();
        assert!(!was_built_in(folder.path(), &raw));
        note_place_in(folder.path(), &raw, &built).unwrap();
        assert!(was_built_in(folder.path(), &raw));
        std::fs::remove_file(&built).unwrap();
        assert!(!was_built_in(folder.path(), &raw));
    }
}
