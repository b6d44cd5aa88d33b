//! Properties of hierarchies built from point clouds. The judge knows nothing of how they were made.

mod clouds;
mod common;

use common::open;
use gigalod::build::{BuildError, NoProgress, Options, splats};
use gigalod::format::splats::Node;
use gigalod::geom::camera::UpAxis;
use gigalod::geom::quantise::normal;
use gigalod::import::VertexBatch;
use gigalod::verify::{self, Measured, SplatTree};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::io::Cursor;
use std::path::Path;

fn build(points: &VertexBatch, options: &Options, out: &Path) -> Result<(), BuildError> {
    let stream = gigalod::import::open(Box::new(Cursor::new(clouds::ply(points)))).unwrap();
    splats::build(stream, options, &NoProgress, out).map(drop)
}

/// Builds a cloud and holds the file against it.
fn builds_soundly(points: &VertexBatch, options: &Options) -> (SplatTree, DVec3, Measured) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    build(points, options, &out).unwrap();
    let file = open(&out);
    let root = file.skeleton().root();
    let metadata = file.container().read_metadata().unwrap();
    let count = points.positions.len() as u64;
    assert!(root.leaves == count + metadata.repeated && !root.closed);
    let (tree, problems) = verify::check(&file, &mut |_| {});
    assert_eq!(problems.told, Vec::<String>::new());
    let measured = verify::against_points(&tree, root.origin, points, &|_| ());
    assert_eq!(measured.violations, 0, "{measured:?}");
    assert!(metadata.repeated <= tree.twins());
    assert_eq!((metadata.input.points, metadata.input.triangles), (count, 0));
    (tree, root.origin, measured)
}

fn leaves(tree: &SplatTree) -> impl Iterator<Item = (Vec3, f32, Vec3)> {
    let leaves = tree.nodes.iter().filter(|node| node.children == 0);
    leaves.map(|leaf| (leaf.sphere.center, leaf.sphere.radius, normal::decode(Node::normal(leaf.node))))
}

fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 31)
    }
}

/// Points all over a unit sphere, with colours.
fn ball(count: usize) -> VertexBatch {
    let mut random = random(7);
    let mut cloud = VertexBatch::default();
    while cloud.positions.len() < count {
        let at = DVec3::new(random(), random(), random()) * 2.0 - 1.0;
        if at.length() < 1.0 && at.length() > 0.1 {
            cloud.colors.push([(cloud.positions.len() % 256) as u8, 90, 40]);
            cloud.positions.push(at.normalize());
        }
    }
    cloud
}

