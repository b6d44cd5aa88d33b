//! Several files, or a folder, as one model; units, and coordinates on the Earth.

mod cli_support;

use cli_support::{names_in, other_splat_statue, statue};
use serde_json::{Value, json};
use std::path::Path;

fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> std::path::PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    path
}

/// A wavy grid of so many squares each way, from x on, as OBJ.
fn obj(side: usize, x: f64) -> String {
    let places = (0..=side).flat_map(|row| (0..=side).map(move |column| (row, column)));
    let mut text: String = places
        .map(|(row, column)| format!("v {} {row} {}\n", x + column as f64, (row * row + 3 * column) % 7))
        .collect();
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        let a = row * (side + 1) + column + 1;
        text += &format!("f {a} {} {} {}\n", a + 1, a + side + 2, a + side + 1);
    }
    text
}

/// A grid of points as text.
fn xyz(side: usize, from: [f64; 3]) -> String {
    let places = (0..side * side).map(|at| (at / side, at % side));
    let [x, y, z] = from;
    places.map(|(row, column)| format!("{} {} {z}\n", x + column as f64 * 0.25, y + row as f64 * 0.25)).collect()
}

/// A folder with two models and much that is none.
fn tiles(folder: &Path) {
    write(folder, "b.obj", format!("mtllib b.mtl\n{}", obj(40, 100.0)));
    std::fs::copy(&statue().ply, folder.join("a.ply")).unwrap();
    write(folder, "b.mtl", "newmtl a\nKd 1 0 0\n");
    write(folder, "b.png", b"\x89PNG\r\n\x1a\n");
    write(folder, "notes.txt", "Scanned on a Tuesday.\n");
    write(folder, "scene.bin", [0; 100]);
    write(folder, ".hidden.ply", std::fs::read(&statue().ply).unwrap());
    std::fs::create_dir(folder.join("below")).unwrap();
    std::fs::copy(&statue().ply, folder.join("below/c.ply")).unwrap();
}

#[test]
fn a_folder_is_the_models_in_it_and_they_are_one_model() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("tiles");
    std::fs::create_dir(&folder).unwrap();
    tiles(&folder);
    let [out, other] = ["a.glod", "b.glod"].map(|name| place.path().join(name));
    let ran = run!["build", folder, "-o", out, "--as", "splats", "--json"].done();
    let below = folder.join("below");
    let left_out = "left out: folders below one are not looked into, name it too";
    assert_eq!(ran.stderr, format!("warning: {}: {left_out}\n", below.display()));
    let single = run!["build", statue().ply, "-o", other, "--json"].done().json();
    let count = |report: &Value, what: &str| report["input"][what].as_u64().unwrap();
    assert_eq!(count(&ran.json(), "triangles"), count(&single, "triangles") + 2 * 40 * 40);
    assert_eq!(count(&ran.json(), "vertices"), count(&single, "vertices") + 41 * 41);
    // The same files by name, in any order: the same sets of vertices and triangles.
    run!["build", folder.join("b.obj"), folder.join("a.ply"), "-o", other, "--as", "splats"].done();
    assert!(std::fs::read(&out).unwrap() == std::fs::read(&other).unwrap(), "the same bytes");
    // The judge takes the same inputs; without one of them it sees that something is missing.
    for against in [vec![folder.clone()], vec![folder.join("a.ply"), folder.join("b.obj")]] {
        let mut arguments = vec!["verify".into(), out.clone(), "--json".into(), "--against".into()];
        arguments.extend(against);
        let found = cli_support::gigalod(arguments).done().json();
        assert_eq!((&found["ok"], &found["measured"]["violations"]), (&json!(true), &json!(0)));
    }
    assert_eq!(run!["verify", out, "--json", "--against", statue().ply].json()["ok"], false);
    let said = run!["build", folder, "-o", out, "-v"].done().stderr;
    let listed: Vec<_> = said.lines().filter(|line| line.starts_with(folder.to_str().unwrap())).collect();
    assert!(listed.len() == 2 && listed[0].ends_with("a.ply: PLY") && listed[1].ends_with("b.obj: OBJ"), "{said}");
}

