//! From a patch to what a file keeps of it: positions on the level's grid, normals on the octahedron, and how far all that may be off.

use super::Shape;
use super::cell::Cell;
use super::patch::{Face, Patch, Vertex, total};
use super::points::Small;
use super::simplify::up;
use super::weld::PlaceHasher;
use gigalod_format::hybrid::{NodeRecord, Page};
use glam::{DVec3, Vec3};
use std::collections::HashSet;
use std::hash::BuildHasherDefault;

type Hashed<K> = HashSet<K, BuildHasherDefault<PlaceHasher>>;

/// A node that is finished, but for its place in the file.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub(super) cell: Cell,
    pub(super) record: NodeRecord,
    pub(super) page: Page,
}

/// Where a node stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Below all others: it keeps its triangles.
    Leaf,
    /// Small triangles may be points.
    Above,
}

/// Rounds a patch to the grid of its cell's level.
pub(super) fn round(patch: &Patch, cell: Cell, shape: &Shape, place: Place) -> Made {
    let step = shape.step(cell.level);
    let grid = |at: DVec3| (at / step).round().to_array().map(|x| x as i32);
    let steps: Vec<[i32; 3]> = patch.vertices.iter().map(|vertex| grid(vertex.at)).collect();
    let away = |steps: [i32; 3], at: DVec3| (DVec3::from_array(steps.map(f64::from)) * step - at).length();
    let moved = |vertex: u32| away(steps[vertex as usize], patch.vertices[vertex as usize].at);
    let room = cell.edge(shape.edge) / f64::from(shape.resolution);
    let small = match place {
        Place::Leaf => Small::default(),
        Place::Above => Small::of(patch, room, moved),
    };
    let (mut errors, mut points_errors) = (Errors::default(), Errors::default());
    let mut cone = Cone::default();
    let mut names = Names { names: vec![u32::MAX; patch.vertices.len()], used: Vec::new() };
    let mut page = Page::default();
    let mut flattened = Vec::new();
    for (number, face) in patch.faces.iter().enumerate() {
        let corners = face.corners.map(|corner| steps[corner as usize]);
        let geo = up(f64::from(face.geo) + face.corners.map(moved).into_iter().fold(0.0, f64::max));
        if let Some(Some(_)) = small.reaches.get(number) {
            points_errors.add(geo, face.app);
            cone.add(corners);
            continue;
        }
        errors.add(geo, face.app);
        let [a, b, c] = corners;
        if a == b || b == c || c == a {
            flattened.push((corners, face));
            continue;
        }
        cone.add(corners);
        page.triangles.push(face.corners.map(|corner| names.of(corner)));
    }
    let mut placed: Vec<([i32; 3], Vertex)> = Vec::with_capacity(names.used.len());
    placed.extend(names.used.iter().map(|vertex| (steps[*vertex as usize], patch.vertices[*vertex as usize])));
    // What rounding has flattened is drawn by what lies beside it, or else for itself.
    let bare = Bare::of(&flattened, &page, &placed);
    for (corners, face) in &bare.needles {
        let first = placed.len() as u32;
        let mut farthest = 0.0f64;
        for (at, corner) in corners.iter().zip(face.corners) {
            farthest = farthest.max(away(*at, patch.vertices[corner as usize].at));
            placed.push((*at, patch.vertices[corner as usize]));
        }
        errors.add(up(f64::from(face.geo) + farthest), face.app);
        cone.add(*corners);
        page.triangles.push([first, first + 1, first + 2]);
    }
    let vertices = placed.len();
    for (vertex, is_point) in small.is_point.iter().enumerate() {
        if *is_point {
            placed.push((steps[vertex], patch.vertices[vertex]));
        }
    }
    let mut reach = small.reach;
    for (at, face) in &bare.points {
        let moved = face.corners.map(moved).into_iter().fold(0.0, f64::max);
        points_errors.add(up(f64::from(face.geo) + moved), face.app);
        reach = reach.max(moved);
        cone.add_any();
        placed.push((*at, patch.vertices[face.corners[0] as usize]));
    }
    for spot in &patch.spots {
        let at = grid(spot.vertex.at);
        let away = away(at, spot.vertex.at);
        points_errors.add(up(f64::from(spot.geo) + away), spot.app);
        cone.add_any();
        reach = reach.max(f64::from(spot.reach) + away);
        placed.push((at, spot.vertex));
    }
    let points = placed.len() - vertices;
    errors.add_points(&points_errors, reach);
    let (min_steps, extent_steps) = fill(&mut page, &placed, shape);
    let (cone_axis, cone_sine) = cone.finish();
    let record = NodeRecord {
        level: cell.level,
        first_child: 0,
        children: 0,
        min_steps,
        extent_steps,
        error_geo: errors.geo,
        error_total: errors.total,
        cone_axis,
        cone_sine,
        spacing: if points > 0 { up(2.0 * reach) } else { 0.0 },
        vertices: vertices as u32,
        triangles: page.triangles.len() as u32,
        points: points as u32,
        borders: 0,
        bytes: 0,
        checksum: 0,
    };
    Made { cell, record, page }
}