fn soups() -> impl Strategy<Value = VertexBatch> {
    // Few distinct coordinates make coinciding points; scales and offsets make rounding hurt.
    let coordinate = prop_oneof![(-4i32..4).prop_map(f64::from), -1.0f64..1.0];
    (
        prop::collection::vec((prop::array::uniform3(coordinate), prop::array::uniform3(-1f32..1.0)), 1..300),
        prop_oneof![Just(1.0), Just(1e-9), Just(1e9)],
        prop_oneof![Just(0.0), Just(1e6)],
        0..3,
    )
        .prop_map(|(points, scale, offset, normals)| {
            let positions = points.iter().map(|(at, _)| DVec3::from_array(*at) * scale + offset).collect();
            let normal = |(number, (_, normal)): (usize, &(_, [f32; 3]))| {
                // All have one, or some.
                if normals == 1 || number % 3 == 0 { Vec3::from_array(*normal) } else { Vec3::ZERO }
            };
            let normals = if normals == 0 { vec![] } else { points.iter().enumerate().map(normal).collect() };
            VertexBatch { positions, normals, colors: vec![] }
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_clouds_build_soundly(points in soups()) {
        builds_soundly(&points, &Options::default());
    }
}

#[test]
fn nasty_clouds_build_soundly() {
    let of = |positions: Vec<[f64; 3]>| {
        builds_soundly(&clouds::plain(positions.into_iter().map(DVec3::from_array)), &Options::default())
    };
    of(vec![[5.0; 3]]);
    of(vec![[5.0; 3], [6.0; 3]]);
    // More in one place than a cell has room for; and beside others.
    of(vec![[1.0, 2.0, 3.0]; 40_000]);
    let two = (0..40_000).map(|i| [f64::from(i % 2), f64::from(i / 30_000), 0.0]);
    of(two.collect());
    // Distances that halve, and grow: as unequal as f32 allows.
    of((0..120).map(|i| [0.5f64.powi(i), 0.0, 0.0]).collect());
    of((0..60).map(|i| [2f64.powi(i), 3f64.powi(i / 2), 0.0]).collect());
    // A line, in several cells.
    of((0..50_000).map(|i| [f64::from(i), f64::from(i) * 2.0, 1e6]).collect());
    // Neighbouring f32 numbers.
    of((0..9).map(|i| [1.0 + f64::from(i) * f64::from(f32::EPSILON), 1.0, 1.0]).collect());
}

#[test]
fn nothing_at_all_and_what_is_too_wide_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let error = |positions: Vec<[f64; 3]>| {
        let points = clouds::plain(positions.into_iter().map(DVec3::from_array));
        build(&points, &Options::default(), &out).unwrap_err().to_string()
    };
    assert_eq!(error(vec![]), "no triangles and no points, expected at least one");
    let wide = error(vec![[-1e300, 0.0, 0.0], [1e300, 0.0, 0.0]]);
    assert!(wide.starts_with("the model is 2e300 units wide"), "{wide}");
    let crowd = clouds::plain(std::iter::repeat_n(DVec3::ONE, 70_000));
    let little = Options { memory_bytes: 1 << 20, ..Options::default() };
    let crowd = build(&crowd, &little, &out).unwrap_err().to_string();
    assert_eq!(crowd, "70000 vertices in one place, expected at most 65536 within this budget");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

#[test]
fn bytes_do_not_depend_on_threads_memory_or_order() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let mut cloud = ball(60_000);
    // Many in one place, which differ in their colours.
    for at in 0..300 {
        cloud.positions[at * 7] = cloud.positions[at / 10 * 11];
    }
    let mut with_normals = cloud.clone();
    with_normals.normals = cloud.positions.iter().map(|at| at.as_vec3()).collect();
    for cloud in [cloud, with_normals] {
        let bytes = |cloud: &VertexBatch, threads: usize, memory_bytes: u64| {
            build(cloud, &Options { threads, memory_bytes, ..Options::default() }, &out).unwrap();
            std::fs::read(&out).unwrap()
        };
        let first = bytes(&cloud, 1, 2 << 30);
        assert!(first == bytes(&cloud, 5, 2 << 30), "threads");
        assert!(first == bytes(&cloud, 2, 4 << 20) && first == bytes(&cloud, 1, 1 << 20), "memory");
        let shuffled = clouds::shuffled(&cloud);
        assert!(first == bytes(&shuffled, 2, 2 << 30) && first == bytes(&shuffled, 2, 1 << 20), "order");
    }
}

/// A ball in many cells: what is known of its normals is where they should point.
#[test]
fn normals_of_a_closed_cloud_point_outward() {
    let (tree, origin, _) = builds_soundly(&ball(150_000), &Options::default());
    let cosines: Vec<f64> = leaves(&tree)
        .map(|(center, _, normal)| (center.as_dvec3() + origin).normalize().dot(normal.as_dvec3()))
        .collect();
    assert!(cosines.iter().all(|cosine| *cosine > 0.95), "{:?}", cosines.iter().copied().reduce(f64::min));
    // Upward, normals are means of what is below: never of opposite ones.
    let large = tree.nodes.iter().filter(|node| node.children > 0 && node.sphere.radius < 0.3);
    for node in large {
        let outward = (node.sphere.center.as_dvec3() + origin).normalize();
        assert!(normal::decode(node.node.normal()).as_dvec3().dot(outward) > 0.9);
    }
}

/// Hills seen from above, with two separate roofs and a ditch: all normals have the sky's side.
#[test]
fn normals_of_a_landscape_point_to_the_sky() {
    let mut random = random(3);
    let at = |x: f64, y: f64| (x * 0.05).sin() * 6.0 + (y * 0.08).cos() * 4.0;
    let ground = (0..60_000).map(|_| (random() * 300.0, random() * 300.0)).map(|(x, y)| (x, y, at(x, y)));
    let mut places: Vec<(f64, f64, f64)> = ground.collect();
    places.extend((0..900).map(|i| (f64::from(i % 30), f64::from(i / 30), 40.0)));
    places.extend((0..900).map(|i| (150.0 + f64::from(i % 30), f64::from(i / 30), 60.0 + f64::from(i / 30))));
    for up in [UpAxis::Y, UpAxis::Z] {
        let place = |(x, y, height): &(f64, f64, f64)| match up {
            UpAxis::Y => DVec3::new(*x, *height, *y),
            UpAxis::Z => DVec3::new(*x, *y, *height),
        };
        let sky = if up == UpAxis::Y { Vec3::Y } else { Vec3::Z };
        let options = Options { up: Some(up), ..Options::default() };
        let (tree, ..) = builds_soundly(&clouds::plain(places.iter().map(place)), &options);
        let down = leaves(&tree).filter(|(_, _, normal)| normal.dot(sky) < 0.0).count();
        assert_eq!(down, 0);
    }
}

#[test]
fn a_files_own_normals_are_taken_and_those_that_are_missing_are_turned_alike() {
    let mut cloud = ball(20_000);
    // Inward, as no builder would guess; none for some.
    cloud.normals = cloud.positions.iter().map(|at| -at.as_vec3() * 3.0).collect();
    cloud.normals.iter_mut().step_by(5).for_each(|normal| *normal = Vec3::ZERO);
    let (tree, origin, _) = builds_soundly(&cloud, &Options::default());
    for (center, _, normal) in leaves(&tree) {
        let outward = (center.as_dvec3() + origin).normalize();
        assert!(normal.as_dvec3().dot(outward) < -0.9);
    }
}

/// Birds over a ball, and noise: what is drawn of them is about as large as what is drawn of the ball.
#[test]
fn isolated_points_are_not_blown_up() {
    let cloud = ball(8_000);
    let (whole, ..) = builds_soundly(&cloud, &Options::default());
    let mut usual: Vec<f32> = leaves(&whole).map(|(_, radius, _)| radius).collect();
    usual.sort_unstable_by(f32::total_cmp);
    let median = usual[usual.len() / 2];
    // From two spacings above the ball to a thousand times its size.
    let distances = [0.05, 0.2, 1.0, 4.0, 15.0, 60.0, 250.0, 1000.0];
    let direction = |at: usize| {
        let angle = at as f64 * 2.4;
        DVec3::new(angle.cos(), 0.3, angle.sin()).normalize()
    };
    let birds: Vec<DVec3> = distances.iter().enumerate().map(|(at, away)| direction(at) * (1.0 + away)).collect();
    // The widest of all.
    let drawn = |cloud: &VertexBatch| -> f32 {
        let (tree, ..) = builds_soundly(cloud, &Options::default());
        let mut after: Vec<f32> = leaves(&tree).map(|(_, radius, _)| radius).collect();
        after.sort_unstable_by(f32::total_cmp);
        assert!(after[after.len() / 2] < median * 1.2, "what is near others is as it was");
        after[after.len() - 1] / median
    };
    let with = |lone: &[DVec3]| {
        let mut cloud = cloud.clone();
        cloud.positions.extend(lone);
        cloud.colors.resize(cloud.positions.len(), [9; 3]);
        cloud
    };
    // Each with those that are nearer.
    for (count, away) in (1..).zip(distances) {
        let times = drawn(&with(&birds[..count]));
        println!("with a bird {away} away the widest is {times:.2} times as large as a usual point of the ball");
        assert!(times <= 4.0, "{away}: {times}");
    }
    // These are far from each other too: no larger than the builder's bound for noise.
    let mut random = random(9);
    let noise: Vec<DVec3> = (0..50).map(|_| DVec3::new(random(), random(), random()) * 10.0 + 2.0).collect();
    let widest = drawn(&with(&noise));
    println!("noise: up to {widest:.2} times");
    assert!(widest <= 16.0);
}
