//! Files as programs out there write them: run with `GIGALOD_DATA` set to the folder that has `scans` and `nasty`.

use crate::nasty::OTHERS;
use crate::sources::{Model, read_with};
use gigalod_import::ByteSource;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The test data, or none with a note.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("GIGALOD_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: GIGALOD_DATA not set");
    }
    folder
}

fn load(path: &Path) -> Result<Model, String> {
    let file = fs::File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let folder = path.parent().expect("it is in a folder").to_owned();
    let side =
        move |name: &str| -> io::Result<Box<dyn ByteSource>> { Ok(Box::new(fs::File::open(folder.join(name))?)) };
    read_with(Box::new(file), Box::new(side)).map_err(|error| error.to_string())
}

#[test]
fn nasty_files_give_what_the_table_says() {
    let Some(data) = data() else { return };
    let mut results: Vec<_> = fs::read_dir(data.join("nasty"))
        .expect("the test data has a folder `nasty`")
        .map(|entry| entry.expect("it can be listed").path())
        .filter(|path| !matches!(path.extension().and_then(|it| it.to_str()), Some("ply" | "bin")))
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (name, load(&path).map(|model| (model.positions.len(), model.triangles.len())))
        })
        .collect();
    results.sort();
    let expected: Vec<_> =
        OTHERS.iter().map(|&(name, result)| (name.to_owned(), result.map_err(str::to_owned))).collect();
    for (found, expected) in results.iter().zip(&expected) {
        assert_eq!(found, expected);
    }
    assert_eq!(results, expected);
}

#[test]
fn objects_have_the_vertices_and_triangles_that_their_lines_say() {
    let Some(data) = data() else { return };
    // Lines `v` and `vt`; corners less two of lines `f`; different names after `usemtl`.
    for (name, vertices, tex_coords, triangles, materials) in [
        ("city/railway_lod3_obj/railway_lod3.obj", 78_175, 52_555, 121_914, 56),
        ("trees/eztree/ash_large.obj", 28_098, 28_098, 21_512, 2),
        ("trees/eztree/pine_medium.obj", 26_111, 26_111, 19_872, 2),
        ("trees/gazebo_oak_tree/oak_tree.obj", 812, 2_844, 948, 2),
    ] {
        let model = load(&data.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let counts = (model.positions.len(), model.tex_coords.len(), model.triangles.len(), model.material_names.len());
        assert_eq!(counts, (vertices, tex_coords, triangles, materials), "{name}");
    }
}

#[test]
fn scenes_have_the_vertices_and_triangles_that_their_accessors_say() {
    let Some(data) = data() else { return };
    // Sums over the nodes of the counts in the JSON.
    for (name, vertices, triangles) in
        [("city/VirtualCity.glb", 19_483, 8_383), ("trees/DiffuseTransmissionPlant.glb", 44_794, 69_806)]
    {
        let model = load(&data.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((model.positions.len(), model.triangles.len()), (vertices, triangles), "{name}");
    }
}

#[test]
fn clouds_have_the_points_and_bounds_that_their_headers_say() {
    let Some(data) = data() else { return };
    for (name, points, has_colors) in [
        ("autzen_crop.laz", 1_357_056, true),
        ("autzen_trim.las", 110_000, true),
        ("1.2-with-color.las", 1_065, true),
        ("lion_takanawa.copc.laz", 341_989, true),
    ] {
        let path = data.join("points").join(name);
        let header = fs::read(&path).expect("it is there");
        let number = |at: usize| f64::from_le_bytes(*header[at..].first_chunk().expect("a header has 227 bytes"));
        let model = load(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((model.positions.len(), !model.colors.is_empty()), (points, has_colors), "{name}");
        for axis in 0..3 {
            let values = || model.positions.iter().map(|position| position[axis]);
            let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            let (expected_high, expected_low) = (number(179 + 16 * axis), number(187 + 16 * axis));
            let scale = number(131 + 8 * axis);
            assert!(
                (low - expected_low).abs() <= scale && (high - expected_high).abs() <= scale,
                "{name}: {low}, {high}"
            );
        }
        // A picture has more than a few colours.
        let mut colors = model.colors.clone();
        colors.sort_unstable();
        colors.dedup();
        assert!(colors.len() > 300 && colors.last().is_some_and(|color| color[0] > 128), "{name}: {}", colors.len());
    }
}