#[test]
fn what_does_not_make_one_model_is_refused_by_name() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let out = folder.join("a.glod");
    let mesh = write(folder, "mesh.obj", obj(9, 0.0));
    let cloud = write(folder, "points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    let cut = write(folder, "cut.obj", "v 0 0 0\nv 1 0 0\nf 1 2 7\n");
    let refused = |inputs: &[&Path], file: &Path| {
        let mut build = cli_support::command();
        build.arg("build").args(inputs).arg("-o").arg(&out).arg("--json");
        let ran = cli_support::Ran::of(build.output().unwrap());
        assert!(!out.exists());
        (ran.failed(file), ran.stderr.lines().skip(1).collect::<String>())
    };
    let (what, hint) = refused(&[&mesh, &cloud], &cloud);
    assert_eq!(what, format!("expected triangles as in {}, found points without triangles", mesh.display()));
    assert_eq!(hint, "hint: build meshes and point clouds apart");
    assert_eq!(refused(&[&mesh, &cut], &cut).0, "expected a vertex number from 1 to 2, or from -2 to -1, found `7`");
    let around = folder.join("../").join(folder.file_name().unwrap()).join("mesh.obj");
    assert_eq!(refused(&[&mesh, &around], &around).0, "given twice");
    let missing = folder.join("missing.ply");
    refused(&[&mesh, &missing], &missing);
    let empty = folder.join("empty");
    std::fs::create_dir(&empty).unwrap();
    assert_eq!(refused(&[&mesh, &empty], &empty).0, "expected files in it that are models, found none");
    // All of the folder: broken files are not passed over.
    std::fs::remove_file(&cloud).unwrap();
    refused(&[folder], &cut);
    // Nor is the only one in its folder named as that.
    let one = tempfile::tempdir().unwrap();
    let only = one.path().join("cut.obj");
    std::fs::copy(&cut, &only).unwrap();
    refused(&[one.path()], &only);
    // One that would be replaced.
    let ran = run!["build", folder, "-o", mesh, "--json"];
    assert_eq!(ran.failed(&mesh), "input and output are the same file");
    // What is called a model and is none.
    std::fs::remove_file(&cut).unwrap();
    let odd = write(folder, "odd.laz", "");
    let ran = run!["build", folder, "-o", out].done();
    assert!(
        ran.stderr.starts_with(&format!("warning: {}: left out: no model by its content\n", odd.display())),
        "{ran:?}"
    );
}

#[test]
fn what_inputs_say_differently_the_user_must_say() {
    let place = tempfile::tempdir().unwrap();
    let [folder, out] = ["tiles", "a.glod"].map(|name| place.path().join(name));
    std::fs::create_dir(&folder).unwrap();
    let points: String = (0..900).map(|at| format!("{} {} 1\n", at % 30, at / 30)).collect();
    let header =
        "ply\nformat ascii 1.0\nelement vertex 900\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let text = write(&folder, "a.ply", format!("{header}{points}"));
    // LAS says that z is up.
    let mut las = vec![0; 227];
    las[..4].copy_from_slice(b"LASF");
    las[24..26].copy_from_slice(&[1, 2]);
    las[94..96].copy_from_slice(&227u16.to_le_bytes());
    las[96..100].copy_from_slice(&227u32.to_le_bytes());
    las[105..107].copy_from_slice(&20u16.to_le_bytes());
    las[107..111].copy_from_slice(&9u32.to_le_bytes());
    (131..155).step_by(8).for_each(|at| las[at..at + 8].copy_from_slice(&0.5f64.to_le_bytes()));
    for point in 0..9i32 {
        las.extend([point, point * point, 1].iter().flat_map(|value| value.to_le_bytes()));
        las.extend([0; 8]);
    }
    let las = write(&folder, "b.las", las);
    let ran = run!["build", folder, "-o", out, "--json"];
    assert_eq!(ran.failed(&las), format!("expected y upwards as in {}, found z upwards", text.display()));
    assert!(ran.stderr.ends_with("\nhint: say which way is up in all of them, as --up z\n"), "{ran:?}");
    let built = run!["build", folder, "-o", out, "--up", "z", "--json"].done().json();
    assert_eq!((&built["input"]["points"], &built["options"]["up"]), (&json!(909), &json!("z")));
    assert_eq!(run!["verify", out, "--against", folder, "--json"].done().json()["ok"], true);
}

#[test]
fn lengths_have_the_unit_that_the_user_says_and_coordinates_keep_their_digits() {
    let place = tempfile::tempdir().unwrap();
    let (file, out) = (place.path().join("a.xyz"), place.path().join("a.glod"));
    std::fs::write(&file, xyz(80, [636_001.7700001, 848_935.203, 406.589])).unwrap();
    run!["build", file, "-o", out].done();
    let plain = run!["info", out, "--json"].done().json();
    assert_eq!((&plain["units"], &plain["reference_system"]), (&Value::Null, &Value::Null));
    let built = run!["build", file, "-o", out, "--units", "us-ft", "--json"].done().json();
    assert_eq!(built["options"], json!({ "as": "splats", "up": "z", "units": "us-ft" }));
    let info = run!["info", out, "--json"].done().json();
    assert_eq!(info["units"], "us-ft");
    assert_eq!(info["bounds"], plain["bounds"], "a unit changes no coordinate");
    let max = [636_001.7700001 + 79.0 * 0.25, 848_935.203 + 79.0 * 0.25, 406.589];
    assert_eq!(info["bounds"], json!({ "min": [636_001.7700001, 848_935.203, 406.589], "max": max }));
    let text = run!["info", out].done().stdout;
    // In as many digits as single precision tells apart in a model of this size.
    let line = "bounds      636001.77 848935.203 406.589 to 636021.52 848954.953 406.589 us-ft";
    assert!(text.lines().any(|found| found == line) && text.contains(" max error/us-ft\n"), "{text}");
    assert!(run!["verify", out, "--against", file].done().stdout.contains(" (us-ft)\n"));
    let ran = run!["build", file, "-o", out, "--units", "feet"];
    assert!(ran.status == 2 && ran.stderr.contains("'feet', expected m, mm, cm, km, ft, us-ft, in"), "{ran:?}");
}

