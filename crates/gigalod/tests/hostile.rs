//! Hostile bytes: `.glod` files in this process, and all kinds of files through the program. Each works or gives one line and
//! status 1, in bounded memory. Alone in its program, because the allocator counts for all threads.
#![cfg(unix)]

mod cli_support;
mod counting;
#[path = "../../import/tests/fuzzing/mod.rs"]
mod damage;
mod fuzzing;
#[allow(dead_code)]
#[path = "../../import/tests/formats/make_points.rs"]
mod make;
#[path = "../../import/tests/nasty/mod.rs"]
mod nasty;

use cli_support::{Ran, can_draw, command};
use counting::peak_of;
use damage::damaged;
use fuzzing::{glod, mended};
use gigalod::build::{NoProgress, Options, splats};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Most memory that any small file may take in this process.
const MOST_BYTES: usize = 64 << 20;
const CUTS: usize = 200;
const COPIES: usize = 2000;
/// One in so many goes through the program as well.
const SHARE: usize = 20;

/// A grid as text: coloured, so that all there is in a `.glod` file is in what it builds into.
fn grid(side: usize) -> String {
    let places = (0..=side).flat_map(|row| (0..=side).map(move |column| (row, column)));
    let mut text: String = places
        .map(|(row, column)| format!("v {column} {row} {} {} 0.5 0\n", (row * row + 3 * column) % 7, row as f32 / 99.0))
        .collect();
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        let a = row * (side + 1) + column + 1;
        text += &format!("f {a} {} {} {}\n", a + 1, a + side + 2, a + side + 1);
    }
    text
}

/// A `.glod` file with a leaf for each vertex: diced, it would be too large to be looked at thousands of times.
fn built(side: usize) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.glod");
    let stream = gigalod::import::open(Box::new(Cursor::new(grid(side)))).unwrap();
    let options = Options { threads: 1, spacing: Some(f64::MAX), ..Options::default() };
    splats::build(stream, &options, &NoProgress, &out).unwrap();
    std::fs::read(&out).unwrap()
}

#[test]
fn damaged_glod_files_are_errors_and_take_no_memory() {
    let good = built(12);
    assert!(glod(&good));
    let ((), peak) = peak_of(|| {
        for (number, bytes) in damaged(&good, CUTS, COPIES).enumerate() {
            assert!(!glod(&bytes) || bytes == good, "copy {number}: checksums cover all bytes that mean something");
        }
    });
    assert!(peak < MOST_BYTES, "{peak} bytes");
}

/// Behind right checksums, bytes may mean anything.
#[test]
fn forged_glod_files_are_taken_as_they_are_or_refused() {
    let good = built(12);
    assert!(mended(&good) == good, "the format's document and its writer agree on where checksums are");
    if let Some(corpus) = std::env::var_os("GIGALOD_CORPUS").map(|corpus| PathBuf::from(corpus).join("glod")) {
        std::fs::create_dir_all(&corpus).unwrap();
        std::fs::write(corpus.join("grid"), &good).unwrap();
    }
    let (sound, peak) = peak_of(|| damaged(&good, CUTS, COPIES).filter(|bytes| glod(&mended(bytes))).count());
    println!("{sound} of {} make sense", CUTS + COPIES);
    assert!(sound < COPIES / 2, "{sound}: most damage is seen all the same");
    assert!(peak < MOST_BYTES, "{peak} bytes");
}

/// Runs the program in at most a gibibyte of memory of its own.
fn within_a_gibibyte(arguments: &[&Path]) -> Ran {
    let program = command();
    let mut shell = Command::new("sh");
    shell.arg("-c").arg("ulimit -d 1048576; exec \"$0\" \"$@\"").arg(program.get_program()).args(arguments);
    program.get_envs().filter_map(|(name, value)| Some((name, value?))).for_each(|(name, value)| {
        shell.env(name, value);
    });
    Ran::of(shell.output().unwrap())
}

