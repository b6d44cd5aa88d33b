//! Whether what simplification claims is true: the slow way, by samples, against the original.

use super::overlay::{Overlay, Verdict};
use super::patch::{Face, Patch, Vertex};
use super::points;
use super::simplify::{Limit, simplify};
use super::zip;
use glam::{DVec3, Vec3};
use proptest::prelude::*;

/// Samples along each edge of a triangle.
const SAMPLES: u32 = 5;

/// From a point to a triangle: to its plane where the foot lies inside, else to the nearest of its edges.
fn distance(at: DVec3, corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let edge = |p: DVec3, q: DVec3| {
        let along = q - p;
        let share = ((at - p).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
        (p + along * share - at).length()
    };
    let rim = edge(a, b).min(edge(b, c)).min(edge(c, a));
    let is_over = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| normal.cross(*q - *p).dot(at - *p) >= 0.0);
    match normal.try_normalize() {
        Some(normal) if is_over => rim.min((at - a).dot(normal).abs()),
        _ => rim,
    }
}

fn samples([a, b, c]: [DVec3; 3]) -> impl Iterator<Item = DVec3> {
    (0..=SAMPLES).flat_map(move |i| {
        (0..=SAMPLES - i).map(move |j| {
            let [u, v] = [i, j].map(|x| f64::from(x) / f64::from(SAMPLES));
            a * u + b * v + c * (1.0 - u - v)
        })
    })
}

fn corners(patch: &Patch, face: &Face) -> [DVec3; 3] {
    face.corners.map(|corner| patch.vertices[corner as usize].at)
}

/// Each point of the result has the original as near as its face says, and each of the original something that close that says so.
fn holds(original: &Patch, result: &Patch) -> Result<(), TestCaseError> {
    for face in &result.faces {
        for at in samples(corners(result, face)) {
            let nearest =
                original.faces.iter().map(|old| distance(at, corners(original, old))).fold(f64::INFINITY, f64::min);
            prop_assert!(nearest <= f64::from(face.geo) + 1e-6, "{at}: {nearest}, claimed {}", face.geo);
        }
    }
    for spot in &result.spots {
        let at = spot.vertex.at;
        let nearest =
            original.faces.iter().map(|old| distance(at, corners(original, old))).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest <= f64::from(spot.geo) + 1e-6, "point {at}: {nearest}, claimed {}", spot.geo);
    }
    for face in &original.faces {
        for at in samples(corners(original, face)) {
            let faces = result.faces.iter().map(|new| distance(at, corners(result, new)) - f64::from(new.geo));
            let spots = result.spots.iter().map(|spot| (spot.vertex.at - at).length() - f64::from(spot.geo));
            let excess = faces.chain(spots).fold(f64::INFINITY, f64::min);
            prop_assert!(excess <= 1e-6, "{at} of the original is {excess} farther than anything claims");
        }
    }
    Ok(())
}

const GRID: u32 = 7;

/// A rough sheet with holes, faces that are there twice, spikes and folds.
fn soup(heights: &[f64], missing: &[bool], shifts: &[f64], is_odd: bool) -> Patch {
    let mut patch = Patch::default();
    for row in 0..GRID {
        for column in 0..GRID {
            let number = (row * GRID + column) as usize;
            let at = DVec3::new(f64::from(column) + shifts[number], f64::from(row) - shifts[number], heights[number]);
            patch.vertices.push(Vertex { at, normal: Vec3::Z, color: Vec3::ZERO });
        }
    }
    for row in 0..GRID - 1 {
        for column in 0..GRID - 1 {
            let a = row * GRID + column;
            for (half, corners) in [[a, a + 1, a + GRID + 1], [a, a + GRID + 1, a + GRID]].into_iter().enumerate() {
                let number = (2 * (row * (GRID - 1) + column)) as usize + half;
                if !missing[number] {
                    patch.faces.push(Face { corners, geo: 0.0, app: 0.0 });
                }
                if is_odd && number % 17 == 3 {
                    patch.faces.push(Face { corners: [corners[0], corners[2], corners[1]], geo: 0.0, app: 0.0 });
                }
            }
        }
    }
    patch
}

