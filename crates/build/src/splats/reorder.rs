//! Puts a mesh in memory whose order says nothing into an order of space: vertices along a Morton curve, triangles by their first
//! vertex there. What follows then finds neighbours near each other.
//!
//! A mesh goes in and comes out, the same but for its order. Nothing that is built depends on that order, so whether this was done
//! changes the time a build takes, never its bytes. Meshes in files are left alone: their joins sort for themselves.

use super::mesh::{Mesh, Positions};
use crate::spool::Spool;
use bytemuck::Pod;
use rayon::prelude::*;

/// Cells of the Morton grid along an axis, as a power of two.
const GRID_BITS: u32 = 10;

/// Triangles that are asked about the order.
const SAMPLES: usize = 4096;

/// Reorders the mesh if it is in memory and gains by it.
pub(super) fn by_space(mesh: &mut Mesh) {
    let (Spool::Memory(triangles), Positions::Narrow(Spool::Memory(positions))) = (&mesh.triangles, &mesh.positions)
    else {
        return;
    };
    // What triangles carry would have to move with them, and nothing is gathered from them that could gain by it.
    if mesh.paint.is_some() {
        return;
    }
    if is_local(triangles, positions.len()) {
        return;
    }
    let order = morton_order(positions);
    let mut rank = vec![0u32; order.len()];
    for (place, vertex) in order.iter().enumerate() {
        rank[*vertex as usize] = place as u32;
    }
    let (triangles, positions) = rayon::join(|| sorted(triangles, &rank), || permuted(positions, &order));
    mesh.triangles = triangles;
    mesh.positions = Positions::Narrow(positions);
    if let Spool::Memory(normals) = &mesh.normals {
        mesh.normals = permuted(normals, &order);
    }
    if let Spool::Memory(colors) = &mesh.colors {
        mesh.colors = permuted(colors, &order);
    }
}

/// True where most triangles' vertices are close to each other in the file, and to those of the triangle before.
fn is_local(triangles: &[[u32; 3]], vertices: usize) -> bool {
    const NEAR: u32 = 1 << 16;
    let step = (triangles.len() / SAMPLES).max(1);
    let pairs = triangles.windows(2).step_by(step);
    let count = pairs.len();
    let near = pairs
        .filter(|pair| {
            let all = || pair.iter().flatten().copied();
            all().max().unwrap_or(0) - all().min().unwrap_or(0) < NEAR
        })
        .count();
    vertices <= NEAR as usize || near * 2 >= count
}

/// Vertices along a Morton curve through the box around them; those in one cell in their order.
fn morton_order(positions: &[[f32; 3]]) -> Vec<u32> {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for position in positions {
        for axis in 0..3 {
            min[axis] = min[axis].min(position[axis]);
            max[axis] = max[axis].max(position[axis]);
        }
    }
    let widest = (0..3).map(|axis| max[axis] - min[axis]).fold(f32::MIN_POSITIVE, f32::max);
    let scale = (1 << GRID_BITS) as f32 / widest;
    let last = (1 << GRID_BITS) - 1;
    let mut keys: Vec<u64> = positions
        .par_iter()
        .with_min_len(1 << 14)
        .enumerate()
        .map(|(vertex, position)| {
            let cell: [u32; 3] = std::array::from_fn(|axis| (((position[axis] - min[axis]) * scale) as u32).min(last));
            let key = spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2;
            u64::from(key) << 32 | vertex as u64
        })
        .collect();
    keys.par_sort_unstable();
    keys.iter().map(|key| *key as u32).collect()
}

/// Ten bits, each followed by two zeroes.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// The triangles under their vertices' new numbers, near the order of their smallest one.
fn sorted(triangles: &[[u32; 3]], rank: &[u32]) -> Spool<[u32; 3]> {
    const BLOCK_BITS: u32 = 10;
    let renumbered: Vec<[u32; 3]> = triangles
        .par_iter()
        .with_min_len(1 << 14)
        .map(|triangle| triangle.map(|vertex| rank[vertex as usize]))
        .collect();
    let block = |triangle: &[u32; 3]| (triangle[0].min(triangle[1]).min(triangle[2]) >> BLOCK_BITS) as usize;
    let mut starts = vec![0u32; (rank.len() >> BLOCK_BITS) + 2];
    for triangle in &renumbered {
        starts[block(triangle) + 1] += 1;
    }
    for at in 1..starts.len() {
        starts[at] += starts[at - 1];
    }
    let mut all = vec![[0; 3]; triangles.len()];
    for triangle in renumbered {
        let start = &mut starts[block(&triangle)];
        all[*start as usize] = triangle;
        *start += 1;
    }
    Spool::Memory(all)
}

fn permuted<T: Pod + Send + Sync>(records: &[T], order: &[u32]) -> Spool<T> {
    if records.is_empty() {
        return Spool::Memory(Vec::new());
    }
    Spool::Memory(order.par_iter().with_min_len(1 << 14).map(|vertex| records[*vertex as usize]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spool::Place;

    #[test]
    fn a_reordered_mesh_is_the_same_mesh() {
        let count = 400_000u32;
        let positions: Vec<[f32; 3]> = (0..count)
            .map(|v| [v.wrapping_mul(2_654_435_761) as f32, v.wrapping_mul(40_503) as f32, v as f32])
            .collect();
        let triangles: Vec<[u32; 3]> = (0..50_000u32)
            .map(|t| [t * 39 % count, t.wrapping_mul(40_503) % count, t.wrapping_mul(7919) % count])
            .collect();
        let mut mesh = Mesh {
            positions: Positions::Narrow(Spool::new(&Place::Memory).unwrap()),
            normals: Spool::new(&Place::Memory).unwrap(),
            colors: Spool::new(&Place::Memory).unwrap(),
            triangles: Spool::new(&Place::Memory).unwrap(),
            paint: None,
        };
        let Positions::Narrow(narrow) = &mut mesh.positions else { unreachable!() };
        narrow.push(&positions).unwrap();
        mesh.triangles.push(&triangles).unwrap();
        mesh.colors.push(&positions.iter().map(|p| [p[2] as u32 as u8, 0, 1]).collect::<Vec<_>>()).unwrap();
        by_space(&mut mesh);
        let (Spool::Memory(now), Positions::Narrow(Spool::Memory(at)), Spool::Memory(colors)) =
            (&mesh.triangles, &mesh.positions, &mesh.colors)
        else {
            unreachable!()
        };
        assert!(**now != *triangles, "it was no order of space");
        assert!(at.iter().zip(&**colors).all(|(at, color)| at[2] as u32 as u8 == color[0]));
        let corners = |triangles: &[[u32; 3]], at: &[[f32; 3]]| {
            let mut all: Vec<_> =
                triangles.iter().map(|triangle| triangle.map(|v| at[v as usize].map(f32::to_bits))).collect();
            all.sort_unstable();
            all
        };
        assert!(corners(now, at) == corners(&triangles, &positions));
    }
}
