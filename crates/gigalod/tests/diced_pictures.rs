//! Real cities as splats, beside the ray tracer that has their triangles and textures.

mod common;
mod painted;

use common::{draw, open, renderer, scene};
use gigalod::build::{NoProgress, Options, splats};
use gigalod::geom::camera::UpAxis;
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Kernel, Lighting, Picture};
use gigalod::runtime::splats::MATERIAL_SRGB;
use gigalod_reference::delta_e::mean_delta_e;
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::{supersampled_coverage, supersampled_picture};
use gigalod_reference::{Bvh, Shading, Truth};
use glam::DVec3;
use std::path::{Path, PathBuf};

const SIZE: ImageSize = ImageSize { width: 640, height: 360 };

fn city(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("GIGALOD_DATA") else {
        println!("skipped: GIGALOD_DATA not set");
        return None;
    };
    let path = Path::new(&folder).join("city").join(name);
    assert!(path.is_file(), "{} is missing", path.display());
    Some(path)
}

fn rgb(picture: &Picture) -> gigalod_reference::Picture {
    let pixels = picture.rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
    gigalod_reference::Picture { size: picture.size, pixels }
}

/// Writes a picture where somebody wants to look at it.
fn keep(name: &str, picture: &gigalod_reference::Picture) {
    if let Some(folder) = std::env::var_os("GIGALOD_PICTURES") {
        let (width, height) = (picture.size.width, picture.size.height);
        let path = Path::new(&folder).join(name).with_extension("png");
        image::save_buffer(path, picture.as_bytes(), width, height, image::ExtendedColorType::Rgb8).unwrap();
    }
}

/// From four sides, and near: `near` are eyes and targets as shares of the bounds.
fn has_no_holes_no_fat_and_its_colours(name: &str, up: UpAxis, near: &[([f64; 3], [f64; 3])]) {
    let (Some(path), Some(mut renderer)) = (city(name), renderer()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("city.glod");
    let options = Options { up: Some(up), ..Options::default() };
    splats::build(painted::open_beside(&path), &options, &NoProgress, &out).unwrap();
    let mut scene = scene(open(&out));
    let mesh = painted::skinned_mesh(&path);
    let bvh = Bvh::build(&mesh);
    let bounds = mesh.bounds();
    let fov = 40f64.to_radians();
    let sides = [[0.0, 20.0], [90.0, 35.0], [180.0, 10.0], [270.0, 60.0]];
    let mut cameras: Vec<Camera> =
        sides.into_iter().map(|side| Camera::orbit(&bounds, up, side, 1.0, fov, SIZE)).collect();
    let sky = if up == UpAxis::Y { DVec3::Y } else { DVec3::Z };
    let at = |share: [f64; 3]| bounds.min + bounds.extent() * DVec3::from_array(share);
    cameras.extend(near.iter().map(|(eye, target)| Camera::look_at(at(*eye), at(*target), sky, fov, SIZE)));
    let mut differences = Vec::new();
    for (number, camera) in cameras.iter().enumerate() {
        let truth = Truth::trace(&bvh, camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, camera, 4);
        let shading = Shading {
            to_light: camera.shoulder_light(),
            background_srgb: Lighting::default().background,
            plain_albedo_srgb: MATERIAL_SRGB,
        };
        let expected = supersampled_picture(&bvh, camera, &shading, 3);
        keep(&format!("{}-{number}-truth", path.file_stem().unwrap().display()), &expected);
        for kernel in [Kernel::Square, Kernel::Round] {
            let (report, picture) = draw(&mut scene, &mut renderer, camera, 1.0, kernel);
            let limited = report.limited_by.is_some().then_some(&picture.footprint_px[..]);
            let verdict = judge(&truth, &touched, &Drawn { depth: &picture.depth, data_footprint_px: limited }, 1.0);
            let (holes, fat) = (verdict.holes.len(), verdict.fat.len());
            let difference = mean_delta_e(&expected, &rgb(&picture), Some(&truth.silhouette()));
            println!(
                "{name} {number} {kernel:?}: {holes} holes, {fat} fat of {}, ΔE {difference:.2}",
                verdict.judged.count()
            );
            keep(&format!("{}-{number}-{kernel:?}", path.file_stem().unwrap().display()), &rgb(&picture));
            assert!(verdict.judged.count() > 1000, "something was judged");
            differences.push((number, kernel, holes, fat, difference));
        }
    }
    let mean = differences.iter().map(|(.., difference)| difference).sum::<f64>() / differences.len() as f64;
    println!("{name}: ΔE {mean:.2} on average");
    for (number, kernel, holes, fat, difference) in differences {
        assert!(holes == 0 && fat == 0, "{name} {number} {kernel:?}: {holes} holes, {fat} fat");
        // Where a pixel shows one splat, what is thinner than a pixel is not its mean, as it is in the reference.
        assert!(difference <= 8.0, "{name} {number} {kernel:?}: ΔE {difference}");
    }
    assert!(mean <= 5.0, "{name}: ΔE {mean}");
}

#[test]
fn a_town_of_textured_triangles_has_no_holes_no_fat_and_its_colours() {
    let near = [([0.5, 0.4, 0.8], [0.5, 0.55, 0.1]), ([0.35, 0.5, 0.35], [0.5, 0.6, 0.05])];
    has_no_holes_no_fat_and_its_colours("railway_lod3_obj/railway_lod3.obj", UpAxis::Z, &near);
}

#[test]
fn a_city_of_textured_boxes_has_no_holes_no_fat_and_its_colours() {
    let near = [([0.5, 0.7, 0.7], [0.5, 0.1, 0.4]), ([0.3, 0.3, 0.3], [0.5, 0.1, 0.5])];
    has_no_holes_no_fat_and_its_colours("VirtualCity.glb", UpAxis::Y, &near);
}
