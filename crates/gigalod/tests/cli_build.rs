//! What `build` and `synth` leave on disk.

mod cli_support;

use cli_support::{can_draw, crc32, names_in, statue};
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::path::Path;

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

#[test]
fn build_replaces_an_existing_file_in_one_step() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.glod");
    std::fs::write(&out, "what was there before").unwrap();
    let mut before = File::open(&out).unwrap();
    let ran = run!["build", statue().ply, "-o", out].done();
    assert_eq!(bytes(&out), bytes(&statue().glod), "the same input gives the same bytes");
    let mut old = String::new();
    before.read_to_string(&mut old).unwrap();
    assert_eq!(old, "what was there before", "a new file took the place, nobody wrote into the old one");
    assert_eq!(names_in(folder.path()), ["a.glod"], "nothing else");
    assert!(ran.stdout.starts_with(out.to_str().unwrap()) && ran.stdout.lines().count() == 1, "{ran:?}");
    assert_eq!(ran.stderr, "");
}

#[test]
fn a_build_that_fails_leaves_the_old_file_and_nothing_new() {
    let folder = tempfile::tempdir().unwrap();
    let (cut, out) = (folder.path().join("cut.ply"), folder.path().join("a.glod"));
    let scan = bytes(&statue().ply);
    // In the header, in the vertices, in the triangles.
    for end in [20, scan.len() / 4, scan.len() - 1] {
        std::fs::write(&cut, &scan[..end]).unwrap();
        std::fs::write(&out, "old").unwrap();
        run!["build", cut, "-o", out, "--json"].failed(&cut);
        assert_eq!(bytes(&out), b"old");
        assert_eq!(names_in(folder.path()), ["a.glod", "cut.ply"]);
    }
}

#[test]
fn no_command_replaces_its_own_input() {
    let folder = tempfile::tempdir().unwrap();
    let (ply, glod) = (folder.path().join("a.ply"), folder.path().join("a.glod"));
    std::fs::copy(&statue().ply, &ply).unwrap();
    std::fs::copy(&statue().glod, &glod).unwrap();
    // The same file by another name.
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    let around = folder.path().join("sub/../a.ply");
    for (ran, output) in [
        (run!["build", ply, "-o", ply, "--json"], &ply),
        (run!["build", ply, "-o", around, "--json"], &around),
        (run!["render", glod, "-o", glod, "--json"], &glod),
        (run!["render", ply, "-o", around, "--json"], &around),
        (run!["render", glod, "-o", folder.path().join("a.png"), "--depth", glod, "--json"], &glod),
        (run!["synth", "replicate", ply, "--triangles", "1k", "-o", ply, "--json"], &ply),
        (run!["synth", "path", "orbit", "--around", glod, "-o", glod, "--json"], &glod),
    ] {
        assert_eq!(ran.failed(output), "input and output are the same file");
    }
    assert_eq!(bytes(&ply), bytes(&statue().ply), "unharmed");
    assert_eq!(bytes(&glod), bytes(&statue().glod), "unharmed");
    assert_eq!(names_in(folder.path()), ["a.glod", "a.ply", "sub"]);
}

#[test]
#[cfg(unix)]
fn a_link_to_the_input_is_the_input() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("link.glod");
    std::os::unix::fs::symlink(&statue().ply, &link).unwrap();
    let ran = run!["build", statue().ply, "-o", link, "--json"];
    assert_eq!(ran.failed(&link), "input and output are the same file");
}

#[test]
fn a_gzipped_scan_builds_into_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (zipped, out) = (folder.path().join("a.ply.gz"), folder.path().join("a.glod"));
    std::fs::write(&zipped, gzip(&bytes(&statue().ply))).unwrap();
    run!["build", zipped, "-o", out].done();
    assert_eq!(bytes(&out), bytes(&statue().glod));
    // By its contents, not by its name; and a broken one is refused.
    let renamed = folder.path().join("a.ply");
    std::fs::rename(&zipped, &renamed).unwrap();
    run!["build", renamed, "-o", out].done();
    let mut broken = gzip(&bytes(&statue().ply));
    let end = broken.len();
    broken[end / 2] ^= 1;
    std::fs::write(&zipped, broken).unwrap();
    run!["build", zipped, "-o", out, "--json"].failed(&zipped);
    assert_eq!(names_in(folder.path()), ["a.glod", "a.ply", "a.ply.gz"]);
}

/// Stored, not compressed.
fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    let blocks = bytes.chunks(0xffff);
    let last = blocks.len() - 1;
    for (at, block) in blocks.enumerate() {
        let length = block.len() as u16;
        out.push(u8::from(at == last));
        out.extend(length.to_le_bytes());
        out.extend((!length).to_le_bytes());
        out.extend(block);
    }
    out.extend(crc32(bytes).to_le_bytes());
    out.extend((bytes.len() as u32).to_le_bytes());
    out
}

