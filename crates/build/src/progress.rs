//! How a builder says where it is.

use std::sync::Mutex;
use std::time::Instant;

/// Told about phases and steps, from any thread.
pub trait Progress: Sync {
    /// A new phase of `total` steps begins; the one before is done.
    fn begin(&self, phase: &'static str, total: u64);
    /// So many steps of the phase are done, in all.
    fn at(&self, done: u64);
    /// Something that the user may want to know.
    fn note(&self, _text: &str) {}
}

/// Nobody is watching.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn begin(&self, _phase: &'static str, _total: u64) {}
    fn at(&self, _done: u64) {}
}

/// How long one phase took.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseTime {
    /// As in [`Progress::begin`].
    pub name: &'static str,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// What a builder did.
#[derive(Clone, Debug)]
pub struct Report {
    /// Also stored in the file.
    pub metadata: gigalod_format::Metadata,
    /// Length of the file.
    pub output_bytes: u64,
    /// In order; those that this process went through.
    pub phases: Vec<PhaseTime>,
    /// The last phase that an earlier process had finished.
    pub resumed_after: Option<String>,
}

/// Passes progress on and takes the time of each phase.
pub(crate) struct Phases<'a> {
    watcher: &'a dyn Progress,
    begun: Mutex<Vec<(&'static str, Instant)>>,
}

impl<'a> Phases<'a> {
    pub(crate) fn new(watcher: &'a dyn Progress) -> Self {
        Self { watcher, begun: Mutex::default() }
    }

    pub(crate) fn begin(&self, name: &'static str, total: u64) {
        self.begun.lock().expect("no thread panics while it holds the lock").push((name, Instant::now()));
        self.watcher.begin(name, total);
    }

    pub(crate) fn at(&self, done: u64) {
        self.watcher.at(done);
    }

    pub(crate) fn note(&self, text: &str) {
        self.watcher.note(text);
    }

    pub(crate) fn times(self) -> Vec<PhaseTime> {
        let begun = self.begun.into_inner().expect("no thread panics while it holds the lock");
        let ends = begun.iter().skip(1).map(|(_, at)| *at).chain([Instant::now()]);
        begun
            .iter()
            .zip(ends)
            .map(|((name, start), end)| PhaseTime { name, seconds: (end - *start).as_secs_f64() })
            .collect()
    }
}
