//! What a command says when it is done, and when it cannot go on.

use gigalod_build::BuildError;
use gigalod_format::FormatError;
use gigalod_import::{ImportError, Problem, Shared};
use serde::Serialize;
use std::path::Path;
use std::{fmt, io};

/// The end of a command that did what it was asked to.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// One object, on one line.
    pub(crate) json: String,
    /// For people; ends with a line end.
    pub(crate) text: String,
    /// False where the answer is no: `verify` found problems.
    pub(crate) good: bool,
}

impl Outcome {
    pub(crate) fn new(json: &impl Serialize, text: String) -> Self {
        let json = serde_json::to_string(json).expect("reports are plain data");
        Self { json, text, good: true }
    }
}

/// One thing that is wrong: `error: FILE: what is wrong (where)`, and perhaps hints, a line each.
#[derive(Clone, Debug, Default)]
pub(crate) struct CliError {
    file: Option<String>,
    what: String,
    place: Option<String>,
    hints: Vec<String>,
    pub(crate) is_usage: bool,
}

impl CliError {
    pub(crate) fn new(what: impl fmt::Display) -> Self {
        Self { what: one_line(&what.to_string()), ..Self::default() }
    }

    pub(crate) fn in_file(file: &Path, what: impl fmt::Display) -> Self {
        Self { file: Some(one_line(&file.display().to_string())), ..Self::new(what) }
    }

    /// A file could not be written, or not completely.
    pub(crate) fn write(file: &Path, error: &io::Error) -> Self {
        // The system's own words would name a temporary file that nobody asked for.
        match error.kind() {
            io::ErrorKind::NotFound if !gigalod_build::folder_of(file).is_dir() => {
                Self::in_file(file, "could not write: the folder does not exist")
            }
            io::ErrorKind::NotFound => Self::in_file(file, "could not write: the folder takes no new files"),
            io::ErrorKind::InvalidFilename => Self::in_file(file, "could not write: the name is too long"),
            io::ErrorKind::PermissionDenied => Self::in_file(file, "could not write: permission denied"),
            _ => {
                let said = error.to_string();
                Self::in_file(file, format!("could not write: {}", said.split(" at path \"").next().unwrap_or(&said)))
            }
        }
    }

    /// The arguments are wrong in a way that the parser of arguments cannot see.
    pub(crate) fn usage(what: impl fmt::Display) -> Self {
        Self { is_usage: true, ..Self::new(what) }
    }

    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hints.push(hint.into());
        self
    }

    /// Says where in the file.
    pub(crate) fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }

    pub(crate) fn import(file: &Path, error: &ImportError) -> Self {
        let file = error.file().map_or(file, Path::new);
        let wrong = Self { place: error.place().map(ToString::to_string), ..Self::in_file(file, error.what()) };
        match error.what() {
            Problem::Differs { what: Shared::Up, .. } => wrong.hint("say which way is up in all of them, as --up z"),
            Problem::Differs { what: Shared::Unit, .. } => wrong.hint("say what it is in all of them, as --units m"),
            Problem::Differs { what: Shared::Kind, .. } => wrong.hint("build meshes and point clouds apart"),
            _ => wrong,
        }
    }

    pub(crate) fn format(file: &Path, error: &FormatError) -> Self {
        Self::in_file(file, error)
    }

    pub(crate) fn build(input: &Path, output: &Path, error: &BuildError) -> Self {
        match error {
            BuildError::Import(error) => Self::import(input, error),
            BuildError::Output(error) => Self::write(output, error),
            BuildError::Busy { .. } | BuildError::OtherBuild { .. } => Self::in_file(output, error),
            BuildError::Crowd { .. } => Self::in_file(input, error).hint("give a larger --memory, as --memory 8GiB"),
            BuildError::Scratch(_) => Self::in_file(output, error)
                .hint("temporary files lie in the folder of the output, and may be larger than the input"),
            error => Self::in_file(input, error),
        }
    }

    /// `{"error":{"file","what","where"}}`.
    pub(crate) fn to_json(&self) -> String {
        #[derive(Serialize)]
        struct Report<'a> {
            file: Option<&'a str>,
            what: &'a str,
            r#where: Option<&'a str>,
        }
        let report = Report { file: self.file.as_deref(), what: &self.what, r#where: self.place.as_deref() };
        serde_json::json!({ "error": report }).to_string()
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("error: ")?;
        if let Some(file) = &self.file {
            write!(f, "{file}: ")?;
        }
        f.write_str(&self.what)?;
        if let Some(place) = &self.place {
            write!(f, " ({place})")?;
        }
        self.hints.iter().try_for_each(|hint| write!(f, "\nhint: {hint}"))
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
