//! Fifty random poses a model, close up, along the surface and from behind among them: what is drawn covers what it should,
//! and no frame claims a smaller error than it has.

mod common;

use common::{built, draw, mesh, renderer, scan, scene};
use gigalod::geom::ImageSize;
use gigalod::render::{Frame, Kernel, Look};
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod::runtime::{Fineness, Magnified, ViewId};
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Truth, poses, screen_error};

const SIZE: ImageSize = ImageSize { width: 320, height: 180 };
const POSES: u64 = 50;

/// Rounding of depths that went through a renderer in `f32`, in pixels.
const ROUNDING_PX: f64 = 1e-2;

fn keeps_its_word(model: &str, thresholds_px: &[f32]) {
    let (Some(path), Some(mut renderer)) = (scan(model), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(&path, folder.path()));
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    let (mut tightest, mut finite) = (0.0f64, 0);
    for index in 0..POSES {
        let (place, camera) = poses::pose(&mesh, 4, index, 40f64.to_radians(), SIZE);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        let threshold_px = thresholds_px[index as usize / 4 % thresholds_px.len()];
        let (report, picture) = draw(&mut scene, &mut renderer, &camera, threshold_px, Kernel::Round);
        let limited = report.limited_by.is_some().then_some(&picture.footprint_px[..]);
        let drawn = Drawn { depth: &picture.depth, data_footprint_px: limited };
        let verdict = judge(&truth, &touched, &drawn, f64::from(threshold_px));
        let what = format!("{model}, pose {index} ({place:?}), {threshold_px} px");
        assert!(
            verdict.is_clean(),
            "{what}: {} holes, {} fat; {:?} {:?}",
            verdict.holes.len(),
            verdict.fat.len(),
            verdict.holes.first(),
            verdict.fat.first(),
        );
        assert!(report.limited_by.is_some() || report.max_error_px <= threshold_px, "{what}: {report:?}");
        if let Some(error) = screen_error::largest(&bvh, &camera, &picture.depth)
            && report.max_error_px.is_finite()
        {
            finite += 1;
            let claimed_px = f64::from(report.max_error_px);
            tightest = tightest.max(error.px / claimed_px);
            assert!(error.px <= claimed_px + ROUNDING_PX, "{what}: {error:?}, claimed {claimed_px}");
        }
    }
    println!("{model}: {finite} poses with a finite claim, the tightest is met to {:.0} %", tightest * 100.0);
    assert!(finite >= POSES / 3 && tightest > 0.3, "claims are about something: {finite}, {tightest}");
}

/// Drawn with pixels that are several of the screen's wide, and shown on the screen.
#[test]
fn what_is_shown_magnified_keeps_its_word_too() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(&path, folder.path()));
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    let (mut finite, mut needed) = (0, 0);
    for index in 0..POSES {
        let (place, camera) = poses::pose(&mesh, 4, index, 40f64.to_radians(), SIZE);
        let threshold_px = [1.0, 6.0, 20.0][index as usize / 4 % 3];
        let cut = scene.select_converged(ViewId(0), &camera, &Fineness::px(threshold_px));
        let small = Magnified::new(&camera, [1.19, 2.0, 2.83, 4.0][index as usize / 12 % 4]);
        let draws = scene.draws(ViewId(0)).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
        let frame = Frame { camera: *small.camera(), look: Look::default(), draws };
        let picture = renderer.picture(&frame).unwrap();
        let width = small.camera().size.width as usize;
        assert!(picture.depth.len() < SIZE.pixels(), "fewer pixels");
        let pixels = (0..SIZE.height).flat_map(|y| (0..SIZE.width).map(move |x| [x, y]));
        let depth: Vec<f32> = pixels
            .map(|pixel| small.pixel_at(pixel))
            .map(|[column, row]| picture.depth[row as usize * width + column as usize])
            .collect();
        let report = small.report(&cut);
        if let Some(error) = screen_error::largest(&bvh, &camera, &depth)
            && report.max_error_px.is_finite()
        {
            finite += 1;
            needed += usize::from(error.px > f64::from(cut.max_error_px) + ROUNDING_PX);
            let claimed_px = f64::from(report.max_error_px);
            assert!(error.px <= claimed_px + ROUNDING_PX, "pose {index} ({place:?}): {error:?}, claimed {claimed_px}");
        }
    }
    println!("{finite} poses with a finite claim, {needed} of which need more than their splats' error");
    assert!(finite as u64 >= POSES / 3 && needed > 0, "claims are about something: {finite}, {needed}");
}

#[test]
fn the_bunny_keeps_its_word_in_fifty_poses() {
    keeps_its_word("bun_zipper.ply", &[1.0, 6.0, 20.0]);
}

#[test]
fn laurana_keeps_her_word_in_fifty_poses() {
    keeps_its_word("laurana.ply", &[1.0, 6.0, 20.0]);
}

#[test]
fn the_dragon_keeps_its_word_in_fifty_poses() {
    keeps_its_word("dragon_vrip.ply.gz", &[1.0, 6.0, 20.0]);
}
