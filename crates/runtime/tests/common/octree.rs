//! Hybrid files made up in memory: a sphere's surface in an octree, uneven, with errors, cones and pages that fit.

use gigalod_format::hybrid::{HybridFile, Model, NodeId, NodeRecord, Page, Prepared, Root, Skeleton, Statistics};
use gigalod_format::{Bounds, Container, InputCounts, Kind, LevelSummary, MemoryStore, Metadata, Writer};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use glam::{DVec3, IVec3};
use std::io::Cursor;
use std::sync::Arc;

pub(crate) const CELL_BITS: u32 = 8;
pub(crate) const RADIUS: f64 = 0.45;
const NORMAL_BITS: u32 = 8;

/// A file, as it is put together.
#[derive(Clone)]
pub(crate) struct Octree {
    pub(crate) root: Root,
    pub(crate) records: Vec<NodeRecord>,
    pub(crate) pages: Vec<Page>,
    model: Model,
}

/// The same for the same.
fn hash(cell: IVec3, level: u32) -> u32 {
    let mut state = 0x9E37_79B9u32 ^ level.wrapping_mul(0x85EB_CA6B);
    for at in cell.to_array() {
        state = (state ^ at as u32).wrapping_mul(0xC2B2_AE35).rotate_left(13);
    }
    state ^ state >> 15
}

impl Octree {
    /// `levels` of them, in places up to two fewer where there are more than three, with a node for each cell that the sphere's surface crosses.
    pub(crate) fn sphere(levels: u32, closed: bool) -> Self {
        let (mut cells, mut records, mut pages) = (vec![(IVec3::ZERO, 0)], Vec::new(), Vec::new());
        let mut at = 0;
        while let Some(&(cell, level)) = cells.get(at) {
            let is_inner =
                level + 1 < levels && (levels < 4 || level + 3 < levels || !hash(cell, level).is_multiple_of(4));
            let first_child = cells.len() as u32;
            if is_inner {
                let below = (0..8).map(|corner| cell * 2 + IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2));
                cells.extend(below.filter(|cell| is_crossed(*cell, level + 1)).map(|cell| (cell, level + 1)));
            }
            let children = cells.len() as u32 - first_child;
            let (record, page) = node(cell, level, first_child, children);
            records.push(record);
            pages.push(page);
            at += 1;
        }
        let leaves = records.iter().filter(|record| record.children == 0).count() as u64;
        let root = Root {
            origin: DVec3::new(10.0, -20.0, 5.0),
            edge: 1.0,
            bounds: Aabb { min: DVec3::new(10.05, -19.95, 5.05), max: DVec3::new(10.95, -19.05, 5.95) },
            cell_bits: CELL_BITS,
            normal_bits: NORMAL_BITS,
            resolution: 64,
            nodes: records.len() as u64,
            leaves,
            levels,
            preserves_appearance: true,
            has_colors: true,
            closed,
            up: UpAxis::Y,
        };
        // In the order in which they are coded, and with the borders that this finds.
        let mut statistics = Statistics::default();
        for (record, page) in records.iter_mut().zip(&mut pages) {
            let prepared = Prepared::new(page, record.vertices, NORMAL_BITS);
            statistics.count(&prepared);
            *page = prepared.into_page();
            record.borders = page.borders.len() as u32;
            *record = record.as_stored();
        }
        Self { root, records, pages, model: Model::of(&statistics) }
    }

    /// The file's bytes.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut records = self.records.clone();
        let pages: Vec<Vec<u8>> = (0..self.pages.len()).map(|number| self.encoded(number)).collect();
        for (record, page) in records.iter_mut().zip(&pages) {
            record.bytes = page.len() as u32;
            record.checksum = gigalod_format::checksum(page);
        }
        let skeleton = Skeleton::encode(&self.root, &records, &self.model);
        let metadata = Metadata {
            generator: "test".into(),
            input: InputCounts { triangles: 1000, vertices: 500, points: 0 },
            options: Default::default(),
            nodes: self.root.nodes,
            levels: self.root.levels,
            leaves: self.root.leaves,
            repeated: 0,
            raw_bytes: 0,
            closed: self.root.closed,
            bounds: Bounds { min: self.root.bounds.min.to_array(), max: self.root.bounds.max.to_array() },
            reference_system: None,
            attributes: Vec::new(),
            dicing: None,
            per_level: (0..self.root.levels).map(|level| self.summary(level)).collect(),
        };
        let mut out = Cursor::new(Vec::new());
        let mut writer = Writer::new(&mut out, Kind::Hybrid, skeleton.len() as u64).unwrap();
        pages.iter().for_each(|page| writer.page(page).unwrap());
        writer.finish(&skeleton, &metadata).unwrap();
        out.into_inner()
    }

    fn encoded(&self, number: usize) -> Vec<u8> {
        self.pages[number].encode(self.records[number].vertices, NORMAL_BITS, &self.model).0
    }

    fn summary(&self, level: u32) -> LevelSummary {
        let of_level = || self.records.iter().enumerate().filter(|(_, record)| record.level == level);
        LevelSummary {
            level,
            nodes: of_level().count() as u64,
            triangles: of_level().map(|(_, record)| u64::from(record.triangles)).sum(),
            points: of_level().map(|(_, record)| u64::from(record.points)).sum(),
            bytes: of_level().map(|(number, _)| self.encoded(number).len() as u64).sum(),
            max_error: of_level().map(|(_, record)| f64::from(record.error_geo)).fold(0.0, f64::max),
        }
    }

    /// Open.
    pub(crate) fn file(&self) -> Arc<HybridFile> {
        open(self.bytes())
    }
}

