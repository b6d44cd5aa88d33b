//! Hybrid models made by hand: meshes cut into nodes of one level, files in memory, and the same as the judge sees them.
#![allow(dead_code, reason = "each test file uses its own part")]

use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page, Root, Skeleton};
use gigalod_format::{Bounds, Container, InputCounts, Kind, MemoryStore, Metadata, Writer};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use gigalod_reference::Mesh;
use gigalod_runtime::hybrid::{HybridList, HybridNode, Ranks};
use gigalod_runtime::splats::Tint;
use gigalod_runtime::{DrawSource, FileId};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;

pub(crate) const NORMAL_BITS: u32 = 12;

/// A mesh before it is cut.
#[derive(Clone, Default)]
pub(crate) struct Soup {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// A hybrid model.
pub(crate) struct Model {
    pub(crate) file: Arc<HybridFile>,
    /// Number of the first node that has a page.
    pub(crate) first: u32,
    pub(crate) pages: Vec<Arc<Page>>,
}

pub(crate) fn encode_normal(n: Vec3) -> u32 {
    let n = n / (n.x.abs() + n.y.abs() + n.z.abs());
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let (u, v) = if n.z >= 0.0 { (n.x, n.y) } else { ((1.0 - n.y.abs()) * sign(n.x), (1.0 - n.x.abs()) * sign(n.y)) };
    let code = |x: f32| ((x * 0.5 + 0.5) * ((1 << NORMAL_BITS) - 1) as f32).round() as u32;
    code(u) | code(v) << 16
}

pub(crate) fn decode_normal(code: u32) -> Vec3 {
    let at = |code: u32| code as f32 / ((1 << NORMAL_BITS) - 1) as f32 * 2.0 - 1.0;
    let (u, v) = (at(code & 0xffff), at(code >> 16));
    let z = 1.0 - u.abs() - v.abs();
    let fold = (-z).max(0.0);
    let folded = |x: f32| if x >= 0.0 { x - fold } else { x + fold };
    Vec3::new(folded(u), folded(v), z).normalize()
}

/// What a node is made of besides triangles.
#[derive(Clone, Copy, Default)]
pub(crate) struct Extra {
    pub(crate) error_geo: f32,
    pub(crate) spacing: f32,
}

/// Root cell and grid of a model.
pub(crate) struct Grid {
    pub(crate) origin: DVec3,
    pub(crate) edge: f64,
    pub(crate) cell_bits: u32,
}

impl Grid {
    pub(crate) fn around(soup: &Soup) -> Self {
        let mut bounds = Aabb::EMPTY;
        for position in &soup.positions {
            bounds = bounds.including(*position);
        }
        let edge = bounds.extent().max_element().max(1e-3) * 1.001;
        Self { origin: bounds.min, edge, cell_bits: 14 }
    }

    pub(crate) fn step(&self) -> f64 {
        self.edge / f64::from(1 << self.cell_bits)
    }

    pub(crate) fn steps(&self, position: DVec3) -> [i32; 3] {
        ((position - self.origin) / self.step()).round().to_array().map(|x| x as i32)
    }

    pub(crate) fn snapped(&self, position: DVec3) -> DVec3 {
        self.origin + DVec3::from_array(self.steps(position).map(f64::from)) * self.step()
    }
}

/// Triangles, and vertices without any.
type Cell = (Vec<[u32; 3]>, Vec<u32>);

impl Soup {
    /// As the judge sees it: on the grid, with coded normals.
    pub(crate) fn mesh(&self, grid: &Grid) -> Mesh {
        let positions = self.positions.iter().map(|p| grid.snapped(*p)).collect();
        let normals = self.normals.iter().map(|n| decode_normal(encode_normal(*n))).collect();
        let colors = (!self.colors.is_empty()).then(|| self.colors.clone());
        Mesh::new(positions, Some(normals), colors, self.triangles.clone()).unwrap()
    }

    /// Nodes by the cells of a cubic grid, `cells` along each side; vertices without triangles become points of their cell.
    pub(crate) fn model(&self, grid: &Grid, cells: u32, extra: Extra) -> Model {
        let cell_of =
            |p: DVec3| ((p - grid.origin) / grid.edge * f64::from(cells)).floor().to_array().map(|x| x as i32);
        let mut by_cell: BTreeMap<[i32; 3], Cell> = BTreeMap::new();
        let mut is_used = vec![false; self.positions.len()];
        for triangle in &self.triangles {
            let middle = triangle.iter().map(|v| self.positions[*v as usize]).sum::<DVec3>() / 3.0;
            by_cell.entry(cell_of(middle)).or_default().0.push(*triangle);
            triangle.iter().for_each(|v| is_used[*v as usize] = true);
        }
        for (vertex, _) in is_used.iter().enumerate().filter(|(_, used)| !**used) {
            by_cell.entry(cell_of(self.positions[vertex])).or_default().1.push(vertex as u32);
        }
        let nodes = by_cell.values().map(|(triangles, points)| self.node(grid, triangles, points, extra)).collect();
        Model::new(grid, !self.colors.is_empty(), nodes)
    }

