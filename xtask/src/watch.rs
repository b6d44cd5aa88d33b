//! A process seen from outside: how much memory and disk it takes at once.
//!
//! Linux tells both in `/proc`; elsewhere they are zero. Files without a name are counted as well, as long as they are open.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The most there was at any time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Peaks {
    /// Anonymous resident bytes.
    pub(crate) memory: u64,
    /// Bytes that files of the work folder take, and open ones without a name.
    pub(crate) disk: u64,
}

/// Runs a command that succeeds, with a look at it every 10 ms; what it reports.
pub(crate) fn run(mut command: Command, work: &Path) -> Result<(Value, Peaks)> {
    let mut child = command.stdout(Stdio::piped()).spawn()?;
    let mut peaks = Peaks::default();
    while child.try_wait()?.is_none() {
        peaks.memory = peaks.memory.max(anonymous_bytes(child.id()));
        peaks.disk = peaks.disk.max(disk_bytes(child.id(), work));
        std::thread::sleep(Duration::from_millis(10));
    }
    let out = child.wait_with_output()?;
    let text = String::from_utf8_lossy(&out.stdout);
    if !out.status.success() {
        bail!("{command:?}: {text}");
    }
    Ok((serde_json::from_str(&text).with_context(|| format!("{command:?}"))?, peaks))
}

fn anonymous_bytes(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|kib| kib.parse::<u64>().ok()).unwrap_or(0) * 1024
}

#[cfg(unix)]
fn disk_bytes(process: u32, work: &Path) -> u64 {
    use std::os::unix::fs::MetadataExt;
    let mut files = BTreeMap::new();
    let open = std::fs::read_dir(format!("/proc/{process}/fd")).into_iter().flatten().flatten();
    let nameless = open.filter(|entry| {
        std::fs::read_link(entry.path())
            .is_ok_and(|to| to.starts_with(work) && to.to_string_lossy().ends_with(" (deleted)"))
    });
    let named = std::fs::read_dir(work).into_iter().flatten().flatten();
    for entry in nameless.chain(named) {
        // Follows the link, although nothing has that name.
        if let Ok(file) = std::fs::metadata(entry.path()) {
            files.insert((file.dev(), file.ino()), file.blocks() * 512);
        }
    }
    files.values().sum()
}

#[cfg(not(unix))]
fn disk_bytes(_process: u32, _work: &Path) -> u64 {
    0
}

/// Free bytes of the disk that `folder` lies on.
pub(crate) fn free_bytes(folder: &Path) -> Result<u64> {
    let out = Command::new("df").arg("-Pk").arg(folder).output().context("could not start df")?;
    let text = String::from_utf8_lossy(&out.stdout);
    let free = text.lines().nth(1).and_then(|line| line.split_whitespace().nth(3)?.parse::<u64>().ok());
    Ok(free.with_context(|| format!("df says {text}"))? * 1024)
}
