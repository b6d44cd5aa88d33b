//! What a camera truly sees of a mesh: one ray through every pixel centre, or many per pixel.
//!
//! Takes a [`Bvh`] and a [`Camera`]; returns per pixel the first surface point, whether anything is seen at all, or a
//! filtered picture. No near plane: whatever lies in front of the eye is seen. Rows are traced in parallel, each on its own,
//! so the result does not depend on the number of threads.

use crate::mesh::linear_of_srgb8;
use crate::triangle::Ray;
use crate::{Bvh, Mask, Picture, Shading};
use gigalod_geom::Camera;
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// What the camera sees through the centre of each pixel.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Where from.
    pub camera: Camera,
    /// The first surface point behind each pixel centre, row by row from the top left; `None` for background.
    pub surface: Vec<Option<SurfacePoint>>,
}

/// A point of the surface as a camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Distance along the viewing axis, in model units.
    pub depth: f64,
    /// Unit vector, on the seen side: the vertex normals, interpolated.
    pub shading_normal: Vec3,
    /// Unit vector, towards the eye: the normal of the triangle's plane.
    pub flat_normal: Vec3,
    /// Linear RGB.
    pub albedo: Vec3,
    /// Index of the triangle.
    pub triangle: u32,
}

impl Truth {
    /// Traces one ray per pixel centre. `plain_albedo_srgb` is the colour of a mesh that has none.
    pub fn trace(bvh: &Bvh, camera: &Camera, plain_albedo_srgb: [u8; 3]) -> Self {
        let plain_albedo = linear_of_srgb8(plain_albedo_srgb);
        let surface = per_pixel(camera, |corner| surface_point(bvh, camera, corner + 0.5, plain_albedo));
        Self { camera: *camera, surface }
    }

    /// Depth of a pixel by its index in the rows; +inf for background.
    pub fn depth(&self, index: usize) -> f64 {
        self.surface[index].map_or(f64::INFINITY, |point| point.depth)
    }

    /// `[x, y]` of a pixel by its index in the rows.
    pub fn pixel(&self, index: usize) -> [u32; 2] {
        let width = self.camera.size.width as usize;
        [(index % width) as u32, (index / width) as u32]
    }

    /// Direction through a pixel's centre; its length along the viewing axis is 1.
    pub fn ray(&self, index: usize) -> DVec3 {
        let [x, y] = self.pixel(index).map(f64::from);
        self.camera.ray_through(DVec2::new(x, y) + 0.5)
    }

    /// All depths as `f32`, +inf for background: what a perfect renderer's `--depth` would hold.
    pub fn depths_f32(&self) -> Vec<f32> {
        (0..self.surface.len()).map(|pixel| self.depth(pixel) as f32).collect()
    }

    /// Pixels whose centre sees the surface.
    pub fn silhouette(&self) -> Mask {
        Mask { size: self.camera.size, members: self.surface.iter().map(Option::is_some).collect() }
    }
}

/// Pixels in which any of n × n stratified rays, n = `samples_per_side`, or the central one, meets the surface: what a thin
/// feature truly touches.
pub fn supersampled_coverage(bvh: &Bvh, camera: &Camera, samples_per_side: u32) -> Mask {
    let members = per_pixel(camera, |corner| {
        let sees = |within: DVec2| bvh.is_hit(&ray_through(camera, corner + within));
        sees(DVec2::splat(0.5)) || stratified_samples(samples_per_side).any(sees)
    });
    Mask { size: camera.size, members }
}

/// The picture averaged over n × n stratified rays per pixel, n = `samples_per_side`, in linear light.
///
/// # Panics
/// When `samples_per_side` is 0.
pub fn supersampled_picture(bvh: &Bvh, camera: &Camera, shading: &Shading, samples_per_side: u32) -> Picture {
    assert!(samples_per_side > 0, "a picture needs at least one sample per pixel");
    let plain_albedo = linear_of_srgb8(shading.plain_albedo_srgb);
    let pixels = per_pixel(camera, |corner| {
        let sum: Vec3 = stratified_samples(samples_per_side)
            .map(|within| shading.linear(surface_point(bvh, camera, corner + within, plain_albedo).as_ref()))
            .sum();
        crate::shade::srgb8_of_linear(sum / (samples_per_side * samples_per_side) as f32)
    });
    Picture { size: camera.size, pixels }
}

