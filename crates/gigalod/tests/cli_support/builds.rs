//! Builds that are interrupted, for tests of what becomes of them.

use super::{Ran, command, names_in, strips};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// What a build makes, and the phases that can be gone on after, as journals name them, in order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) kind: &'static str,
    pub(crate) phases: &'static [&'static str],
}

pub(crate) const SPLATS: Way = Way { kind: "splats", phases: &["read", "leaves", "part of tree", "tree"] };
pub(crate) const HYBRID: Way = Way { kind: "hybrid", phases: &["read", "pieces", "part of octree"] };

/// So often a build is begun anew that was over before it could be killed: then the machine is too fast for that.
pub(crate) const TRIES: usize = 100;

/// An output in a folder of its own.
pub(crate) struct Place {
    pub(crate) folder: tempfile::TempDir,
    pub(crate) out: PathBuf,
    pub(crate) work: PathBuf,
    pub(crate) way: Way,
}

impl Place {
    /// For splats.
    pub(crate) fn new() -> Self {
        Self::of(SPLATS)
    }

    pub(crate) fn of(way: Way) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (out, work) = (folder.path().join("a.glod"), folder.path().join(".a.glod.build"));
        Self { folder, out, work, way }
    }

    pub(crate) fn spawn(&self, input: &Path, options: &[&str]) -> Child {
        let mut command = command();
        command.arg("build").arg(input).arg("-o").arg(&self.out).args(["--memory", "64MiB", "--as", self.way.kind]);
        command.args(options);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    pub(crate) fn resume(&self, input: &Path) -> Ran {
        self.build(input, &["--memory", "64MiB", "--resume", "--json"])
    }

    pub(crate) fn build(&self, input: &Path, options: &[&str]) -> Ran {
        let mut command = command();
        command.arg("build").arg(input).arg("-o").arg(&self.out).args(["--as", self.way.kind]).args(options);
        Ran::of(command.output().unwrap())
    }

    /// The phase that the journal says is finished.
    pub(crate) fn journaled(&self) -> Option<String> {
        let text = std::fs::read_to_string(self.work.join("journal")).ok()?;
        let body: Value = serde_json::from_str(text.lines().nth(1)?).ok()?;
        Some(body["phase"].as_str()?.to_string())
    }

    /// The folder has what the next run needs, and nothing else.
    #[track_caller]
    pub(crate) fn expect_tidy(&self) {
        let text = std::fs::read_to_string(self.work.join("journal")).unwrap();
        let journal: Value = serde_json::from_str(text.lines().nth(1).unwrap()).unwrap();
        let spools = journal["spools"].as_object().unwrap().keys().map(|name| format!("{name}.spool"));
        let mut expected: Vec<String> = spools.chain(["journal".into(), "lock".into()]).collect();
        expected.sort();
        assert_eq!(names_in(&self.work), expected);
    }

    /// Waits until so many phases are finished, and some more, and ends the process as nobody can prevent. Returns the phase
    /// that was the last to be finished.
    pub(crate) fn kill_after(&self, child: &mut Child, phases: usize, more: Duration) -> Option<String> {
        let has_come = |phase: &String| {
            let number = self.way.phases.iter().position(|name| name == phase);
            number.expect("journals name the phases that tests know") + 1 >= phases
        };
        let is_early = || phases > 0 && !self.journaled().as_ref().is_some_and(has_come);
        while child.try_wait().unwrap().is_none() && is_early() {
            std::thread::yield_now();
        }
        std::thread::sleep(more);
        child.kill().unwrap();
        child.wait().unwrap();
        self.journaled()
    }

    /// Continues or begins a build that fails for want of room as soon as a file has more than so many bytes.
    pub(crate) fn build_within(&self, file_bytes: u64, input: &Path) -> Ran {
        let script = format!(
            "trap '' XFSZ; ulimit -f {}; exec \"$0\" build --resume --json --as {} -o \"$@\"",
            file_bytes / 512,
            self.way.kind
        );
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(script).arg(env!("CARGO_BIN_EXE_gigalod")).arg(&self.out).arg(input).stdin(Stdio::null());
        let mut ran = Ran::of(shell.output().unwrap());
        // That there was nothing to continue is not what is asked here.
        ran.stderr = ran.stderr.split_inclusive('\n').filter(|line| !line.starts_with("note: ")).collect();
        ran
    }

    #[track_caller]
    pub(crate) fn expect_done(&self, bytes: &[u8]) {
        assert!(std::fs::read(&self.out).unwrap() == bytes, "the bytes of a build that nobody interrupted");
        assert_eq!(names_in(self.folder.path()), ["a.glod"], "nothing else");
    }
}

/// Vertices of [`small`].
pub(crate) const SMALL_VERTICES: u64 = SIDE * SIDE;
const SIDE: u64 = 130;

/// A small model that is built out of core, where it is to be built, and what it builds into.
pub(crate) fn small(way: Way) -> (Place, PathBuf, Vec<u8>) {
    let place = Place::of(way);
    let ply = place.folder.path().join("strips.ply");
    std::fs::write(&ply, strips(SIDE as usize)).unwrap();
    place.build(&ply, &[]).done();
    let bytes = std::fs::read(&place.out).unwrap();
    std::fs::remove_file(&place.out).unwrap();
    (place, ply, bytes)
}

/// The same, with a build of splats that was interrupted after the leaves.
pub(crate) fn interrupted() -> (Place, PathBuf, Vec<u8>) {
    let (place, ply, bytes) = small(SPLATS);
    // Positions and triangles take 24 bytes a vertex, kept nodes more.
    let ran = place.build_within(SMALL_VERTICES * 25, &ply);
    assert!(ran.failed(&place.out).contains("temporary files"), "{ran:?}");
    assert!(ran.stderr.ends_with("\nhint: continue with --resume\n"), "{ran:?}");
    assert_eq!(place.journaled().as_deref(), Some("leaves"));
    assert_eq!(names_in(place.folder.path()), [".a.glod.build", "strips.ply"]);
    (place, ply, bytes)
}
