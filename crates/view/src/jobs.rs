//! Files that are being opened, built or written, each on a thread of its own.

use crate::host::{Host, Opened, Work};
use gigalod_geom::{CameraPath, ImageSize};
use gigalod_runtime::scene::description::SceneDescription;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

/// How a job ended.
pub(crate) enum Finished {
    Opened(JobNumber, Box<Result<Opened, String>>),
    /// By a person, with the file's name.
    Cancelled(JobNumber, String),
    /// What the file was to be called, and what it is called.
    Wrote(PathBuf, Result<PathBuf, String>),
}

/// Names a job; in the order in which they were begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct JobNumber(u64);

/// A file that is being opened.
pub(crate) struct Job {
    pub(crate) number: JobNumber,
    pub(crate) name: String,
    pub(crate) work: Work,
}

pub(crate) struct Jobs {
    host: Arc<dyn Host>,
    wake: Arc<dyn Fn() + Send + Sync>,
    running: Vec<Job>,
    begun: u64,
    /// Files that are being written.
    writing: usize,
    tell: Sender<(JobNumber, Finished)>,
    done: Receiver<(JobNumber, Finished)>,
}

impl Jobs {
    pub(crate) fn new(host: Arc<dyn Host>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (tell, done) = channel();
        Self { host, wake: Arc::new(wake), running: Vec::new(), begun: 0, writing: 0, tell, done }
    }

    /// Files that are being opened.
    pub(crate) fn running(&self) -> &[Job] {
        &self.running
    }

    /// True while a file is being written.
    pub(crate) fn is_writing(&self) -> bool {
        self.writing > 0
    }

    pub(crate) fn open(&mut self, file: &Path) {
        let wake = self.wake.clone();
        let work = Work::watched(move || wake());
        let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned();
        let (host, path, progress) = (self.host.clone(), file.to_owned(), work.clone());
        let called = name.clone();
        let number = self.start(move |number| match host.open(&path, &progress) {
            Err(_) if progress.is_cancelled() => Finished::Cancelled(number, called),
            opened => Finished::Opened(number, Box::new(opened)),
        });
        self.running.push(Job { number, name, work });
    }

    pub(crate) fn write_picture(&mut self, name: PathBuf, size: ImageSize, rgba: Vec<u8>) {
        let host = self.host.clone();
        self.write(name, move |name| host.write_picture(name, size, &rgba));
    }

    pub(crate) fn write_path(&mut self, name: PathBuf, path: CameraPath) {
        let host = self.host.clone();
        self.write(name, move |name| host.write_path(name, &path));
    }

    pub(crate) fn write_scene(&mut self, name: PathBuf, scene: SceneDescription) {
        let host = self.host.clone();
        self.write(name, move |name| host.write_scene(name, &scene));
    }

    fn write(&mut self, name: PathBuf, write: impl FnOnce(&Path) -> Result<PathBuf, String> + Send + 'static) {
        self.writing += 1;
        self.start(move |_| {
            let wrote = write(&name);
            Finished::Wrote(name, wrote)
        });
    }

    fn start(&mut self, job: impl FnOnce(JobNumber) -> Finished + Send + 'static) -> JobNumber {
        self.begun += 1;
        let (number, tell, wake) = (JobNumber(self.begun), self.tell.clone(), self.wake.clone());
        // Without threads nothing works; the system says so where the stage is started.
        let _ = std::thread::Builder::new().name(format!("job {}", self.begun)).spawn(move || {
            // Who no longer listens needs no answer.
            let _ = tell.send((number, job(number)));
            wake();
        });
        number
    }

    /// What has ended since the last call.
    pub(crate) fn finished(&mut self) -> Vec<Finished> {
        let done: Vec<(JobNumber, Finished)> = self.done.try_iter().collect();
        for (number, finished) in &done {
            self.running.retain(|job| job.number != *number);
            self.writing -= usize::from(matches!(finished, Finished::Wrote(..)));
        }
        done.into_iter().map(|(_, finished)| finished).collect()
    }
}
