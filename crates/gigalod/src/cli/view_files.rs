//! Files for the viewer: opened, built and written on its background threads.
//!
//! A raw model is built by another process of this program, so that cancelling it is safe at any moment and a build that runs out
//! of memory does not take the window along.

use super::args::BuildOptions;
use super::cache::{self, Found};
use super::error::CliError;
use super::exact;
use super::files;
use super::path_file;
use super::scene_file;
use super::{view_folder, view_preview};
use gigalod_geom::{CameraPath, ImageSize};
use gigalod_runtime::Similarity;
use gigalod_runtime::scene::description::SceneDescription;
use gigalod_view::pick::{Hit, Ray};
use gigalod_view::{Host, Model, Opened, OpenedScene, Preview, Work, next_name};
use glam::DVec3;
use std::collections::HashSet;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often a build is asked whether it is done.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// What the viewer needs of files.
pub(crate) struct Files {
    build: BuildOptions,
    /// Camera paths and scenes that were written; these may be written again.
    written: Mutex<HashSet<PathBuf>>,
}

impl Host for Files {
    fn open(&self, path: &Path, work: &Work) -> Result<Opened, String> {
        self.open_any(path, work).map_err(told)
    }

    fn exact_point(&self, original: &Path, ray: &Ray, near: &Hit, work: &Work) -> Result<Option<DVec3>, String> {
        exact::point(original, ray, near, &|| work.is_cancelled()).map_err(told)
    }

    fn write_picture(&self, path: &Path, size: ImageSize, rgba: &[u8]) -> Result<PathBuf, String> {
        let path = free_name(path);
        let write = || {
            files::check_output(&path, &[])?;
            files::check_png_name(&path)?;
            files::write_png(&path, size, rgba)
        };
        write().map_err(told).map(|()| path)
    }

    fn write_path(&self, path: &Path, camera_path: &CameraPath) -> Result<PathBuf, String> {
        self.write(path, |path| {
            files::check_output(path, &[])?;
            path_file::write(path, camera_path).map(drop)
        })
    }

    fn write_scene(&self, path: &Path, scene: &SceneDescription) -> Result<PathBuf, String> {
        let models: Vec<&Path> = scene.models.iter().map(|model| model.file.as_path()).collect();
        self.write(path, |path| {
            files::check_output(path, &models)?;
            scene_file::write(path, scene)
        })
    }
}

/// The name, or the next one that no file has.
fn free_name(path: &Path) -> PathBuf {
    let mut free = path.to_owned();
    while let (true, Some(name)) = (free.exists(), free.file_name()) {
        free = free.with_file_name(next_name(&name.to_string_lossy()));
    }
    free
}

/// As the window says it.
fn told(error: CliError) -> String {
    let line = error.to_string();
    line.strip_prefix("error: ").unwrap_or(&line).to_string()
}

impl Files {
    pub(crate) fn new(build: BuildOptions) -> Self {
        Self { build, written: Mutex::default() }
    }

    /// Writes under that name where there is no such file or it is one of ours, else under the next one that is free.
    fn write(&self, path: &Path, write: impl FnOnce(&Path) -> Result<(), CliError>) -> Result<PathBuf, String> {
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        let path = if written.contains(path) { path.to_owned() } else { free_name(path) };
        write(&path).map_err(told)?;
        written.insert(path.clone());
        Ok(path)
    }

