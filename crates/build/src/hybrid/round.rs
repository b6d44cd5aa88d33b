//! From a patch to what a file keeps of it: positions on the level's grid, normals on the octahedron, and how far all that may be off.

use super::Shape;
use super::cell::Cell;
use super::patch::{Patch, Vertex, total};
use super::simplify::up;
use gigalod_format::hybrid::{NodeRecord, Page};
use glam::{DVec3, Vec3};

/// A node that is finished, but for its place in the file.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub(super) cell: Cell,
    pub(super) record: NodeRecord,
    pub(super) page: Page,
}

/// Rounds a patch to the grid of its cell's level.
pub(super) fn round(patch: &Patch, cell: Cell, shape: &Shape) -> Made {
    let step = shape.step(cell.level);
    let steps: Vec<[i32; 3]> =
        patch.vertices.iter().map(|vertex| (vertex.at / step).round().to_array().map(|x| x as i32)).collect();
    let moved = |vertex: u32| {
        let rounded = DVec3::from_array(steps[vertex as usize].map(f64::from)) * step;
        (rounded - patch.vertices[vertex as usize].at).length()
    };
    let mut names = vec![u32::MAX; patch.vertices.len()];
    let mut used: Vec<u32> = Vec::new();
    let mut page = Page::default();
    let (mut error_geo, mut error_total) = (0.0f32, 0.0f32);
    let mut cone = Cone::default();
    for face in &patch.faces {
        let geo = up(f64::from(face.geo) + face.corners.map(moved).into_iter().fold(0.0, f64::max));
        error_geo = error_geo.max(geo);
        error_total = error_total.max(total(geo, face.app));
        let [a, b, c] = face.corners.map(|corner| steps[corner as usize]);
        if a == b || b == c || c == a {
            continue;
        }
        cone.add([a, b, c]);
        let corners = face.corners.map(|corner| {
            let name = &mut names[corner as usize];
            if *name == u32::MAX {
                *name = used.len() as u32;
                used.push(corner);
            }
            *name
        });
        page.triangles.push(corners);
    }
    let min = used.iter().fold([i32::MAX; 3], |min, vertex| {
        let at = steps[*vertex as usize];
        [0, 1, 2].map(|axis| min[axis].min(at[axis]))
    });
    let min = if used.is_empty() { [0; 3] } else { min };
    let mut extent = [0u16; 3];
    for vertex in &used {
        let at = steps[*vertex as usize];
        let from = [0, 1, 2].map(|axis| (at[axis] - min[axis]) as u16);
        extent = [0, 1, 2].map(|axis| extent[axis].max(from[axis]));
        page.positions.push(from);
        let Vertex { normal, color, .. } = &patch.vertices[*vertex as usize];
        page.normals.push(octahedral(*normal, shape.normal_bits));
        if shape.has_colors {
            let [r, g, b] = color.to_array().map(|value| value.round() as u8);
            page.colors.push([r, g, b, 255]);
        }
    }
    let (cone_axis, cone_sine) = cone.finish();
    let record = NodeRecord {
        level: cell.level,
        first_child: 0,
        children: 0,
        min_steps: min,
        extent_steps: extent,
        error_geo,
        error_total,
        cone_axis,
        cone_sine,
        spacing: 0.0,
        vertices: used.len() as u32,
        triangles: page.triangles.len() as u32,
        points: 0,
        borders: 0,
        bytes: 0,
        checksum: 0,
    };
    Made { cell, record, page }
}

/// Code of a normal on the octahedron: u and v, `bits` each, u | v << 16.
pub(super) fn octahedral(normal: Vec3, bits: u32) -> u32 {
    let size = normal.x.abs() + normal.y.abs() + normal.z.abs();
    let (x, y) = if size > 0.0 { (normal.x / size, normal.y / size) } else { (0.0, 0.0) };
    let sign = |value: f32| if value < 0.0 { -1.0f32 } else { 1.0 };
    let (u, v) = if normal.z < 0.0 { ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)) } else { (x, y) };
    let most = ((1u32 << bits) - 1) as f32;
    let code = |value: f32| ((value * 0.5 + 0.5) * most + 0.5).clamp(0.0, most) as u32;
    code(u) | code(v) << 16
}

/// Normals of faces, as a cone.
#[derive(Default)]
struct Cone {
    normals: Vec<Vec3>,
    sum: Vec3,
}

impl Cone {
    fn add(&mut self, corners: [[i32; 3]; 3]) {
        let [a, b, c] = corners.map(|at| DVec3::from_array(at.map(f64::from)));
        if let Some(normal) = (b - a).cross(c - a).try_normalize() {
            self.normals.push(normal.as_vec3());
            self.sum += normal.as_vec3();
        }
    }

    /// Axis and sine of the half-angle, rounded up.
    fn finish(self) -> ([f32; 3], f32) {
        let Some(axis) = self.sum.try_normalize() else { return ([0.0, 0.0, 1.0], 1.0) };
        let least = self.normals.iter().fold(1.0f32, |least, normal| least.min(normal.dot(axis))) - 1e-5;
        let sine = if least > 0.0 { (1.0 - least * least).max(0.0).sqrt() + 1e-5 } else { 1.0 };
        (axis.to_array(), sine.min(1.0))
    }
}