/// Sample positions in the unit square: one in each of n × n cells, and one in each of n² columns and n² rows, so that a
/// feature thinner than a cell is not missed for being upright.
///
/// # Source
/// Chiu, Shirley & Wang, *Multi-jittered Sampling*, Graphics Gems IV, 1994; without the jitter.
fn stratified_samples(per_side: u32) -> impl Iterator<Item = DVec2> {
    let n = f64::from(per_side);
    let place = move |cell: u32, within: u32| (f64::from(cell) + (f64::from(within) + 0.5) / n) / n;
    (0..per_side)
        .flat_map(move |row| (0..per_side).map(move |column| DVec2::new(place(column, row), place(row, column))))
}

fn ray_through(camera: &Camera, pixel: DVec2) -> Ray {
    Ray { origin: camera.eye, direction: camera.ray_through(pixel) }
}

fn surface_point(bvh: &Bvh, camera: &Camera, pixel: DVec2, plain_albedo: Vec3) -> Option<SurfacePoint> {
    let ray = ray_through(camera, pixel);
    let hit = bvh.first_hit(&ray)?;
    let mesh = bvh.mesh();
    let flat = towards(mesh.flat_normal(hit.triangle), -ray.direction);
    // On the side of the flat normal, not of the eye: near a silhouette the interpolated normal may well lean away.
    let smooth = mesh.smooth_normal(hit.triangle, hit.barycentrics).map_or(flat, |normal| towards(normal, flat));
    Some(SurfacePoint {
        // The ray's direction has length 1 along the viewing axis.
        depth: hit.t,
        shading_normal: smooth.as_vec3(),
        flat_normal: flat.as_vec3(),
        albedo: mesh.linear_color(hit.triangle, hit.barycentrics).unwrap_or(plain_albedo),
        triangle: hit.triangle,
    })
}

/// `normal`, turned to the side that `direction` points to.
fn towards(normal: DVec3, direction: DVec3) -> DVec3 {
    if normal.dot(direction) < 0.0 { -normal } else { normal }
}

