//! Where a ray meets the original of a model, exactly.
//!
//! In: a raw model, a ray, and what the leaves say about where it hits. Out: the first point of a triangle on the ray near there, by
//! the judge's own intersection; of a point cloud, the point nearest to the ray. The model is streamed: memory stays bounded by what
//! lies around the hit.

use super::error::CliError;
use super::files;
use gigalod_import::Batch;
use gigalod_reference::triangle::{PreparedRay, Ray as TriangleRay};
use gigalod_view::pick::{Hit, Ray};
use glam::DVec3;
use std::collections::HashMap;
use std::path::Path;

/// A leaf's ball holds all triangles at its vertex, and the triangle that is hit has a corner among its neighbours; or it is a leaf's
/// own. So far around the hit, in distances of vertices, corners are looked for. Doubled as often as nothing is found.
const REACHES: [f64; 3] = [8.0, 24.0, 72.0];

/// Around a hit there are not more corners than these; what has more is not a model that was measured by its leaves.
const MOST_CORNERS: usize = 4 << 20;

/// The exact point, in model space; `None` where the ray meets nothing there.
pub(crate) fn point(
    original: &Path,
    ray: &Ray,
    near: &Hit,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Option<DVec3>, CliError> {
    let around = ray.origin + ray.direction * near.t;
    for reach in REACHES {
        let search = Search { ray, around, reach: near.detail * reach };
        let found = search.run(original, is_cancelled)?;
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

struct Search<'a> {
    ray: &'a Ray,
    around: DVec3,
    reach: f64,
}

impl Search<'_> {
    fn run(&self, original: &Path, is_cancelled: &dyn Fn() -> bool) -> Result<Option<DVec3>, CliError> {
        let wrong = |error: &_| CliError::import(original, error);
        let prepared = PreparedRay::new(&TriangleRay { origin: self.ray.origin, direction: self.ray.direction });
        let mut corners: HashMap<u32, DVec3> = HashMap::new();
        let mut nearest = f64::INFINITY;
        let mut lone: Option<(f64, DVec3)> = None;
        let mut has_triangles = false;
        let mut meet = |corners: &HashMap<u32, DVec3>, triangle: &[u32; 3]| {
            if let [Some(a), Some(b), Some(c)] = triangle.map(|corner| corners.get(&corner).copied())
                && let Some(hit) = prepared.meet([a, b, c])
            {
                nearest = nearest.min(hit.t);
            }
        };
        // Triangles may come before their corners: those of the first reading that lack some are met in a second one.
        let mut has_missed = false;
        for reading in 0..2 {
            let mut stream = files::open_model(original)?;
            let mut batch = Batch::default();
            let mut first = 0;
            while stream.next(&mut batch).map_err(|error| wrong(&error))? {
                if is_cancelled() {
                    return Err(CliError::in_file(original, "cancelled"));
                }
                has_triangles |= !batch.triangles.is_empty();
                if reading == 0 {
                    for (at, position) in batch.vertices.positions.iter().enumerate() {
                        if position.distance_squared(self.around) <= self.reach * self.reach {
                            corners.insert(first + at as u32, *position);
                            lone = self.nearer(lone, *position);
                        }
                    }
                    first += batch.vertices.positions.len() as u32;
                    if corners.len() > MOST_CORNERS {
                        return Ok(None);
                    }
                    has_missed |= batch.triangles.iter().flatten().any(|corner| *corner >= first);
                }
                batch.triangles.iter().for_each(|triangle| meet(&corners, triangle));
            }
            if !has_missed {
                break;
            }
        }
        if !has_triangles {
            return Ok(lone.map(|(_, point)| point));
        }
        Ok(nearest.is_finite().then(|| self.ray.origin + self.ray.direction * nearest))
    }

    /// Of two points the one that is nearer to the ray.
    fn nearer(&self, before: Option<(f64, DVec3)>, point: DVec3) -> Option<(f64, DVec3)> {
        let direction = self.ray.direction.normalize_or_zero();
        let from = point - self.ray.origin;
        let distance = (from - direction * from.dot(direction)).length_squared();
        Some(before.filter(|(nearest, _)| *nearest <= distance).unwrap_or((distance, point)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::camera::UpAxis;
    use gigalod_geom::{Camera, ImageSize};
    use gigalod_reference::Bvh;
    use gigalod_view::pick::Pages;
    use glam::DVec2;

    const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

    /// Picked points of a model against the ray tracer's, over a grid of pixels.
    #[derive(Debug, Default)]
    struct Judged {
        /// Pixels where both meet the surface.
        met: usize,
        /// Of these, where the leaves are as near to the truth as they say.
        held: usize,
        /// Largest distance of the leaves' points there, in diagonals.
        by_leaves: f64,
        /// Points that were looked for in the original.
        looked_for: usize,
        /// Largest distance of the original's points, in diagonals.
        exactly: f64,
    }

    fn judge(original: &Path, glod: &Path) -> Judged {
        let file = files::open_built(glod).unwrap().splats().unwrap().clone();
        let mut stream = files::open_model(original).unwrap();
        let mesh = gigalod::verify::mesh_of(gigalod_import::read_all(&mut *stream, &mut |_, _| {}).unwrap()).unwrap();
        let (bvh, diagonal) = (Bvh::build(&mesh), mesh.bounds().diagonal());
        let mut pages = Pages::default();
        let mut judged = Judged::default();
        for zoom in [1.0, 20.0] {
            let camera = Camera::orbit(&mesh.bounds(), UpAxis::Y, [30.0, 10.0], zoom, 0.7, SIZE);
            for at in (0..12).flat_map(|x| (0..9).map(move |y| DVec2::new(f64::from(x), f64::from(y)) * 53.3 + 20.0)) {
                let ray = Ray { origin: camera.eye, direction: camera.ray_through(at) };
                let true_ray = TriangleRay { origin: ray.origin, direction: ray.direction };
                let (truth, hit) = (bvh.first_hit(&true_ray), pages.first_hit(&file, &ray).unwrap());
                let (Some(truth), Some(hit)) = (truth, hit) else { continue };
                judged.met += 1;
                let distance = (hit.t - truth.t).abs() * ray.direction.length();
                // Close to a silhouette balls stand out, and what is behind may be another sheet.
                if distance > hit.radius * 2.0 {
                    continue;
                }
                judged.held += 1;
                judged.by_leaves = judged.by_leaves.max(distance / diagonal);
                // The whole original is read for each: a few are enough.
                if judged.held % 8 == 0 {
                    judged.looked_for += 1;
                    let found = point(original, &ray, &hit, &|| false).unwrap().expect("the ray meets it there");
                    let true_point = ray.origin + ray.direction * truth.t;
                    judged.exactly = judged.exactly.max((found - true_point).length() / diagonal);
                }
            }
        }
        judged
    }

    #[test]
    fn picked_points_are_the_ray_tracers() {
        let folder = tempfile::tempdir().unwrap();
        let (scan, glod) = (folder.path().join("statue.ply"), folder.path().join("statue.glod"));
        let options = gigalod_synth::StatueOptions {
            triangles: 200_000,
            seed: 2,
            colors: false,
            order: gigalod_synth::Order::Shuffled,
        };
        gigalod_synth::write_statue(options, &mut std::fs::File::create(&scan).unwrap(), &mut |_, _| {}).unwrap();
        let real = std::env::var_os("GIGALOD_DATA").map(|data| Path::new(&data).join("scans/dragon_vrip.ply.gz"));
        for model in [Some(scan), real].into_iter().flatten() {
            let stream = files::open_model(&model).unwrap();
            gigalod_build::splats::build(stream, &Default::default(), &gigalod_build::NoProgress, &glod).unwrap();
            let judged = judge(&model, &glod);
            println!("{}: {judged:?}", model.display());
            assert!(judged.met > 40 && judged.looked_for > 4, "{judged:?}");
            assert!(judged.held * 100 >= judged.met * 95, "{judged:?}");
            assert!(judged.exactly < 1e-9, "{judged:?}");
        }
    }

    #[test]
    fn of_a_cloud_the_point_that_is_nearest_to_the_ray_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let cloud = folder.path().join("cloud.xyz");
        let points: String = (0..20).flat_map(|x| (0..20).map(move |y| format!("{x} {y} 0.5\n"))).collect();
        std::fs::write(&cloud, points).unwrap();
        let ray = Ray { origin: DVec3::new(7.2, 11.4, 10.0), direction: DVec3::NEG_Z };
        let found = point(&cloud, &ray, &Hit::on_ball(9.4, 0.7), &|| false).unwrap();
        assert_eq!(found, Some(DVec3::new(7.0, 11.0, 0.5)));
        let missed = Ray { origin: DVec3::new(500.0, 11.4, 10.0), ..ray };
        assert_eq!(point(&cloud, &missed, &Hit::on_ball(9.4, 0.7), &|| false).unwrap(), None);
    }
}