    fn open_any(&self, path: &Path, work: &Work) -> Result<Opened, CliError> {
        if path.is_dir() {
            return view_folder::list(path).map(Opened::Folder);
        }
        if scene_file::is_scene(path) {
            let description = scene_file::read(path)?;
            let open = |model: &gigalod_runtime::scene::description::SceneModel| {
                self.model(&model.file, scene_file::places(&model.places)?, work)
            };
            let models = description.models.iter().map(open).collect::<Result<_, _>>()?;
            return Ok(Opened::Scene(OpenedScene { description, models }));
        }
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
            return path_file::read(path).map(Opened::Path);
        }
        self.model(path, vec![Similarity::IDENTITY], work).map(Opened::Model)
    }

    fn model(&self, path: &Path, placements: Vec<Similarity>, work: &Work) -> Result<Model, CliError> {
        let mut at = |done: u64, total: u64| {
            work.at("looked up", Some(done as f32 / total.max(1) as f32), None);
            !work.is_cancelled()
        };
        let (container, original) = match cache::find(path, &self.build, &mut at)? {
            Found::Itself => (path.to_owned(), None),
            Found::Built(cached) => (cached, Some(path.to_owned())),
            Found::NotBuilt(cached) => {
                self.build_with_preview(path, &cached, &placements, work)?;
                (cached, Some(path.to_owned()))
            }
        };
        if original.is_some() {
            cache::note_place(path, &container);
        }
        let unit = files::open_container(&container)?.read_metadata().ok();
        let unit = unit.and_then(|mut metadata| metadata.options.remove("units"));
        let file = files::open_built(&container)?;
        Ok(Model { source: path.to_owned(), file, original, unit, placements })
    }

    /// Builds a raw model, and shows what can be had of it sooner.
    fn build_with_preview(
        &self,
        path: &Path,
        output: &Path,
        placements: &[Similarity],
        work: &Work,
    ) -> Result<(), CliError> {
        let is_built = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let preview = scope.spawn(|| {
                let is_late = || work.is_cancelled() || is_built.load(Ordering::Relaxed);
                // What is wrong with the file is told by the build.
                if let Ok(Some((file, points))) = view_preview::of(path, &self.build, &is_late)
                    && !is_late()
                {
                    let (source, placements) = (path.to_owned(), placements.to_vec());
                    let model = Model { source, file: Arc::new(file).into(), original: None, unit: None, placements };
                    work.preview(Preview { model, points });
                }
            });
            let built = self.build(path, output, work);
            is_built.store(true, Ordering::Relaxed);
            let _ = preview.join();
            built
        })
    }

    /// Builds a raw model in another process; what a cancelled build has finished is continued the next time.
    fn build(&self, input: &Path, output: &Path, work: &Work) -> Result<(), CliError> {
        let wrong = |error: std::io::Error| CliError::in_file(input, format!("could not be built: {error}"));
        // Names may begin as options do.
        let input_name = std::path::absolute(input).map_err(wrong)?;
        let mut child = Command::new(std::env::current_exe().map_err(wrong)?)
            .args(["build", "--verbose", "--resume"])
            .args(["--memory", &self.build.memory.to_string(), "--threads", &self.build.threads.to_string()])
            .args(self.build.recipe_arguments())
            .arg("--output")
            .arg(output)
            .arg(input_name)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(wrong)?;
        let lines = child.stderr.take();
        stand_back(&child);
        builds().push(child.id());
        let (progress, name) = (work.clone(), input.file_name().unwrap_or_default().to_string_lossy().into_owned());
        let listener = std::thread::spawn(move || {
            let mut errors = Vec::new();
            for line in lines.into_iter().flat_map(|lines| BufReader::new(lines).lines()).map_while(Result::ok) {
                match line.strip_prefix(&format!("{name}: ")) {
                    Some(step) => {
                        let (phase, part, left) = phase_of(step);
                        progress.at(phase, part, left);
                    }
                    None if line.starts_with("error: ") || line.starts_with("hint: ") => errors.push(line),
                    None => {}
                }
            }
            errors
        });
        let mut is_stopped = false;
        let status = loop {
            if work.is_cancelled() && !is_stopped {
                stop(&mut child);
                is_stopped = true;
            }
            // As long as it is in the list, its number is no other's.
            let mut builds = builds();
            let ended = child.try_wait();
            if !matches!(ended, Ok(None)) {
                builds.retain(|build| *build != child.id());
            }
            drop(builds);
            match ended.map_err(wrong)? {
                Some(status) => break status,
                None => std::thread::sleep(LOOK_EVERY),
            }
        };
        let errors = listener.join().unwrap_or_default();
        if is_stopped {
            return Err(CliError::in_file(input, "cancelled"));
        }
        if status.success() {
            return Ok(());
        }
        let said = errors.join("\n");
        let said = said.strip_prefix("error: ").unwrap_or(&said);
        Err(if said.is_empty() {
            CliError::in_file(input, format!("could not be built: {status}"))
        } else {
            CliError::new(said)
        })
    }
}

