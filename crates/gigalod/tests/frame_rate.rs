//! Frame-rate control with real cuts and pictures, and a clock that the test winds: a frame takes what its splats cost, and the
//! pixels that they cover.

mod common;

use common::{SIZE, built, renderer};
use gigalod::geom::{Camera, CameraPath};
use gigalod::render::{Frame, Kernel, Look, Picture, Renderer};
use gigalod::runtime::{CutReport, Fineness, FrameRate, Scene, ViewId};
use gigalod::synth::{PathKind, PathOptions, StatueOptions, camera_path, write_statue};
use std::path::PathBuf;

const VIEW: ViewId = ViewId(0);

const TARGET_MS: f64 = 100.0;

/// Milliseconds of a picture, of each splat in it, and of each pixel that one covers.
struct Machine {
    picture_ms: f64,
    splat_ms: f64,
    covered_ms: f64,
}

/// One for which splats are what takes time, and one that is too slow for all the pixels that they cover.
const MACHINES: [Machine; 2] = [
    Machine { picture_ms: 20.0, splat_ms: 3.2e-3, covered_ms: 0.0 },
    Machine { picture_ms: 40.0, splat_ms: 2e-4, covered_ms: 6e-5 },
];

impl Machine {
    fn control(&self) -> FrameRate {
        let control = FrameRate::new(TARGET_MS, 1.0);
        if self.covered_ms > 0.0 { control.with_larger_pixels() } else { control }
    }
}

/// What a frame was.
struct Shown {
    ms: f64,
    wanted: Fineness,
    report: CutReport,
    edge_px: f64,
}

/// Selects a frame and winds the clock.
fn frame(machine: &Machine, scene: &mut Scene, control: &mut FrameRate, camera: &Camera, moved: bool) -> Shown {
    let wanted = control.next(moved);
    let report = scene.select(VIEW, camera, &wanted);
    scene.serve();
    while scene.residency().is_loading() {
        scene.residency_mut().receive(true);
    }
    let area_px = scene.area_px(VIEW, camera);
    let edge_px = if machine.covered_ms > 0.0 { control.pixel_edge_px(&report, 0.0, area_px) } else { 1.0 };
    let for_pixels = (machine.picture_ms + machine.covered_ms * area_px) / (edge_px * edge_px);
    let ms = for_pixels + machine.splat_ms * report.drawn as f64;
    control.drew(ms, &report, false);
    Shown { ms, wanted, report, edge_px }
}

fn statue(folder: &std::path::Path) -> PathBuf {
    let ply = folder.join("statue.ply");
    let options = StatueOptions { triangles: 600_000, seed: 3, ..StatueOptions::default() };
    write_statue(options, &mut std::fs::File::create(&ply).unwrap(), &mut |_, _| {}).unwrap();
    ply
}

fn camera(path: &CameraPath, t: f64) -> Camera {
    let pose = path.at(t);
    Camera::look_at(pose.eye, pose.target, path.up, path.fov_deg.to_radians(), SIZE)
}

fn picture(scene: &Scene, renderer: &mut Renderer, camera: &Camera) -> Picture {
    let draws = scene.draws(VIEW).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
    let look = Look { kernel: Kernel::Round, ..Look::default() };
    renderer.picture(&Frame { camera: *camera, look, draws }).unwrap()
}

#[test]
fn frames_take_their_time_along_paths_and_a_rested_picture_is_that_of_render() {
    let Some(mut renderer) = renderer() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = built(&statue(folder.path()), folder.path());
    let root = *file.skeleton().root();
    let kinds = [PathKind::Walk, PathKind::SuddenTurn];
    for (kind, machine) in kinds.into_iter().flat_map(|kind| MACHINES.iter().map(move |machine| (kind, machine))) {
        let path = camera_path(kind, &root.bounds, root.up, PathOptions { seconds: 12.0, seed: 1 });
        let mut scene = common::scene(file.clone());
        let mut control = machine.control();
        let (mut clock_ms, mut moved, mut late, mut frames, mut held_back) = (0.0, true, 0, 0, Vec::new());
        let mut widest_px = 1.0f64;
        while clock_ms < 12_000.0 {
            let pose = camera(&path, clock_ms * 1e-3);
            let Shown { ms, report, edge_px, .. } = frame(machine, &mut scene, &mut control, &pose, moved);
            clock_ms += ms;
            frames += 1;
            // The first frames know neither the machine nor the model.
            if frames > 8 {
                late += usize::from(ms > 1.2 * TARGET_MS);
                widest_px = widest_px.max(edge_px);
                // Of nothing in view, none is held back.
                if report.drawn > 0 && (report.threshold_px > 1.0 || edge_px > 1.0) {
                    held_back.push(ms);
                }
            }
        }
        held_back.sort_by(f64::total_cmp);
        let median_ms = held_back[held_back.len() / 2];
        println!(
            "{kind:?}: {frames} frames, {} held back, median {median_ms:.1} ms, {late} late, pixels up to {widest_px} px",
            held_back.len()
        );
        assert!(held_back.len() > 20, "the target was a bound");
        assert_eq!(widest_px > 1.0, machine.covered_ms > 0.0, "{kind:?}: {widest_px}");
        assert!((0.8..1.2).contains(&(median_ms / TARGET_MS)), "{kind:?}: {median_ms} ms");
        assert!(late * 20 <= held_back.len(), "{kind:?}: {late} of {} late", held_back.len());

        // At rest: only finer, down to one pixel, and then exactly what a picture of that pose is.
        let rest = camera(&path, 12.0);
        moved = false;
        let mut last_px = f32::INFINITY;
        for _ in 0..40 {
            let shown = frame(machine, &mut scene, &mut control, &rest, moved);
            let threshold_px = shown.wanted.threshold_px;
            assert!(threshold_px <= last_px && shown.edge_px == 1.0, "{threshold_px} after {last_px}");
            last_px = threshold_px;
            if control.is_settled() {
                break;
            }
        }
        assert!(control.is_settled() && last_px == 1.0, "{last_px}");
        let rested = picture(&scene, &mut renderer, &rest);
        let mut fresh = common::scene(file.clone());
        fresh.select_converged(VIEW, &rest, &Fineness::px(1.0));
        let expected = picture(&fresh, &mut renderer, &rest);
        assert!(rested.rgba == expected.rgba && rested.depth == expected.depth, "{kind:?}");
    }
}
