//! Builds that are interrupted, and go on.
#![cfg(unix)]

mod cli_support;

use cli_support::builds::{HYBRID, Place, SPLATS, TRIES, Way, interrupted};
use cli_support::{Ran, command, folder, names_in};
use serde_json::Value;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant, SystemTime};

/// A statue that does not fit into the smallest memory, and what it builds into.
struct Big {
    ply: PathBuf,
    glod: Vec<u8>,
    /// How long it took to build, for moments spread over it.
    took: Duration,
}

fn big(way: Way) -> &'static Big {
    static OF_SPLATS: OnceLock<Big> = OnceLock::new();
    static HYBRID_ONE: OnceLock<Big> = OnceLock::new();
    if way.kind == SPLATS.kind {
        return OF_SPLATS.get_or_init(|| {
            let ply = folder().join("big.ply");
            run!["synth", "statue", "--triangles", "900k", "--colors", "-o", ply].done();
            Big::built(way, ply)
        });
    }
    // What takes longer to build is out of core although it is small, and as a whole too large for the smallest memory.
    HYBRID_ONE.get_or_init(|| {
        let ply = folder().join("strips.ply");
        std::fs::write(&ply, cli_support::strips(270)).unwrap();
        Big::built(way, ply)
    })
}

impl Big {
    fn built(way: Way, ply: PathBuf) -> Self {
        let place = Place::of(way);
        let begun = Instant::now();
        place.build(&ply, &["--memory", "64MiB"]).done();
        let took = begun.elapsed();
        let glod = std::fs::read(&place.out).unwrap();
        place.build(&ply, &[]).done();
        assert!(std::fs::read(&place.out).unwrap() == glod, "in memory as out of it");
        Self { ply, glod, took }
    }
}

#[test]
fn a_build_killed_again_and_again_ends_with_the_same_bytes() {
    expect_the_same_bytes_after_kills(SPLATS);
}

#[test]
fn a_hybrid_build_killed_again_and_again_ends_with_the_same_bytes() {
    expect_the_same_bytes_after_kills(HYBRID);
}

fn expect_the_same_bytes_after_kills(way: Way) {
    let (big, place) = (big(way), Place::of(way));
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut kills = 0;
    while kills < 10 {
        let mut child = place.spawn(&big.ply, &["--resume"]);
        // From the first phase to the last, at any moment of it.
        let phases = kills * (way.phases.len() + 1) / 10;
        let last = place.kill_after(&mut child, phases, big.took.mul_f64(random() / way.phases.len() as f64));
        if child.wait().unwrap().success() {
            // It was done before its time: once more from the beginning.
            place.expect_done(&big.glod);
            std::fs::remove_file(&place.out).unwrap();
        } else {
            kills += 1;
            println!("killed after {last:?}");
            let names = names_in(place.folder.path());
            // Of a build that had its name a moment ago, but had not put its work away yet.
            if place.out.exists() {
                assert!(std::fs::read(&place.out).unwrap() == big.glod);
                std::fs::remove_file(&place.out).unwrap();
            } else {
                assert!(names.iter().all(|name| name == ".a.glod.build"), "{names:?}");
            }
        }
    }
    let ran = place.resume(&big.ply).done();
    place.expect_done(&big.glod);
    assert!(ran.stderr.lines().all(|line| line.starts_with("note: ")), "{ran:?}");
}

#[test]
fn finished_phases_are_not_done_again_whatever_memory_and_threads_there_are_now() {
    expect_finished_phases_to_stay(SPLATS);
}

#[test]
fn finished_phases_of_a_hybrid_build_are_not_done_again() {
    expect_finished_phases_to_stay(HYBRID);
}

fn expect_finished_phases_to_stay(way: Way) {
    let big = big(way);
    let others = [["--memory", "64MiB"], ["--memory", "4GiB"], ["--memory", "256MiB"], ["--threads", "1"]];
    for (phases, options) in (1..=way.phases.len()).zip(others) {
        let place = Place::of(way);
        // Where the machine is so busy that the build was over before it could be killed: once more.
        let phase = std::iter::repeat_with(|| {
            let mut child = place.spawn(&big.ply, &["--threads", "2"]);
            place.kill_after(&mut child, phases, Duration::ZERO)
        });
        let phase = phase.take(TRIES).flatten().next().expect("large enough to be killed in time");
        println!("goes on after {phase}");
        let ran = place.build(&big.ply, &["--resume", "--json", options[0], options[1]]).done();
        assert_eq!(ran.stderr, "", "nothing to note");
        assert_eq!(ran.json()["resumed_after"], *phase);
        let names: Vec<_> =
            ran.json()["phases"].as_array().unwrap().iter().map(|phase| phase["name"].clone()).collect();
        assert!(!names.contains(&Value::from("read")) && !names.contains(&Value::from(phase)), "{names:?}");
        assert_eq!(names.last().unwrap(), "write");
        place.expect_done(&big.glod);
    }
}