pub(crate) fn open(bytes: Vec<u8>) -> Arc<HybridFile> {
    Arc::new(HybridFile::open(Container::open(Arc::new(MemoryStore::new(bytes))).unwrap()).unwrap())
}

/// True where the sphere's surface crosses a cell.
fn is_crossed(cell: IVec3, level: u32) -> bool {
    let edge = 0.5f64.powi(level as i32);
    let min = cell.as_dvec3() * edge - 0.5;
    let nearest = DVec3::ZERO.clamp(min, min + edge).length();
    let farthest = min.abs().max((min + edge).abs()).length();
    (nearest..=farthest).contains(&RADIUS)
}

fn node(cell: IVec3, level: u32, first_child: u32, children: u32) -> (NodeRecord, Page) {
    let random = hash(cell, level);
    let edge = 0.5f64.powi(level as i32);
    let middle = (cell.as_dvec3() + 0.5) * edge - 0.5;
    // A little beyond the cell, on some sides.
    let beyond = |bits: u32| (random >> bits & 7) as i32;
    let from = IVec3::new(beyond(0), beyond(3), beyond(6));
    let to = IVec3::new(beyond(9), beyond(12), beyond(15));
    let min_steps = (cell * (1 << CELL_BITS) - from).to_array();
    let extent_steps = (from + to + (1 << CELL_BITS)).to_array().map(|at| at as u16);
    let error = edge / 64.0;
    // Around a loop, once to twice: what is there twice has no borders.
    let vertices = 30 + random % 20;
    let triangles = vertices + (random >> 4 & 7) * vertices / 7;
    let points = if children > 0 { random >> 8 & 31 } else { 0 };
    let record = NodeRecord {
        level,
        first_child,
        children,
        min_steps,
        extent_steps,
        error_geo: (error * 0.75) as f32,
        error_total: error as f32,
        cone_axis: middle.try_normalize().unwrap_or(DVec3::Z).as_vec3().to_array(),
        // Normals of a sphere in a cell.
        cone_sine: if level < 2 { 1.0 } else { (edge / RADIUS) as f32 },
        spacing: if points > 0 { error as f32 } else { 0.0 },
        vertices,
        triangles,
        points,
        borders: 0,
        bytes: 0,
        checksum: 0,
    };
    let count = (vertices + points) as usize;
    let page = Page {
        positions: (0..count).map(|at| extent_steps.map(|extent| (at as u16 * 5) % (extent + 1))).collect(),
        normals: vec![0; count],
        colors: vec![[200, 100, 50, 255]; count],
        triangles: (0..triangles).map(|at| [at % vertices, (at + 1) % vertices, (at + 2) % vertices]).collect(),
        borders: Vec::new(),
    };
    (record, page)
}

/// Leaves below each node.
pub(crate) fn leaves_below(records: &[NodeRecord], node: NodeId) -> Vec<NodeId> {
    let record = &records[node.0 as usize];
    match record.children {
        0 => vec![node],
        children => (0..children).flat_map(|at| leaves_below(records, NodeId(record.first_child + at))).collect(),
    }
}
