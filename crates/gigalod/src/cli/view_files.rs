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
use gigalod_geom::{CameraPath, ImageSize};
use gigalod_runtime::Similarity;
use gigalod_runtime::scene::description::SceneDescription;
use gigalod_view::pick::{Hit, Ray};
use gigalod_view::{Host, Model, Opened, OpenedScene, Work};
use glam::DVec3;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

/// Names of models end in one of these, and perhaps in `.gz`.
const ENDINGS: [&str; 15] =
    ["glod", "toml", "ply", "obj", "stl", "off", "gltf", "glb", "las", "laz", "e57", "pcd", "pts", "xyz", "txt"];

/// How often a build is asked whether it is done.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// What the viewer needs of files.
pub(crate) struct Files {
    pub(crate) build: BuildOptions,
}

impl Host for Files {
    fn open(&self, path: &Path, work: &Work) -> Result<Opened, String> {
        self.open_any(path, work).map_err(told)
    }

    fn exact_point(&self, original: &Path, ray: &Ray, near: &Hit, work: &Work) -> Result<Option<DVec3>, String> {
        exact::point(original, ray, near, &|| work.is_cancelled()).map_err(told)
    }

    fn write_picture(&self, path: &Path, size: ImageSize, rgba: &[u8]) -> Result<(), String> {
        let write = || {
            files::check_output(path, &[])?;
            files::check_png_name(path)?;
            files::write_png(path, size, rgba)
        };
        write().map_err(told)
    }

    fn write_path(&self, path: &Path, camera_path: &CameraPath) -> Result<(), String> {
        files::check_output(path, &[]).and_then(|()| path_file::write(path, camera_path)).map(drop).map_err(told)
    }

    fn write_scene(&self, path: &Path, scene: &SceneDescription) -> Result<(), String> {
        let models: Vec<&Path> = scene.models.iter().map(|model| model.file.as_path()).collect();
        files::check_output(path, &models).and_then(|()| scene_file::write(path, scene)).map_err(told)
    }
}

/// As the window says it.
fn told(error: CliError) -> String {
    let line = error.to_string();
    line.strip_prefix("error: ").unwrap_or(&line).to_string()
}

impl Files {
    fn open_any(&self, path: &Path, work: &Work) -> Result<Opened, CliError> {
        if path.is_dir() {
            return models_of(path).map(Opened::Folder);
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
            work.at("reading", Some(done as f32 / total.max(1) as f32));
            !work.is_cancelled()
        };
        let (container, original) = match cache::find(path, None, &mut at)? {
            Found::Itself => (path.to_owned(), None),
            Found::Built(cached) => (cached, Some(path.to_owned())),
            Found::NotBuilt(cached) => {
                self.build(path, &cached, work)?;
                (cached, Some(path.to_owned()))
            }
        };
        let file = Arc::new(files::open_splats(&container)?);
        Ok(Model { source: path.to_owned(), file, original, placements })
    }

    /// Builds a raw model in another process; what a cancelled build has finished is continued the next time.
    fn build(&self, input: &Path, output: &Path, work: &Work) -> Result<(), CliError> {
        let wrong = |error: std::io::Error| CliError::in_file(input, format!("could not be built: {error}"));
        // Names may begin as options do.
        let input_name = std::path::absolute(input).map_err(wrong)?;
        let mut child = Command::new(std::env::current_exe().map_err(wrong)?)
            .args(["build", "--verbose", "--resume"])
            .args(["--memory", &self.build.memory.to_string(), "--threads", &self.build.threads.to_string()])
            .arg("--output")
            .arg(output)
            .arg(input_name)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(wrong)?;
        let lines = child.stderr.take();
        let (progress, name) = (work.clone(), input.file_name().unwrap_or_default().to_string_lossy().into_owned());
        let listener = std::thread::spawn(move || {
            let mut errors = Vec::new();
            for line in lines.into_iter().flat_map(|lines| BufReader::new(lines).lines()).map_while(Result::ok) {
                match line.strip_prefix(&format!("{name}: ")) {
                    Some(step) => {
                        let (phase, part) = phase_of(step);
                        progress.at(phase, part);
                    }
                    None if line.starts_with("error: ") || line.starts_with("hint: ") => errors.push(line),
                    None => {}
                }
            }
            errors
        });
        let status = loop {
            if work.is_cancelled() {
                stop(&mut child);
                let _ = listener.join();
                return Err(CliError::in_file(input, "cancelled"));
            }
            match child.try_wait().map_err(wrong)? {
                Some(status) => break status,
                None => std::thread::sleep(LOOK_EVERY),
            }
        };
        let errors = listener.join().unwrap_or_default();
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

/// Ends a build as Ctrl-C would, so that it cleans up.
fn stop(child: &mut Child) {
    #[cfg(unix)]
    {
        let id = nix::unistd::Pid::from_raw(child.id() as i32);
        // One that has just ended needs no signal.
        let _ = nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT);
    }
    #[cfg(not(unix))]
    let _ = child.kill();
    let _ = child.wait();
}

/// `read 12 %, 3 s left` → what is done, and how much of it.
fn phase_of(step: &str) -> (&str, Option<f32>) {
    let percent = step.split_once(" %").and_then(|(before, _)| before.rsplit_once(' '));
    match percent.and_then(|(phase, number)| Some((phase, number.parse::<f32>().ok()?))) {
        Some((phase, percent)) => (phase, Some(percent / 100.0)),
        None => (step, None),
    }
}

/// Models and scenes of a folder, by name.
fn models_of(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let entries = std::fs::read_dir(folder).map_err(|error| CliError::in_file(folder, error))?;
    let mut found: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(|path| is_model(path)).collect();
    found.sort();
    Ok(found)
}

fn is_model(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
    ENDINGS.contains(&ending) && !name.starts_with('.') && path.is_file()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_a_build_say_how_far_it_is() {
        assert_eq!(phase_of("read 12 %, 3 s left"), ("read", Some(0.12)));
        assert_eq!(phase_of("sort runs 100 %, 0 s left"), ("sort runs", Some(1.0)));
        assert_eq!(phase_of("write"), ("write", None));
    }

    #[test]
    fn a_folder_lists_what_can_be_shown() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.ply.gz", "a.GLOD", "scene.toml", "notes.md", ".hidden.ply", "c.laz"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        std::fs::create_dir(folder.path().join("d.ply")).unwrap();
        let names: Vec<String> = models_of(folder.path())
            .unwrap()
            .iter()
            .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(names, ["a.GLOD", "b.ply.gz", "c.laz", "scene.toml"]);
    }
}
