//! Hybrid cuts within budgets: of primitives, of memory; beside splats in one scene; broken off.

mod common;

use common::octree::Octree;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::residency::{InlineLoader, ThreadedLoader};
use gigalod_runtime::{
    DrawSource, Fineness, Instance, Interrupt, Limit, Loader, Residency, Scene, Selection, Similarity, ViewId,
};
use glam::DVec3;

const VIEW: ViewId = ViewId(0);
const OTHER: ViewId = ViewId(1);

/// Instances of the octree, side by side.
fn scene(octree: &Octree, budget_bytes: u64, instances: u32) -> Scene {
    let mut residency = Residency::new(budget_bytes, Box::<InlineLoader>::default());
    let file = residency.add(octree.file());
    let mut scene = Scene::new(residency);
    for at in 0..instances {
        let position = DVec3::X * 1.1 * f64::from(at);
        scene.add(Instance { file, placement: Similarity { position, ..Similarity::IDENTITY } });
    }
    scene
}

fn camera(scene: &Scene, azimuth_deg: f64, zoom: f64) -> Camera {
    let size = ImageSize { width: 400, height: 300 };
    Camera::orbit(&scene.bounds(), UpAxis::Y, [azimuth_deg, 12.0], zoom, 0.7, size)
}

fn nodes(selection: &Selection) -> Vec<u32> {
    let DrawSource::Hybrid(list) = &selection.draw else { panic!("{:?}", selection.draw) };
    list.nodes.iter().map(|node| node.node.0).collect()
}

fn drawn(scene: &Scene, view: ViewId) -> Vec<Vec<u32>> {
    scene.draws(view).map(|(_, selection)| nodes(selection)).collect()
}

#[test]
fn a_number_of_primitives_is_never_exceeded_and_its_threshold_is_the_first_that_fits() {
    let octree = Octree::sphere(7, false);
    let mut scene = scene(&octree, 1 << 30, 2);
    for (azimuth, zoom, cross_fade) in [(0.0, 1.0, false), (60.0, 3.0, true), (60.0, 3.0, false), (190.0, 0.2, true)] {
        scene.set_cross_fade(cross_fade);
        let camera = camera(&scene, azimuth, zoom);
        let all = scene.select_converged(VIEW, &camera, &Fineness::px(0.1));
        for share in [3, 10, 70] {
            let most_splats = all.primitives() / share;
            let fineness = Fineness { most_splats, ..Fineness::px(0.1) };
            let report = scene.select(VIEW, &camera, &fineness);
            assert!(report.primitives() <= most_splats || report.threshold_px == f32::INFINITY, "{report:?}");
            assert!(report.threshold_px > 0.1 && report.limited_by == Some(Limit::Budget), "{report:?}");
            let shown = drawn(&scene, VIEW);
            // Nothing but the budget led there.
            let at = |threshold_px: f32| Fineness { threshold_px, ..Fineness::px(0.1) };
            let same = scene.select(OTHER, &camera, &at(report.threshold_px));
            assert_eq!((same.primitives(), same.max_error_px), (report.primitives(), report.max_error_px));
            assert_eq!(drawn(&scene, OTHER), shown);
            // A sixteenth of an octave finer would not fit.
            let finer = scene.select(OTHER, &camera, &at(report.threshold_px / 1.07));
            assert!(report.threshold_px == f32::INFINITY || finer.primitives() > most_splats, "{report:?} {finer:?}");
            assert_eq!(scene.select(VIEW, &camera, &fineness), report, "nor earlier frames");
        }
        assert_eq!(scene.select(VIEW, &camera, &Fineness::px(0.1)), all);
        scene.serve();
    }
}