#[test]
fn neither_threads_nor_memory_change_what_is_built() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.glod");
    for options in [["--threads", "1"], ["--threads", "3"], ["--memory", "64MiB"], ["--as", "hybrid"]] {
        run!["build", statue().ply, "-o", out, options[0], options[1]].done();
        assert_eq!(bytes(&out), bytes(&statue().glod), "{options:?}");
    }
}

#[test]
fn build_reports_what_it_read_and_wrote() {
    let folder = tempfile::tempdir().unwrap();
    let (ply, out) = (folder.path().join("a.ply"), folder.path().join("a.glod"));
    let made = run!["synth", "statue", "--triangles", "6k", "-o", ply, "--json"].done().json();
    for kind in ["hybrid", "splats"] {
        let ran = run!["build", ply, "-o", out, "--as", kind, "--json"].done();
        let built = ran.json();
        assert_eq!(built["kind"], kind);
        for count in ["triangles", "vertices", "points"] {
            assert_eq!(built["input"][count], made[count], "{count}");
        }
        let number = |value: &Value| value.as_u64().unwrap();
        if kind == "splats" {
            let once = number(&built["leaves"]) - number(&built["repeated"]);
            assert_eq!(once, number(&made["vertices"]), "a leaf for each vertex");
            assert!(ran.stderr.contains("vertices; splats are made for dense scans"), "{ran:?}");
        } else {
            assert_eq!((number(&built["repeated"]), &*ran.stderr), (0, ""), "nothing to warn of");
        }
        assert_eq!(made["bytes"], bytes(&ply).len());
        assert_eq!(built["output_bytes"], bytes(&out).len());
        let phases = built["phases"].as_array().unwrap().iter();
        let phases: f64 = phases.map(|phase| phase["seconds"].as_f64().unwrap()).sum();
        assert!(phases > 0.0 && phases <= built["seconds"].as_f64().unwrap(), "{built}");
        assert!(built["peak_memory_bytes"].as_u64().unwrap() > 0);
    }
}

