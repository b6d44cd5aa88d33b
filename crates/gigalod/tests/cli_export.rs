//! `gigalod export`: what it writes is read again, and is the model.

mod cli_support;
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "common/hybrid.rs"]
mod hybrid;

use cli_support::statue;
use gigalod::import::{Batch, read_all};
use gigalod_reference::Bvh;
use gigalod_reference::distance::{Sampling, two_sided};
use glam::DVec3;
use std::collections::HashSet;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

fn read(path: &Path) -> Batch {
    let mut stream = gigalod::import::open(Box::new(File::open(path).unwrap())).unwrap();
    read_all(&mut *stream, &mut |_, _| {}).unwrap()
}

fn distances(one: &Path, other: &Path) -> f64 {
    let (one, other) = (hybrid::mesh(one), hybrid::mesh(other));
    let sampling = Sampling { points: 50_000, min_per_triangle: 1 };
    two_sided(&Bvh::build(&one), &Bvh::build(&other), sampling).unwrap().hausdorff()
}

#[test]
fn what_is_exported_is_read_again_in_all_three_formats() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    hybrid::write(&at("statue.ply"), true);
    run!["build", at("statue.ply"), "-o", at("a.glod"), "--as", "hybrid", "--tmax", "1024"].done();
    let info = run!["info", at("a.glod"), "--json"].done().json();
    let verified = run!["verify", at("a.glod"), "--against", at("statue.ply"), "--json"].done().json();
    let error = verified["measured"]["hausdorff"].as_f64().unwrap();
    let leaves = verified["structure"]["cuts"].as_array().unwrap().last().unwrap()["triangles"].as_u64().unwrap();
    assert!(info["levels"].as_u64().unwrap() > 2, "{info}");

    let mut found = Vec::new();
    for name in ["out.ply", "out.obj", "out.glb"] {
        let json = run!["export", at("a.glod"), "-o", at(name), "--json"].done().json();
        assert_eq!(cli_support::shape(&json), "{bytes output points seconds triangles vertices}");
        assert_eq!(json["bytes"], std::fs::metadata(at(name)).unwrap().len());
        let model = read(&at(name));
        assert_eq!(json["triangles"], model.triangles.len(), "{name}");
        assert_eq!(json["vertices"], model.vertices.positions.len(), "{name}");
        assert_eq!(json["triangles"], leaves, "{name}");
        // Each place once: the statue is closed, so its vertices are half its triangles.
        let places: HashSet<[u64; 3]> =
            model.vertices.positions.iter().map(|at| at.to_array().map(f64::to_bits)).collect();
        assert_eq!(places.len(), model.vertices.positions.len(), "{name}");
        let apart = distances(&at(name), &at("statue.ply"));
        assert!(apart <= error * 1.01 + 1e-6, "{name}: {apart}, {error}");
        found.push(model);
    }
    let [ply, obj, glb] = &found[..] else { unreachable!() };
    assert!([&obj.triangles, &glb.triangles] == [&ply.triangles; 2]);
    // Both are in single precision, but one of them in decimals.
    let narrow = |all: &Batch| all.vertices.positions.iter().map(|at| at.as_vec3()).collect::<Vec<_>>();
    assert!(narrow(obj) == narrow(ply));
    let apart = |a: &DVec3, b: &DVec3| a.distance(*b);
    let most = |all: &Batch| {
        all.vertices.positions.iter().zip(&ply.vertices.positions).map(|(a, b)| apart(a, b)).fold(0.0, f64::max)
    };
    assert!(most(glb) < 1e-6, "{}", most(glb));
    assert!([&obj.vertices.colors, &glb.vertices.colors] == [&ply.vertices.colors; 2]);
    assert!(ply.vertices.colors.iter().any(|color| *color != ply.vertices.colors[0]));
    for (one, other) in glb.vertices.normals.iter().zip(&ply.vertices.normals) {
        assert!(one.distance(*other) < 1e-5 && (one.length() - 1.0).abs() < 1e-5, "{one} {other}");
    }
}

