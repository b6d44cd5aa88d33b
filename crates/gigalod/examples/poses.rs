//! Fifty random poses of a large model, judged: `tests/splat_poses.rs` for what takes too long there.
//!
//! `cargo run --release --example poses -- MODEL.ply MODEL.glod [POSES]`
//!
//! Takes a mesh and what was built from it. Draws it from random poses (from afar, close to the surface, along it at 5°, from
//! behind it) at 1, 6 and 20 px in turn, with the kernels that promise no hole and the blended one in turn. Prints one JSON
//! object: for each kernel frames, holes, fat, frames that claim a smaller error than is measured, and the largest part of a
//! claim that was needed.

#[path = "../tests/common/mod.rs"]
mod common;

use anyhow::{Context, Result, bail};
use common::{draw, mesh, open_any, scene};
use gigalod::geom::ImageSize;
use gigalod::render::{Gpu, Kernel, Renderer};
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Truth, poses, screen_error};
use std::path::Path;

const SIZE: ImageSize = ImageSize { width: 640, height: 360 };
const KERNELS: [Kernel; 3] = [Kernel::Round, Kernel::Square, Kernel::Gauss];
const THRESHOLDS_PX: [f32; 3] = [1.0, 6.0, 20.0];

/// Rounding of depths that went through a renderer in `f32`, in pixels.
const ROUNDING_PX: f64 = 1e-2;

/// Of one kernel.
#[derive(Default)]
struct Figures {
    frames: u64,
    holes: usize,
    fat: usize,
    false_claims: u64,
    tightest: f64,
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, built, rest @ ..] = &arguments[..] else { bail!("usage: poses MODEL.ply MODEL.glod [POSES]") };
    let count = rest.first().map_or(Ok(50), |text| text.parse()).context("POSES")?;
    let mesh = mesh(Path::new(model));
    let bvh = Bvh::build(&mesh);
    let mut scene = scene(open_any(Path::new(built)));
    let mut renderer = Renderer::new(Gpu::open()?)?;
    let mut figures: [Figures; KERNELS.len()] = Default::default();
    for index in 0..count {
        let (place, camera) = poses::pose(&mesh, 4, index, 40f64.to_radians(), SIZE);
        // Four poses make a round of places: the same threshold, and another kernel for each pose from round to round.
        let threshold_px = THRESHOLDS_PX[index as usize / 4 % THRESHOLDS_PX.len()];
        let which = (index as usize + index as usize / 4) % KERNELS.len();
        let (report, picture) = draw(&mut scene, &mut renderer, &camera, threshold_px, KERNELS[which]);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        let limited = report.limited_by.is_some().then_some(&picture.footprint_px[..]);
        let drawn = Drawn { depth: &picture.depth, data_footprint_px: limited };
        let verdict = judge(&truth, &touched, &drawn, f64::from(threshold_px));
        let measured = screen_error::largest(&bvh, &camera, &picture.depth).map_or(0.0, |error| error.px);
        let claimed = f64::from(report.max_error_px);
        let figures = &mut figures[which];
        figures.frames += 1;
        figures.holes += verdict.holes.len();
        figures.fat += verdict.fat.len();
        // Where something reaches the eye itself, nothing is claimed.
        if claimed.is_finite() {
            figures.tightest = figures.tightest.max(measured / claimed);
            figures.false_claims += u64::from(measured > claimed + ROUNDING_PX);
        }
        let (holes, fat) = (verdict.holes.len(), verdict.fat.len());
        let errors = format!("{measured:.2} of {claimed:.2} px, {holes} holes, {fat} fat");
        eprintln!("{index} {place:?} {:?} {threshold_px} px: {errors}", KERNELS[which]);
    }
    let of_kernel = |(kernel, figures): (Kernel, &Figures)| {
        let Figures { frames, holes, fat, false_claims, tightest } = figures;
        let report = serde_json::json!({
            "frames": frames, "holes": holes, "fat": fat, "false_claims": false_claims, "tightest": tightest,
        });
        (format!("{kernel:?}"), report)
    };
    let kernels: serde_json::Map<_, _> = KERNELS.into_iter().zip(&figures).map(of_kernel).collect();
    println!("{}", serde_json::json!({ "model": model, "poses": count, "kernels": kernels }));
    Ok(())
}