    fn node(&self, grid: &Grid, triangles: &[[u32; 3]], points: &[u32], extra: Extra) -> (NodeRecord, Page) {
        let mut names = BTreeMap::new();
        let mut order = Vec::new();
        let mut local = |v: u32| {
            *names.entry(v).or_insert_with(|| {
                order.push(v);
                order.len() as u32 - 1
            })
        };
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(&mut local)).collect();
        let vertices = order.len() as u32;
        order.extend(points);
        let steps: Vec<[i32; 3]> = order.iter().map(|v| grid.steps(self.positions[*v as usize])).collect();
        let min = std::array::from_fn(|i| steps.iter().map(|s| s[i]).min().unwrap());
        let max: [i32; 3] = std::array::from_fn(|i| steps.iter().map(|s| s[i]).max().unwrap());
        let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        for [a, b, c] in &triangles {
            for [p, q] in [[*a, *b], [*b, *c], [*c, *a]] {
                *edges.entry([p.min(q), p.max(q)]).or_default() += 1;
            }
        }
        let borders: Vec<[u32; 2]> = edges.into_iter().filter(|(_, n)| *n == 1).map(|(edge, _)| edge).collect();
        let page = Page {
            positions: steps.iter().map(|s| std::array::from_fn(|i| u16::try_from(s[i] - min[i]).unwrap())).collect(),
            normals: order.iter().map(|v| encode_normal(self.normals[*v as usize])).collect(),
            colors: match self.colors.is_empty() {
                true => Vec::new(),
                false => order.iter().map(|v| self.colors[*v as usize]).map(|[r, g, b]| [r, g, b, 255]).collect(),
            },
            triangles,
            borders,
        };
        let record = NodeRecord {
            min_steps: min,
            extent_steps: std::array::from_fn(|i| (max[i] - min[i]) as u16),
            error_geo: extra.error_geo,
            error_total: extra.error_geo,
            spacing: extra.spacing,
            vertices,
            triangles: page.triangles.len() as u32,
            points: points.len() as u32,
            borders: page.borders.len() as u32,
            ..NOTHING
        };
        (record, page)
    }
}

/// A node without anything.
const NOTHING: NodeRecord = NodeRecord {
    level: 0,
    first_child: 0,
    children: 0,
    min_steps: [0; 3],
    extent_steps: [0; 3],
    error_geo: 0.0,
    error_total: 0.0,
    cone_axis: [0.0, 0.0, 1.0],
    cone_sine: 1.0,
    spacing: 0.0,
    vertices: 0,
    triangles: 0,
    points: 0,
    borders: 0,
    bytes: 0,
    checksum: 0,
};

impl Model {
    /// A file in memory of these nodes, all on one level, below as many without anything as make them a tree; their places count
    /// steps of that level, which are the grid's. Pages on file are zeros, since lists bring them along.
    pub(crate) fn new(grid: &Grid, has_colors: bool, nodes: Vec<(NodeRecord, Page)>) -> Self {
        let (leaves, pages): (Vec<_>, Vec<_>) = nodes.into_iter().unzip();
        let mut widths = vec![leaves.len() as u32];
        while widths[0] > 1 {
            widths.insert(0, widths[0].div_ceil(8));
        }
        let level = widths.len() as u32 - 1;
        let largest = leaves.iter().map(|leaf| leaf.error_total).fold(0.0, f32::max);
        let mut records = Vec::new();
        for (above, width) in (0..level).zip(&widths) {
            let below = widths[above as usize + 1];
            for at in 0..*width {
                let children = (below - 8 * at).min(8);
                let first_child = records.len() as u32 - at + width + 8 * at;
                records.push(NodeRecord { level: above, first_child, children, error_total: largest, ..NOTHING });
            }
        }
        let first = records.len() as u32;
        let bytes = |leaf: &NodeRecord| leaf.vertices + leaf.triangles + leaf.points;
        records.extend(leaves.iter().map(|leaf| NodeRecord { level, bytes: bytes(leaf), ..*leaf }));
        let root = Root {
            origin: grid.origin,
            edge: grid.edge,
            bounds: Aabb { min: grid.origin, max: grid.origin + DVec3::splat(grid.edge) },
            cell_bits: grid.cell_bits - level,
            normal_bits: NORMAL_BITS,
            resolution: 100,
            nodes: records.len() as u64,
            leaves: leaves.len() as u64,
            levels: level + 1,
            preserves_appearance: true,
            has_colors,
            closed: false,
            up: UpAxis::Y,
        };
        let skeleton = Skeleton::encode(&root, &records, &gigalod_format::hybrid::Model::default());
        let mut writer = Writer::new(Cursor::new(Vec::new()), Kind::Hybrid, skeleton.len() as u64).unwrap();
        for record in &records {
            writer.page(&vec![0; record.bytes as usize]).unwrap();
        }
        let (bytes, _) = writer.finish(&skeleton, &metadata()).unwrap();
        let container = Container::open(Arc::new(MemoryStore::new(bytes.into_inner()))).unwrap();
        Self {
            file: Arc::new(HybridFile::open(container).unwrap()),
            first,
            pages: pages.into_iter().map(Arc::new).collect(),
        }
    }