/// Calls `f` with the top left corner of every pixel, rows in parallel.
fn per_pixel<T: Send>(camera: &Camera, f: impl Fn(DVec2) -> T + Sync) -> Vec<T> {
    let (width, height) = (camera.size.width, camera.size.height);
    let f = &f;
    (0..height)
        .into_par_iter()
        .flat_map_iter(|y| (0..width).map(move |x| f(DVec2::new(f64::from(x), f64::from(y)))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, fixtures, shade};
    use gigalod_geom::ImageSize;

    const SIZE: ImageSize = ImageSize { width: 96, height: 72 };
    const STONE: [u8; 3] = [200, 190, 175];

    fn looking_at(center: DVec3) -> Camera {
        Camera::look_at(center + DVec3::new(1.0, 2.0, 3.0), center, DVec3::Y, 0.7, SIZE)
    }

    #[test]
    fn sphere_has_the_depth_and_normal_of_a_sphere() {
        let mesh = fixtures::icosphere(5, DVec3::ZERO);
        let camera = looking_at(DVec3::ZERO);
        let truth = Truth::trace(&Bvh::build(&mesh), &camera, STONE);
        let mut seen = 0;
        for (index, point) in truth.surface.iter().enumerate() {
            let pixel = DVec2::new((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
            let d = camera.ray_through(pixel);
            let (half_b, c) = (camera.eye.dot(d), camera.eye.length_squared() - 1.0);
            let discriminant = half_b * half_b - d.length_squared() * c;
            let Some(point) = point else {
                assert!(discriminant < 0.05, "background inside the sphere at {pixel}");
                continue;
            };
            seen += 1;
            // The mesh lies inside the sphere, by at most the sagitta of its edges.
            let at = camera.eye + d * point.depth;
            assert!(at.length() <= 1.0 + 1e-12 && at.length() > 0.999, "{at}");
            assert!(point.shading_normal.as_dvec3().dot(at) > 0.9995);
            assert!(point.flat_normal.as_dvec3().dot(at) > 0.99);
            if discriminant > 0.5 {
                let exact = (-half_b - discriminant.sqrt()) / d.length_squared();
                assert!((point.depth - exact).abs() < 2e-3, "{} for {exact}", point.depth);
            }
        }
        assert!(seen > 1000);
    }

    #[test]
    fn far_from_the_origin_the_picture_is_the_same() {
        let shading =
            Shading { to_light: DVec3::new(0.3, 0.9, 0.3), background_srgb: [9; 3], plain_albedo_srgb: STONE };
        // Both multiples of the mesh's own precision there, so that the two meshes are truly one.
        let offset = DVec3::new(1e6, -3e6, 2e6);
        let round = |p: &DVec3| (*p * 1048576.0).round() / 1048576.0;
        let near = fixtures::icosphere(3, DVec3::ZERO);
        let positions: Vec<DVec3> = near.positions().iter().map(round).collect();
        let moved = positions.iter().map(|p| *p + offset).collect();
        let picture = |positions: Vec<DVec3>, center: DVec3| {
            let mesh = Mesh::new(positions, None, None, near.triangles().to_vec()).unwrap();
            let camera = looking_at(center);
            let truth = Truth::trace(&Bvh::build(&mesh), &camera, STONE);
            (shade::picture(&truth, &shading), truth.depths_f32())
        };
        assert!(picture(positions, DVec3::ZERO) == picture(moved, offset));
    }

    #[test]
    fn both_sides_are_seen_and_normals_point_to_the_eye() {
        let [a, b] = fixtures::rectangle([-5.0, -5.0], [5.0, 5.0], 0.0)[..] else { unreachable!() };
        let camera = looking_at(DVec3::ZERO);
        let flipped = |[a, b, c]: [DVec3; 3]| [a, c, b];
        let front = fixtures::soup(&[a, b]);
        let back = fixtures::soup(&[flipped(a), flipped(b)]);
        let front = Truth::trace(&Bvh::build(&front), &camera, STONE);
        let back = Truth::trace(&Bvh::build(&back), &camera, STONE);
        for (front, back) in front.surface.iter().zip(&back.surface) {
            let (front, back) = (front.unwrap(), back.unwrap());
            assert_eq!((front.flat_normal, front.shading_normal), (Vec3::Z, Vec3::Z));
            assert_eq!((back.flat_normal, back.shading_normal), (Vec3::Z, Vec3::Z));
        }
    }

    #[test]
    fn a_hair_between_pixel_centres_is_covered_but_not_seen() {
        let size = ImageSize { width: 16, height: 16 };
        let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, std::f64::consts::FRAC_PI_2, size);
        // One unit away and 90° wide, a pixel is 1/8. The hair stands in column 3, between 0.55 and 0.65 of its width.
        let x = |pixels: f64| (pixels - 8.0) / 8.0;
        let hair = fixtures::soup(&fixtures::rectangle([x(3.55), -2.0], [x(3.65), 2.0], 0.0));
        let bvh = Bvh::build(&hair);
        assert_eq!(Truth::trace(&bvh, &camera, STONE).silhouette().count(), 0);
        let covered = supersampled_coverage(&bvh, &camera, 4);
        for (index, member) in covered.members.iter().enumerate() {
            assert_eq!(*member, index % 16 == 3, "pixel {index}");
        }
        // In the picture it covers a tenth of the pixel: one or two of sixteen samples.
        let white = Shading { to_light: DVec3::Z, background_srgb: [0; 3], plain_albedo_srgb: [255; 3] };
        let picture = supersampled_picture(&bvh, &camera, &white, 4);
        let expected = [1.0, 2.0].map(|hits: f32| gigalod_geom::color::srgb8_of_linear(hits / 16.0));
        assert!(expected.contains(&picture.pixels[3][0]), "{:?}", picture.pixels[3]);
        assert_eq!(picture.pixels[4], [0; 3]);
    }
}