/// It did what it was asked to, perhaps with warnings; or it said in one line what is wrong with `file`. True where it did.
#[track_caller]
fn expect_done_or_refused(ran: &Ran, file: &Path, name: &str) -> bool {
    let lines: Vec<&str> = ran.stderr.lines().filter(|line| !line.starts_with("warning: ")).collect();
    match (ran.status, &lines[..]) {
        (0, []) => true,
        (1, [error, hints @ ..]) => {
            assert!(error.starts_with(&format!("error: {}: ", file.display())), "{name}: {ran:?}");
            assert!(hints.iter().all(|hint| hint.starts_with("hint: ")), "{name}: {ran:?}");
            false
        }
        _ => panic!("{name}: {ran:?}"),
    }
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn damaged_models_are_built_or_refused_by_the_program() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("a.glod");
    let mut binary =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\n\
        element face 4\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
    binary.extend((0..27).flat_map(|value| ((value * value % 13) as f32).to_le_bytes()));
    for face in 0..4u32 {
        binary.push(3);
        binary.extend([face, face + 1, face + 4].iter().flat_map(|corner| corner.to_le_bytes()));
    }
    for (name, good) in [
        ("ply", binary),
        ("obj", grid(3).into_bytes()),
        ("glb", glb()),
        ("laz", make::las(3, 2, 60, Some(40))),
        ("e57", make::e57(300)),
    ] {
        let mut done = 0;
        let copies = damaged(&good, CUTS, COPIES).step_by(SHARE);
        for (number, bytes) in std::iter::once(good.clone()).chain(copies).enumerate() {
            let file = write(place.path(), name, &bytes);
            let ran = within_a_gibibyte(&[
                "build".as_ref(),
                &file,
                "-o".as_ref(),
                &out,
                "--memory".as_ref(),
                "64MiB".as_ref(),
                "--threads".as_ref(),
                "1".as_ref(),
            ]);
            done += usize::from(expect_done_or_refused(&ran, &file, &format!("{name}, copy {number}")));
            assert!(number > 0 || done == 1, "{name}: {ran:?}");
            let _ = std::fs::remove_file(&out);
        }
        println!("{name}: {done} of {} were built", 1 + (CUTS + COPIES) / SHARE);
        let left: Vec<String> = cli_support::names_in(place.path()).into_iter().filter(|left| left != name).collect();
        assert_eq!(left, [""; 0], "nothing is left behind");
        std::fs::remove_file(place.path().join(name)).unwrap();
    }
}

/// A triangle fan as GLB.
fn glb() -> Vec<u8> {
    let positions = (0..8).flat_map(|at| [(at % 3) as f32, (at / 3) as f32, (at % 2) as f32 * 0.5]);
    let mut bytes: Vec<u8> = positions.flat_map(f32::to_le_bytes).collect();
    bytes.extend([0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5].iter().flat_map(|corner: &u16| corner.to_le_bytes()));
    let json = serde_json::json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8 },
            { "bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 12 },
        ],
        "bufferViews": [{ "buffer": 0, "byteLength": 96 }, { "buffer": 0, "byteOffset": 96, "byteLength": 24 }],
        "buffers": [{ "byteLength": bytes.len() }],
    });
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + text.len() as u32 + bytes.len() as u32).to_le_bytes());
    for (kind, content) in [(b"JSON", &text), (b"BIN\0", &bytes)] {
        glb.extend((content.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(content);
    }
    glb
}

#[test]
fn damaged_glod_files_are_told_of_and_drawn_or_refused_by_the_program() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("a.png");
    let good = built(12);
    let (mut told, mut drawn) = (0, 0);
    for (number, bytes) in damaged(&good, CUTS, COPIES).step_by(SHARE).enumerate() {
        for (kind, bytes) in [("damaged", bytes.clone()), ("forged", mended(&bytes))] {
            let file = write(place.path(), "a.glod", &bytes);
            let name = format!("{kind} copy {number}");
            let is_told = expect_done_or_refused(&within_a_gibibyte(&["info".as_ref(), &file]), &file, &name);
            told += usize::from(is_told);
            // To open a graphics device takes most of the time: not for what is refused before.
            if number % 10 == 0 && can_draw() {
                let ran =
                    command().arg("render").arg(&file).args(["--size", "16x16", "-o"]).arg(&out).output().unwrap();
                drawn += usize::from(expect_done_or_refused(&Ran::of(ran), &file, &name));
            }
        }
    }
    println!("{told} could be told of, {drawn} drawn");
    assert!(told > 0, "damage to pages is no concern of info");
}

#[test]
fn each_odd_file_is_built_or_refused_as_the_table_says() {
    let Some(data) = std::env::var_os("GIGALOD_DATA").map(PathBuf::from) else {
        println!("skipped: GIGALOD_DATA not set");
        return;
    };
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("a.glod");
    for (name, outcome) in nasty::PLY.iter().chain(nasty::OTHERS) {
        let file = data.join("nasty").join(name);
        let ran = run!["build", file, "-o", out, "--json"];
        match outcome {
            Ok((0, _)) => {
                assert_eq!(ran.failed(&file), "no triangles and no points, expected at least one", "{name}");
            }
            Ok((vertices, triangles)) => {
                let points = if *triangles == 0 { *vertices } else { 0 };
                let expected =
                    serde_json::json!({ "triangles": triangles, "vertices": vertices - points, "points": points });
                assert_eq!(ran.done().json()["input"], expected, "{name}");
            }
            Err(what) => {
                ran.failed(&file);
                // As one line; with the place, which the line has and `failed` has compared.
                let line = format!("error: {}: {what}", file.display());
                assert_eq!(ran.stderr.lines().next(), Some(&*line), "{name}");
            }
        }
    }
}
