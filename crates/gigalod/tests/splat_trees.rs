//! Properties of built hierarchies. The judge walks the finished file from its root and knows nothing of how it was made.

mod common;

use common::{built, mesh, open, scan};
use gigalod::build::{BuildError, NoProgress, Options, splats};
use gigalod::geom::camera::UpAxis;
use gigalod::import::{Attributes, Batch, ImportError, ModelStream};
use gigalod::verify;
use gigalod_reference::Mesh;
use glam::DVec3;
use proptest::prelude::*;
use std::path::Path;

/// A mesh as a stream, in batches of three.
struct FromMemory {
    positions: Vec<DVec3>,
    colors: Vec<[u8; 3]>,
    triangles: Vec<[u32; 3]>,
    sent: usize,
}

impl FromMemory {
    fn new(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Self {
        let positions = positions.iter().map(|p| DVec3::from_array(*p)).collect();
        Self { positions, colors: vec![], triangles: triangles.to_vec(), sent: 0 }
    }
}

impl ModelStream for FromMemory {
    fn attributes(&self) -> Attributes {
        Attributes { normals: false, colors: !self.colors.is_empty() }
    }

    fn declared_vertices(&self) -> Option<u64> {
        Some(self.positions.len() as u64)
    }

    fn declared_faces(&self) -> Option<u64> {
        Some(self.triangles.len() as u64)
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        let range = |len: usize| self.sent.min(len)..(self.sent + 3).min(len);
        batch.vertices.positions.extend(&self.positions[range(self.positions.len())]);
        batch.vertices.colors.extend(&self.colors[range(self.colors.len())]);
        batch.triangles.extend(&self.triangles[range(self.triangles.len())]);
        self.sent += 3;
        Ok(!(batch.vertices.positions.is_empty() && batch.triangles.is_empty()))
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        (0, 0)
    }
}

fn build(stream: FromMemory, options: &Options, out: &Path) -> Result<(), BuildError> {
    splats::build(Box::new(stream), options, &NoProgress, out).map(drop)
}

/// Builds the mesh and holds the file against it.
fn builds_soundly(positions: &[[f64; 3]], triangles: &[[u32; 3]]) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    // As a scan has them: however large triangles are, their vertices are all there is.
    let options = Options { spacing: Some(f64::MAX), ..Options::default() };
    build(FromMemory::new(positions, triangles), &options, &out).unwrap();
    let file = open(&out);
    let (tree, problems) = verify::check(&file, &mut |_| {});
    assert_eq!(problems.told, Vec::<String>::new());
    let positions = positions.iter().map(|p| DVec3::from_array(*p)).collect();
    let mesh = Mesh::new(positions, None, None, triangles.to_vec()).unwrap();
    let measured = verify::against(&tree, file.skeleton().root().origin, &mesh, None, &|_| ());
    assert_eq!(measured.violations, 0, "{measured:?}");
    let mut referenced: Vec<u32> = triangles.as_flattened().to_vec();
    referenced.sort_unstable();
    referenced.dedup();
    assert_eq!(file.skeleton().root().leaves, referenced.len() as u64);
    assert!(tree.nodes.iter().all(|node| node.children != 1 && node.children <= 4));
}