#[test]
fn a_larger_error_leaves_less_and_keeps_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    run!["build", statue().ply, "-o", at("a.glod"), "--as", "hybrid", "--tmax", "1024", "--appearance", "off"].done();
    let mut before = u64::MAX;
    for error in ["0", "0.012", "0.03", "1000"] {
        let json = run!["export", at("a.glod"), "-o", at("out.ply"), "--error", error, "--json"].done().json();
        let triangles = json["triangles"].as_u64().unwrap();
        assert!(triangles > 0 && triangles < before, "{triangles} after {before}");
        before = triangles;
        let apart = distances(&at("out.ply"), &statue().ply);
        let least: f64 = error.parse::<f64>().unwrap().max(0.002);
        assert!(apart <= least, "{apart}, {error}");
    }
    let per_level = run!["info", at("a.glod"), "--json"].done().json()["per_level"].clone();
    assert_eq!(per_level[0]["triangles"], before, "the root alone");
}

#[test]
fn splats_are_exported_as_points() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    run!["build", statue().ply, "-o", at("a.glod"), "--as", "splats"].done();
    let info = run!["info", at("a.glod"), "--json"].done().json();
    for name in ["out.ply", "out.glb", "out.obj"] {
        let json = run!["export", at("a.glod"), "-o", at(name), "--json"].done().json();
        assert_eq!((&json["triangles"], &json["vertices"]), (&0.into(), &0.into()), "{name}");
        let leaves = info["leaves"].as_u64().unwrap() - info["repeated"].as_u64().unwrap();
        assert!(json["points"].as_u64().unwrap().abs_diff(leaves) <= 2, "{json}, {leaves}");
        if name != "out.obj" {
            let model = read(&at(name));
            assert_eq!(
                (json["points"].as_u64().unwrap(), 0),
                (model.vertices.positions.len() as u64, model.triangles.len())
            );
        }
    }
    let fewer = run!["export", at("a.glod"), "-o", at("out.ply"), "--error", "0.3", "--json"].done().json();
    assert!(fewer["points"].as_u64().unwrap() * 4 < info["leaves"].as_u64().unwrap(), "{fewer}");
}

#[test]
fn what_cannot_be_exported_is_said_in_one_line_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    run!["build", statue().ply, "-o", at("a.glod"), "--as", "hybrid"].done();
    let why = run!["export", at("a.glod"), "-o", at("a.stl"), "--json"].failed(&at("a.stl"));
    assert!(why.contains(".ply, .obj or .glb"), "{why}");
    let why = run!["export", statue().ply, "-o", at("a.ply"), "--json"].failed(&statue().ply);
    assert!(!why.is_empty());
    assert_eq!(run!["export", at("a.glod"), "-o", at("a.ply"), "--error=-1"].status, 2);
    let mut damaged = std::fs::read(at("a.glod")).unwrap();
    damaged[last_page_byte(&at("a.glod"))] ^= 1;
    std::fs::write(at("b.glod"), damaged).unwrap();
    let why = run!["export", at("b.glod"), "-o", at("a.ply"), "--json"].failed(&at("b.glod"));
    assert!(why.contains("checksum"), "{why}");
    assert_eq!(cli_support::names_in(folder.path()), ["a.glod", "b.glod"]);
}

/// Where the last page has its last byte: a leaf's, which every export reads.
fn last_page_byte(path: &Path) -> usize {
    let store = gigalod::format::FileStore::open(path).unwrap();
    let container = gigalod::format::Container::open(Arc::new(store)).unwrap();
    let file = gigalod::format::hybrid::HybridFile::open(container).unwrap();
    let last = file.skeleton().nodes().iter().rposition(|node| node.bytes > 0).unwrap();
    let node = gigalod::format::hybrid::NodeId(last as u32);
    file.skeleton().page_offset(node) as usize + file.skeleton().record(node).bytes as usize - 1
}
