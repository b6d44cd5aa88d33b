//! Several files as one model: what comes is what each of them has, one after the other, with numbers that go on.

use crate::make::{e57, las, square};
use crate::sources::{Model, read, read_stream};
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use gigalod_import::{ImportError, OpenPart, Part, SideFiles, Together, open, open_all, open_with};
use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const FREE: Together = Together { up: None, unit: None, plain_color: [1, 2, 3] };

fn part(name: &str, bytes: &[u8]) -> Part {
    let bytes = bytes.to_vec();
    Part { name: name.into(), open: Box::new(move || open(Box::new(Cursor::new(bytes.clone())))) }
}

fn read_all_of(files: &[(&str, &[u8])], together: &Together) -> Result<Model, ImportError> {
    read_stream(open_all(files.iter().map(|(name, bytes)| part(name, bytes)).collect(), together)?)
}

/// What is wrong, and with which file.
fn error_of(files: &[(&str, &[u8])]) -> String {
    let error = read_all_of(files, &FREE).expect_err("they do not go together");
    format!("{}: {error}", error.file().unwrap_or("-"))
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
    property list uchar int vertex_indices\nend_header\n0 0 0 9 8 7\n1 0 0 6 5 4\n0 1 0 3 2 1\n3 0 1 2\n";
const OFF: &str = "OFF\n4 2 0\n5 0 0\n6 0 0\n6 1 0\n5 1 0\n3 0 1 2\n3 0 2 3\n";

#[test]
fn files_follow_each_other_and_their_numbers_go_on() {
    let obj = "v 0 0 9\nv 1 0 9\nv 0 1 9\nvt 0 1\nvt 1 1\nvt 0.5 0\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 3 2 1\n";
    let files =
        [("a.ply", PLY.as_bytes()), ("b.obj", obj.as_bytes()), ("c.off", OFF.as_bytes()), ("d", obj.as_bytes())];
    let found = read_all_of(&files, &FREE).expect("they go together");
    let each: Vec<Model> = files.iter().map(|(name, bytes)| read(bytes).expect(name)).collect();
    let positions: Vec<_> = each.iter().flat_map(|model| model.positions.clone()).collect();
    assert_eq!(found.positions, positions);
    assert_eq!(found.tex_coords, [&each[1].tex_coords[..], &each[3].tex_coords].concat());
    let mut triangles = Vec::new();
    let mut first = 0;
    for model in &each {
        triangles.extend(model.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
        first += model.positions.len() as u32;
    }
    assert_eq!(found.triangles, triangles);
    assert_eq!(found.material_names, ["a", "b", "a", "b"], "materials of different files are different");
    assert_eq!(found.materials, [0, 1, 2, 3]);
    let none = u32::MAX;
    assert_eq!(found.corner_tex_coords, [[0, 1, 2], [none; 3], [3, 4, 5], [none; 3]]);
    // Colours are those of the first, and the plain one for those without.
    assert_eq!(found.colors[..3], each[0].colors);
    assert!(found.colors[3..].iter().all(|color| *color == [1, 2, 3]) && found.colors.len() == 13);
}

#[test]
fn headers_add_up() {
    let stream = |files: &[&[u8]]| {
        open_all(files.iter().map(|bytes| part("a", bytes)).collect(), &FREE).expect("they go together")
    };
    let two = stream(&[PLY.as_bytes(), OFF.as_bytes()]);
    assert_eq!((two.declared_vertices(), two.declared_faces()), (Some(7), Some(3)));
    assert_eq!(two.bytes_consumed(), (0, (PLY.len() + OFF.len()) as u64));
    let one_unknown = stream(&[OFF.as_bytes(), b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"]);
    assert_eq!((one_unknown.declared_vertices(), one_unknown.declared_faces()), (None, None));
    assert_eq!(stream(&[&las(0, 0, 4, None), &las(1, 0, 5, Some(100))]).declared_vertices(), Some(9));
    // What a file says of its units holds for those that say nothing; what the user says holds for all.
    let glb = square().glb();
    let unit =
        |together: Together| open_all(vec![part("a", OFF.as_bytes()), part("b", &glb)], &together).unwrap().unit();
    assert_eq!(unit(FREE), Some(LengthUnit::Metre));
    assert_eq!(unit(Together { unit: Some(LengthUnit::Inch), ..FREE }), Some(LengthUnit::Inch));
}

#[test]
fn clouds_far_from_the_origin_keep_their_last_digits() {
    let text = "636001.7700001 848935.203 406.589\n636001.7700002 848935.204 406.59\n";
    let other = "-2712345.678901 1 1e-9\n2 2 2\n3 3 3\n";
    let found = read_all_of(&[("a.xyz", text.as_bytes()), ("b.xyz", other.as_bytes())], &FREE).unwrap();
    assert_eq!(found.positions[0], [636_001.770_000_1, 848_935.203, 406.589]);
    assert_eq!(found.positions[1], [636_001.770_000_2, 848_935.204, 406.59]);
    assert_eq!(found.positions[2], [-2_712_345.678_901, 1.0, 1e-9]);
    assert_eq!(found.positions.len(), 5);
}

#[test]
fn files_that_do_not_go_together_are_refused_by_name() {
    let cloud = las(0, 0, 4, None);
    let points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let glb = square().glb();
    let e57 = e57(30);
    for (files, expected) in [
        // One that says so, one that shows it at its end.
        (
            [("a.off", OFF.as_bytes()), ("b.ply", &*PLY.replace("face 1", "face 0").into_bytes())],
            "b.ply: expected triangles as in a.off, found points without triangles",
        ),
        (
            [("a.off", OFF.as_bytes()), ("b.obj", points.as_bytes())],
            "b.obj: expected triangles as in a.off, found points without triangles",
        ),
        (
            [("a.obj", points.as_bytes()), ("b.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")],
            "b.obj: expected points without triangles as in a.obj, found triangles",
        ),
        (
            [("a.las", &*cloud), ("b.off", OFF.as_bytes())],
            "b.off: expected points without triangles as in a.las, found triangles",
        ),
        ([("a.glb", &*glb), ("b.e57", &*e57)], "b.e57: expected triangles as in a.glb, found points without triangles"),
        (
            [("a.las", &*cloud), ("b.ply", &*PLY.replace("face 1", "face 0").into_bytes())],
            "b.ply: expected z upwards as in a.las, found y upwards",
        ),
    ] {
        assert_eq!(error_of(&files), expected);
    }
    let up = |up| Together { up: Some(up), ..FREE };
    let stream = open_all(vec![part("a", &cloud), part("b", b"1 2 3\n4 5 6\n")], &up(UpAxis::Z)).expect("told");
    assert_eq!(stream.up_axis(), UpAxis::Z);
    // A file without anything goes with all.
    assert_eq!(read_all_of(&[("a", OFF.as_bytes()), ("b", &las(0, 0, 0, None))], &FREE).unwrap().triangles.len(), 2);
}

#[test]
fn errors_are_of_the_file_that_is_wrong() {
    let broken = OFF.replace("3 0 2 3", "3 0 2 4");
    assert_eq!(
        error_of(&[("a.off", OFF.as_bytes()), ("b.off", broken.as_bytes()), ("c.off", OFF.as_bytes())]),
        "b.off: expected a vertex number below 4, found `4` (line 8, face 1)"
    );
    assert!(error_of(&[("a.off", OFF.as_bytes()), ("b", b"")]).starts_with("b: expected a model, found an empty file"));
}

/// Opened for its header first, and then to be read: when it cannot be had the second time, that is its error.
#[test]
fn a_file_that_is_gone_when_its_turn_comes_is_an_error_of_that_file() {
    let times = Arc::new(AtomicUsize::new(0));
    let counted = times.clone();
    let open_twice: OpenPart = Box::new(move || match counted.fetch_add(1, Ordering::Relaxed) {
        0 => open_with(Box::new(Cursor::new(OFF)), Box::new(gigalod_import::NoSideFiles) as Box<dyn SideFiles>),
        _ => Err(std::io::Error::new(std::io::ErrorKind::NotFound, "gone").into()),
    });
    let parts = vec![part("a", OFF.as_bytes()), Part { name: "b".into(), open: open_twice }];
    let error = read_stream(open_all(parts, &FREE).expect("it is still there")).expect_err("it is gone");
    assert_eq!((error.file(), &*error.to_string()), (Some("b"), "expected to read on, found an input error: gone"));
    assert_eq!(times.load(Ordering::Relaxed), 2);
}