#[test]
fn real_files_bring_their_unit_and_system() {
    let Some(data) = std::env::var_os("GIGALOD_DATA") else {
        println!("skipped: GIGALOD_DATA not set");
        return;
    };
    let las = Path::new(&data).join("points/autzen_trim.las");
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("a.glod");
    run!["build", las, "-o", out].done();
    let info = run!["info", out, "--json"].done().json();
    assert_eq!((&info["units"], &info["options"]["up"]), (&json!("ft"), &json!("z")));
    let system = &info["reference_system"];
    assert_eq!((&system["name"], &system["epsg"]), (&json!("NAD_1983_HARN_Lambert_Conformal_Conic"), &Value::Null));
    assert!(system["wkt"].as_str().unwrap().starts_with("PROJCS["), "{system}");
    let header = std::fs::read(&las).unwrap();
    let number = |at: usize| f64::from_le_bytes(*header[at..].first_chunk().unwrap());
    for (axis, at) in [179, 195, 211].into_iter().enumerate() {
        let [min, max] = ["min", "max"].map(|end| info["bounds"][end][axis].as_f64().unwrap());
        assert!((max - number(at)).abs() < 1e-6 && (min - number(at + 8)).abs() < 1e-6, "{info}");
    }
    let text = run!["info", out].done().stdout;
    assert!(text.contains("system      NAD_1983_HARN_Lambert_Conformal_Conic; 592 bytes of WKT"), "{text}");
    run!["build", las, "-o", out, "--units", "m"].done();
    assert_eq!(run!["info", out, "--json"].done().json()["units"], "m", "what the user says goes first");
}

/// What a build of several was begun with, all of it, is what it is continued with.
#[cfg(unix)]
#[test]
fn an_interrupted_build_of_several_goes_on_with_just_these() {
    use cli_support::builds::{Place, SMALL_VERTICES};
    let place = Place::new();
    let folder = place.folder.path().join("tiles");
    std::fs::create_dir(&folder).unwrap();
    // Strips: nobody declares how many triangles they are, so it is built out of core.
    write(&folder, "a.ply", cli_support::strips(130));
    let second = write(&folder, "b.obj", obj(60, 500.0));
    place.build(&folder, &[]).done();
    let bytes = std::fs::read(&place.out).unwrap();
    std::fs::remove_file(&place.out).unwrap();
    // Positions and triangles take 24 bytes a vertex, kept nodes more.
    let ran = place.build_within((SMALL_VERTICES + 61 * 61) * 25, &folder);
    assert!(ran.failed(&place.out).contains("temporary files"), "{ran:?}");
    assert!(place.journaled().is_some());
    // Without one, with another, with one more.
    let refused = |inputs: &[&Path], what: &str| {
        let mut build = cli_support::command();
        build
            .arg("build")
            .args(inputs)
            .arg("-o")
            .arg(&place.out)
            .args(["--resume", "--json", "--memory", "64MiB", "--as", "splats"]);
        let said = cli_support::Ran::of(build.output().unwrap()).failed(&place.out);
        assert!(said.contains("of another input") && said.contains(what), "{said}");
    };
    refused(&[&folder.join("a.ply")], "expected 2 files, found 1 files");
    refused(&[&folder, &other_splat_statue().ply], "expected 2 files, found 3 files");
    refused(&[&second, &folder.join("a.ply")], "a.ply, found ");
    let before = std::fs::read(&second).unwrap();
    let modified = second.metadata().unwrap().modified().unwrap();
    write(&folder, "b.obj", [&before[..], b"\n"].concat());
    refused(&[&folder], &format!("expected {} bytes, found {} bytes", before.len(), before.len() + 1));
    write(&folder, "b.obj", &before);
    std::fs::File::options().write(true).open(&second).unwrap().set_modified(modified).unwrap();
    let said = place.build(&folder, &["--resume", "--json", "--units", "m"]).failed(&place.out);
    assert!(said.contains("with other options"), "{said}");
    let resumed = place.resume(&folder).done().json();
    assert!(!resumed["resumed_after"].is_null(), "{resumed}");
    assert!(std::fs::read(&place.out).unwrap() == bytes, "the bytes of a build that nobody interrupted");
    assert_eq!(names_in(place.folder.path()), ["a.glod", "tiles"]);
}
