//! The command line with models whose large triangles are diced, and with textures.
#![cfg(unix)]

mod cli_support;

use cli_support::builds::Place;
use cli_support::{Ran, can_draw, command, names_in};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A textured OBJ with its library and picture: a slope of so many walls along a side. OBJ declares nothing: it is built out of core.
fn walls(folder: &Path, side: usize) -> PathBuf {
    let mut picture = image::RgbImage::new(128, 128);
    picture.enumerate_pixels_mut().for_each(|(x, y, pixel)| pixel.0 = [2 * x as u8, 2 * y as u8, 90]);
    picture.save(folder.join("bricks.png")).unwrap();
    std::fs::write(folder.join("walls.mtl"), "newmtl bricks\nKd 1 0.9 1\nmap_Kd -s 2 2 bricks.png\n").unwrap();
    let mut text = "mtllib walls.mtl\nusemtl bricks\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n".to_string();
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        for (x, y) in [(0.0, 0.0), (0.9, 0.0), (0.9, 0.8), (0.0, 0.8)] {
            writeln!(text, "v {} {} {}", column as f64 + x, row as f64 + y, (row + column) % 3).unwrap();
        }
        text.push_str("f -4/1 -3/2 -2/3 -1/4\n");
    }
    let obj = folder.join("walls.obj");
    std::fs::write(&obj, text).unwrap();
    obj
}

#[test]
fn build_info_and_verify_say_what_was_diced() {
    let place = tempfile::tempdir().unwrap();
    let (obj, out) = (walls(place.path(), 10), place.path().join("a.glod"));
    let built = run!["build", obj, "-o", out, "--spacing", "0.05", "--json"].done();
    assert_eq!(built.stderr, "");
    let built = built.json();
    assert_eq!((built["options"]["spacing"].as_str(), built["input"]["triangles"].as_u64()), (Some("0.05"), Some(200)));
    let names: Vec<_> = built["phases"].as_array().unwrap().iter().map(|phase| phase["name"].clone()).collect();
    assert!(["textures", "grids", "dice"].iter().all(|name| names.contains(&(*name).into())), "{names:?}");
    let info = run!["info", out, "--json"].done().json();
    let dicing = &info["dicing"];
    assert_eq!((dicing["spacing"].as_f64(), dicing["triangles"].as_u64()), (Some(0.05), Some(200)));
    let number = |value: &serde_json::Value| value.as_u64().unwrap();
    assert_eq!(number(&dicing["samples"]), number(&info["leaves"]) - number(&info["repeated"]), "{info}");
    assert!(number(&dicing["samples"]) > 30_000, "{info}");
    let text = run!["info", out].done().stdout;
    assert!(text.contains("\ndiced       200 triangles into "), "{text}");
    let verified = run!["verify", out, "--against", obj, "--json"].done().json();
    assert!(verified["ok"] == true && verified["measured"]["violations"] == 0, "{verified}");

    // Against another model, or one of which something is missing, it is not sound.
    let text = std::fs::read_to_string(&obj).unwrap();
    let other = place.path().join("other.obj");
    for wrong in [
        text.replace("v 0.9 0.8 0\n", "v 0.9 0.8 0.2\n"),
        text.replace("f -4/1 -3/2 -2/3 -1/4\n", "f -4/1 -3/2 -2/3\n"),
    ] {
        std::fs::write(&other, wrong).unwrap();
        let ran = run!["verify", out, "--against", other, "--json"];
        assert!(ran.status == 1 && ran.json()["measured"]["violations"].as_u64().unwrap() > 0, "{ran:?}");
    }

    // Left to the model: of 3 million texels that it shows, as many as are wanted at most.
    run!["build", obj, "-o", out].done();
    let info = run!["info", out, "--json"].done().json();
    let samples = info["dicing"]["samples"].as_u64().unwrap();
    assert!((1_900_000..2_300_000).contains(&samples) && info["options"]["spacing"].is_string(), "{info}");
    for wrong in ["0", "-1", "nan", "much"] {
        assert_eq!(run!["build", obj, "-o", out, "--spacing", wrong].status, 2, "{wrong}");
    }
}

