//! The fast traversal beside the slow one: the same list, the same report, the same wishes; on random trees, from anywhere, with
//! pages missing, on one thread and on three.

mod common;

use common::judge::{assert_same, largest_px, list_of, plain_of};
use common::{bytes_of, open, scene, statue, statue_ply};
use gigalod_format::splats::SplatFile;
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::splats::Cutting;
use gigalod_runtime::{Fineness, Interrupt, Limit, ModelView, Scene, Similarity, ViewId};
use glam::DVec3;
use proptest::prelude::*;
use std::fmt::Write;
use std::sync::{Arc, OnceLock};

const VIEW: ViewId = ViewId(0);

/// A soup of triangles of all sizes in heaps, so that trees are uneven.
fn soup(triangles: usize, seed: u64) -> Arc<SplatFile> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f64 / (1 << 24) as f64
    };
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", triangles * 3);
    ply.push_str("property float x\nproperty float y\nproperty float z\n");
    writeln!(ply, "element face {triangles}\nproperty list uchar int vertex_indices\nend_header").unwrap();
    let heaps: Vec<DVec3> = (0..5).map(|_| DVec3::new(random(), random(), random())).collect();
    for triangle in 0..triangles {
        let size = 0.2 * random().powi(6) + 1e-4;
        let middle = heaps[triangle % 5] + DVec3::new(random(), random(), random()) * random().powi(4);
        for _ in 0..3 {
            let corner = middle + DVec3::new(random(), random(), random()) * size;
            writeln!(ply, "{} {} {}", corner.x, corner.y, corner.z).unwrap();
        }
    }
    for triangle in 0..triangles {
        writeln!(ply, "3 {} {} {}", triangle * 3, triangle * 3 + 1, triangle * 3 + 2).unwrap();
    }
    open(bytes_of(ply.into_bytes()))
}

/// From anywhere, inside included; sometimes along the surface.
fn cameras() -> impl Strategy<Value = (DVec3, DVec3, f64, u32)> {
    let point = |reach: f64| prop::array::uniform3(-reach..reach).prop_map(DVec3::from_array);
    (prop_oneof![point(0.6), point(3.0), point(60.0)], point(0.5), 0.05f64..2.5, 1u32..900)
}

fn camera(scene: &Scene, (eye, target, fov, height): (DVec3, DVec3, f64, u32)) -> Camera {
    let (center, size) = (scene.bounds().center(), scene.bounds().diagonal());
    let picture = ImageSize { width: height * 3 / 2, height };
    Camera::look_at(center + eye * size, center + target * size + DVec3::splat(1e-6), DVec3::Y, fov, picture)
}

fn thresholds() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0f32), 0.1f32..4.0, 4f32..300.0, Just(f32::INFINITY)]
}

fn cuttings() -> impl Strategy<Value = Cutting> {
    (any::<bool>(), any::<bool>())
        .prop_map(|(frustum_culling, backface_culling)| Cutting { frustum_culling, backface_culling })
}

