//! Small meshes for the tests of this crate.

use crate::Mesh;
use glam::DVec3;
use std::collections::HashMap;

/// A closed unit sphere around `center`: an icosahedron split `levels` times, `20 * 4^levels` triangles, with exact normals.
pub(crate) fn icosphere(levels: u32, center: DVec3) -> Mesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = [[-1.0, golden, 0.0], [1.0, golden, 0.0], [-1.0, -golden, 0.0], [1.0, -golden, 0.0]]
        .into_iter()
        .flat_map(|[x, y, z]| [[x, y, z], [z, x, y], [y, z, x]])
        .map(|p| DVec3::from_array(p).normalize())
        .collect();
    // The faces are the triples of points that are neighbours of one another.
    let side = 2.0 / (1.0 + golden * golden).sqrt();
    let near = |a: usize, b: usize| (points[a] - points[b]).length() < side * 1.01;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] }.map(|v| v as u32));
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]: [u32; 3]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let normals = points.iter().map(|p| p.as_vec3()).collect();
    let positions = points.into_iter().map(|p| p + center).collect();
    Mesh::new(positions, Some(normals), None, triangles).expect("a sphere is a mesh")
}

/// The closed unit cube with its smallest corner at `corner`, 12 triangles, vertices shared.
pub(crate) fn cube(corner: DVec3) -> Mesh {
    let positions =
        (0..8).map(|i| corner + DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new(positions, None, None, triangles).expect("a cube is a mesh")
}

/// A rectangle across the z axis, two triangles, facing +z.
pub(crate) fn rectangle(min: [f64; 2], max: [f64; 2], z: f64) -> Vec<[DVec3; 3]> {
    let corner = |x: f64, y: f64| DVec3::new(x, y, z);
    let (a, b) = (corner(min[0], min[1]), corner(max[0], min[1]));
    let (c, d) = (corner(max[0], max[1]), corner(min[0], max[1]));
    vec![[a, b, c], [a, c, d]]
}

/// A mesh of separate triangles.
pub(crate) fn soup(triangles: &[[DVec3; 3]]) -> Mesh {
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(triangles.as_flattened().to_vec(), None, None, indices).expect("a soup is a mesh")
}

/// Points scattered without a pattern in the ball of `radius`; the same on every call.
pub(crate) fn hash_points(count: usize, radius: f64) -> Vec<DVec3> {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    std::iter::repeat_with(|| DVec3::new(next(), next(), next()))
        .filter(|p| p.length_squared() <= 1.0)
        .map(|p| p * radius)
        .take(count)
        .collect()
}
