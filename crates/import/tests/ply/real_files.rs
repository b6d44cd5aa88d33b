//! Files as programs out there write them: run with `GIGALOD_DATA` set to the folder that has `scans` and `nasty`.

use crate::nasty::PLY;
use crate::sources::{Model, read_source};
use std::{fs, path::PathBuf};

/// The test data, or none with a note.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("GIGALOD_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: GIGALOD_DATA not set");
    }
    folder
}

fn load(path: PathBuf) -> Result<Model, String> {
    let file = fs::File::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    read_source(Box::new(file)).map_err(|error| error.to_string())
}

#[test]
fn scans_have_the_vertices_and_triangles_they_are_known_for() {
    let Some(data) = data() else { return };
    for (name, vertices, triangles, normals_and_colors) in [
        ("dragon_vrip.ply.gz", 437_645, 871_414, false),
        ("dragon_vrip_res2.ply.gz", 100_250, 202_520, false),
        ("bun_zipper.ply", 35_947, 69_451, false),
        ("laurana.ply", 25_160, 50_000, true),
        ("rangemap_lato000.ply", 44_461, 86_766, false),
    ] {
        let model = load(data.join("scans").join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((model.positions.len(), model.triangles.len()), (vertices, triangles), "{name}");
        assert_eq!(!model.normals.is_empty(), normals_and_colors, "{name}");
        assert_eq!(!model.colors.is_empty(), normals_and_colors, "{name}");
        let is_near = |position: &[f64; 3]| position.iter().all(|value| value.abs() < 1e4);
        assert!(model.positions.iter().all(is_near), "{name} has wild positions");
    }
}

#[test]
fn nasty_files_give_what_the_table_says() {
    let Some(data) = data() else { return };
    let mut results: Vec<_> = fs::read_dir(data.join("nasty"))
        .expect("the test data has a folder `nasty`")
        .map(|entry| entry.expect("it can be listed").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "ply"))
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (name, load(path).map(|model| (model.positions.len(), model.triangles.len())))
        })
        .collect();
    results.sort();
    let expected: Vec<_> = PLY.iter().map(|&(name, result)| (name.to_owned(), result.map_err(str::to_owned))).collect();
    assert_eq!(results, expected);
}
