//! What `write_statue` promises, read back from its bytes.

mod common;

use common::{Mesh, fnv, on_threads, read};
use gigalod_synth::{Order, StatueOptions, SynthError, write_statue};

fn statue_bytes(options: StatueOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut last = (0, 0);
    let written = write_statue(options, &mut bytes, &mut |done, total| {
        assert!(done >= last.0 && done <= total, "progress went from {last:?} to {done} of {total}");
        last = (done, total);
    })
    .unwrap();
    assert_eq!(written.bytes, bytes.len() as u64);
    assert_eq!(last, (written.bytes, written.bytes));
    bytes
}

fn options(triangles: u64, seed: u64) -> StatueOptions {
    StatueOptions { triangles, seed, colors: true, order: Order::Coherent }
}

fn statue(options: StatueOptions) -> Mesh {
    read(&statue_bytes(options))
}

#[test]
fn statue_is_closed_and_faces_outwards() {
    for (triangles, seed) in [(12, 1), (100, 2), (1_000, 3), (20_000, 4)] {
        let mesh = statue(options(triangles, seed));
        let edges = mesh.directed_edges();
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "{triangles}: open");
        assert!(mesh.volume() > 0.3, "{triangles}: volume {}", mesh.volume());
        assert_eq!(mesh.positions.len() * 2, mesh.triangles.len() + 4, "{triangles}: not a sphere");
    }
}

#[test]
fn triangle_count_is_met_within_one_percent() {
    for triangles in [1_000, 1_234, 2_000, 3_333, 5_000, 7_919, 10_000, 31_415, 100_000] {
        let mut counter = std::io::sink();
        let written = write_statue(options(triangles, 1), &mut counter, &mut |_, _| {}).unwrap();
        let off = written.triangles as f64 / triangles as f64 - 1.0;
        assert!(off.abs() < 0.01, "{triangles}: {}", written.triangles);
    }
}

#[test]
fn statue_stands_on_the_ground_and_is_as_tall_as_promised() {
    for seed in [1, 2, 3] {
        let mesh = statue(options(20_000, seed));
        let range = |axis: usize| {
            let values = || mesh.positions.iter().map(|p| p[axis]);
            (values().fold(f32::INFINITY, f32::min), values().fold(f32::NEG_INFINITY, f32::max))
        };
        let (low, high) = range(1);
        assert!(low.abs() < 1e-6 && (high - 2.7).abs() < 0.15, "{seed}: y from {low} to {high}");
        for axis in [0, 2] {
            let (low, high) = range(axis);
            assert!((low + high).abs() < 0.3 && high < 1.1, "{seed}: axis {axis} from {low} to {high}");
        }
    }
}

#[test]
fn spacing_is_even() {
    for seed in [1, 2] {
        let lengths = statue(options(200_000, seed)).edge_lengths();
        let at = |share: f64| lengths[((lengths.len() - 1) as f64 * share) as usize];
        let (median, p999, longest) = (at(0.5), at(0.999), at(1.0));
        println!("seed {seed}: median {median:.5} m, 99.9 % {:.2}×, longest {:.2}×", p999 / median, longest / median);
        assert!(p999 < 6.0 * median, "99.9th percentile is {}× the median", p999 / median);
        assert!(at(0.001) > median / 20.0 && lengths[0] > 0.0, "shortest {}", lengths[0]);
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let one = on_threads(1, || statue_bytes(options(3_000, 5)));
    for threads in [2, 5] {
        assert_eq!(fnv(&one), fnv(&on_threads(threads, || statue_bytes(options(3_000, 5)))), "{threads} threads");
    }
}

/// Changes only when the statue is meant to change; equal on every machine and in every build.
#[test]
fn bytes_are_pinned() {
    assert_eq!(format!("{:016x}", fnv(&statue_bytes(options(2_000, 1)))), "42c166b5c4348198");
}

#[test]
fn both_orders_hold_the_same_triangles() {
    let coherent = statue(options(5_000, 6));
    let shuffled = statue(StatueOptions { order: Order::Shuffled, ..options(5_000, 6) });
    assert_ne!(coherent.positions, shuffled.positions);
    assert!(coherent.triangle_soup() == shuffled.triangle_soup(), "the meshes differ by more than numbering");
}

#[test]
fn coherent_triangles_lie_near_their_neighbours_in_the_file() {
    let mesh = statue(options(20_000, 1));
    let near = mesh.triangles.windows(2).filter(|pair| pair[0].iter().any(|corner| pair[1].contains(corner))).count();
    assert!(near as f64 > 0.99 * mesh.triangles.len() as f64, "{near} of {}", mesh.triangles.len());
}

#[test]
fn seeds_and_colors_change_what_they_say() {
    let (a, b) = (statue(options(2_000, 1)), statue(options(2_000, 2)));
    assert_ne!(a.positions, b.positions);
    assert_eq!(a.triangles, b.triangles);
    let plain = statue(StatueOptions { colors: false, ..options(2_000, 1) });
    assert!(plain.colors.is_empty() && !plain.header.contains("red"));
    assert_eq!(plain.positions, a.positions);
}

#[test]
fn a_larger_statue_is_the_same_statue() {
    // The topmost point and the widest place agree between sizes to about the coarser one's spacing.
    let extent = |triangles| {
        let mesh = statue(options(triangles, 1));
        [0, 1, 2].map(|axis| mesh.positions.iter().map(|p| p[axis]).fold(f32::NEG_INFINITY, f32::max))
    };
    let (small, large) = (extent(10_000), extent(80_000));
    for axis in 0..3 {
        assert!((small[axis] - large[axis]).abs() < 0.03, "{small:?} {large:?}");
    }
}

#[test]
fn refused_counts_say_the_limits_and_a_full_disk_is_an_error() {
    let error = write_statue(options(0, 1), &mut Vec::new(), &mut |_, _| {}).unwrap_err();
    assert_eq!(error.to_string(), "cannot make 0 triangles: the number must lie between 12 and 4290000000");
    let mut small = [0_u8; 1000];
    let error = write_statue(options(2_000, 1), &mut small.as_mut_slice(), &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, SynthError::Io { .. }));
}