/// Processes that build for the viewer.
static BUILDS: Mutex<Vec<u32>> = Mutex::new(Vec::new());

fn builds() -> MutexGuard<'static, Vec<u32>> {
    BUILDS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends all builds that run for the viewer, which is being ended itself: nobody waits for them.
pub(crate) fn abandon_builds() {
    builds().iter().for_each(|build| interrupt(*build));
}

/// Ends a build as Ctrl-C would, so that it cleans up.
fn stop(build: &mut Child) {
    #[cfg(unix)]
    interrupt(build.id());
    #[cfg(not(unix))]
    let _ = build.kill();
}

/// Elsewhere the system has no such signal, and a build goes on without the viewer until it is done.
fn interrupt(build: u32) {
    #[cfg(unix)]
    {
        let id = nix::unistd::Pid::from_raw(build as i32);
        // One that has just ended needs no signal.
        let _ = nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT);
    }
    #[cfg(not(unix))]
    let _ = build;
}

/// Lets a build have what processors the window leaves: a picture that a person waits for comes first.
fn stand_back(build: &Child) {
    #[cfg(unix)]
    {
        /// Of -20 to 19, the last of which is the most modest.
        const PRIORITY: i32 = 10;
        // Threads that it begins later inherit it.
        let _ = rustix::process::setpriority_process(Some(rustix::process::Pid::from_child(build)), PRIORITY);
    }
    #[cfg(not(unix))]
    let _ = build;
}

/// `read 12 %, 3 s left` → what is done, how much of it, and how long it still takes.
fn phase_of(step: &str) -> (&str, Option<f32>, Option<Duration>) {
    let read = || {
        let (before, after) = step.split_once(" %")?;
        let (phase, percent) = before.rsplit_once(' ')?;
        let left = after.strip_prefix(", ").and_then(|left| left.strip_suffix(" s left")?.parse().ok());
        Some((phase, Some(percent.parse::<f32>().ok()? / 100.0), left.map(Duration::from_secs)))
    };
    read().unwrap_or((step, None, None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::Pose;

    #[test]
    fn lines_of_a_build_say_how_far_it_is() {
        let seconds = |seconds| Some(Duration::from_secs(seconds));
        assert_eq!(phase_of("read 12 %, 3 s left"), ("read", Some(0.12), seconds(3)));
        assert_eq!(phase_of("sort runs 100 %, 0 s left"), ("sort runs", Some(1.0), seconds(0)));
        assert_eq!(phase_of("write"), ("write", None, None));
    }

    #[test]
    fn what_was_there_before_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let contents = |name: &str| std::fs::read(at(name)).unwrap();
        for name in ["a-1.png", "a-2.png", "a.json"] {
            std::fs::write(at(name), name).unwrap();
        }
        let files = Files::new(BuildOptions::within(1 << 30));
        let size = ImageSize { width: 2, height: 1 };
        let picture = |name: &str| files.write_picture(&at(name), size, &[200; 8]).unwrap();
        assert_eq!([picture("a-1.png"), picture("a-1.png")], [at("a-3.png"), at("a-4.png")]);
        // A path may be saved again by who saved it.
        let pose = Pose { t: 0.0, eye: DVec3::X, target: DVec3::ZERO };
        let path = CameraPath { up: DVec3::Y, fov_deg: 40.0, frames: vec![pose] };
        let written: Vec<PathBuf> =
            ["a.json", "b.json", "b.json"].map(|name| files.write_path(&at(name), &path).unwrap()).into();
        assert_eq!(written, [at("a-2.json"), at("b.json"), at("b.json")]);
        for name in ["a-1.png", "a-2.png", "a.json"] {
            assert_eq!(contents(name), name.as_bytes());
        }
    }
}
