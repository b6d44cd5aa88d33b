//! Point clouds on the command line: built, shown, verified; interrupted, and gone on with.
#![cfg(unix)]

mod cli_support;
mod clouds;

use cli_support::builds::Place;
use cli_support::{folder, statue};
use gigalod::import::VertexBatch;
use std::path::PathBuf;
use std::sync::OnceLock;

/// A statue's vertices that do not fit into the smallest memory, and what they build into.
fn big() -> &'static (PathBuf, Vec<u8>) {
    static BIG: OnceLock<(PathBuf, Vec<u8>)> = OnceLock::new();
    BIG.get_or_init(|| {
        let (mesh, ply, out) = (folder().join("mesh.ply"), folder().join("cloud.ply"), folder().join("cloud.glod"));
        run!["synth", "statue", "--triangles", "1.2M", "--colors", "-o", mesh].done();
        std::fs::write(&ply, clouds::ply(&clouds::vertices(&mesh))).unwrap();
        run!["build", ply, "-o", out].done();
        (ply, std::fs::read(&out).unwrap())
    })
}

#[test]
fn a_cloud_is_built_shown_and_verified() {
    let place = tempfile::tempdir().unwrap();
    let (ply, out) = (place.path().join("a.ply"), place.path().join("a.glod"));
    let points = clouds::vertices(&statue().ply);
    std::fs::write(&ply, clouds::ply(&points)).unwrap();
    let count = points.positions.len() as u64;
    let ran = run!["build", ply, "-o", out, "--json"].done();
    let input = serde_json::json!({ "triangles": 0, "vertices": 0, "points": count });
    let built = ran.json();
    let once = built["leaves"].as_u64().unwrap() - built["repeated"].as_u64().unwrap();
    assert_eq!((&built["input"], once), (&input, count));
    let info = run!["info", out, "--json"].done().json();
    assert_eq!((&info["input"], &info["closed"]), (&input, &false.into()));
    let text = run!["info", out].done().stdout;
    assert!(
        text.lines().any(|line| line.starts_with("input ") && line.ends_with(&format!(" {count} points"))),
        "{text}"
    );

    let found = run!["verify", out, "--against", ply, "--json"].done().json();
    assert_eq!((&found["ok"], &found["measured"]["violations"]), (&true.into(), &0.into()));
    assert!(found["measured"]["worst_ratio"].as_f64().unwrap() <= 1.0, "{found}");

    // Against points that are elsewhere, or turned, or too few.
    let against = |points: &VertexBatch| {
        let other = place.path().join("other.ply");
        std::fs::write(&other, clouds::ply(points)).unwrap();
        let ran = run!["verify", out, "--against", other, "--json"];
        assert_eq!(ran.status, 1, "{ran:?}");
        ran.json()["measured"]["violations"].as_u64().unwrap()
    };
    let mut other = points.clone();
    let extent = gigalod::geom::Aabb::of(points.positions.iter().copied()).diagonal();
    other.positions.iter_mut().for_each(|at| at.x += extent * 0.02);
    assert!(against(&other) > count / 2);
    let mut other = points.clone();
    other.positions.truncate(count as usize / 2);
    against(&other);
    let mut other = points;
    other.normals = vec![glam::Vec3::NEG_Y; count as usize];
    assert!(against(&other) > count / 10);
}

#[test]
fn a_cloud_of_no_points_is_an_error() {
    let place = tempfile::tempdir().unwrap();
    let (ply, out) = (place.path().join("a.ply"), place.path().join("a.glod"));
    std::fs::write(&ply, clouds::ply(&VertexBatch::default())).unwrap();
    let ran = run!["build", ply, "-o", out, "--json"];
    assert_eq!(ran.failed(&ply), "no triangles and no points, expected at least one");
    assert!(!out.exists());
}

#[test]
fn interrupted_after_each_phase_a_cloud_ends_with_the_same_bytes() {
    let (ply, bytes) = big();
    let mut phases = std::collections::BTreeSet::new();
    let expected = ["cells", "leaves", "part of radii", "part of tree", "radii", "read", "tree"];
    // Journals come and go: killed as soon as there is a new one, until all have been seen.
    for _ in 0..300 {
        let place = Place::new();
        let mut child = place.spawn(ply, &["--threads", "1"]);
        let phase = loop {
            let phase = place.journaled();
            if child.try_wait().unwrap().is_some() || phase.as_ref().is_some_and(|phase| !phases.contains(phase)) {
                break phase;
            }
            std::thread::yield_now();
        };
        child.kill().unwrap();
        child.wait().unwrap();
        let Some(phase) = place.journaled().filter(|_| phase.is_some()) else { continue };
        let ran = place.resume(ply).done();
        assert_eq!(ran.json()["resumed_after"], *phase);
        place.expect_done(bytes);
        phases.insert(phase);
        if phases.len() == expected.len() {
            break;
        }
    }
    println!("{phases:?}");
    assert!(phases.iter().map(String::as_str).eq(expected), "{phases:?}");
}
