//! The judge of hybrid files: finds nothing in files that were built from real scans, and whatever is forged.

// The judge needs no pictures.
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "common/hybrid.rs"]
mod common;

use common::{Forged, built, scan, statue};
use gigalod::build::Options;
use gigalod::format::hybrid::NodeId;
use gigalod::verify::hybrid::{Way, against, check};

#[test]
fn no_node_of_a_real_scan_is_beyond_its_error() {
    for name in ["bun_zipper.ply", "dragon_vrip_res2.ply.gz"] {
        let Some(path) = scan(name) else { return };
        let folder = tempfile::tempdir().unwrap();
        let options = Options { keeps_looks: false, ..Options::default() };
        let (file, mesh) = built(&path, &options, folder.path());
        let (structure, problems) = check(&file, &mut |_| {});
        assert_eq!(problems.told, [""; 0], "{name}");
        assert_eq!(
            *structure.cuts.last().unwrap(),
            file.skeleton()
                .nodes()
                .iter()
                .filter(|node| node.children == 0)
                .map(|node| u64::from(node.triangles))
                .sum::<u64>()
        );
        let measured = against(&file, &mesh, &|_| {}).unwrap();
        assert_eq!(measured.violations, [], "{name}");
        assert_eq!(measured.nodes, file.skeleton().root().nodes);
        assert!(measured.worst_ratio <= 1.0 + 1e-6 && measured.median_ratio >= 0.3, "{name}: {measured:?}");
        assert!(
            measured.hausdorff > 0.0 && measured.rms > 0.0 && measured.rms < measured.hausdorff,
            "{name}: {measured:?}"
        );
    }
}

/// Its ground is cut, and its parts lie deeper than they would have to.
#[test]
fn nor_one_of_a_statue_on_a_large_ground() {
    let folder = tempfile::tempdir().unwrap();
    let (_, mesh) = statue(folder.path());
    let bounds = mesh.bounds();
    let mut obj = String::new();
    let mut vertex = |at: [f64; 3]| obj.push_str(&format!("v {} {} {}\n", at[0], at[1], at[2]));
    mesh.positions().iter().for_each(|at| vertex(at.to_array()));
    let (middle, reach, first) = (bounds.center(), 20.0 * bounds.diagonal(), mesh.positions().len() + 1);
    for [x, z] in [[-1.0, -1.0], [0.9, -1.0], [1.0, 1.0], [-1.0, 0.8]] {
        vertex([middle.x + x * reach, bounds.min.y + 0.01 * x, middle.z + z * reach]);
    }
    let faces = mesh.triangles().iter().map(|corners| corners.map(|corner| corner as usize + 1));
    for [a, b, c] in faces.chain([[first, first + 2, first + 1], [first, first + 3, first + 2]]) {
        obj.push_str(&format!("f {a} {b} {c}\n"));
    }
    let path = folder.path().join("on_ground.obj");
    std::fs::write(&path, obj).unwrap();
    let options = Options { most_triangles: Some(512), ..Options::default() };
    let (file, mesh) = built(&path, &options, folder.path());
    assert_eq!(check(&file, &mut |_| {}).1.told, [""; 0]);
    let measured = against(&file, &mesh, &|_| {}).unwrap();
    assert_eq!(measured.violations, []);
    let leaves = || file.skeleton().nodes().iter().filter(|node| node.children == 0);
    let most = leaves().map(|leaf| leaf.error_geo).fold(0.0, f32::max);
    assert!(f64::from(most) < 2e-5 * mesh.bounds().diagonal(), "{most}: the ground is where it was");
}

#[test]
fn a_vertex_that_is_moved_beyond_the_error_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (file, mesh) = statue(folder.path());
    let mut forged = Forged::of(&file);
    let node = forged.inner();
    let error = forged.records[node].error_geo;
    // Along the box's longest side, where there is room for it.
    let axis = (0..3).max_by_key(|axis| forged.records[node].extent_steps[*axis]).unwrap();
    let step = file.skeleton().step(forged.records[node].level);
    let away = (f64::from(error) * 8.0 / step) as u16;
    let at = &mut forged.pages[node].positions[0][axis];
    *at = if *at > away { *at - away } else { *at + away };
    // It may show its back now.
    forged.records[node].cone_sine = 1.0;
    let forged = forged.open();
    assert_eq!(check(&forged, &mut |_| {}).1.told, [""; 0], "nothing is wrong by itself");
    let measured = against(&forged, &mesh, &|_| {}).unwrap();
    let [violation] = measured.violations[..] else { panic!("one node, {measured:?}") };
    assert_eq!(violation.node, NodeId(node as u32));
    assert!(measured.worst_ratio > 1.5 && violation.measured > violation.stored, "{measured:?}");
    assert!(violation.to_string().contains(&format!("node {node} (level ")), "{violation}");
}

#[test]
fn a_node_that_claims_less_error_than_it_has_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (file, mesh) = statue(folder.path());
    let mut forged = Forged::of(&file);
    let node = forged.inner();
    forged.records[node].error_geo *= 0.05;
    let forged = forged.open();
    assert_eq!(check(&forged, &mut |_| {}).1.told, [""; 0], "nothing is wrong by itself");
    let found: Vec<u32> = against(&forged, &mesh, &|_| {}).unwrap().violations.iter().map(|it| it.node.0).collect();
    assert_eq!(found, [node as u32]);
}

#[test]
fn what_is_missing_in_a_node_is_found_from_the_original() {
    let folder = tempfile::tempdir().unwrap();
    let (file, mesh) = statue(folder.path());
    let mut forged = Forged::of(&file);
    let node = forged.inner();
    // The first half, in the page's order, which goes from neighbour to neighbour.
    let half = forged.pages[node].triangles.len() / 2;
    forged.pages[node].triangles.drain(..half);
    forged.tidy(node);
    let measured = against(&forged.open(), &mesh, &|_| {}).unwrap();
    assert!(measured.violations.iter().any(|violation| violation.way == Way::Forward), "{measured:?}");
    assert!(measured.violations.iter().all(|violation| violation.way == Way::Forward), "{measured:?}");
}

#[test]
fn records_that_contradict_their_page_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let (file, _) = statue(folder.path());
    let found = |change: &dyn Fn(&mut Forged)| {
        let mut forged = Forged::of(&file);
        change(&mut forged);
        let told = check(&forged.open(), &mut |_| {}).1.told;
        assert!(!told.is_empty());
        told.join("\n")
    };
    let cone = found(&|forged| {
        let node = forged.with_cone();
        forged.records[node].cone_axis = forged.records[node].cone_axis.map(|x| -x);
    });
    let narrow = found(&|forged| {
        let node = forged.with_cone();
        forged.records[node].cone_sine = 0.01;
    });
    assert!(cone.contains("cone") && narrow.contains("cone"), "{cone}\n{narrow}");
    let error = found(&|forged| {
        let root = &mut forged.records[0];
        root.error_geo *= 4.0;
        root.error_total = root.error_total.max(root.error_geo);
    });
    assert!(error.contains("node 0: an error of geometry of"), "{error}");
}