#[test]
fn a_missing_picture_is_noted_and_the_model_is_built() {
    let place = tempfile::tempdir().unwrap();
    let (obj, out) = (walls(place.path(), 3), place.path().join("a.glod"));
    std::fs::remove_file(place.path().join("bricks.png")).unwrap();
    let ran: Ran = run!["build", obj, "-o", out, "--spacing", "0.1"].done();
    let notes: Vec<&str> = ran.stderr.lines().filter(|line| line.starts_with("note: ")).collect();
    assert!(notes.len() == 1 && notes[0].starts_with("note: picture bricks.png: "), "{ran:?}");
    run!["verify", out, "--against", obj].done();
}

#[test]
fn a_missing_library_is_warned_of_and_the_model_is_built() {
    let place = tempfile::tempdir().unwrap();
    let (obj, out) = (walls(place.path(), 3), place.path().join("a.glod"));
    let library = place.path().join("walls.mtl");
    std::fs::remove_file(&library).unwrap();
    let ran = run!["build", obj, "-o", out, "--spacing", "0.1"].done();
    let warning = format!("warning: {}: could not be read: ", library.display());
    assert_eq!(ran.stderr.lines().filter(|line| line.starts_with(&warning)).count(), 1, "{ran:?}");
    // Of several in one line, one may be missing; a name may have blanks.
    let text = std::fs::read_to_string(&obj).unwrap();
    std::fs::write(place.path().join("all walls.mtl"), "newmtl bricks\nKd 1 0 0\n").unwrap();
    for (line, warnings) in [("mtllib all walls.mtl\n", 0), ("mtllib nothing.mtl\n", 1)] {
        std::fs::write(&obj, text.replace("mtllib walls.mtl\n", line)).unwrap();
        let ran = run!["build", obj, "-o", out, "--spacing", "0.1"].done();
        assert_eq!(ran.stderr.matches("could not be read").count(), warnings, "{line}: {ran:?}");
    }
}

/// The picture of a raw model is kept; which files it names is part of what it is.
#[test]
fn what_is_in_the_cache_counts_as_long_as_pictures_and_libraries_are_the_same() {
    if !can_draw() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let obj = walls(place.path(), 3);
    let render = |model: &Path| {
        let out = place.path().join("a.png");
        // Empty at first.
        let mut render = command();
        render.env("XDG_CACHE_HOME", place.path().join("cache")).arg("render").arg(model).arg("-o").arg(&out);
        render.args(["--size", "160x120", "--spacing", "0.1", "-v"]);
        let ran = Ran::of(render.output().unwrap()).done();
        assert!(ran.stderr.contains("built as") != ran.stderr.contains("built before as"), "{ran:?}");
        (ran.stderr.contains("built as"), std::fs::read(&out).unwrap())
    };
    let (is_built, bricks) = render(&obj);
    assert!(is_built && render(&obj) == (false, bricks.clone()));
    image::RgbImage::from_pixel(8, 8, image::Rgb([255, 0, 0])).save(place.path().join("bricks.png")).unwrap();
    let (is_built, red) = render(&obj);
    assert!(is_built && red != bricks && render(&obj) == (false, red.clone()));
    std::fs::write(place.path().join("walls.mtl"), "newmtl bricks\nKd 0 0 1\n").unwrap();
    let (is_built, blue) = render(&obj);
    assert!(is_built && blue != red);
    std::fs::remove_file(place.path().join("walls.mtl")).unwrap();
    assert!(render(&obj).0, "gone");
    // The same bytes among other files.
    let other = place.path().join("other");
    std::fs::create_dir(&other).unwrap();
    let copy = walls(&other, 3);
    assert_eq!(render(&copy), (true, bricks));
}