/// Boxes of all levels hold the eye, and each might be everywhere on the screen.
#[test]
fn close_to_a_surface_a_budget_goes_to_what_is_near() {
    let octree = Octree::sphere(7, false);
    let mut scene = scene(&octree, 1 << 30, 1);
    let (middle, radius) = (scene.bounds().center(), scene.bounds().extent().x * 0.5);
    let eye = middle + DVec3::X * (radius * 1.004);
    let size = ImageSize { width: 400, height: 300 };
    let camera = Camera::look_at(eye, eye + DVec3::new(-0.3, 1.0, 0.1), DVec3::Z, 0.7, size);
    let all = scene.select_converged(VIEW, &camera, &Fineness::px(0.1));
    for share in [2, 8, 32] {
        let fineness = Fineness { most_splats: all.primitives() / share, ..Fineness::px(0.1) };
        let report = scene.select(VIEW, &camera, &fineness);
        assert!(report.primitives() <= fineness.most_splats, "{report:?} {all:?}");
        assert!(report.threshold_px.is_finite() && report.limited_by == Some(Limit::Budget), "{report:?}");
        // Not the root alone.
        assert!(report.primitives() * 4 > fineness.most_splats, "{report:?} of {fineness:?}");
        // The same while the camera moves, with time that is short instead.
        let paced = Fineness { threshold_px: report.threshold_px, ..fineness };
        assert_eq!(scene.select(OTHER, &camera, &paced).primitives(), report.primitives());
    }
}

#[test]
fn pages_and_lists_never_exceed_their_budget_whatever_lists_hold() {
    let octree = Octree::sphere(7, false);
    let needed = {
        let mut free = scene(&octree, u64::MAX >> 1, 1);
        let camera = camera(&free, 0.0, 1.0);
        free.select_converged(VIEW, &camera, &Fineness::px(0.0));
        free.cpu_bytes()
    };
    for budget in [needed / 3, needed / 10, needed / 10 * 9] {
        let mut tight = scene(&octree, budget, 1);
        tight.set_cpu_budget(budget);
        let interrupt = Interrupt::default();
        for azimuth in [0.0, 90.0, 180.0, 0.0] {
            let (near, far) = (camera(&tight, azimuth, 4.0), camera(&tight, azimuth + 90.0, 0.5));
            for turn in 0..12 {
                // Another view's list holds pages of its own, and is not made anew.
                if turn == 0 {
                    tight.select(OTHER, &far, &Fineness::px(1.0));
                }
                tight.select_interruptible(VIEW, &near, &Fineness::px(0.0), &interrupt).expect("nobody");
                assert!(tight.cpu_bytes() <= budget, "{} of {budget}", tight.cpu_bytes());
                tight.serve();
                while tight.residency().is_loading() {
                    tight.residency_mut().receive(true);
                    assert!(tight.cpu_bytes() <= budget, "{} of {budget}", tight.cpu_bytes());
                }
                for (_, selection) in tight.draws(OTHER).chain(tight.draws(VIEW)) {
                    let DrawSource::Hybrid(list) = &selection.draw else { panic!("hybrid") };
                    let still_there = |node: &gigalod_runtime::HybridNode| {
                        let resident = tight.residency().node(list.file, node.node);
                        resident.is_some_and(|page| std::sync::Arc::ptr_eq(page, &node.page))
                    };
                    assert!(list.nodes.iter().all(still_there), "what a list holds is counted");
                }
            }
        }
        let camera = camera(&tight, 0.0, 4.0);
        let report = tight.select(VIEW, &camera, &Fineness::px(0.0));
        assert!(report.drawn > 0, "{report:?}");
        tight.serve();
        // Less from now on: at once, and what is drawn goes too.
        tight.set_cpu_budget(budget / 2);
        assert!(tight.cpu_bytes() <= budget / 2, "{} of {}", tight.cpu_bytes(), budget / 2);
    }
}

