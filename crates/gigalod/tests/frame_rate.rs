//! Frame-rate control with real cuts and pictures, and a clock that the test winds: a frame takes what its splats cost.

mod common;

use common::{SIZE, built, renderer};
use gigalod::geom::{Camera, CameraPath};
use gigalod::render::{Frame, Kernel, Look, Picture, Renderer};
use gigalod::runtime::{Fineness, FrameRate, Scene, ViewId};
use gigalod::synth::{PathKind, PathOptions, StatueOptions, camera_path, write_statue};
use std::path::PathBuf;

const VIEW: ViewId = ViewId(0);

/// Milliseconds of a frame, and of each splat in it.
const FIXED_MS: f64 = 20.0;
const SPLAT_MS: f64 = 3.2e-3;
const TARGET_MS: f64 = 100.0;

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
    for kind in [PathKind::Walk, PathKind::SuddenTurn] {
        let path = camera_path(kind, &root.bounds, root.up, PathOptions { seconds: 12.0, seed: 1 });
        let mut scene = common::scene(file.clone());
        let mut control = FrameRate::new(TARGET_MS, 1.0);
        let (mut clock_ms, mut moved, mut late, mut frames, mut held_back) = (0.0, true, 0, 0, Vec::new());
        let frame = |scene: &mut Scene, control: &mut FrameRate, camera: &Camera, moved: bool| {
            let wanted = control.next(moved);
            let report = scene.select(VIEW, camera, &wanted);
            scene.serve();
            while scene.residency().is_loading() {
                scene.residency_mut().receive(true);
            }
            let ms = FIXED_MS + SPLAT_MS * report.drawn as f64;
            control.drew(ms, &report, false);
            (ms, wanted, report)
        };
        while clock_ms < 12_000.0 {
            let (ms, _, report) = frame(&mut scene, &mut control, &camera(&path, clock_ms * 1e-3), moved);
            clock_ms += ms;
            frames += 1;
            // The first frames know neither the machine nor the model.
            if frames > 8 {
                late += usize::from(ms > 1.2 * TARGET_MS);
                if report.threshold_px > 1.0 {
                    held_back.push(ms);
                }
            }
        }
        held_back.sort_by(f64::total_cmp);
        let median_ms = held_back[held_back.len() / 2];
        println!("{kind:?}: {frames} frames, {} held back, median {median_ms:.1} ms, {late} late", held_back.len());
        assert!(held_back.len() > 20, "the target was a bound");
        assert!((0.8..1.2).contains(&(median_ms / TARGET_MS)), "{kind:?}: {median_ms} ms");
        assert!(late * 20 <= held_back.len(), "{kind:?}: {late} of {} late", held_back.len());

        // At rest: only finer, down to one pixel, and then exactly what a picture of that pose is.
        let rest = camera(&path, 12.0);
        moved = false;
        let mut last_px = f32::INFINITY;
        for _ in 0..40 {
            let (_, Fineness { threshold_px, .. }, _) = frame(&mut scene, &mut control, &rest, moved);
            assert!(threshold_px <= last_px, "{threshold_px} after {last_px}");
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