fn any_soup() -> impl Strategy<Value = Patch> {
    let vertices = (GRID * GRID) as usize;
    let faces = (2 * (GRID - 1) * (GRID - 1)) as usize;
    let rough = prop_oneof![Just(0.02), Just(0.2), Just(1.5)];
    (
        rough.prop_flat_map(move |rough| prop::collection::vec(-rough..rough, vertices)),
        prop::collection::vec(prop::bool::weighted(0.12), faces),
        prop_oneof![Just(0.0), Just(0.7)].prop_flat_map(move |most| prop::collection::vec(-most..=most, vertices)),
    )
        .prop_map(|(heights, missing, shifts)| soup(&heights, &missing, &shifts, true))
        .prop_filter("something is left", |patch| !patch.faces.is_empty())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn errors_are_never_larger_than_they_say(patch in any_soup(), error in prop_oneof![Just(0.05), Just(0.3), Just(2.0)],
        keeps_looks in any::<bool>()) {
        let mut result = simplify(patch.clone(), Limit { error, keeps_looks });
        points::shrink(&mut result, error);
        for face in &result.faces {
            prop_assert!(f64::from(face.total()) <= error * (1.0 + 1e-5), "{face:?}");
        }
        holds(&patch, &result)?;
        // And once more from there, as the next level does: errors are those to the original.
        let again = simplify(result, Limit { error: 2.0 * error, keeps_looks });
        holds(&patch, &again)?;
    }

    #[test]
    fn closing_cracks_claims_what_it_moves(patch in any_soup(), apart in 0.0f64..0.2) {
        // The same sheet in two halves, one of them a little off.
        let mut torn = patch.clone();
        let middle = f64::from(GRID) / 2.0;
        let (left, right): (Vec<Face>, Vec<Face>) =
            patch.faces.iter().partition(|face| corners(&patch, face).iter().map(|at| at.x).sum::<f64>() / 3.0 < middle);
        let first = torn.vertices.len() as u32;
        torn.vertices.extend(patch.vertices.iter().map(|vertex| Vertex { at: vertex.at + DVec3::new(0.0, apart, apart), ..*vertex }));
        torn.faces = left;
        torn.faces.extend(right.iter().map(|face| Face { corners: face.corners.map(|corner| corner + first), ..*face }));
        let mut closed = torn.clone();
        zip::zip(&mut closed, 0.4);
        holds(&torn, &closed)?;
    }
}

#[test]
fn a_flat_sheet_becomes_few_triangles_and_a_rough_one_does_not() {
    let count = (GRID * GRID) as usize;
    let (none, shifts) = (vec![false; 2 * count], vec![0.0; count]);
    let flat = simplify(soup(&vec![0.0; count], &none, &shifts, false), Limit { error: 1e-3, keeps_looks: false });
    let rough: Vec<f64> = (0..count).map(|i| (i * i * 31 % 17) as f64 * 0.1).collect();
    let kept = simplify(soup(&rough, &none, &shifts, false), Limit { error: 1e-3, keeps_looks: false });
    assert!(flat.faces.len() <= 24, "{} faces of a flat sheet", flat.faces.len());
    assert!(kept.faces.len() >= 60, "{} faces of a rough one", kept.faces.len());
}

#[test]
fn an_overlay_finds_the_distance_at_a_crossing() {
    // A square whose diagonal is turned: ends of one are up by 1, so the middle moves by 1.
    let mut overlay = Overlay::default();
    let at = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]];
    overlay.at = at.map(DVec3::from_array).to_vec();
    // A fan around the middle, which goes; the first corner takes its place.
    overlay.old = vec![[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]];
    overlay.old_geo = vec![0.25; 4];
    overlay.gone = vec![4];
    overlay.apex = 1;
    overlay.apex_is_old = true;
    overlay.new = vec![[1, 2, 3], [1, 3, 0]];
    assert_eq!(overlay.begin(10.0), Verdict::Good);
    assert_eq!(overlay.finish(10.0), Verdict::Good);
    for geo in &overlay.geo {
        assert!((geo - 1.25).abs() < 1e-4, "{geo}");
    }
    assert_eq!(overlay.begin(1.0), Verdict::TooFar);
}