/// Pictures of the same name in two folders are two.
#[test]
fn each_of_several_inputs_has_its_own_pictures() {
    let place = tempfile::tempdir().unwrap();
    let folders = ["first", "second"].map(|name| place.path().join(name));
    let inputs = folders.each_ref().map(|folder| {
        std::fs::create_dir(folder).unwrap();
        walls(folder, 3)
    });
    let out = place.path().join("a.glod");
    let build = || {
        let ran = run!["build", inputs[0], inputs[1], "-o", out, "--spacing", "0.05"].done();
        let notes: Vec<String> = ran.stderr.lines().filter(|line| line.starts_with("note: ")).map(Into::into).collect();
        (std::fs::read(&out).unwrap(), notes)
    };
    let (alike, notes) = build();
    assert_eq!(notes, Vec::<String>::new());
    image::RgbImage::from_pixel(8, 8, image::Rgb([255, 0, 0])).save(folders[1].join("bricks.png")).unwrap();
    let (different, notes) = build();
    assert!(different != alike && notes.is_empty(), "{notes:?}");
    std::fs::remove_file(folders[1].join("bricks.png")).unwrap();
    let (missing, notes) = build();
    assert!(missing != different && notes.len() == 1, "{notes:?}");
    assert!(notes[0].starts_with("note: picture bricks.png of ") && notes[0].contains("second"), "{notes:?}");
}

#[test]
fn interrupted_after_each_phase_a_diced_model_ends_with_the_same_bytes() {
    let inputs = tempfile::tempdir().unwrap();
    let obj = walls(inputs.path(), 60);
    let spaced = ["--spacing", "0.05"];
    let whole = Place::new();
    run!["build", obj, "-o", whole.out, spaced[0], spaced[1]].done();
    let bytes = std::fs::read(&whole.out).unwrap();
    let mut phases = std::collections::BTreeSet::new();
    for _ in 0..200 {
        let place = Place::new();
        let mut child = place.spawn(&obj, &["--threads", "1", spaced[0], spaced[1]]);
        // As soon as there is a phase that was not seen yet.
        loop {
            let phase = place.journaled();
            if child.try_wait().unwrap().is_some() || phase.is_some_and(|phase| !phases.contains(&phase)) {
                break;
            }
            std::thread::yield_now();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let Some(phase) = place.journaled() else { continue };
        // The picture was read by then, or not: what is continued has it.
        let ran = run!["build", obj, "-o", place.out, "--memory", "64MiB", "--resume", "--json", spaced[0], spaced[1]];
        assert_eq!(ran.done().json()["resumed_after"], *phase);
        place.expect_done(&bytes);
        phases.insert(phase);
        if phases.len() == 4 {
            break;
        }
    }
    assert!(phases.iter().map(String::as_str).eq(["leaves", "part of tree", "read", "tree"]), "{phases:?}");
    // Another spacing is another build, and so is another picture.
    let place = Place::new();
    let mut child = place.spawn(&obj, &spaced);
    place.kill_after(&mut child, 1, std::time::Duration::ZERO);
    if place.journaled().is_some() {
        let picture = inputs.path().join("bricks.png");
        let before = std::fs::read(&picture).unwrap();
        image::RgbImage::from_pixel(8, 8, image::Rgb([255, 0, 0])).save(&picture).unwrap();
        let resume = || run!["build", obj, "-o", place.out, "--resume", "--json", spaced[0], spaced[1]];
        let said = resume().failed(&place.out);
        assert!(said.contains("with other materials: expected ") && said.contains("bricks.png"), "{said}");
        std::fs::remove_file(&picture).unwrap();
        let said = resume().failed(&place.out);
        assert!(said.contains("bricks.png there, found ") && said.contains("bricks.png not there"), "{said}");
        std::fs::write(&picture, before).unwrap();
        let said = run!["build", obj, "-o", place.out, "--resume", "--json", "--spacing", "0.06"].failed(&place.out);
        assert!(said.contains("with other options") && said.contains("--spacing 0.05"), "{said}");
        assert_eq!(names_in(place.folder.path()), [".a.glod.build"]);
    }
}
