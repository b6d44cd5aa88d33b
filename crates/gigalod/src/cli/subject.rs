//! What is looked at: a model, or a scene of several.

use super::args::BuildOptions;
use super::cache;
use super::error::CliError;
use super::files;
use super::progress::Console;
use super::scene_file;
use gigalod_geom::camera::UpAxis;
use gigalod_runtime::scene::description::SceneDescription;
use gigalod_runtime::{ModelFile, Similarity};
use std::path::Path;

/// Models in their places, open.
pub(crate) struct Subject {
    /// What the scene says besides; nothing for a single model.
    pub(crate) description: SceneDescription,
    /// At least one.
    pub(crate) models: Vec<(ModelFile, Vec<Similarity>)>,
}

impl Subject {
    /// Opens a model, or a scene; raw models are built first.
    pub(crate) fn open(file: &Path, options: &BuildOptions, console: &Console) -> Result<Self, CliError> {
        if !scene_file::is_scene(file) {
            return Self::of_container(&cache::container_of(file, options, console)?);
        }
        let description = scene_file::read(file)?;
        for missing in description.not_drawn() {
            console.warn(&CliError::in_file(file, missing));
        }
        let open = |model: &gigalod_runtime::scene::description::SceneModel| {
            let container = cache::container_of(&model.file, options, console)?;
            Ok((files::open_built(&container)?, scene_file::places(&model.places)?))
        };
        let models = description.models.iter().map(open).collect::<Result<_, CliError>>()?;
        Ok(Self { description, models })
    }

    /// Opens a `.glod` file.
    pub(crate) fn of_container(file: &Path) -> Result<Self, CliError> {
        let model = files::open_built(file)?;
        Ok(Self { description: SceneDescription::default(), models: vec![(model, vec![Similarity::IDENTITY])] })
    }

    /// Largest error on screen, in pixels, where nobody says: what suits all models.
    pub(crate) fn default_error_px(&self) -> f64 {
        self.models.iter().map(|(file, _)| file.default_error_px()).fold(0.0, f64::max)
    }

    /// Which way is up: as the scene says, or the first model.
    pub(crate) fn up(&self) -> UpAxis {
        let first = self.models.first().map(|(file, _)| file.up());
        self.description.up.or(first).unwrap_or_default()
    }
}
