//! Hybrid files on the command line: told of, looked around, and refused by what does not know them.

mod cli_support;
// The same made-up octree as in the tests of cuts.
#[allow(dead_code, reason = "cuts have their own tests")]
#[path = "../../runtime/tests/common/octree.rs"]
mod octree;

use octree::Octree;

#[test]
fn a_hybrid_file_is_told_of_with_its_levels() {
    let folder = tempfile::tempdir().unwrap();
    let (octree, file) = (Octree::sphere(5, true), folder.path().join("sphere.glod"));
    std::fs::write(&file, octree.bytes()).unwrap();
    let json = run!["info", file, "--json"].done().json();
    assert_eq!(json["kind"], "hybrid");
    assert_eq!(json["nodes"], octree.root.nodes);
    assert_eq!(json["closed"], true);
    let levels = json["per_level"].as_array().unwrap();
    assert_eq!(levels.len(), 5);
    let sum = |name: &str| levels.iter().map(|level| level[name].as_u64().unwrap()).sum::<u64>();
    assert_eq!(sum("nodes"), octree.root.nodes);
    assert_eq!(sum("triangles"), octree.records.iter().map(|record| u64::from(record.triangles)).sum::<u64>());
    assert_eq!(sum("points"), octree.records.iter().map(|record| u64::from(record.points)).sum::<u64>());
    let text = run!["info", file].done().stdout;
    assert!(text.contains("bytes an input triangle") && text.contains("triangles       points"), "{text}");
}

#[test]
fn a_camera_path_leads_around_a_hybrid_file() {
    let folder = tempfile::tempdir().unwrap();
    let (file, path) = (folder.path().join("sphere.glod"), folder.path().join("orbit.json"));
    std::fs::write(&file, Octree::sphere(3, false).bytes()).unwrap();
    run!["synth", "path", "orbit", "--around", file, "-o", path, "--seconds", "1"].done();
    let made: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let frames = made["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 31, "both ends");
    for frame in frames {
        let target = |axis: usize| frame["target"][axis].as_f64().unwrap();
        assert!((target(0) - 10.5).abs() < 1.0 && (target(1) + 19.5).abs() < 1.0, "{frame}");
    }
}

/// A picture of nothing and a status of 0 would say that all is well.
#[test]
fn a_budget_that_holds_nothing_is_an_error_that_says_what_would_do() {
    if !cli_support::can_draw() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (model, out) = (folder.path().join("sphere.glod"), folder.path().join("out.png"));
    std::fs::write(&model, Octree::sphere(4, false).bytes()).unwrap();
    let ran = run!["render", model, "-o", out, "--size", "64x64", "--cpu-budget", "1000"];
    assert_eq!(ran.status, 1, "{ran:?}");
    let needed = ran.stderr.split_whitespace().find_map(|word| word.parse::<u64>().ok()).expect("it says how many");
    let text = format!("error: the coarsest picture needs {needed} bytes of memory, expected at most 1000\n");
    assert_eq!(ran.stderr, text + "hint: give a larger --cpu-budget\n");
    assert!(!out.exists());
    run!["render", model, "-o", out, "--size", "64x64", "--cpu-budget", needed.to_string()].done();
    assert!(out.exists());
}

#[test]
fn a_damaged_hybrid_file_is_an_error_of_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let (file, octree) = (folder.path().join("sphere.glod"), Octree::sphere(4, false));
    let bytes = octree.bytes();
    // The skeleton comes before the pages.
    for at in [70, octree.file().skeleton().page_offset(gigalod::format::hybrid::NodeId(0)) as usize - 20] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x40;
        std::fs::write(&file, damaged).unwrap();
        let why = run!["info", file, "--json"].failed(&file);
        assert!(why.contains("checksum"), "{why}");
    }
}
