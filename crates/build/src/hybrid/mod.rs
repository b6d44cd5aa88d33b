//! Hybrid: an out-of-core octree of simplified triangles and points with proven errors, from any mesh.

mod cell;
mod cover;
mod looks;
mod octree;
mod overlay;
mod patch;
mod quadric;
mod round;
mod simplify;
mod surface;
mod weld;
mod zip;

/// What all nodes have in common.
#[derive(Clone, Debug)]
struct Shape {
    /// Of the root's cell; model units.
    edge: f64,
    /// A node's error is at most the edge of its cell divided by this.
    resolution: u32,
    /// Most triangles of a leaf.
    most_triangles: usize,
    cell_bits: u32,
    normal_bits: u32,
    keeps_looks: bool,
    has_colors: bool,
}

impl Shape {
    /// Of the grid of a level; model units.
    fn step(&self, level: u32) -> f64 {
        self.edge / (1u64 << (level + self.cell_bits)) as f64
    }

    /// Largest error of a patch before it is rounded to the grid.
    fn limit(&self, level: u32) -> f64 {
        let most_moved = 0.5 * 3f64.sqrt() * 1.000_001 * self.step(level);
        self.edge / (1u64 << level) as f64 / f64::from(self.resolution) - most_moved
    }
}

#[doc(hidden)]
#[allow(missing_docs)]
pub mod experiment {
    use super::*;
    use glam::{DVec3, Vec3};
    type Out = (Vec<DVec3>, Vec<[u32; 3]>, Vec<f32>, Vec<f32>);
    fn normals(p: &[DVec3], t: &[[u32; 3]]) -> Vec<Vec3> {
        let mut normals = vec![DVec3::ZERO; p.len()];
        for f in t {
            let [a, b, c] = f.map(|i| p[i as usize]);
            let n = (b - a).cross(c - a);
            for i in f {
                normals[*i as usize] += n;
            }
        }
        normals.iter().map(|n| n.normalize_or(DVec3::Y).as_vec3()).collect()
    }
    pub fn simplify(p: &[DVec3], t: &[[u32; 3]], error: f64, keeps_looks: bool) -> Out {
        let vertices = p
            .iter()
            .zip(&normals(p, t))
            .map(|(at, n)| patch::Vertex { at: *at, normal: *n, color: Vec3::ZERO })
            .collect();
        let faces = t.iter().map(|c| patch::Face { corners: *c, geo: 0.0, app: 0.0 }).collect();
        let out =
            super::simplify::simplify(patch::Patch { vertices, faces }, super::simplify::Limit { error, keeps_looks });
        (
            out.vertices.iter().map(|v| v.at).collect(),
            out.faces.iter().map(|f| f.corners).collect(),
            out.faces.iter().map(|f| f.geo).collect(),
            out.faces.iter().map(|f| f.app).collect(),
        )
    }
    pub fn octree(
        p: &[DVec3],
        t: &[[u32; 3]],
        res: u32,
        tmax: usize,
        keeps_looks: bool,
    ) -> Vec<(u32, usize, f32, f32, Vec<DVec3>, Vec<[u32; 3]>)> {
        let (lo, hi) = p.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        let edge = (hi - lo).max_element() * 1.0001;
        let shape = Shape {
            edge,
            resolution: res,
            most_triangles: tmax,
            cell_bits: res.ilog2() + 4,
            normal_bits: 9,
            keeps_looks,
            has_colors: false,
        };
        let n = normals(p, t);
        let pieces: Vec<octree::Piece> = t
            .iter()
            .map(|f| octree::Piece {
                at: f.map(|i| (p[i as usize] - lo).as_vec3().to_array()),
                normals: f.map(|i| weld::code_of(n[i as usize])),
                colors: [[0; 4]; 3],
            })
            .collect();
        let raised = octree::raise(pieces, cell::Cell::ROOT, &shape);
        raised
            .nodes
            .into_iter()
            .map(|m| {
                let step = shape.step(m.cell.level);
                let at = m
                    .page
                    .positions
                    .iter()
                    .map(|q| {
                        let s = [0, 1, 2].map(|a| (m.record.min_steps[a] + i32::from(q[a])) as f64 * step);
                        DVec3::from_array(s) + lo
                    })
                    .collect();
                (m.cell.level, m.page.triangles.len(), m.record.error_geo, m.record.error_total, at, m.page.triangles)
            })
            .collect()
    }
}