#[test]
fn another_input_and_other_options_are_refused_and_nothing_is_lost() {
    let (place, ply, bytes) = interrupted();
    let refused = |ran: Ran, what: &str| {
        let said = ran.failed(&place.out);
        assert!(said.starts_with(&format!("the build in {} was {what}: expected ", place.work.display())), "{said}");
        assert!(said.ends_with("; remove the folder or run without --resume"), "{said}");
        assert_eq!(ran.stderr.lines().count(), 1, "no hint: {ran:?}");
        assert_eq!(place.journaled().as_deref(), Some("leaves"));
        said
    };
    let said = refused(place.build(&ply, &["--resume", "--json", "--up", "z"]), "with other options");
    assert!(said.contains("expected --as splats --up y, found --as splats --up z;"), "{said}");

    let resume = ["build", ply.to_str().unwrap(), "-o", place.out.to_str().unwrap(), "--resume", "--json"];
    let hybrid = cli_support::gigalod(resume.iter().chain(&["--as", "hybrid"]));
    assert!(refused(hybrid, "with other options").contains("found --appearance on --as hybrid --res 64"));

    let other = place.folder.path().join("other.ply");
    std::fs::copy(&ply, &other).unwrap();
    let said = refused(place.resume(&other), "of another input");
    assert!(said.contains("strips.ply, found ") && said.contains("other.ply;"), "{said}");
    std::fs::remove_file(other).unwrap();

    // Another time, another length, other bytes; then all as it was.
    let file = File::options().read(true).write(true).open(&ply).unwrap();
    let (written, length) = (file.metadata().unwrap().modified().unwrap(), file.metadata().unwrap().len());
    file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1)).unwrap();
    let said = refused(place.resume(&ply), "of another input");
    assert!(said.contains(", found modified 1970-01-01T00:00:01.000000000Z;"), "{said}");
    file.set_len(length + 1).unwrap();
    file.set_modified(written).unwrap();
    let said = refused(place.resume(&ply), "of another input");
    assert!(said.contains(&format!("expected {length} bytes, found {} bytes;", length + 1)), "{said}");
    file.set_len(length).unwrap();
    let mut last = [0];
    file.read_exact_at(&mut last, length - 2).unwrap();
    file.write_all_at(b" ", length - 2).unwrap();
    file.set_modified(written).unwrap();
    let said = refused(place.resume(&ply), "of another input");
    assert!(said.contains("of its ends, found checksums"), "{said}");
    file.write_all_at(&last, length - 2).unwrap();
    file.set_modified(written).unwrap();

    assert_eq!(place.resume(&ply).done().json()["resumed_after"], "leaves");
    std::fs::remove_file(ply).unwrap();
    place.expect_done(&bytes);
}

