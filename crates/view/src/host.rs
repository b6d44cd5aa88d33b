//! What the viewer needs of whoever runs it: files are opened, built and written there, on threads of their own.

use crate::pick::{Hit, Ray};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{CameraPath, ImageSize};
use gigalod_runtime::scene::description::SceneDescription;
use gigalod_runtime::{ModelFile, Similarity};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A model open for drawing.
#[derive(Clone)]
pub struct Model {
    /// As the person named it.
    pub source: PathBuf,
    /// Its hierarchy.
    pub file: ModelFile,
    /// What it was built from, where that lies at hand: picked points are exact then.
    pub original: Option<PathBuf>,
    /// What a length of 1 is, where that is known: a symbol such as `m`.
    pub unit: Option<String>,
    /// Where it stands, at least once.
    pub placements: Vec<Similarity>,
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Model").field("source", &self.source).finish_non_exhaustive()
    }
}

/// What a file turned out to be.
#[derive(Debug)]
pub enum Opened {
    /// To be added to what is shown.
    Model(Model),
    /// To take the place of what is shown.
    Scene(OpenedScene),
    /// Something to choose from.
    Folder(Folder),
    /// To be played.
    Path(CameraPath),
}

/// What can be opened in a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folder {
    /// Its absolute name.
    pub path: PathBuf,
    /// In the order to be shown.
    pub entries: Vec<Entry>,
}

/// One thing in a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its name, with the folder's.
    pub path: PathBuf,
    /// What it is, by its name.
    pub kind: Kind,
    /// Of the file; 0 of a folder.
    pub bytes: u64,
}

/// What something in a folder is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Another folder.
    Folder,
    /// A model that is shown at once.
    Model,
    /// A raw model that was built before and has not changed since.
    Built,
    /// A raw model that is built first.
    Raw,
    /// A scene.
    Scene,
    /// A camera path.
    Path,
}

/// A scene with its models open.
#[derive(Debug)]
pub struct OpenedScene {
    /// What it says, but for its models.
    pub description: SceneDescription,
    /// Open.
    pub models: Vec<Model>,
}

/// Opens and writes files. Long work looks often whether it was cancelled: the viewer waits for it at exit. Errors are one line for people, with a hint line if there is one.
pub trait Host: Send + Sync + 'static {
    /// Opens a model, a raw one too, which is built first; a scene, a folder or a camera path.
    ///
    /// # Errors
    /// What is wrong with it; also when `work` was cancelled.
    fn open(&self, path: &Path, work: &Work) -> Result<Opened, String>;

    /// Where a ray meets the original of a model near `near`, exactly; model space. `None` where it does not.
    ///
    /// # Errors
    /// What is wrong with the original; also when `work` was cancelled.
    fn exact_point(&self, original: &Path, ray: &Ray, near: &Hit, work: &Work) -> Result<Option<DVec3>, String>;

    /// Writes a picture: 8-bit sRGB and alpha, rows from the top. Returns the file's name: what is there already is not
    /// replaced, and names count up instead ([`crate::next_name`]).
    ///
    /// # Errors
    /// What is wrong with the name or the disk.
    fn write_picture(&self, path: &Path, size: ImageSize, rgba: &[u8]) -> Result<PathBuf, String>;

    /// Writes a camera path. Returns the file's name: only what this host has written itself is replaced.
    ///
    /// # Errors
    /// What is wrong with the name or the disk.
    fn write_path(&self, path: &Path, camera_path: &CameraPath) -> Result<PathBuf, String>;

    /// Writes a scene; its files are named relative to its folder where they lie below it. Returns the file's name: only what
    /// this host has written itself is replaced.
    ///
    /// # Errors
    /// What is wrong with the name or the disk.
    fn write_scene(&self, path: &Path, scene: &SceneDescription) -> Result<PathBuf, String>;
}

/// Long work that somebody watches and may cancel. Clones are the same one.
#[derive(Clone, Default)]
pub struct Work(Arc<WorkState>);

#[derive(Default)]
struct WorkState {
    cancelled: AtomicBool,
    at: Mutex<Progress>,
    preview: Mutex<Option<Preview>>,
    changed: Mutex<Option<Box<dyn Fn() + Send>>>,
}

/// How far work is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// What is being done; empty before it begins.
    pub phase: String,
    /// From 0 to 1; `None` where nobody knows.
    pub part: Option<f32>,
    /// How long this phase still takes, where that can be told.
    pub left: Option<Duration>,
}

/// Something coarse to look at while a model is being built.
#[derive(Clone, Debug)]
pub struct Preview {
    /// Where the model will stand.
    pub model: Model,
    /// Points of the model that it is made of; how far it is from the model is not known.
    pub points: u64,
}

impl std::fmt::Debug for Work {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.progress().fmt(f)
    }
}

impl Work {
    /// Work that calls `changed` when it has got on.
    pub fn watched(changed: impl Fn() + Send + 'static) -> Self {
        let work = Self::default();
        *work.0.changed.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(changed));
        work
    }

    /// Tells how far it is.
    pub fn at(&self, phase: &str, part: Option<f32>, left: Option<Duration>) {
        let progress = Progress { phase: phase.to_string(), part, left };
        let mut at = self.0.at.lock().unwrap_or_else(PoisonError::into_inner);
        if *at != progress {
            *at = progress;
            drop(at);
            self.changed();
        }
    }

    fn changed(&self) {
        if let Some(changed) = &*self.0.changed.lock().unwrap_or_else(PoisonError::into_inner) {
            changed();
        }
    }

    /// Shows something until the work is done.
    pub fn preview(&self, preview: Preview) {
        *self.0.preview.lock().unwrap_or_else(PoisonError::into_inner) = Some(preview);
        self.changed();
    }

    /// The preview that has come since the last call.
    pub(crate) fn take_preview(&self) -> Option<Preview> {
        self.0.preview.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        self.0.at.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// It is no longer wanted: whoever does it ends soon, with an error.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// True from [`Work::cancel`] on.
    pub fn is_cancelled(&self) -> bool {
        self.0.cancelled.load(Ordering::Relaxed)
    }
}

/// Which way is up in a scene of these models: as the first has it.
pub(crate) fn up_of(models: &[Model]) -> UpAxis {
    models.first().map_or(UpAxis::Y, |model| model.file.up())
}