#[test]
fn hybrid_models_and_splats_share_a_scene_a_threshold_and_a_budget() {
    let octree = Octree::sphere(6, false);
    let mut residency = Residency::new(1 << 30, Box::new(ThreadedLoader::new(2).unwrap()) as Box<dyn Loader>);
    let (hybrid, splats) = (residency.add(octree.file()), residency.add(common::statue()));
    let statue_height = residency.file(splats).bounds().extent().y;
    let mut scene = Scene::new(residency);
    scene.add(Instance { file: hybrid, placement: Similarity::IDENTITY });
    let placement =
        Similarity { position: DVec3::new(11.5, -20.0, 5.5), scale: 1.0 / statue_height, ..Similarity::IDENTITY };
    scene.add(Instance { file: splats, placement });
    let camera = camera(&scene, 0.0, 1.0);
    let all = scene.select_converged(VIEW, &camera, &Fineness::px(1.0));
    let parts: Vec<_> = scene.draws(VIEW).map(|(_, selection)| (selection.draw.clone(), selection.report)).collect();
    assert!(matches!(parts[0].0, DrawSource::Hybrid(_)) && matches!(parts[1].0, DrawSource::Splats(_)));
    assert_eq!(parts[0].1.merge(parts[1].1), all);
    assert_eq!((parts[1].1.points, parts[1].1.triangles), (parts[1].1.drawn, 0));
    assert!(parts[0].1.triangles > 0 && all.limited_by.is_none_or(|limit| limit == Limit::Data));
    let area = scene.area_px(VIEW, &camera);
    assert!(area > 5_000.0 && area.is_finite(), "{area}");

    let most_splats = all.primitives() / 4;
    let report = scene.select(VIEW, &camera, &Fineness { most_splats, ..Fineness::px(1.0) });
    assert!(report.primitives() <= most_splats && report.limited_by == Some(Limit::Budget), "{report:?}");
    for (_, selection) in scene.draws(VIEW) {
        assert_eq!(selection.report.threshold_px, report.threshold_px, "one threshold for all");
        assert!(selection.report.drawn > 0);
    }
    // Each instance is drawn as it is alone.
    assert_eq!(scene.select(VIEW, &camera, &Fineness::px(1.0)), all);
    let again: Vec<_> = scene.draws(VIEW).map(|(_, selection)| selection.draw.clone()).collect();
    assert!(again.iter().eq(parts.iter().map(|(draw, _)| draw)));
}

#[test]
fn what_is_broken_off_leaves_the_last_cut_and_its_requests() {
    let octree = Octree::sphere(7, false);
    let mut scene = scene(&octree, 1 << 30, 2);
    let (first, second) = (camera(&scene, 0.0, 1.0), camera(&scene, 120.0, 2.0));
    let interrupt = Interrupt::default();
    scene.select_converged(VIEW, &first, &Fineness::px(0.2));
    scene.select_interruptible(VIEW, &first, &Fineness::px(0.2), &interrupt).unwrap();
    let shown = drawn(&scene, VIEW);
    interrupt.set();
    for fineness in [Fineness::px(0.0), Fineness { most_splats: 5000, ..Fineness::px(0.1) }] {
        assert_eq!(scene.select_interruptible(VIEW, &second, &fineness, &interrupt), None);
        assert_eq!(drawn(&scene, VIEW), shown);
    }
    interrupt.clear();
    scene.select_interruptible(VIEW, &second, &Fineness::px(0.2), &interrupt).unwrap();
    assert_ne!(drawn(&scene, VIEW), shown);
}

#[test]
fn instances_that_are_gone_hold_nothing() {
    let octree = Octree::sphere(6, false);
    let mut residency = Residency::new(1 << 30, Box::<InlineLoader>::default());
    let file = residency.add(octree.file());
    let mut scene = Scene::new(residency);
    let id = scene.add(Instance { file, placement: Similarity::IDENTITY });
    let camera = camera(&scene, 0.0, 1.0);
    scene.select_converged(VIEW, &camera, &Fineness::px(0.5));
    assert!(scene.residency().resident_bytes() > 0);
    scene.remove(id);
    assert_eq!(scene.draws(VIEW).count(), 0);
    scene.set_cpu_budget(1);
    assert_eq!(scene.residency().resident_bytes(), 0);
}