/// True what a report says, of what is drawn.
fn assert_true(scene: &Scene, camera: &Camera, asked_px: f32, report: &gigalod_runtime::CutReport) {
    let view = ModelView::new(camera, &Similarity::IDENTITY);
    let list = list_of(scene, VIEW);
    let largest = largest_px(list.iter().map(|(ball, _)| ball), &view);
    assert_eq!(report.max_error_px, largest);
    assert_eq!(report.drawn, list.len() as u64);
    // Where the two are equal but for rounding, either is true.
    if largest > asked_px * 1.0001 {
        assert!(report.limited_by.is_some(), "{largest} of {asked_px}");
    } else if largest < asked_px * 0.9999 {
        assert!(matches!(report.limited_by, None | Some(Limit::Residency)), "{largest} of {asked_px}: {report:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn random_trees_are_cut_as_by_the_slow_traversal(
        triangles in 1usize..800, seed in any::<u64>(),
        looks in prop::collection::vec((cameras(), thresholds(), cuttings()), 12),
    ) {
        let mut scene = scene(soup(triangles, seed), 1 << 30);
        for (pose, threshold_px, cutting) in looks {
            let camera = camera(&scene, pose);
            scene.splats_mut().cutting = cutting;
            let report = scene.select_converged(VIEW, &camera, &Fineness::px(threshold_px));
            assert_same(&scene, VIEW, &report, &plain_of(&scene, &camera, threshold_px, cutting));
            assert_true(&scene, &camera, threshold_px, &report);
        }
    }

    #[test]
    fn a_closed_statue_with_missing_pages_is_cut_as_by_the_slow_traversal(
        budget_pages in 0u64..9, looks in prop::collection::vec((cameras(), thresholds(), cuttings()), 12),
    ) {
        let mut scene = scene(statue(), budget_pages * 50_000);
        for (pose, threshold_px, cutting) in looks {
            let camera = camera(&scene, pose);
            scene.splats_mut().cutting = cutting;
            for _ in 0..2 {
                let report = scene.select(VIEW, &camera, &Fineness::px(threshold_px));
                assert_same(&scene, VIEW, &report, &plain_of(&scene, &camera, threshold_px, cutting));
                assert_true(&scene, &camera, threshold_px, &report);
                scene.serve();
                scene.residency_mut().receive(true);
                scene.residency_mut().receive(true);
            }
        }
    }

    #[test]
    fn a_number_of_splats_is_never_exceeded_and_hardly_wasted(
        pose in cameras(), threshold_px in 0f32..3.0, share in 0.002f64..1.2,
        before in prop::collection::vec((cameras(), 0.002f64..1.2), 0..3),
    ) {
        let mut scene = scene(statue(), 1 << 30);
        let pose = camera(&scene, pose);
        let free = scene.select_converged(VIEW, &pose, &Fineness::px(threshold_px));
        let most = |share: f64| ((free.drawn as f64 * share) as u64).max(1);
        let fineness = Fineness { most_splats: most(share), ..Fineness::px(threshold_px) };
        // What was looked at before must not matter; all that is wanted now is resident, and stays so.
        for (other, share) in before {
            let other = camera(&scene, other);
            scene.select(VIEW, &other, &Fineness { most_splats: most(share), ..fineness });
        }
        let report = scene.select(VIEW, &pose, &fineness);
        let again = scene.select(VIEW, &pose, &fineness);
        prop_assert_eq!(again, report);
        prop_assert!(report.drawn <= fineness.most_splats);
        assert_true(&scene, &pose, threshold_px, &report);
        if free.drawn <= fineness.most_splats {
            prop_assert_eq!(report, free);
        } else {
            prop_assert!(report.threshold_px > threshold_px);
            if report.max_error_px > threshold_px {
                prop_assert_eq!(report.limited_by, Some(Limit::Budget));
            }
            // A little finer, and there would be too many. What hides its back is counted although it is not drawn.
            let finer = plain_of(&scene, &pose, (report.threshold_px / 1.07).min(1e9), Cutting::default()).report;
            let slack = 20 + finer.culled_backface;
            prop_assert!(finer.drawn + slack > fineness.most_splats, "{} at {}", finer.drawn, report.threshold_px);
            let mut expected = plain_of(&scene, &pose, report.threshold_px, Cutting::default());
            if report.max_error_px > threshold_px {
                expected.report.limited_by = Some(Limit::Budget);
            }
            assert_same(&scene, VIEW, &report, &expected);
        }
    }
}

/// Large enough that threads are worth it.
fn large() -> Arc<SplatFile> {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    open(BYTES.get_or_init(|| bytes_of(statue_ply(200_000, false))).clone())
}

#[test]
fn threads_make_the_same_list_in_pieces() {
    for threads in [1, 2, 3, 7] {
        let mut scene = scene(large(), 1 << 30);
        scene.splats_mut().set_threads(threads);
        scene.splats_mut().cutting.backface_culling = false;
        for (azimuth, zoom, threshold_px) in [(0.0, 1.0, 0.0), (70.0, 0.8, 0.3), (200.0, 1.1, 0.0), (200.0, 40.0, 0.1)]
        {
            let camera = common::camera(&scene, azimuth, zoom);
            scene.select_converged(VIEW, &camera, &Fineness::px(threshold_px));
            let report = scene.select(VIEW, &camera, &Fineness::px(threshold_px));
            let cutting = Cutting { backface_culling: false, ..Cutting::default() };
            assert_same(&scene, VIEW, &report, &plain_of(&scene, &camera, threshold_px, cutting));
            let filled = list_of(&scene, VIEW).pieces.iter().filter(|piece| !piece.balls.is_empty()).count();
            assert!(threads == 1 || zoom > 2.0 || filled > threads, "{filled} pieces of {threads} threads");
        }
    }
}

#[test]
fn an_interrupted_cut_leaves_the_last_one() {
    let mut scene = scene(large(), 1 << 30);
    scene.splats_mut().set_threads(3);
    let (front, back) = (common::camera(&scene, 0.0, 1.0), common::camera(&scene, 180.0, 1.0));
    let interrupt = Interrupt::default();
    scene.select_converged(VIEW, &back, &Fineness::px(0.0));
    scene.select_converged(VIEW, &front, &Fineness::px(0.0));
    let report = scene.select_interruptible(VIEW, &front, &Fineness::px(0.0), &interrupt).expect("nobody interrupts");
    let expected = plain_of(&scene, &front, 0.0, Cutting::default());
    assert_same(&scene, VIEW, &report, &expected);
    scene.serve();

    interrupt.set();
    for fineness in [Fineness::px(0.0), Fineness { most_splats: 100, ..Fineness::px(0.0) }] {
        assert_eq!(scene.select_interruptible(VIEW, &back, &fineness, &interrupt), None);
        assert_same(&scene, VIEW, &report, &expected);
    }
    interrupt.clear();
    // From another thread, at any moment.
    let (mut broken_off, mut complete) = (0, 0);
    for turn in 0..60 {
        let from = interrupt.clone();
        let setter = std::thread::spawn(move || {
            (0..turn * 400).for_each(|_| std::hint::spin_loop());
            from.set();
        });
        match scene.select_interruptible(VIEW, &back, &Fineness::px(0.0), &interrupt) {
            None => broken_off += 1,
            Some(_) => complete += 1,
        }
        setter.join().unwrap();
        interrupt.clear();
        let shown = if complete > 0 { &back } else { &front };
        let expected = plain_of(&scene, shown, 0.0, Cutting::default());
        assert_eq!(list_of(&scene, VIEW).len(), expected.splats.len());
    }
    println!("{broken_off} broken off, {complete} complete");
    let report = scene.select_interruptible(VIEW, &back, &Fineness::px(0.0), &interrupt).expect("nobody interrupts");
    assert_same(&scene, VIEW, &report, &plain_of(&scene, &back, 0.0, Cutting::default()));
}

#[test]
fn instances_share_a_number_of_splats() {
    let mut scene = scene(statue(), 1 << 30);
    let file = gigalod_runtime::FileId(0);
    for step in 1..4 {
        let position = DVec3::new(f64::from(step) * 0.7, 0.0, f64::from(step) * -0.9) * scene.bounds().diagonal();
        scene.add(gigalod_runtime::Instance { file, placement: Similarity { position, ..Similarity::IDENTITY } });
    }
    let camera = common::camera(&scene, 20.0, 1.0);
    let free = scene.select_converged(VIEW, &camera, &Fineness::px(0.5));
    for most_splats in [2, 4, 100, 1000, free.drawn / 2, free.drawn - 1, free.drawn] {
        let report = scene.select(VIEW, &camera, &Fineness { most_splats, ..Fineness::px(0.5) });
        // One an instance is always drawn.
        assert!(report.drawn <= most_splats.max(4), "{} of {most_splats}", report.drawn);
        assert!(report.drawn > most_splats / 2);
        assert_eq!(report.limited_by == Some(Limit::Budget), most_splats < free.drawn);
        let of_all: u64 = scene.draws(VIEW).map(|(_, selection)| selection.report.drawn).sum();
        assert_eq!(of_all, report.drawn);
    }
}
