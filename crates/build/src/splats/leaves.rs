//! From a mesh to leaves: for each referenced vertex a sphere, a normal, a cone and a colour.
//!
//! The sphere is centred on the vertex and as large as the largest bounding sphere of the triangles around it, so the spheres
//! at a triangle's corners cover it (splats paper, section 2.2). The normal is the mesh's own, or else the mean of the
//! triangles' normals weighted by their angles at the vertex (Thürmer & Wüthrich, *Computing vertex normals from polygonal
//! facets*, JGT 1998). The cone holds the normals of all triangles around the vertex, seen from the normal as quantised.

use super::mesh::Mesh;
use super::orientation::Orientation;
use crate::BuildError;
use gigalod_geom::quantise::{cone, normal};
use gigalod_geom::sphere::{round_up, triangle_bounding_radius};
use gigalod_geom::{Aabb, Sphere};
use glam::{DVec3, Vec3};

/// A leaf of the hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    /// Local space. Encloses the exact sphere around the exact vertex, whatever rounding to `f32` did to it.
    pub(super) sphere: Sphere,
    /// Code of [`normal`].
    pub(super) normal: u16,
    /// Code of [`cone`].
    pub(super) cone: u8,
    /// 8-bit sRGB.
    pub(super) color: [u8; 3],
}

pub(super) struct Leaves {
    pub(super) leaves: Vec<Leaf>,
    /// Of local space; model space.
    pub(super) origin: DVec3,
    /// Of the referenced vertices; model space.
    pub(super) bounds: Aabb,
    pub(super) closed: bool,
    pub(super) has_colors: bool,
}

/// What a vertex gathers from its triangles.
#[derive(Clone, Copy)]
struct Gathered {
    /// −1 until the vertex is referenced.
    radius: f64,
    normal: Vec3,
    /// Cosine between the quantised normal and the farthest triangle normal.
    cos_cone: f32,
}

pub(super) fn from_mesh(mesh: Mesh) -> Result<Leaves, BuildError> {
    let mut gathered = vec![Gathered { radius: -1.0, normal: Vec3::ZERO, cos_cone: 1.0 }; mesh.positions.len()];
    let own_normals = !mesh.normals.is_empty();
    let corners_of = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize]);

    let mut bounds = Aabb::EMPTY;
    let mut orientation = Orientation::default();
    let anchor = mesh.positions[mesh.triangles[0][0] as usize];
    for triangle in &mesh.triangles {
        let corners = corners_of(triangle);
        bounds = corners.into_iter().fold(bounds, Aabb::including);
        orientation.add(*triangle, corners.map(|corner| corner - anchor));
        let radius = triangle_bounding_radius(corners);
        let weighted = angle_weighted_normals(corners);
        for (vertex, normal) in triangle.iter().zip(weighted) {
            let vertex = &mut gathered[*vertex as usize];
            vertex.radius = vertex.radius.max(radius);
            vertex.normal += normal;
        }
    }
    let extent = bounds.extent().max_element();
    if extent.is_nan() || extent > 1e30 {
        return Err(BuildError::TooWide { extent });
    }
    let origin = bounds.center();

    let codes: Vec<u16> = gathered
        .iter()
        .enumerate()
        .map(|(vertex, gathered)| {
            let own = if own_normals { mesh.normals[vertex].normalize_or_zero() } else { Vec3::ZERO };
            normal::encode([own, gathered.normal, Vec3::Y].into_iter().find(|n| *n != Vec3::ZERO).unwrap_or(Vec3::Y))
        })
        .collect();
    for triangle in &mesh.triangles {
        let face = face_normal(corners_of(triangle));
        for vertex in triangle {
            let cos = normal::decode(codes[*vertex as usize]).dot(face);
            let vertex = &mut gathered[*vertex as usize];
            // Triangles without an area have no side that could be seen.
            if face != Vec3::ZERO {
                vertex.cos_cone = vertex.cos_cone.min(cos);
            }
        }
    }

    let leaves: Vec<Leaf> = gathered
        .iter()
        .enumerate()
        .filter(|(_, gathered)| gathered.radius >= 0.0)
        .map(|(vertex, gathered)| {
            let exact = mesh.positions[vertex] - origin;
            let center = exact.as_vec3();
            let moved = (center.as_dvec3() - exact).length();
            Leaf {
                sphere: Sphere { center, radius: round_up((gathered.radius + moved) * (1.0 + 1e-14)) },
                normal: codes[vertex],
                cone: cone::encode(gathered.cos_cone),
                color: mesh.colors.get(vertex).copied().unwrap_or_default(),
            }
        })
        .collect();
    if leaves.len() >= 1 << 31 {
        return Err(BuildError::TooManyVertices { found: leaves.len() as u64 });
    }
    Ok(Leaves { leaves, origin, bounds, closed: orientation.is_closed(), has_colors: !mesh.colors.is_empty() })
}

/// Unit normal; zero for a triangle without an area.
fn face_normal([a, b, c]: [DVec3; 3]) -> Vec3 {
    (b - a).cross(c - a).try_normalize().map_or(Vec3::ZERO, |normal| normal.as_vec3())
}

/// The face normal times the angle at each corner; zero for a triangle without an area.
fn angle_weighted_normals(corners: [DVec3; 3]) -> [Vec3; 3] {
    let normal = face_normal(corners);
    std::array::from_fn(|corner| {
        let to = |other: usize| (corners[(corner + other) % 3] - corners[corner]).as_vec3();
        let (u, v) = (to(1), to(2));
        normal * libm_free_angle(u, v)
    })
}

/// Angle between two vectors within 0.002 radian, without any platform's `libm`: it only weights.
fn libm_free_angle(u: Vec3, v: Vec3) -> f32 {
    let scale = (u.length_squared() * v.length_squared()).sqrt();
    if scale <= 0.0 || !scale.is_finite() {
        return 0.0;
    }
    let cos = (u.dot(v) / scale).clamp(-1.0, 1.0);
    // acos(|x|) ≈ √(1 − |x|) · (1.5707288 − 0.2121144 |x| + 0.0742610 x² − 0.0187293 |x|³); Abramowitz & Stegun 4.4.45.
    let x = cos.abs();
    let acute = (1.0 - x).sqrt() * (1.570_728_8 + x * (-0.212_114_4 + x * (0.074_261 - 0.018_729_3 * x)));
    if cos < 0.0 { std::f32::consts::PI - acute } else { acute }
}
