//! Makes a mesh denser (each triangle into four) or sparser (vertex clustering). Both keep orientation.

use super::mesh::Mesh;
use crate::noise::noise3;
use glam::{DVec3, Vec3};

/// Splits every triangle into four at the middles of its edges; shared edges stay shared.
///
/// New and old vertices are then moved by noise of about an edge's wavelength and `rough_m` amplitude.
pub(super) fn subdivide(mesh: &Mesh, edge_m: f32, rough_m: f32, seed: u32) -> Mesh {
    let edge_key = |a: u32, b: u32| (a.min(b), a.max(b));
    let mut edges: Vec<(u32, u32)> =
        mesh.triangles.iter().flat_map(|&[a, b, c]| [edge_key(a, b), edge_key(b, c), edge_key(c, a)]).collect();
    edges.sort_unstable();
    edges.dedup();
    let old = mesh.positions.len() as u32;
    let middle = |a: u32, b: u32| {
        let at = edges.binary_search(&edge_key(a, b)).unwrap_or_else(|_| panic!("edge {a} {b} was not listed"));
        old + at as u32
    };
    let triangles = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        })
        .collect();
    let halves = edges.iter().map(|&(a, b)| (mesh.positions[a as usize] + mesh.positions[b as usize]) * 0.5);
    let move_it = |p: Vec3| p + noise3(seed, p / edge_m) * rough_m;
    let positions = mesh.positions.iter().copied().chain(halves).map(move_it).collect();
    let colors = if mesh.colors.is_empty() {
        Vec::new()
    } else {
        let mean = |&(a, b): &(u32, u32)| {
            let (a, b) = (mesh.colors[a as usize], mesh.colors[b as usize]);
            std::array::from_fn(|channel| ((u16::from(a[channel]) + u16::from(b[channel])) / 2) as u8)
        };
        mesh.colors.iter().copied().chain(edges.iter().map(mean)).collect()
    };
    Mesh { positions, triangles, colors }
}

/// Merges all vertices within a cell of a grid into their mean, and drops triangles that collapse or repeat.
///
/// Returns the mesh unchanged where nothing would be left.
///
/// # Source
/// Rossignac & Borrel, *Multi-resolution 3D Approximations for Rendering Complex Scenes*, 1993.
pub(super) fn cluster(mesh: Mesh, cell_m: f32) -> Mesh {
    let low = mesh.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    // 21 bits for each axis, compared as one number.
    let key = |p: Vec3| {
        let cell = ((p - low) / cell_m).min(Vec3::splat(2_000_000.0)).as_u64vec3();
        cell.x << 42 | cell.y << 21 | cell.z
    };
    let mut keyed: Vec<(u64, u32)> = mesh.positions.iter().map(|&p| key(p)).zip(0..).collect();
    keyed.sort_unstable();
    let mut clustered = Mesh::default();
    let mut cluster_of = vec![0_u32; mesh.positions.len()];
    for group in keyed.chunk_by(|a, b| a.0 == b.0) {
        let (mut sum, mut color_sum) = (DVec3::ZERO, [0_u64; 3]);
        for &(_, vertex) in group {
            cluster_of[vertex as usize] = clustered.positions.len() as u32;
            sum += mesh.positions[vertex as usize].as_dvec3();
            if let Some(color) = mesh.colors.get(vertex as usize) {
                color_sum = std::array::from_fn(|channel| color_sum[channel] + u64::from(color[channel]));
            }
        }
        clustered.positions.push((sum / group.len() as f64).as_vec3());
        if !mesh.colors.is_empty() {
            clustered.colors.push(color_sum.map(|sum| (sum / group.len() as u64) as u8));
        }
    }
    // Each triangle starts at its smallest corner, so that repetitions are equal; order of first appearance is kept.
    let mut triangles: Vec<([u32; 3], u32)> = mesh
        .triangles
        .iter()
        .map(|triangle| triangle.map(|corner| cluster_of[corner as usize]))
        .filter(|&[a, b, c]| a != b && b != c && c != a)
        .map(|[a, b, c]| {
            if a < b && a < c {
                [a, b, c]
            } else if b < c {
                [b, c, a]
            } else {
                [c, a, b]
            }
        })
        .zip(0..)
        .collect();
    triangles.sort_unstable();
    triangles.dedup_by_key(|(corners, _)| *corners);
    triangles.sort_unstable_by_key(|&(_, at)| at);
    clustered.triangles = triangles.into_iter().map(|(corners, _)| corners).collect();
    if clustered.triangles.is_empty() { mesh } else { clustered }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(cells: u32) -> Mesh {
        let side = cells + 1;
        let positions =
            (0..side * side).map(|at| Vec3::new((at % side) as f32, (at / side) as f32, 0.0) / cells as f32).collect();
        let triangles = (0..cells * cells)
            .flat_map(|at| {
                let a = at / cells * side + at % cells;
                [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
            })
            .collect();
        Mesh { positions, triangles, colors: vec![[10, 20, 30]; (side * side) as usize] }
    }

    fn area(mesh: &Mesh) -> f32 {
        let double: f32 = mesh
            .triangles
            .iter()
            .map(|&triangle| {
                let [a, b, c] = mesh.corners(triangle);
                (b - a).cross(c - a).z
            })
            .sum();
        0.5 * double
    }

    #[test]
    fn subdividing_keeps_area_and_shares_edges() {
        let fine = subdivide(&square(4), 1.0, 0.0, 1);
        assert_eq!((fine.triangles.len(), fine.positions.len(), fine.colors.len()), (128, 81, 81));
        assert!((area(&fine) - 1.0).abs() < 1e-5);
        assert!(fine.colors.iter().all(|color| *color == [10, 20, 30]));
    }

    #[test]
    fn clustering_a_flat_square_keeps_its_orientation_and_drops_most() {
        let coarse = cluster(square(16), 0.251);
        assert!(coarse.triangles.len() < 40 && coarse.positions.len() == 16, "{}", coarse.triangles.len());
        assert!(area(&coarse) > 0.5 && area(&coarse) <= 1.0);
        assert_eq!(cluster(square(2), 100.0).triangles.len(), 8, "nothing left: unchanged");
    }
}