fn soups() -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<[u32; 3]>)> {
    // Few distinct coordinates make coinciding vertices and degenerate triangles; scales and offsets make rounding hurt.
    let coordinate = prop_oneof![(-4i32..4).prop_map(f64::from), -1.0f64..1.0];
    (
        prop::collection::vec(prop::array::uniform3(coordinate), 1..60),
        prop_oneof![Just(1.0), Just(1e-9), Just(1e9)],
        prop_oneof![Just(0.0), Just(1e6)],
    )
        .prop_flat_map(|(positions, scale, offset)| {
            let positions: Vec<[f64; 3]> = positions.iter().map(|p| p.map(|x| x * scale + offset)).collect();
            let count = positions.len() as u32;
            let triangles = prop::collection::vec(prop::array::uniform3(0..count), 1..80);
            (Just(positions), triangles)
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn every_decoded_sphere_encloses_its_true_sphere_in_random_soups((positions, triangles) in soups()) {
        builds_soundly(&positions, &triangles);
    }
}

#[test]
fn nasty_meshes_build_soundly() {
    builds_soundly(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
    builds_soundly(&[[5.0; 3]], &[[0, 0, 0]]);
    // A thousand vertices in one place, which no plane can separate.
    let same = vec![[1.0, 2.0, 3.0]; 1000];
    let triangles: Vec<[u32; 3]> = (0..998).map(|i| [i, i + 1, i + 2]).collect();
    builds_soundly(&same, &triangles);
    // Distances that halve: as deep a tree as f32 allows.
    let halving: Vec<[f64; 3]> = (0..120).map(|i| [0.5f64.powi(i), 0.0, 0.0]).collect();
    builds_soundly(&halving, &triangles[..118]);
    // Neighbouring f32 numbers: the midpoint falls on one of them.
    let close: Vec<[f64; 3]> = (0..9).map(|i| [1.0 + f64::from(i) * f64::from(f32::EPSILON), 1.0, 1.0]).collect();
    builds_soundly(&close, &triangles[..7]);
}

#[test]
fn what_is_too_wide_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let wide = FromMemory::new(&[[-1e300, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0; 3]], &[[0, 1, 2]]);
    let error = build(wide, &Options::default(), &out).unwrap_err();
    assert!(error.to_string().starts_with("the model is 2e300 units wide"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

/// A wavy grid of `side`² vertices, coloured.
fn wavy_grid(side: u32) -> FromMemory {
    let positions = (0..side * side).map(|i| {
        let (x, y) = (f64::from(i % side), f64::from(i / side));
        DVec3::new(x, y, (x * 0.31).sin() * (y * 0.17).cos() * 5.0)
    });
    let triangles = (0..(side - 1) * (side - 1)).flat_map(|i| {
        let a = i / (side - 1) * side + i % (side - 1);
        [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]
    });
    let colors = (0..side * side).map(|i| [(i % 256) as u8, (i / 256 % 256) as u8, 40]);
    FromMemory { positions: positions.collect(), colors: colors.collect(), triangles: triangles.collect(), sent: 0 }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |threads: usize| {
        let out = folder.path().join("out.glod");
        build(wavy_grid(150), &Options { threads, ..Options::default() }, &out).unwrap();
        std::fs::read(&out).unwrap()
    };
    let one = bytes(1);
    assert!(one == bytes(2) && one == bytes(5));
}

#[test]
fn bytes_do_not_depend_on_the_memory() {
    let folder = tempfile::tempdir().unwrap();
    // 160,000 vertices are several chunks, and far too many for the smallest budgets: those build in files.
    for side in [150, 400] {
        let bytes = |memory_bytes: u64| {
            let out = folder.path().join("out.glod");
            build(wavy_grid(side), &Options { memory_bytes, ..Options::default() }, &out).unwrap();
            std::fs::read(&out).unwrap()
        };
        let large = bytes(2 << 30);
        assert!(large == bytes(64 << 20) && large == bytes(8 << 20) && large == bytes(1 << 20), "{side}");
    }
}

/// The same mesh, its vertices and triangles in no order.
fn shuffled(mesh: FromMemory) -> FromMemory {
    // A step without a common factor visits all.
    let visit = |count: usize| (0..count).map(move |i| (i * 1_000_003 + 17) % count);
    let order: Vec<usize> = visit(mesh.positions.len()).collect();
    let mut rank = vec![0; order.len()];
    for (place, vertex) in order.iter().enumerate() {
        rank[*vertex] = place as u32;
    }
    let triangle = |at: usize| mesh.triangles[at].map(|vertex| rank[vertex as usize]);
    FromMemory {
        positions: order.iter().map(|vertex| mesh.positions[*vertex]).collect(),
        colors: order.iter().map(|vertex| mesh.colors[*vertex]).collect(),
        triangles: visit(mesh.triangles.len()).map(triangle).collect(),
        sent: 0,
    }
}

#[test]
fn bytes_do_not_depend_on_the_order_of_the_input() {
    let folder = tempfile::tempdir().unwrap();
    // With coordinates that `f32` has, and without; in memory, where a mesh in no order is sorted, and in files.
    for scale in [0.5, 0.1] {
        let mesh = || {
            let mut mesh = wavy_grid(300);
            for position in &mut mesh.positions {
                *position = (position.as_vec3() * scale as f32).as_dvec3() + DVec3::splat(scale - 0.5);
            }
            mesh
        };
        let bytes = |mesh: FromMemory, memory_bytes: u64| {
            let out = folder.path().join("out.glod");
            build(mesh, &Options { memory_bytes, ..Options::default() }, &out).unwrap();
            std::fs::read(&out).unwrap()
        };
        let in_order = bytes(mesh(), 2 << 30);
        assert!(bytes(shuffled(mesh()), 2 << 30) == in_order, "in memory, {scale}");
        assert!(bytes(shuffled(mesh()), 4 << 20) == in_order, "in files, {scale}");
    }
}

#[test]
fn a_crowd_that_no_plane_can_separate_needs_memory_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let positions = vec![[1.0, 2.0, 3.0]; 70_000];
    let triangles: Vec<[u32; 3]> = (0..69_998).map(|i| [i, i + 1, i + 2]).collect();
    let options = |memory_bytes| Options { memory_bytes, ..Options::default() };
    let error = build(FromMemory::new(&positions, &triangles), &options(1 << 20), &out).unwrap_err();
    assert_eq!(error.to_string(), "70000 vertices in one place, expected at most 65536 within this budget");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
    build(FromMemory::new(&positions, &triangles), &options(1 << 30), &out).unwrap();
    assert_eq!(open(&out).skeleton().root().leaves, 70_000);
}

#[test]
fn a_tree_of_several_chunks_is_sound() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let grid = wavy_grid(420);
    let mesh = Mesh::new(grid.positions.clone(), None, None, grid.triangles.clone()).unwrap();
    build(grid, &Options::default(), &out).unwrap();
    let file = open(&out);
    let (tree, problems) = verify::check(&file, &mut |_| {});
    assert_eq!(problems.told, Vec::<String>::new());
    let measured = verify::against(&tree, file.skeleton().root().origin, &mesh, None, &|_| ());
    assert_eq!(measured.violations, 0, "{measured:?}");
}

#[test]
fn up_is_the_formats_unless_the_user_says_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    for (up, expected) in [(None, UpAxis::Y), (Some(UpAxis::Z), UpAxis::Z)] {
        build(wavy_grid(30), &Options { up, ..Options::default() }, &out).unwrap();
        assert_eq!(open(&out).skeleton().root().up, expected);
    }
}

/// Sizes and enclosure on a real scan.
fn real_scan_builds_soundly(name: &str, most_bytes_per_leaf: f64) {
    let Some(path) = scan(name) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = built(&path, folder.path());
    let (tree, problems) = verify::check(&file, &mut |_| {});
    assert_eq!(problems.told, Vec::<String>::new());
    let measured = verify::against(&tree, file.skeleton().root().origin, &mesh(&path), None, &|_| ());
    assert_eq!(measured.violations, 0, "{measured:?}");
    let metadata = file.container().read_metadata().unwrap();
    let per_leaf = metadata.raw_bytes as f64 / metadata.leaves as f64;
    let inner = metadata.nodes - metadata.leaves;
    let branching = (metadata.nodes - 1) as f64 / inner as f64;
    println!("{name}: {per_leaf:.3} raw bytes a leaf, {branching:.3} children a node, {measured:?}");
    assert!(per_leaf <= most_bytes_per_leaf, "{per_leaf} bytes a leaf");
    assert!(branching >= 3.5, "{branching} children a node");
}

#[test]
fn the_dragon_builds_soundly_within_6_2_bytes_a_leaf() {
    real_scan_builds_soundly("dragon_vrip.ply.gz", 6.2);
}

#[test]
fn the_bunny_builds_soundly_within_6_2_bytes_a_leaf() {
    real_scan_builds_soundly("bun_zipper.ply", 6.2);
}

#[test]
fn a_raw_range_map_builds_soundly_within_6_2_bytes_a_leaf() {
    real_scan_builds_soundly("rangemap_lato000.ply", 6.2);
}

#[test]
fn a_coloured_bust_builds_soundly_within_9_2_bytes_a_leaf() {
    real_scan_builds_soundly("laurana.ply", 9.2);
}

#[test]
fn a_non_manifold_dragon_builds_soundly() {
    real_scan_builds_soundly("dragon_vrip_res2.ply.gz", 6.2);
}