/// What a file holds is known when all of it is read.
#[test]
fn what_turns_out_to_be_points_or_painted_becomes_splats() {
    let folder = tempfile::tempdir().unwrap();
    let (obj, out, other) = (folder.path().join("a.obj"), folder.path().join("a.glod"), folder.path().join("b.glod"));
    let points: String = (0..6400).map(|at| format!("v {} {} {}\n", at % 80, at / 80, at % 7)).collect();
    let square = |at: usize| format!("f {} {} {} {}\n", at + 1, at + 2, at + 82, at + 81);
    let squares: String = (0..79 * 79).map(|at| square(at / 79 * 80 + at % 79)).collect();
    std::fs::write(folder.path().join("a.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
    for (text, kind, refused) in [
        (points.clone(), "splats", true),
        (format!("{points}{squares}"), "hybrid", false),
        (format!("mtllib a.mtl\n{points}usemtl red\n{squares}"), "splats", false),
    ] {
        std::fs::write(&obj, text).unwrap();
        for options in [&["--json"][..], &["--json", "--memory", "64MiB"]] {
            let ran = cli_support::gigalod(
                ["build", obj.to_str().unwrap(), "-o", out.to_str().unwrap()].iter().chain(options),
            );
            let ran = ran.done();
            assert_eq!(ran.json()["kind"], kind);
            assert!(!ran.stderr.contains("warning: ") && !ran.stderr.contains("note: "), "{ran:?}");
            assert_eq!(ran.json()["options"]["as"], kind);
        }
        run!["build", obj, "-o", other, "--as", kind].done();
        assert!(bytes(&out) == bytes(&other), "{kind}");
        let ran = run!["build", obj, "-o", other, "--as", "hybrid", "--json"];
        if refused {
            assert_eq!(ran.failed(&obj), "no triangles, expected at least one; points become splats");
            assert_eq!(ran.stderr.lines().count(), 1, "nothing to continue: {ran:?}");
        } else {
            ran.done();
        }
        assert_eq!(names_in(folder.path()), ["a.glod", "a.mtl", "a.obj", "b.glod"]);
        // How finely to sample is a question of splats.
        let sampled = run!["build", obj, "-o", other, "--spacing", "1", "--json"].done().json();
        assert_eq!(sampled["kind"], "splats");
    }
}

#[test]
fn synth_makes_the_number_of_triangles_asked_for_and_the_same_bytes_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.ply"), folder.path().join("b.ply"));
    let within_1_percent = |report: &Value, asked: f64| {
        let made = report["triangles"].as_f64().unwrap();
        assert!((made - asked).abs() <= 0.01 * asked, "{made} triangles, {asked} asked for");
    };
    for (text, asked) in [("12345", 12345.0), ("3k", 3000.0), ("0.05M", 50_000.0), ("1_000", 1000.0)] {
        within_1_percent(&run!["synth", "statue", "--triangles", text, "-o", a, "--json"].done().json(), asked);
        run!["synth", "statue", "--triangles", text, "-o", b].done();
        assert!(bytes(&a) == bytes(&b), "{text}: the same bytes");
    }
    for options in [&["--seed", "7"][..], &["--colors"], &["--order", "shuffled"]] {
        let arguments = ["synth", "statue", "--triangles", "1k", "-o", a.to_str().unwrap()];
        cli_support::gigalod(arguments.iter().chain(options)).done();
        assert!(bytes(&a) != bytes(&b), "{options:?}: other bytes");
    }
    for (text, asked) in [("60k", 60_000.0), ("15k", 15_000.0)] {
        let ply = &statue().ply;
        let report = run!["synth", "replicate", ply, "--triangles", text, "-o", a, "--json"].done().json();
        within_1_percent(&report, asked);
        run!["synth", "replicate", ply, "--triangles", text, "-o", b].done();
        assert!(bytes(&a) == bytes(&b), "{text}: the same bytes");
    }
    let out = folder.path().join("c.glod");
    let built = run!["build", a, "-o", out, "--as", "splats", "--json"].done().json();
    within_1_percent(&serde_json::json!({ "triangles": built["input"]["triangles"] }), 15_000.0);
    assert_eq!(run!["verify", out, "--against", a, "--json"].done().json()["ok"], true);
}

#[test]
fn synth_writes_camera_paths_that_render_takes_poses_from() {
    let folder = tempfile::tempdir().unwrap();
    let (path, picture) = (folder.path().join("p.json"), folder.path().join("a.png"));
    for kind in ["orbit", "approach", "walk", "sudden-turn"] {
        run!["synth", "path", kind, "--around", statue().glod, "--seconds", "2", "-o", path].done();
        let first = bytes(&path);
        run!["synth", "path", kind, "--around", statue().glod, "--seconds", "2", "-o", path].done();
        assert_eq!(bytes(&path), first, "{kind}: the same bytes");
        let made: Value = serde_json::from_slice(&first).unwrap();
        let frames = made["frames"].as_array().unwrap();
        assert_eq!(cli_support::shape(&made), "{fov frames[{eye[] t target[]}] up[]}");
        assert_eq!(
            (frames.len(), &frames[60]["t"]),
            (61, &Value::from(2.0)),
            "{kind}: 30 poses a second, and the last"
        );
        if can_draw() {
            let draw = |frame: &str| {
                run![
                    "render",
                    statue().glod,
                    "--path",
                    path,
                    "--frame",
                    frame,
                    "-o",
                    picture,
                    "--size",
                    "64x36",
                    "--json"
                ]
            };
            assert!(draw("60").done().json()["drawn"]["nodes"].as_u64().unwrap() > 0, "{kind}");
            assert!(draw("61").failed(&path).contains("no frame 61, expected 0 to 60"));
        }
    }
}

#[test]
fn paths_that_make_no_sense_are_refused() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let [path, picture] = ["odd.json", "odd.png"].map(|name| folder.path().join(name));
    let pose = r#"{"t":0,"eye":[0,0,3],"target":[0,0,0]}"#;
    for text in [
        String::new(),
        "{}".into(),
        r#"{"up":[0,1,0],"fov":40,"frames":[]}"#.into(),
        format!(r#"{{"up":[0,0,0],"fov":40,"frames":[{pose}]}}"#),
        format!(r#"{{"up":[0,1,0],"fov":180,"frames":[{pose}]}}"#),
        format!(r#"{{"up":[0,1,0],"fov":40,"frames":[{pose}],"speed":3}}"#),
        r#"{"up":[0,1,0],"fov":40,"frames":[{"t":0,"eye":[0,0],"target":[0,0,0]}]}"#.into(),
        r#"{"up":[0,1,0],"fov":40,"frames":[{"t":0,"eye":[0,0,1e999],"target":[0,0,0]}]}"#.into(),
        format!(r#"{{"up":[0,1,0],"fov":40,"frames":[{{"t":1,"eye":[0,0,3],"target":[0,0,0]}},{pose}]}}"#),
    ] {
        std::fs::write(&path, &text).unwrap();
        let ran = run!["render", statue().glod, "--path", path, "--frame", "0", "-o", picture, "--json"];
        assert_eq!(ran.status, 1, "{text}");
        ran.failed(&path);
        assert!(!picture.exists());
    }
}

/// What Ctrl-C does, and `kill`.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_nothing_behind_and_ends_with_status_130() {
    let folder = tempfile::tempdir().unwrap();
    for signal in ["-INT", "-TERM"] {
        let mut run = std::process::Command::new(env!("CARGO_BIN_EXE_gigalod"))
            .args(["synth", "statue", "--triangles", "400M", "-o"])
            .arg(folder.path().join("huge.ply"))
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        // As soon as the unfinished file is there, the handler has long been set.
        while std::fs::read_dir(folder.path()).unwrap().next().is_none() {
            std::thread::yield_now();
        }
        let killed = std::process::Command::new("kill").args([signal, &run.id().to_string()]).status().unwrap();
        assert!(killed.success());
        assert_eq!(run.wait().unwrap().code(), Some(130), "{signal}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{signal}");
    }
}

/// Held up in the middle of reading, by a signal that stops a process, while somebody writes to its input.
#[cfg(unix)]
#[test]
fn an_input_that_changes_while_it_is_read_is_refused_for_that() {
    let folder = tempfile::tempdir().unwrap();
    let (ply, out) = (folder.path().join("a.ply"), folder.path().join("a.glod"));
    // Text is read slowly.
    let scan = cli_support::strips(700);
    type Change = fn(&File, u64);
    let changes: [(&str, Change); 3] = [
        ("longer", |file, bytes| file.set_len(bytes + 1).unwrap()),
        ("shorter", |file, bytes| file.set_len(bytes - 7).unwrap()),
        ("no longer", |file, _| file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap()),
    ];
    let work = folder.path().join(".a.glod.build");
    let signal = |name: &str, run: &std::process::Child| {
        let sent = std::process::Command::new("kill").args([name, &run.id().to_string()]).status().unwrap();
        assert!(sent.success());
    };
    for (what, change) in changes {
        std::fs::write(&ply, &scan).unwrap();
        let run = loop {
            let mut build = cli_support::command();
            build.args(["build", "--json", "-o"]).arg(&out).arg(&ply);
            let mut run =
                build.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped()).spawn().unwrap();
            // It knows what it reads by the time it works.
            while !work.exists() && run.try_wait().unwrap().is_none() {
                std::thread::yield_now();
            }
            signal("-STOP", &run);
            if work.exists() && !work.join("journal").exists() {
                break run;
            }
            // On a busy machine it may have read everything by now: once more.
            run.kill().unwrap();
            run.wait().unwrap();
            let _ = std::fs::remove_file(&out);
        };
        change(&File::options().write(true).open(&ply).unwrap(), scan.len() as u64);
        signal("-CONT", &run);
        let ran = cli_support::Ran::of(run.wait_with_output().unwrap());
        let said = ran.failed(&ply);
        assert!(said.starts_with("changed while it was read (expected "), "{what}: {said}");
        assert_eq!(ran.stderr.lines().count(), 1, "{what}: nothing to continue: {ran:?}");
        assert_eq!(names_in(folder.path()), ["a.ply"], "{what}");
    }
}

#[test]
#[cfg(unix)]
fn a_replaced_file_keeps_its_permissions_and_a_folders_name_is_refused_at_once() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("private.glod");
    std::fs::write(&out, "old").unwrap();
    std::fs::set_permissions(&out, std::fs::Permissions::from_mode(0o600)).unwrap();
    run!["build", statue().ply, "-o", out].done();
    assert_eq!(out.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    let ran = run!["build", statue().ply, "-o", format!("{}/", folder.path().join("new.glod").display())];
    assert_eq!(ran.status, 1);
    assert!(ran.stderr.contains("the name of a folder, expected that of a file"), "{ran:?}");
    assert_eq!(names_in(folder.path()), ["private.glod"]);
}

#[test]
#[cfg(unix)]
fn an_output_that_is_a_link_stays_one_and_its_target_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let other = tempfile::tempdir().unwrap();
    let (link, target) = (folder.path().join("latest.glod"), other.path().join("v7.glod"));
    std::fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    run!["build", statue().ply, "-o", link].done();
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert!(bytes(&target) == bytes(&statue().glod));
    // With little memory the build works in a folder, beside the target.
    std::fs::write(&target, "old").unwrap();
    run!["build", statue().ply, "-o", link, "--memory", "64MiB"].done();
    assert!(link.symlink_metadata().unwrap().is_symlink() && bytes(&target) == bytes(&statue().glod));
    assert_eq!((names_in(folder.path()), names_in(other.path())), (vec!["latest.glod".into()], vec!["v7.glod".into()]));
}
