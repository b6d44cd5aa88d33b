//! A triangle mesh that fits in memory: what all judgements are made against.
//!
//! Takes positions, triangles and perhaps normals and colours; refuses what no later step could handle. Always holds:
//! every index is in range, every referenced position is finite, every vertex has a normal.
//!
//! Degenerate triangles (zero area, a corner used twice) and unreferenced vertices are ordinary input: the former are
//! points or segments that a distance can reach and a ray cannot, the latter do not exist as far as the bounds know.

use crate::Skin;
use gigalod_geom::Aabb;
use gigalod_geom::color::LINEAR_OF_SRGB8;
use glam::{DVec3, Vec3};

/// Largest magnitude of a coordinate, in model units: far beyond any use, and its sixth power is still finite.
pub const MAX_COORDINATE: f64 = 1e50;

/// A triangle mesh; model space.
#[derive(Clone, Debug)]
pub struct Mesh {
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    colors: Option<Vec<[u8; 3]>>,
    triangles: Vec<[u32; 3]>,
    bounds: Aabb,
    skin: Option<Skin>,
}

/// Why a mesh was refused.
#[derive(Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} uses vertex {vertex} but there are {vertex_count} vertices")]
    NoSuchVertex {
        /// The offending triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Vertices in the mesh.
        vertex_count: usize,
    },
    /// A referenced position is NaN, infinite or beyond [`MAX_COORDINATE`].
    #[error("vertex {vertex} is at {position}, expected finite coordinates of at most {MAX_COORDINATE:e}")]
    Position {
        /// The offending vertex.
        vertex: u32,
        /// Where it is said to be.
        position: DVec3,
    },
    /// Attributes do not match the vertices, or triangles, one to one.
    #[error("{found} {attribute} for {vertex_count} {}", if matches!(*.attribute, "normals" | "colors") { "vertices" } else { "triangles" })]
    AttributeCount {
        /// `"normals"` or `"colors"` of vertices; `"texture corners"` or `"materials"` of triangles.
        attribute: &'static str,
        /// How many there are.
        found: usize,
        /// How many were expected.
        vertex_count: usize,
    },
    /// A texture coordinate, material or texture that is not there, or a texture of another size than it says.
    #[error("a number of the skin names nothing")]
    Skin,
    /// More triangles than an index can tell apart.
    #[error("{triangle_count} triangles, expected fewer than 2^32 - 1")]
    TooManyTriangles {
        /// How many there are.
        triangle_count: usize,
    },
}

impl Mesh {
    /// A mesh of counter-clockwise `triangles`. Without `normals` they are computed by [`vertex_normals`]; given ones are
    /// kept as they are (they need not be unit; a zero or NaN normal makes the shading fall back to the flat normal).
    /// `colors` are 8-bit sRGB.
    ///
    /// # Errors
    /// [`MeshError`] where an index, a referenced position or the number of attributes is impossible.
    pub fn new(
        positions: Vec<DVec3>,
        normals: Option<Vec<Vec3>>,
        colors: Option<Vec<[u8; 3]>>,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        let vertex_count = positions.len();
        if triangles.len() >= u32::MAX as usize {
            return Err(MeshError::TooManyTriangles { triangle_count: triangles.len() });
        }
        for (attribute, count) in
            [("normals", normals.as_ref().map(Vec::len)), ("colors", colors.as_ref().map(Vec::len))]
        {
            if let Some(found) = count.filter(|&count| count != vertex_count) {
                return Err(MeshError::AttributeCount { attribute, found, vertex_count });
            }
        }
        let mut bounds = Aabb::EMPTY;
        for (triangle, corners) in triangles.iter().enumerate() {
            for &vertex in corners {
                let Some(&position) = positions.get(vertex as usize) else {
                    return Err(MeshError::NoSuchVertex { triangle, vertex, vertex_count });
                };
                // NaN compares false.
                if !position.abs().cmple(DVec3::splat(MAX_COORDINATE)).all() {
                    return Err(MeshError::Position { vertex, position });
                }
                bounds = bounds.including(position);
            }
        }
        let normals = normals.unwrap_or_else(|| vertex_normals(&positions, &triangles));
        Ok(Self { positions, normals, colors, triangles, bounds, skin: None })
    }

    /// The same mesh with materials and textures.
    ///
    /// # Errors
    /// The skin does not fit.
    pub fn with_skin(self, skin: Skin) -> Result<Self, MeshError> {
        skin.check(self.triangles.len())?;
        Ok(Self { skin: Some(skin), ..self })
    }

    /// False where an alpha mask leaves a point of a triangle out.
    pub fn is_there(&self, triangle: u32, barycentrics: [f64; 3]) -> bool {
        self.skin.as_ref().is_none_or(|skin| skin.is_there(triangle, barycentrics))
    }

    /// Vertex positions.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// One normal per vertex, not necessarily unit; zero where no triangle with an area meets the vertex.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// One 8-bit sRGB colour per vertex.
    pub fn colors(&self) -> Option<&[[u8; 3]]> {
        self.colors.as_deref()
    }

