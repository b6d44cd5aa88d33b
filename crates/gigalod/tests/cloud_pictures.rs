//! Real scans without their faces, beside the ray tracer that has them: nothing may show through, and nothing may stick out.

mod clouds;
mod common;

use common::{SIZE, built, draw, mesh, renderer, scan, scene, twelve_directions};
use gigalod::format::splats::SplatFile;
use gigalod::geom::Camera;
use gigalod::geom::camera::UpAxis;
use gigalod::geom::quantise::normal;
use gigalod::render::Kernel;
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod::verify::{self, SplatTree};
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Mesh, Truth};
use std::sync::Arc;

fn tree(file: &SplatFile) -> SplatTree {
    let (tree, problems) = verify::check(file, &mut |_| {});
    assert_eq!(problems.told, Vec::<String>::new());
    tree
}

fn mean_leaf_radius(tree: &SplatTree) -> f64 {
    let radii: Vec<f64> =
        tree.nodes.iter().filter(|node| node.children == 0).map(|node| f64::from(node.sphere.radius)).collect();
    radii.iter().sum::<f64>() / radii.len() as f64
}

/// Mean angle in degrees between the leaves' normals and the mesh's where it is nearest, and the share that is on the other side.
fn normal_error(file: &Arc<SplatFile>, tree: &SplatTree, mesh: &Mesh, bvh: &Bvh<'_>) -> (f64, f64) {
    let origin = file.skeleton().root().origin;
    let (mut sum, mut turned, mut count) = (0.0, 0.0, 0.0);
    for leaf in tree.nodes.iter().filter(|node| node.children == 0) {
        let nearest = bvh.nearest_point(leaf.sphere.center.as_dvec3() + origin).unwrap();
        let Some(expected) = mesh.smooth_normal(nearest.triangle, nearest.barycentrics) else { continue };
        let cosine = normal::decode(leaf.node.normal()).as_dvec3().dot(expected);
        sum += cosine.abs().min(1.0).acos().to_degrees();
        turned += if cosine < 0.0 { 1.0 } else { 0.0 };
        count += 1.0;
    }
    (sum / count, turned / count)
}

fn points_are_as_good_as_their_mesh(model: &str, most_angle_deg: f64, most_turned: f64) {
    let (Some(path), Some(mut renderer)) = (scan(model), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("points.ply");
    clouds::drop_faces(&path, &points);
    let of_mesh = mean_leaf_radius(&tree(&built(&path, folder.path())));
    let file = built(&points, folder.path());
    let splats = tree(&file);
    let mesh = mesh(&path);
    let bvh = Bvh::build(&mesh);
    let (angle_deg, turned) = normal_error(&file, &splats, &mesh, &bvh);
    let ratio = mean_leaf_radius(&splats) / of_mesh;
    println!("{model}: normals {angle_deg:.2}° off, {:.4} % turned, radii {ratio:.3} of the mesh's", turned * 100.0);
    assert!(angle_deg < most_angle_deg && turned < most_turned && ratio < 1.3);

    let mut scene = scene(file);
    for orbit_deg in twelve_directions() {
        let camera = Camera::orbit(&mesh.bounds(), UpAxis::Y, orbit_deg, 1.0, 40f64.to_radians(), SIZE);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        for kernel in [Kernel::Square, Kernel::Round] {
            let (report, picture) = draw(&mut scene, &mut renderer, &camera, 1.0, kernel);
            let limited = report.limited_by.is_some().then_some(&picture.footprint_px[..]);
            let verdict = judge(&truth, &touched, &Drawn { depth: &picture.depth, data_footprint_px: limited }, 1.0);
            let (holes, fat) = (verdict.holes.len(), verdict.fat.len());
            assert!(verdict.judged.count() > 1000, "something was judged");
            assert!(holes == 0 && fat == 0, "{model} {orbit_deg:?} {kernel:?}: {holes} holes, {fat} fat");
        }
    }
}

#[test]
fn the_dragons_points_have_no_holes_and_no_fat_from_twelve_sides() {
    points_are_as_good_as_their_mesh("dragon_vrip.ply.gz", 8.0, 0.01);
}

#[test]
fn the_bunnys_points_have_no_holes_and_no_fat_from_twelve_sides() {
    points_are_as_good_as_their_mesh("bun_zipper.ply", 8.0, 0.01);
}
