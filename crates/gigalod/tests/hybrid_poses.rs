//! Random poses of built hybrid models, close up, along the surface and from behind among them, beside the ray tracer: nothing is seen
//! through the surface, nothing is drawn where nothing is, and no frame claims a smaller error than it has.

mod common;

use common::{built_hybrid, draw, mesh, renderer, scan, scene};
use gigalod::geom::ImageSize;
use gigalod::render::Kernel;
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Truth, poses, screen_error};

const SIZE: ImageSize = ImageSize { width: 320, height: 240 };
const THRESHOLDS_PX: [f32; 3] = [0.5, 2.0, 8.0];
/// Rounding of depths that went through a renderer in `f32`, in pixels.
const ROUNDING_PX: f64 = 1e-2;
/// Of judged pixels that may be deeper than they should, by the letter: what is steep, and drawn a little to the side.
const MOST_STEEP: f64 = 0.02;

fn keeps_its_word(model: &str, count: u64, cross_fade: bool) {
    let (Some(path), Some(mut renderer)) = (scan(model), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built_hybrid(&path, folder.path()));
    scene.set_cross_fade(cross_fade);
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    let (mut tightest, mut finite) = (0.0f64, 0);
    let (mut steep, mut judged) = (0, 0);
    for index in 0..count {
        let (place, camera) = poses::pose(&mesh, 4, index, 40f64.to_radians(), SIZE);
        let threshold_px = THRESHOLDS_PX[index as usize / 4 % THRESHOLDS_PX.len()];
        let (report, picture) = draw(&mut scene, &mut renderer, &camera, threshold_px, Kernel::Round);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        let drawn = Drawn { depth: &picture.depth, data_footprint_px: Some(&picture.footprint_px) };
        // Leaves are as exact as their grid; what that comes to close up is said. Where the eye is nearer than that to the surface, it is
        // infinite, and there is nothing to judge.
        if report.max_error_px.is_infinite() {
            continue;
        }
        let limited_px = if report.limited_by.is_some() { report.max_error_px } else { 0.0 };
        let error_px = threshold_px.max(limited_px);
        let verdict = judge(&truth, &touched, &drawn, f64::from(error_px));
        let what = format!("{model}, pose {index} ({place:?}), {error_px} px");
        let open: Vec<_> = verdict.holes.iter().filter(|hole| !hole.within_error).collect();
        assert!(open.is_empty(), "{what}: {} holes, {:?}", open.len(), open[0]);
        assert!(verdict.fat.is_empty(), "{what}: {} fat, {:?}", verdict.fat.len(), verdict.fat.first());
        assert!(report.limited_by.is_some() || report.max_error_px <= threshold_px, "{what}: {report:?}");
        steep += verdict.holes.len();
        judged += verdict.judged.count();
        if let Some(error) = screen_error::largest(&bvh, &camera, &picture.depth) {
            finite += 1;
            // A point is a pixel wide at least.
            let claimed_px = f64::from(report.max_error_px) + 0.5f64.sqrt();
            tightest = tightest.max(error.px / claimed_px);
            assert!(error.px <= claimed_px + ROUNDING_PX, "{what}: {error:?}, claimed {claimed_px}");
        }
    }
    println!("{model}: {finite} finite claims, the tightest is met to {tightest:.2}; {steep} of {judged} steep");
    assert!(finite * 10 >= count * 9 && tightest > 0.3, "claims are about something: {finite}, {tightest}");
    assert!((steep as f64) < MOST_STEEP * judged as f64, "{steep} of {judged}");
}

#[test]
fn the_bunny_keeps_its_word() {
    keeps_its_word("bun_zipper.ply", 60, false);
}

#[test]
fn laurana_keeps_her_word() {
    keeps_its_word("laurana.ply", 36, false);
}

#[test]
fn laurana_keeps_her_word_while_her_levels_fade() {
    keeps_its_word("laurana.ply", 36, true);
}

/// Not manifold.
#[test]
fn the_dragon_of_lower_resolution_keeps_its_word() {
    keeps_its_word("dragon_vrip_res2.ply.gz", 36, false);
}
