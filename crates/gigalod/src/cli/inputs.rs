//! The models that a command is given: one file, or several and folders of them as one model.
//!
//! In: arguments. Out: the files they stand for, in order; and all of them as one stream, with what tells them from others.
//!
//! What always holds: a folder stands for the files in it that are models by their content, sorted by name, whatever the file
//! system's order; no file is in the list twice; errors are of the file they are about.

use super::error::CliError;
use super::files;
use super::progress::Console;
use gigalod_build::{FileIdentity, InputIdentity, SideLog};
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use gigalod_import::{ModelStream, OpenPart, Part, Stamp, Together, format_of, open_all, open_watched_since};
use gigalod_runtime::splats::MATERIAL_SRGB;
use std::collections::HashSet;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Files that are one model.
pub(crate) struct Inputs {
    name: PathBuf,
    files: Vec<PathBuf>,
}

/// What the user says of the input, whatever it says itself.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sense {
    pub(crate) up: Option<UpAxis>,
    pub(crate) unit: Option<LengthUnit>,
}

/// Endings of the names of models. A file with one of these in a folder, that is no model, is worth a word.
const ENDINGS: [&str; 13] = ["ply", "obj", "stl", "off", "gltf", "glb", "las", "laz", "e57", "pcd", "xyz", "pts", "gz"];

impl Inputs {
    /// A single file.
    pub(crate) fn one(file: &Path) -> Self {
        Self { name: file.to_owned(), files: vec![file.to_owned()] }
    }

    /// The files that `arguments` stand for, at least one of which there is.
    pub(crate) fn find(arguments: &[PathBuf], console: &Console) -> Result<Self, CliError> {
        let mut found = Vec::new();
        for argument in arguments {
            if argument.is_dir() {
                found.extend(models_in(argument, console)?);
            } else {
                found.push(argument.clone());
            }
        }
        if let [_, _, ..] = found[..] {
            let mut seen = HashSet::new();
            // What cannot be found is told by who opens it.
            let twice = found.iter().find(|file| file.canonicalize().is_ok_and(|file| !seen.insert(file)));
            if let Some(file) = twice {
                return Err(CliError::in_file(file, "given twice"));
            }
        }
        let name = match (arguments, &found[..]) {
            (_, [only]) => only.clone(),
            ([one], _) => one.clone(),
            (several, _) => {
                let first = several.first().map(|file| file.display().to_string()).unwrap_or_default();
                PathBuf::from(format!("{first} and {} more", several.len() - 1))
            }
        };
        Ok(Self { name, files: found })
    }

    /// What messages about all of them say.
    pub(crate) fn name(&self) -> &Path {
        &self.name
    }

    /// The files, in order.
    pub(crate) fn files(&self) -> Vec<&Path> {
        self.files.iter().map(PathBuf::as_path).collect()
    }

    /// Opens the model, and says which it is; `side` is told of the files that it names.
    pub(crate) fn open(
        &self,
        sense: Sense,
        side: &SideLog,
        console: &Console,
    ) -> Result<(Box<dyn ModelStream>, InputIdentity), CliError> {
        if let [file] = &self.files[..] {
            let (stream, identity) = files::open_input(file, side)?;
            return Ok((stream, InputIdentity { files: vec![identity] }));
        }
        let units = Units::default();
        let (parts, identities): (Vec<Part>, Vec<FileIdentity>) =
            self.files.iter().map(|file| part(file, side, &units)).collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let together = Together { up: sense.up, unit: sense.unit, plain_color: MATERIAL_SRGB };
        let stream = open_all(parts, &together).map_err(|error| CliError::import(&self.name, &error))?;
        if sense.unit.is_none() {
            units.warn(console);
        }
        Ok((stream, InputIdentity { files: identities }))
    }
}

/// What files say a length of 1 is, in the order in which they were opened.
#[derive(Clone, Default)]
struct Units(Arc<Mutex<Vec<Said>>>);

