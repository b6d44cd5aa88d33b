//! What files are called that the viewer writes: as the only model, or as a scene of several, and pictures by number.

use std::path::{Path, PathBuf};

/// Names of files to write, as a person may change them; of several models, as they are by default.
#[derive(PartialEq)]
pub(crate) struct Names {
    pub(crate) picture: String,
    pub(crate) path: String,
    pub(crate) scene: String,
}

impl Default for Names {
    fn default() -> Self {
        Self { picture: "view-1.png".into(), path: "path.json".into(), scene: "scene.toml".into() }
    }
}

impl Names {
    /// For what is seen of this model.
    pub(super) fn of(model: &Path) -> Self {
        let stem = stem_of(model);
        Self { picture: format!("{stem}-1.png"), path: format!("{stem}.json"), scene: format!("{stem}.toml") }
    }

    /// The name of a picture; the next one has another.
    pub(super) fn next_picture(&mut self) -> PathBuf {
        let next = next_name(&self.picture);
        PathBuf::from(std::mem::replace(&mut self.picture, next))
    }
}

/// `a/scan.ply.gz` → `scan`.
fn stem_of(model: &Path) -> String {
    let name = model.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// What comes after a file's name: `statue-1.png` → `statue-2.png`; a name without a number gets one.
pub fn next_name(name: &str) -> String {
    let path = Path::new(name);
    let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy())).unwrap_or_default();
    let stem = name.strip_suffix(&extension).unwrap_or(name);
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (front, number) = stem.split_at(stem.len() - digits);
    match number.parse::<u64>() {
        Ok(number) => format!("{front}{}{extension}", number.saturating_add(1)),
        Err(_) => format!("{stem}-2{extension}"),
    }
}

#[cfg(test)]
mod tests {
    use super::{next_name, stem_of};
    use std::path::Path;

    #[test]
    fn what_is_saved_is_called_as_the_model() {
        let stems = ["a/scan.ply.gz", "lion.copc.laz", "b"].map(|name| stem_of(Path::new(name)));
        assert_eq!(stems, ["scan", "lion.copc", "b"]);
    }

    #[test]
    fn names_count_up() {
        assert_eq!(next_name("statue-1.png"), "statue-2.png");
        assert_eq!(next_name("a/b9.png"), "a/b10.png");
        assert_eq!((next_name("x.png").as_str(), next_name("x").as_str()), ("x-2.png", "x-2"));
    }
}
