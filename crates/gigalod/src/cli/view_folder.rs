//! What the viewer can open in a folder.

use super::cache;
use super::error::CliError;
use gigalod_view::{Entry, Folder, Kind};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Names of raw models end in one of these, and perhaps in `.gz`.
const RAW: [&str; 13] = ["ply", "obj", "stl", "off", "gltf", "glb", "las", "laz", "e57", "pcd", "pts", "xyz", "txt"];

/// Folders, then all else, by name. What cannot be looked at is left out.
pub(crate) fn list(folder: &Path) -> Result<Folder, CliError> {
    let wrong = |error| CliError::in_file(folder, error);
    let path = std::path::absolute(folder).map_err(wrong)?;
    // Names of folders that a person leaves again do not pile up.
    let path = path.canonicalize().unwrap_or(path);
    let mut entries: Vec<Entry> =
        std::fs::read_dir(&path).map_err(wrong)?.flatten().filter_map(|entry| entry_of(entry.path())).collect();
    entries.sort_by(|a, b| (a.kind != Kind::Folder, &a.path).cmp(&(b.kind != Kind::Folder, &b.path)));
    Ok(Folder { path, entries })
}

fn entry_of(path: PathBuf) -> Option<Entry> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    if name.starts_with('.') {
        return None;
    }
    let metadata = std::fs::metadata(&path).ok()?;
    if metadata.is_dir() {
        return Some(Entry { path, kind: Kind::Folder, bytes: 0 });
    }
    let kind = kind_of(&name).filter(|_| metadata.is_file())?;
    let kind = match kind {
        Kind::Raw if cache::was_built(&path) => Kind::Built,
        // Much else is JSON: a city may be.
        Kind::Path if !is_camera_path(&path) => return None,
        kind => kind,
    };
    Some(Entry { path, kind, bytes: metadata.len() })
}

/// Whether the first name in a JSON object is one of a camera path's.
fn is_camera_path(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(256).read_to_end(&mut start));
    let name = start.trim_ascii_start().strip_prefix(b"{").map(<[u8]>::trim_ascii_start);
    let names: [&[u8]; 3] = [b"\"up\"", b"\"fov\"", b"\"frames\""];
    read.is_ok() && name.is_some_and(|name| names.iter().any(|known| name.starts_with(known)))
}

/// By its name in small letters.
fn kind_of(name: &str) -> Option<Kind> {
    let ending = |name: &str| name.rsplit_once('.').map(|(_, ending)| ending.to_string());
    match ending(name)?.as_str() {
        "glod" => Some(Kind::Model),
        "toml" => Some(Kind::Scene),
        "json" => Some(Kind::Path),
        _ => ending(name.strip_suffix(".gz").unwrap_or(name))
            .filter(|ending| RAW.contains(&&**ending))
            .map(|_| Kind::Raw),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_lists_what_can_be_shown() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.ply.gz", "a.GLOD", "scene.toml", "notes.md", ".hidden.ply", "c.laz"] {
            std::fs::write(folder.path().join(name), "12345").unwrap();
        }
        std::fs::write(folder.path().join("path.json"), " {\n  \"fov\": 40.0").unwrap();
        std::fs::write(folder.path().join("city.json"), "{\"type\": \"CityJSON\"").unwrap();
        std::fs::create_dir(folder.path().join("z.ply")).unwrap();
        let found = list(folder.path()).unwrap();
        assert!(found.path.is_absolute());
        let entries: Vec<(String, Kind, u64)> = found
            .entries
            .iter()
            .map(|entry| (entry.path.file_name().unwrap().to_string_lossy().into_owned(), entry.kind, entry.bytes))
            .collect();
        let expected = [
            ("z.ply", Kind::Folder, 0),
            ("a.GLOD", Kind::Model, 5),
            ("b.ply.gz", Kind::Raw, 5),
            ("c.laz", Kind::Raw, 5),
            ("path.json", Kind::Path, 16),
            ("scene.toml", Kind::Scene, 5),
        ];
        assert_eq!(entries, expected.map(|(name, kind, bytes)| (name.to_string(), kind, bytes)));
    }
}
