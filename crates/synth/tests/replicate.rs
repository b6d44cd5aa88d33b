//! What `write_replicas` promises, read back from its bytes.

mod common;

use common::{Mesh, fnv, on_threads, read};
use gigalod_synth::{Order, ReplicaOptions, Scan, StatueOptions, SynthError, write_replicas, write_statue};

/// A small closed scan with colours.
fn scan() -> Scan {
    let mut bytes = Vec::new();
    write_statue(StatueOptions { triangles: 2_000, ..StatueOptions::default() }, &mut bytes, &mut |_, _| {}).unwrap();
    let mesh = read(&bytes);
    Scan { positions: mesh.positions, triangles: mesh.triangles, colors: Some(mesh.colors) }
}

fn replica_bytes(scan: &Scan, triangles: u64, order: Order) -> Vec<u8> {
    let mut bytes = Vec::new();
    let written =
        write_replicas(scan, ReplicaOptions { triangles, seed: 11, order }, &mut bytes, &mut |_, _| {}).unwrap();
    assert_eq!((written.triangles, written.bytes), (triangles, bytes.len() as u64));
    bytes
}

fn replicas(triangles: u64, order: Order) -> Mesh {
    read(&replica_bytes(&scan(), triangles, order))
}

#[test]
fn replica_count_is_exact_and_no_vertex_is_unused() {
    for triangles in [1, 2, 999, 1_000, 12_345, 60_000] {
        let mesh = replicas(triangles, Order::Coherent);
        assert_eq!(mesh.triangles.len() as u64, triangles);
        let mut used = vec![false; mesh.positions.len()];
        for corner in mesh.triangles.iter().flatten() {
            used[*corner as usize] = true;
        }
        assert!(used.iter().all(|used| *used), "{triangles}");
        assert!(mesh.positions.iter().flatten().all(|x| x.is_finite()));
        assert_eq!(mesh.colors.len(), mesh.positions.len());
    }
}

#[test]
fn replicas_have_open_borders_and_uneven_density() {
    let mesh = replicas(60_000, Order::Coherent);
    let mut edges: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    edges.sort_unstable();
    let open = edges.iter().filter(|&&(a, b)| edges.binary_search(&(b, a)).is_err()).count();
    assert!(open > 300, "{open} open edges");
    let lengths = mesh.edge_lengths();
    let ratio = lengths[lengths.len() * 9 / 10] / lengths[lengths.len() / 10];
    assert!(ratio > 4.0, "edges differ only by {ratio}");
}

#[test]
fn both_orders_hold_the_same_triangles() {
    let (coherent, shuffled) = (replicas(9_000, Order::Coherent), replicas(9_000, Order::Shuffled));
    assert_ne!(coherent.positions, shuffled.positions);
    assert!(coherent.triangle_soup() == shuffled.triangle_soup());
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let scan = scan();
    let one = fnv(&on_threads(1, || replica_bytes(&scan, 9_000, Order::Coherent)));
    for threads in [2, 5] {
        assert_eq!(one, fnv(&on_threads(threads, || replica_bytes(&scan, 9_000, Order::Coherent))), "{threads}");
    }
    // Changes only when the heap or the statue is meant to change; equal on every machine and in every build.
    assert_eq!(format!("{one:016x}"), "da3498bdaaa61dc5");
}

#[test]
fn a_scan_without_colors_gives_replicas_without_colors() {
    let scan = Scan { colors: None, ..scan() };
    let mesh = read(&replica_bytes(&scan, 3_000, Order::Shuffled));
    assert!(mesh.colors.is_empty() && mesh.positions.len() > 500);
}

#[test]
fn unusable_scans_are_refused_with_the_reason() {
    let refused = |scan: &Scan| {
        let options = ReplicaOptions { triangles: 10, seed: 1, order: Order::Coherent };
        write_replicas(scan, options, &mut Vec::new(), &mut |_, _| {}).unwrap_err().to_string()
    };
    let one =
        Scan { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]], colors: None };
    assert_eq!(refused(&Scan::default()), "the scan to copy has no triangle with an area (0 vertices, 0 triangles)");
    assert_eq!(
        refused(&Scan { triangles: vec![[0, 1, 2], [0, 1, 3]], ..one.clone() }),
        "triangle 1 of the scan names vertex 3, but there are 3 vertices"
    );
    assert_eq!(refused(&Scan { colors: Some(vec![]), ..one.clone() }), "the scan has 0 colours for 3 vertices");
    let mut wild = one.clone();
    wild.positions[2][1] = f32::NAN;
    assert_eq!(refused(&wild), "vertex 2 of the scan has a coordinate that is not finite or beyond 1e30");
    // A single triangle is a scan.
    let options = ReplicaOptions { triangles: 7, seed: 1, order: Order::Coherent };
    let written = write_replicas(&one, options, &mut Vec::new(), &mut |_, _| {}).unwrap();
    assert_eq!(written.triangles, 7);
    assert!(matches!(
        write_replicas(&one, ReplicaOptions { triangles: 0, ..options }, &mut Vec::new(), &mut |_, _| {}),
        Err(SynthError::TriangleCount { asked: 0, .. })
    ));
}