    /// Three vertex indices per triangle, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Smallest box around the *referenced* vertices; empty where there are no triangles.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Corner positions of a triangle.
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.positions[vertex as usize])
    }

    /// The point of a triangle at `barycentrics` (which sum to 1).
    pub fn point(&self, triangle: u32, barycentrics: [f64; 3]) -> DVec3 {
        // Relative to a corner, so that far from the origin no precision goes into the sum of the weights.
        let [a, b, c] = self.corners(triangle);
        a + (b - a) * barycentrics[1] + (c - a) * barycentrics[2]
    }

    /// Unit normal of a triangle's plane, by its winding; zero for a triangle without an area.
    pub fn flat_normal(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Interpolated, normalised vertex normal; `None` where the vertex normals cancel or are not numbers.
    pub fn smooth_normal(&self, triangle: u32, barycentrics: [f64; 3]) -> Option<DVec3> {
        let corners = self.triangles[triangle as usize];
        let sum: DVec3 =
            corners.iter().zip(barycentrics).map(|(&v, weight)| self.normals[v as usize].as_dvec3() * weight).sum();
        sum.try_normalize()
    }

    /// Interpolated linear RGB; `None` where the mesh has no colours. Each corner is converted to linear light *before*
    /// the interpolation: it is light that mixes, not code values. A skin's colour is a factor to it.
    pub fn linear_color(&self, triangle: u32, barycentrics: [f64; 3]) -> Option<Vec3> {
        let of_vertices = self.colors.as_ref().map(|colors| {
            let corners = self.triangles[triangle as usize].iter().zip(barycentrics);
            corners.map(|(&vertex, weight)| linear_of_srgb8(colors[vertex as usize]) * weight as f32).sum()
        });
        match &self.skin {
            Some(skin) => Some(of_vertices.unwrap_or(Vec3::ONE) * skin.look(triangle, barycentrics).0),
            None => of_vertices,
        }
    }
}

/// Linear RGB of an 8-bit sRGB colour.
pub fn linear_of_srgb8(srgb: [u8; 3]) -> Vec3 {
    Vec3::from_array(srgb.map(|value| LINEAR_OF_SRGB8[usize::from(value)]))
}

/// Unit vertex normals: the sum of the adjacent triangles' unit normals, each weighted by its angle at the vertex, which
/// does not depend on how a flat region happens to be cut into triangles. Zero where no triangle with an area meets.
///
/// # Source
/// Thürmer & Wüthrich, *Computing Vertex Normals from Polygonal Facets*, Journal of Graphics Tools 3(1), 1998.
pub fn vertex_normals(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let corners = triangle.map(|vertex| positions[vertex as usize]);
        let [a, b, c] = corners;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        for corner in 0..3 {
            let here = corners[corner];
            let (to_next, to_previous) = (corners[(corner + 1) % 3] - here, corners[(corner + 2) % 3] - here);
            let angle = libm::atan2(to_next.cross(to_previous).length(), to_next.dot(to_previous));
            sums[triangle[corner] as usize] += normal * angle;
        }
    }
    sums.into_iter().map(|sum| sum.normalize_or_zero().as_vec3()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    #[test]
    fn cube_corner_normal_is_the_diagonal_however_its_faces_are_cut() {
        let cube = fixtures::cube(DVec3::ZERO);
        for (position, normal) in cube.positions().iter().zip(cube.normals()) {
            let diagonal = (*position - DVec3::splat(0.5)).normalize();
            assert!((normal.as_dvec3() - diagonal).length() < 1e-6, "{position}: {normal}");
        }
    }

    #[test]
    fn bounds_ignore_unreferenced_vertices_even_nan() {
        let mut positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        positions.extend([DVec3::splat(99.0), DVec3::NAN]);
        let mesh = Mesh::new(positions, None, None, vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.bounds(), Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, 0.0) });
        assert_eq!(mesh.normals()[3], Vec3::ZERO);
    }

    #[test]
    fn degenerate_triangles_do_not_disturb_normals() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X * 2.0];
        let mesh = Mesh::new(positions, None, None, vec![[0, 1, 2], [0, 0, 1], [0, 1, 3], [2, 2, 2]]).unwrap();
        assert_eq!(mesh.normals(), [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::ZERO]);
    }

    #[test]
    fn impossible_meshes_are_refused_by_name() {
        let triangle = || vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let error = |mesh: Result<Mesh, MeshError>| mesh.unwrap_err().to_string();
        assert_eq!(
            error(Mesh::new(triangle(), None, None, vec![[0, 1, 3]])),
            "triangle 0 uses vertex 3 but there are 3 vertices"
        );
        assert_eq!(error(Mesh::new(triangle(), None, Some(vec![[0; 3]]), vec![[0, 1, 2]])), "1 colors for 3 vertices");
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::NAN, 0.0)];
        assert_eq!(
            error(Mesh::new(positions, None, None, vec![[0, 1, 2]])),
            "vertex 2 is at [0, NaN, 0], expected finite coordinates of at most 1e50"
        );
    }

    #[test]
    fn colours_mix_as_light() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = Mesh::new(positions, None, Some(vec![[0; 3], [255; 3], [255; 3]]), vec![[0, 1, 2]]).unwrap();
        let mixed = mesh.linear_color(0, [0.5, 0.5, 0.0]).unwrap();
        assert!((mixed - Vec3::splat(0.5)).length() < 1e-6);
    }
}
