//! What a build does when there is no more room: one error, and nothing that is of no use.
#![cfg(unix)]

mod cli_support;

use cli_support::builds::{HYBRID, Place, SMALL_VERTICES, SPLATS, TRIES, Way, small};
use cli_support::{Ran, names_in, statue, without_progress};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// It failed as it should: the folder stays if a phase is finished, and then it says so.
#[track_caller]
fn expect_failure(place: &Place, ran: &Ran, journaled: Option<&str>) {
    let what = ran.failed(&place.out);
    assert!(what.starts_with("could not "), "{what}");
    assert_eq!(place.journaled().as_deref(), journaled, "{ran:?}");
    let hint = "\nhint: continue with --resume\n";
    assert_eq!(ran.stderr.ends_with(hint), journaled.is_some(), "{ran:?}");
    let kept: &[&str] = if journaled.is_some() { &[".a.glod.build", "strips.ply"] } else { &["strips.ply"] };
    assert_eq!(names_in(place.folder.path()), kept);
    if journaled.is_some() {
        place.expect_tidy();
    }
}

#[test]
fn files_that_cannot_grow_stop_a_build_in_each_phase_and_it_goes_on_when_they_can() {
    let (place, ply, bytes) = small(SPLATS);
    // Largest files: 12 bytes a vertex of positions, 24 of triangles; 24 of leaves; 27 of kept nodes; 5 of quantised ones; 3 of
    // pages.
    for (bytes_per_vertex, journaled) in [
        (0.5, None),
        (10.0, None),
        (23.0, None),
        (25.0, Some("leaves")),
        (2.0, Some("leaves")),
        (26.0, Some("leaves")),
        (30.0, None),
    ] {
        let ran = place.build_within((SMALL_VERTICES as f64 * bytes_per_vertex) as u64, &ply);
        if bytes_per_vertex < 30.0 {
            expect_failure(&place, &ran, journaled);
        } else {
            ran.done();
        }
    }
    assert!(std::fs::read(&place.out).unwrap() == bytes);
    std::fs::remove_file(&place.out).unwrap();

    // From each phase on.
    for (name, bytes_per_vertex) in [("read", 3.0), ("tree", 3.0)] {
        if !leave_after(&place, &ply, name) {
            println!("skipped: too fast to be killed after {name}");
            continue;
        }
        expect_failure(
            &place,
            &place.build_within((SMALL_VERTICES as f64 * bytes_per_vertex) as u64, &ply),
            Some(name),
        );
        let ran = place.resume(&ply).done();
        assert_eq!((&ran.json()["resumed_after"], &*ran.stderr), (&name.into(), ""));
        assert!(std::fs::read(&place.out).unwrap() == bytes);
        std::fs::remove_file(&place.out).unwrap();
    }
}

#[test]
fn so_does_a_hybrid_build() {
    let (place, ply, bytes) = small(HYBRID);
    // Largest files: 24 bytes a vertex of triangles; 120 of pieces, two a vertex; then pages.
    for (bytes_per_vertex, journaled) in
        [(0.5, None), (23.0, None), (60.0, Some("read")), (10.0, Some("read")), (110.0, Some("read"))]
    {
        let ran = place.build_within((SMALL_VERTICES as f64 * bytes_per_vertex) as u64, &ply);
        expect_failure(&place, &ran, journaled);
    }
    let ran = place.resume(&ply).done();
    assert_eq!((&ran.json()["resumed_after"], &*ran.stderr), (&"read".into(), ""));
    assert!(std::fs::read(&place.out).unwrap() == bytes);
    std::fs::remove_file(&place.out).unwrap();

    if !leave_after(&place, &ply, "pieces") {
        return println!("skipped: too fast to be killed after pieces");
    }
    let ran = place.build_within(SMALL_VERTICES, &ply);
    expect_failure(&place, &ran, Some("pieces"));
    assert_eq!(place.resume(&ply).done().json()["resumed_after"], "pieces");
    assert!(std::fs::read(&place.out).unwrap() == bytes);
}

