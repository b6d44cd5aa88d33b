//! What is looked at: a model, or a scene of several.

use super::args::BuildOptions;
use super::cache;
use super::error::CliError;
use super::files;
use super::progress::Console;
use super::scene_file;
use gigalod_format::splats::SplatFile;
use gigalod_geom::camera::UpAxis;
use gigalod_runtime::Similarity;
use gigalod_runtime::scene::description::SceneDescription;
use std::path::Path;
use std::sync::Arc;

/// Models in their places, open.
pub(crate) struct Subject {
    /// What the scene says besides; nothing for a single model.
    pub(crate) description: SceneDescription,
    /// At least one.
    pub(crate) models: Vec<(Arc<SplatFile>, Vec<Similarity>)>,
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
            Ok((Arc::new(files::open_splats(&container)?), scene_file::places(&model.places)?))
        };
        let models = description.models.iter().map(open).collect::<Result<_, CliError>>()?;
        Ok(Self { description, models })
    }

    /// Opens a `.glod` file.
    pub(crate) fn of_container(file: &Path) -> Result<Self, CliError> {
        let splats = Arc::new(files::open_splats(file)?);
        Ok(Self { description: SceneDescription::default(), models: vec![(splats, vec![Similarity::IDENTITY])] })
    }

    /// Which way is up: as the scene says, or the first model.
    pub(crate) fn up(&self) -> UpAxis {
        let first = self.models.first().map(|(file, _)| file.skeleton().root().up);
        self.description.up.or(first).unwrap_or_default()
    }
}