#[test]
fn a_damaged_journal_begins_anew_and_says_so() {
    let (place, ply, bytes) = interrupted();
    let journal = place.work.join("journal");
    let mut damaged = std::fs::read(&journal).unwrap();
    let spools = |name: &str| place.work.join(name).with_extension("spool");
    let starts_anew = |why: &str, is_there: bool| {
        let ran = place.resume(&ply).done();
        assert_eq!(ran.stderr, format!("note: {}: {why}, starting from the beginning\n", place.work.display()));
        assert!(ran.json()["resumed_after"].is_null());
        assert!(std::fs::read(&place.out).unwrap() == bytes && !place.work.exists());
        std::fs::remove_file(&place.out).unwrap();
        assert!(is_there || !journal.exists());
    };
    assert!(spools("leaves").is_file() && !spools("positions").exists(), "what nobody needs is gone");
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(&journal, &damaged).unwrap();
    starts_anew("its journal is damaged", true);
    // As a crash in the first phase leaves it; a crash just before the end; and none.
    std::fs::create_dir(&place.work).unwrap();
    std::fs::write(spools("positions"), "half").unwrap();
    starts_anew("no phase was finished", false);
    starts_anew("nothing to continue", false);

    let (place, ply, bytes) = interrupted();
    File::options().write(true).open(place.work.join("leaves.spool")).unwrap().set_len(100).unwrap();
    let ran = place.resume(&ply).done();
    assert!(ran.stderr.contains(": files are missing, starting from the beginning\n"), "{ran:?}");
    assert!(std::fs::read(&place.out).unwrap() == bytes);

    // One bit of the data themselves.
    let (place, ply, bytes) = interrupted();
    let spool = place.work.join("leaves.spool");
    let mut leaves = std::fs::read(&spool).unwrap();
    let middle = leaves.len() / 2;
    leaves[middle] ^= 1;
    std::fs::write(&spool, leaves).unwrap();
    let ran = place.resume(&ply).done();
    assert!(ran.stderr.contains(": its files are damaged, starting from the beginning\n"), "{ran:?}");
    assert!(std::fs::read(&place.out).unwrap() == bytes);
}

/// Where nobody declares faces, it is known from what was begun whether they are points.
#[test]
fn what_was_begun_as_splats_is_continued_where_nobody_says_as_what() {
    let (place, ply, bytes) = interrupted();
    let ran = run!["build", ply, "-o", place.out, "--memory", "64MiB", "--resume", "--json"].done();
    assert_eq!((&ran.json()["resumed_after"], &ran.json()["kind"]), (&"leaves".into(), &"splats".into()));
    assert_eq!(ran.stderr, "");
    assert!(std::fs::read(&place.out).unwrap() == bytes);
}

#[test]
fn without_resume_an_old_folder_is_removed() {
    // Out of memory, and in it.
    for memory in ["64MiB", "2GiB"] {
        let (place, ply, bytes) = interrupted();
        let small = if memory == "2GiB" { cli_support::statue().ply.clone() } else { ply };
        let ran = place.build(&small, &["--memory", memory, "--json"]).done();
        assert!(ran.json()["resumed_after"].is_null() && ran.stderr.is_empty(), "{ran:?}");
        assert_eq!(names_in(place.folder.path()), ["a.glod", "strips.ply"]);
        assert!(memory == "2GiB" || std::fs::read(&place.out).unwrap() == bytes);
    }
}

#[test]
fn only_one_process_builds_an_output_at_a_time() {
    let (place, ply, bytes) = interrupted();
    let lock = File::options().write(true).open(place.work.join("lock")).unwrap();
    lock.lock().unwrap();
    for options in [&["--json", "--resume"][..], &["--json"]] {
        let ran = place.build(&ply, options);
        let expected = format!("another build is working in {}", place.work.display());
        assert_eq!((ran.failed(&place.out), ran.stderr.lines().count()), (expected, 1));
        assert_eq!(place.journaled().as_deref(), Some("leaves"), "unharmed");
    }
    drop(lock);
    place.resume(&ply).done();
    assert!(std::fs::read(&place.out).unwrap() == bytes);
}

/// What Ctrl-C does, and `kill`.
#[test]
fn an_interrupted_build_says_that_it_can_go_on_if_it_can() {
    let big = big(SPLATS);
    for phases in [0, 1, 2] {
        let place = Place::new();
        let mut build = command();
        build.arg("build").arg(&big.ply).arg("-o").arg(&place.out).args(["--memory", "64MiB", "--as", "splats"]);
        let child = build.stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        while !place.work.join("pages.part").exists() || phases > 0 && place.journaled().is_none() {
            std::thread::yield_now();
        }
        let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(killed.success());
        let ran = Ran::of(child.wait_with_output().unwrap());
        let stays = place.journaled().is_some();
        let hint = if stays { "hint: continue with --resume\n" } else { "" };
        assert_eq!((ran.status, ran.stderr), (130, format!("interrupted\n{hint}")));
        assert!(stays || phases == 0);
        assert_eq!(names_in(place.folder.path()), if stays { &[".a.glod.build"][..] } else { &[] });
        if stays {
            place.expect_tidy();
            assert!(place.resume(&big.ply).done().json()["resumed_after"].is_string());
            place.expect_done(&big.glod);
        }
    }
}