/// Flattened faces that nothing else keeps: of one place, to be points; of two, to be triangles again, with one corner a step aside.
#[derive(Default)]
struct Bare<'a> {
    points: Vec<([i32; 3], &'a Face)>,
    needles: Vec<([[i32; 3]; 3], &'a Face)>,
}

impl<'a> Bare<'a> {
    fn of(flattened: &[([[i32; 3]; 3], &'a Face)], page: &Page, placed: &[([i32; 3], Vertex)]) -> Self {
        let mut bare = Self::default();
        if flattened.is_empty() {
            return bare;
        }
        let mut places: Hashed<[i32; 3]> = placed.iter().map(|(at, _)| *at).collect();
        let mut edges: Hashed<[[i32; 3]; 2]> = Hashed::default();
        edges.reserve(page.triangles.len() * 3 / 2);
        for triangle in &page.triangles {
            let [a, b, c] = triangle.map(|corner| placed[corner as usize].0);
            edges.extend([[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]));
        }
        for (corners, face) in flattened {
            let [a, b, c] = *corners;
            if a == b && b == c {
                if places.insert(a) {
                    bare.points.push((a, face));
                }
                continue;
            }
            let (from, to) = if a == b { (a, c) } else { (a, b) };
            if !edges.insert([from.min(to), from.max(to)]) {
                continue;
            }
            places.extend([from, to]);
            // The corner that is where another is goes aside, along the axis in which the needle is shortest.
            let twin = if a == b || c == b { 1 } else { 2 };
            let along = [0, 1, 2].map(|axis| (to[axis] - from[axis]).abs());
            let axis = (0..3).min_by_key(|axis| along[*axis]).expect("there are three");
            let mut corners = *corners;
            corners[twin][axis] += 1;
            bare.needles.push((corners, face));
        }
        bare
    }
}

/// Puts vertices into a page; returns the smallest place, and the extent from there.
fn fill(page: &mut Page, placed: &[([i32; 3], Vertex)], shape: &Shape) -> ([i32; 3], [u16; 3]) {
    let Some((first, _)) = placed.first() else { return ([0; 3], [0; 3]) };
    let min = placed.iter().fold(*first, |min, (at, _)| [0, 1, 2].map(|axis| min[axis].min(at[axis])));
    let mut extent = [0u16; 3];
    for (at, Vertex { normal, color, .. }) in placed {
        let from = [0, 1, 2].map(|axis| (at[axis] - min[axis]) as u16);
        extent = [0, 1, 2].map(|axis| extent[axis].max(from[axis]));
        page.positions.push(from);
        page.normals.push(octahedral(*normal, shape.normal_bits));
        if shape.has_colors {
            let [r, g, b] = color.to_array().map(|value| value.round() as u8);
            page.colors.push([r, g, b, 255]);
        }
    }
    (min, extent)
}

/// Largest errors so far.
#[derive(Default)]
struct Errors {
    geo: f32,
    total: f32,
}

impl Errors {
    fn add(&mut self, geo: f32, app: f32) {
        self.geo = self.geo.max(geo);
        self.total = self.total.max(total(geo, app));
    }

    /// Adds those of points: what is drawn of them reaches farther than they are.
    fn add_points(&mut self, points: &Self, reach: f64) {
        self.geo = self.geo.max(points.geo);
        // The file's spacing is rounded up, to 16 bits.
        self.total = self.total.max(up(f64::from(points.total) + reach * (1.0 + 1.0 / 16384.0)));
    }
}

/// Numbers of vertices in the page, in order of their first use.
struct Names {
    names: Vec<u32>,
    used: Vec<u32>,
}

impl Names {
    fn of(&mut self, vertex: u32) -> u32 {
        let name = &mut self.names[vertex as usize];
        if *name == u32::MAX {
            *name = self.used.len() as u32;
            self.used.push(vertex);
        }
        *name
    }
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
    is_any: bool,
}

impl Cone {
    /// What may face anywhere.
    fn add_any(&mut self) {
        self.is_any = true;
    }

    fn add(&mut self, corners: [[i32; 3]; 3]) {
        let [a, b, c] = corners.map(|at| DVec3::from_array(at.map(f64::from)));
        if let Some(normal) = (b - a).cross(c - a).try_normalize() {
            self.normals.push(normal.as_vec3());
            self.sum += normal.as_vec3();
        }
    }

    /// Axis and sine of the half-angle, rounded up.
    fn finish(self) -> ([f32; 3], f32) {
        let Some(axis) = self.sum.try_normalize().filter(|_| !self.is_any) else { return ([0.0, 0.0, 1.0], 1.0) };
        let least = self.normals.iter().fold(1.0f32, |least, normal| least.min(normal.dot(axis))) - 1e-5;
        let sine = if least > 0.0 { (1.0 - least * least).max(0.0).sqrt() + 1e-5 } else { 1.0 };
        (axis.to_array(), sine.min(1.0))
    }
}
