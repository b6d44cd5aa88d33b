//! What the process has used: processor time and memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Watches from when it is made.
pub(crate) struct Usage {
    begun: Instant,
    cpu_begun: f64,
    peak: Arc<AtomicU64>,
    done: Arc<AtomicBool>,
    watcher: Option<JoinHandle<()>>,
}

/// How often memory is looked at.
const EVERY: Duration = Duration::from_millis(10);

impl Usage {
    pub(crate) fn watch() -> Self {
        let (peak, done) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (seen, stop) = (peak.clone(), done.clone());
        let watcher = std::thread::Builder::new().name("memory watcher".into()).spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                seen.fetch_max(anonymous_bytes().unwrap_or(0), Ordering::Relaxed);
                std::thread::park_timeout(EVERY);
            }
        });
        // Without a watcher the peak is what the system counts.
        Self { begun: Instant::now(), cpu_begun: cpu_seconds(), peak, done, watcher: watcher.ok() }
    }

    /// Seconds since the watch began: on the clock, and of all processors.
    pub(crate) fn seconds(&self) -> (f64, f64) {
        (self.begun.elapsed().as_secs_f64(), cpu_seconds() - self.cpu_begun)
    }

    /// Most anonymous memory that was resident at once, looked at every 10 ms; where the system does not tell, the most of
    /// any kind.
    pub(crate) fn peak_memory_bytes(&self) -> u64 {
        match self.peak.load(Ordering::Relaxed).max(anonymous_bytes().unwrap_or(0)) {
            0 => most_resident_bytes(),
            peak => peak,
        }
    }
}

impl Drop for Usage {
    fn drop(&mut self) {
        self.done.store(true, Ordering::Relaxed);
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            let _ = watcher.join();
        }
    }
}

/// `RssAnon` of Linux.
fn anonymous_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(unix)]
fn cpu_seconds() -> f64 {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    getrusage(UsageWho::RUSAGE_SELF)
        .map_or(0.0, |usage| (usage.user_time() + usage.system_time()).num_microseconds() as f64 * 1e-6)
}

#[cfg(unix)]
fn most_resident_bytes() -> u64 {
    use nix::sys::resource::{UsageWho, getrusage};
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    getrusage(UsageWho::RUSAGE_SELF).map_or(0, |usage| usage.max_rss() as u64 * unit)
}

#[cfg(not(unix))]
fn cpu_seconds() -> f64 {
    0.0
}

#[cfg(not(unix))]
fn most_resident_bytes() -> u64 {
    0
}