/// A file, and what it says.
type Said = (PathBuf, Option<LengthUnit>);

impl Units {
    fn note(&self, path: &Path, unit: Option<LengthUnit>) {
        self.0.lock().expect("nobody panics while holding it").push((path.to_owned(), unit));
    }

    /// Those that say different ones were refused.
    fn warn(&self, console: &Console) {
        let known = self.0.lock().expect("nobody panics while holding it");
        let said = known.iter().find_map(|(path, unit)| Some((path, (*unit)?)));
        let silent: Vec<&Path> = known.iter().filter(|(_, unit)| unit.is_none()).map(|(path, _)| &**path).collect();
        if let (Some((path, unit)), Some(first)) = (said, silent.first()) {
            let unit = unit.symbol();
            let others = if silent.len() > 1 { format!(", nor do {} others", silent.len() - 1) } else { String::new() };
            let what = format!(
                "does not say in which unit its lengths are{others}; taken for {unit}, as in {}",
                path.display()
            );
            console.warn(
                &CliError::in_file(first, what).hint(format!("say what it is in all of them, as --units {unit}")),
            );
        }
    }
}

/// One of several files as it is now; that it still is that file is checked whenever it is opened.
fn part(path: &Path, side: &SideLog, units: &Units) -> Result<(Part, FileIdentity), CliError> {
    let wrong = |error: io::Error| CliError::in_file(path, error);
    let file = files::open(path)?;
    files::expect_raw(path)?;
    let stamp = files::stamp(&file).map_err(wrong)?;
    let identity = FileIdentity::of(path, &file).map_err(wrong)?;
    let (path, side, units) = (path.to_owned(), side.clone(), units.clone());
    let name = path.display().to_string();
    let open: OpenPart = Box::new(move || {
        let stream = open_part(&path, stamp, &side)?;
        units.note(&path, stream.unit());
        Ok(stream)
    });
    Ok((Part { name, open }, identity))
}

fn open_part(path: &Path, stamp: Stamp, side: &SideLog) -> Result<Box<dyn ModelStream>, gigalod_import::ImportError> {
    let file = File::open(path)?;
    let watched = file.try_clone()?;
    open_watched_since(Box::new(file), files::side_files(path, side), stamp, Box::new(move || files::stamp(&watched)))
}

fn is_named_as_model(path: &Path) -> bool {
    path.extension().is_some_and(|it| ENDINGS.iter().any(|ending| it.eq_ignore_ascii_case(ending)))
}

/// Models in a folder, not below it, sorted by name.
fn models_in(folder: &Path, console: &Console) -> Result<Vec<PathBuf>, CliError> {
    let wrong = |error: io::Error| CliError::in_file(folder, error);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(wrong)? {
        names.push(entry.map_err(wrong)?.file_name());
    }
    names.retain(|name| !name.as_encoded_bytes().starts_with(b"."));
    names.sort();
    let mut models = Vec::new();
    for path in names.into_iter().map(|name| folder.join(name)) {
        // Most folders hold the pictures of materials.
        let has_models = || {
            let entries = std::fs::read_dir(&path).into_iter().flatten().flatten();
            entries.map(|entry| entry.path()).any(|path| is_named_as_model(&path))
        };
        if path.is_dir() && has_models() {
            console.warn(&CliError::in_file(&path, "left out: folders below one are not looked into, name it too"));
        }
        if !path.is_file() {
            continue;
        }
        let format = format_of(Box::new(files::open(&path)?)).map_err(|error| CliError::import(&path, &error))?;
        if let Some(format) = format {
            console.detail(|| format!("{}: {format}", path.display()));
            models.push(path);
        } else if is_named_as_model(&path) {
            console.warn(&CliError::in_file(&path, "left out: no model by its content"));
        }
    }
    if models.is_empty() {
        return Err(CliError::in_file(folder, "expected files in it that are models, found none"));
    }
    Ok(models)
}