    /// The record of the node with this page.
    pub(crate) fn record(&self, at: usize) -> NodeRecord {
        *self.file.skeleton().record(NodeId(self.first + at as u32))
    }

    pub(crate) fn bounds(&self) -> Aabb {
        self.file.skeleton().root().bounds
    }

    /// All of it.
    pub(crate) fn draw(&self, file: u32, draws_lines: bool) -> DrawSource {
        let node = |(at, page): (usize, &Arc<Page>)| HybridNode {
            node: NodeId(self.first + at as u32),
            page: page.clone(),
            draws_lines,
            ranks: Ranks::ALL,
        };
        DrawSource::Hybrid(HybridList {
            file: FileId(file),
            hybrid: Some(self.file.clone()),
            nodes: self.pages.iter().enumerate().map(node).collect(),
            tint: Tint::Model,
        })
    }
}

fn metadata() -> Metadata {
    Metadata {
        generator: String::new(),
        input: InputCounts { triangles: 0, vertices: 0, points: 0 },
        options: BTreeMap::new(),
        nodes: 0,
        levels: 1,
        leaves: 0,
        repeated: 0,
        raw_bytes: 0,
        closed: false,
        bounds: Bounds { min: [0.0; 3], max: [1.0; 3] },
        reference_system: None,
        attributes: Vec::new(),
        dicing: None,
        per_level: Vec::new(),
    }
}

/// A closed surface with waves, `rows` × 2 `rows` quads, coloured.
pub(crate) fn wavy(rows: u32) -> Soup {
    let columns = 2 * rows;
    let mut soup = Soup::default();
    let at = |theta: f64, phi: f64| {
        let radius = 1.0 + 0.12 * (7.0 * theta).sin() * (9.0 * phi).sin() + 0.02 * (31.0 * phi).cos() * theta.sin();
        DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * radius
    };
    let pole = |soup: &mut Soup, theta: f64| {
        soup.positions.push(at(theta, 0.0));
        soup.normals.push(at(theta, 0.0).normalize().as_vec3());
        soup.positions.len() as u32 - 1
    };
    let top = pole(&mut soup, 0.0);
    for row in 1..rows {
        for column in 0..columns {
            let (theta, phi) = (
                f64::from(row) / f64::from(rows) * std::f64::consts::PI,
                f64::from(column) / f64::from(columns) * std::f64::consts::TAU,
            );
            let h = 1e-4;
            let along = at(theta + h, phi) - at(theta - h, phi);
            let across = at(theta, phi + h) - at(theta, phi - h);
            soup.positions.push(at(theta, phi));
            soup.normals.push(across.cross(along).normalize().as_vec3());
        }
    }
    let bottom = pole(&mut soup, std::f64::consts::PI);
    let name = |row: u32, column: u32| match row {
        0 => top,
        row if row == rows => bottom,
        row => 1 + (row - 1) * columns + column % columns,
    };
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (name(row, column), name(row, column + 1));
            let (c, d) = (name(row + 1, column + 1), name(row + 1, column));
            if a != b {
                soup.triangles.push([a, b, c]);
            }
            if c != d {
                soup.triangles.push([a, c, d]);
            }
        }
    }
    let color = |p: &DVec3| (*p * 90.0 + 128.0).to_array().map(|x| x.clamp(0.0, 255.0) as u8);
    soup.colors = soup.positions.iter().map(color).collect();
    soup
}

/// A closed cube of 12 triangles, with a normal of its own for each side.
pub(crate) fn cube() -> Soup {
    let mut soup = Soup::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let place = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                p[axis] = side;
                p[(axis + 1) % 3] = u * side;
                p[(axis + 2) % 3] = v;
                DVec3::from_array(p)
            };
            let first = soup.positions.len() as u32;
            let mut normal = [0.0; 3];
            normal[axis] = side as f32;
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                soup.positions.push(place(u, v));
                soup.normals.push(Vec3::from_array(normal));
            }
            soup.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    soup
}
