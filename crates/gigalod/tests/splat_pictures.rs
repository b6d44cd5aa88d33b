//! Real scans as splats, beside the ray tracer: nothing may show through, and nothing may stick out.

mod common;

use common::{SIZE, built, draw, mesh, renderer, scan, scene, twelve_directions};
use gigalod::geom::Camera;
use gigalod::geom::camera::UpAxis;
use gigalod::render::{Kernel, Lighting, Picture, Renderer};
use gigalod::runtime::splats::{Cutting, MATERIAL_SRGB};
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Shading, Truth, metrics, shade};
use std::path::{Path, PathBuf};

fn rgb(picture: &Picture) -> gigalod_reference::Picture {
    let pixels = picture.rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
    gigalod_reference::Picture { size: picture.size, pixels }
}

fn has_no_holes_and_no_fat(model: &str) {
    let (Some(path), Some(renderer)) = (scan(model), renderer()) else { return };
    is_covered_from_twelve_sides(model, &path, renderer);
}

fn is_covered_from_twelve_sides(model: &str, path: &Path, mut renderer: Renderer) {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(path, folder.path()));
    let mesh = mesh(path);
    let bvh = Bvh::build(&mesh);
    let mut psnr = [vec![], vec![], vec![]];
    for orbit_deg in twelve_directions() {
        let camera = Camera::orbit(&mesh.bounds(), UpAxis::Y, orbit_deg, 1.0, 40f64.to_radians(), SIZE);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        let shading = Shading {
            to_light: camera.shoulder_light(),
            background_srgb: Lighting::default().background,
            plain_albedo_srgb: MATERIAL_SRGB,
        };
        let expected = shade::picture(&truth, &shading);
        let mask = metrics::silhouette_mask(&truth);
        for (kernel, psnr) in [Kernel::Square, Kernel::Round, Kernel::Gauss].into_iter().zip(&mut psnr) {
            let (report, picture) = draw(&mut scene, &mut renderer, &camera, 1.0, kernel);
            let limited = report.limited_by.is_some().then_some(&picture.footprint_px[..]);
            let verdict = judge(&truth, &touched, &Drawn { depth: &picture.depth, data_footprint_px: limited }, 1.0);
            assert!(
                verdict.holes.is_empty() && verdict.fat.is_empty(),
                "{model} from {orbit_deg:?}, {kernel:?}: {} holes, {} fat, first {:?} {:?}",
                verdict.holes.len(),
                verdict.fat.len(),
                verdict.holes.first(),
                verdict.fat.first(),
            );
            assert!(verdict.judged.count() > 1000, "something was judged");
            psnr.extend(metrics::psnr_db(&expected, &rgb(&picture), Some(&mask)));
        }
    }
    let [square, round, gauss] = psnr.map(|all| all.iter().sum::<f64>() / all.len() as f64);
    println!("{model}: mean PSNR to the ray tracer {square:.2} dB (square), {round:.2} (round), {gauss:.2} (gauss)");
    assert!(round > 15.0 && gauss > 15.0, "the picture is recognisable");
}

#[test]
fn dragon_has_no_holes_and_no_fat_from_twelve_sides() {
    has_no_holes_and_no_fat("dragon_vrip.ply.gz");
}

#[test]
fn bunny_has_no_holes_and_no_fat_from_twelve_sides() {
    has_no_holes_and_no_fat("bun_zipper.ply");
}

#[test]
fn laurana_has_no_holes_and_no_fat_from_twelve_sides() {
    has_no_holes_and_no_fat("laurana.ply");
}

/// Poses close to and inside the model: grazing, through the near plane, from within.
#[test]
fn bunny_has_no_holes_close_up_at_grazing_angles_and_from_inside() {
    let (Some(path), Some(mut renderer)) = (scan("bun_zipper.ply"), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(built(&path, folder.path()));
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    let size = mesh.bounds().diagonal();
    let mut poses = Vec::new();
    for vertex in (0..mesh.positions().len()).step_by(mesh.positions().len() / 9) {
        let (at, normal) = (mesh.positions()[vertex], mesh.normals()[vertex].as_dvec3().normalize());
        let along = normal.any_orthonormal_vector();
        // Straight on from 4 % of the size; along the surface, 5° above it; from behind the surface outwards.
        poses.push((at + normal * size * 0.04, at));
        poses.push((at + (along * 0.9962 + normal * 0.0872) * size * 0.1, at));
        poses.push((at - normal * size * 0.1, at));
    }
    for (eye, target) in poses {
        let camera = Camera::look_at(eye, target, glam::DVec3::Y, 40f64.to_radians(), SIZE);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        for kernel in [Kernel::Square, Kernel::Round, Kernel::Gauss] {
            let (_, picture) = draw(&mut scene, &mut renderer, &camera, 1.0, kernel);
            let footprint = Some(&picture.footprint_px[..]);
            let verdict = judge(&truth, &touched, &Drawn { depth: &picture.depth, data_footprint_px: footprint }, 1.0);
            let (holes, fat) = (verdict.holes.len(), verdict.fat.len());
            assert!(holes == 0 && fat == 0, "{eye} {target} {kernel:?}: {holes} holes, {fat} fat");
        }
    }
}

/// A closed statue, so that what shows its back is left out.
fn closed_statue(folder: &Path, triangles: u64) -> PathBuf {
    let ply = folder.join("statue.ply");
    let options = gigalod::synth::StatueOptions { triangles, seed: 2, ..gigalod::synth::StatueOptions::default() };
    let mut file = std::fs::File::create(&ply).unwrap();
    gigalod::synth::write_statue(options, &mut file, &mut |_, _| {}).unwrap();
    ply
}

/// The scans are open, and drawn from both sides; here what shows its back is left out.
#[test]
fn a_closed_statue_has_no_holes_and_no_fat_from_twelve_sides() {
    let Some(renderer) = renderer() else { return };
    let folder = tempfile::tempdir().unwrap();
    let ply = closed_statue(folder.path(), 400_000);
    assert!(built(&ply, folder.path()).skeleton().root().closed);
    is_covered_from_twelve_sides("closed statue", &ply, renderer);
}

#[test]
fn culling_never_changes_the_picture() {
    let Some(mut renderer) = renderer() else { return };
    let folder = tempfile::tempdir().unwrap();
    let ply = closed_statue(folder.path(), 40_000);
    let mut scene = scene(built(&ply, folder.path()));
    for (orbit_deg, zoom, threshold_px) in
        [([0.0, 0.0], 1.0, 1.0), ([40.0, 10.0], 5.0, 2.0), ([200.0, -30.0], 2.0, 12.0)]
    {
        let camera = Camera::orbit(&scene.bounds(), UpAxis::Y, orbit_deg, zoom, 40f64.to_radians(), SIZE);
        let mut picture = |frustum_culling, backface_culling| {
            scene.splats_mut().cutting = Cutting { frustum_culling, backface_culling };
            draw(&mut scene, &mut renderer, &camera, threshold_px, Kernel::Round)
        };
        let (all, uncut) = picture(false, false);
        for (frustum, backface) in [(true, false), (false, true), (true, true)] {
            let (report, cut) = picture(frustum, backface);
            assert!(cut.rgba == uncut.rgba && cut.depth == uncut.depth, "{orbit_deg:?} {frustum} {backface}");
            assert!(report.visited < all.visited || !frustum || zoom == 1.0, "culling saves work");
        }
    }
}