/// Leaves a build whose last finished phase is this one. False where the machine is too fast for that.
fn leave_after(place: &Place, ply: &Path, name: &str) -> bool {
    let phases = place.way.phases.iter().position(|phase| *phase == name).expect("a phase") + 1;
    for _ in 0..TRIES {
        let mut child = place.spawn(ply, &["--resume", "--threads", "1"]);
        if place.kill_after(&mut child, phases, Duration::ZERO).as_deref() == Some(name) {
            return true;
        }
        // Too late: once more.
        let _ = std::fs::remove_dir_all(&place.work);
        let _ = std::fs::remove_file(&place.out);
    }
    false
}

#[test]
fn a_build_in_memory_that_cannot_write_leaves_nothing() {
    let place = Place::new();
    for bytes in [0, 4096, 30_000] {
        let ran = place.build_within(bytes, &statue().ply);
        assert!(ran.failed(&place.out).starts_with("could not write"), "{ran:?}");
        assert_eq!(ran.stderr.lines().count(), 1, "{ran:?}");
        assert!(names_in(place.folder.path()).is_empty());
    }
}

/// On a small disk of its own, which only this process and its children see.
const ON_A_DISK: &str = r#"
    program=$0 disk=$1 ply=$2 kind=$3 kib=$4 said=$5
    mount -t tmpfs -o size=${kib}k tmpfs "$disk" || exit 77
    build() { "$program" build "$ply" -o "$disk/a.glod" --as $kind --memory 64MiB --resume "$@"; }
    build > "$said.out" 2> "$said.err"
    echo $? > "$said.status"
    ls -A "$disk" > "$said.names"
    ls -A "$disk/.a.glod.build" > "$said.work" 2> "$said.nothing"
    mount -o remount,size=64m "$disk" && build > "$said.again" 2>&1 && cp "$disk/a.glod" "$said.glod"
"#;

#[test]
fn a_disk_that_is_full_is_an_error_and_with_more_room_the_build_goes_on() {
    expect_to_go_on_with_more_room(SPLATS, 8);
}

#[test]
fn so_it_is_for_a_hybrid_build() {
    expect_to_go_on_with_more_room(HYBRID, 40);
}

/// Tries larger and larger disks, each of so many bytes a vertex more.
fn expect_to_go_on_with_more_room(way: Way, growing_by: u64) {
    let (place, ply, bytes) = small(way);
    let disk = place.folder.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    let (mut failures, mut kept) = (0, 0);
    for step in 0..16 {
        let said = place.folder.path().join(format!("said{step}"));
        // From less than the positions take to more than all takes at once.
        let kib = SMALL_VERTICES * (8 + growing_by * step) / 1024;
        let mut shell = Command::new("unshare");
        shell.args(["-rm", "sh", "-c", ON_A_DISK, env!("CARGO_BIN_EXE_gigalod")]).args([&disk, &ply]);
        let ran = match shell.arg(way.kind).arg(kib.to_string()).arg(&said).output() {
            Ok(ran) => ran,
            Err(error) => return println!("skipped: no unshare: {error}"),
        };
        let text = |suffix: &str| without_progress(&std::fs::read_to_string(said.with_extension(suffix)).unwrap());
        if !said.with_extension("status").exists() {
            return println!("skipped: no disk of its own: {}", String::from_utf8_lossy(&ran.stderr));
        }
        if text("status") == "0\n" {
            assert!(failures > 4 && kept > 0 && step > 0, "{failures} sizes were too small, {kept} builds went on");
            return;
        }
        failures += 1;
        assert_eq!(text("status"), "1\n");
        let errors = text("err").lines().filter(|line| line.starts_with("error: ")).count();
        let others =
            text("err").lines().filter(|line| line.starts_with("hint: ") || line.starts_with("note: ")).count();
        assert_eq!((errors, others), (1, text("err").lines().count() - 1), "{}", text("err"));
        assert!(text("err").contains("No space left on device"), "{}", text("err"));
        let can_go_on = text("work").lines().any(|name| name == "journal");
        assert_eq!(text("names"), if can_go_on { ".a.glod.build\n" } else { "" });
        assert!(!text("work").contains("part"), "{}", text("work"));
        assert_eq!(text("err").ends_with("hint: continue with --resume\n"), can_go_on);
        assert_eq!(text("again").contains("starting from the beginning"), !can_go_on);
        assert!(std::fs::read(said.with_extension("glod")).unwrap() == bytes, "{}", text("again"));
        kept += usize::from(can_go_on);
    }
    panic!("the largest disk was too small");
}
