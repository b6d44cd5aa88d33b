//! Pages and files to be read: whatever triangles and points, in a tree of any shape.

use gigalod_format::hybrid::{HybridFile, Model, NodeRecord, Page, Prepared, Root, Skeleton, Statistics};
use gigalod_format::{Bounds, Container, FormatError, InputCounts, Kind, MemoryStore, Metadata, Writer, checksum};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use glam::DVec3;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;

pub(crate) const NORMAL_BITS: u32 = 9;

/// A small generator of numbers, so that what is made is the same everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % bound.max(1)
    }
}

/// A page and how many of its positions are vertices.
#[derive(Clone, Debug)]
pub(crate) struct Made {
    pub(crate) page: Page,
    pub(crate) vertices: u32,
}

impl Made {
    /// Of these triangles, with random attributes.
    pub(crate) fn of(
        triangles: Vec<[u32; 3]>,
        vertices: u32,
        points: usize,
        colors: bool,
        random: &mut Random,
    ) -> Self {
        let count = vertices as usize + points;
        let extent = [1, 50, 4000, 65_536][random.below(4)];
        let mut code = || random.below(1 << NORMAL_BITS) as u32;
        let normals = (0..count).map(|_| code() | code() << 16).collect();
        let positions = (0..count).map(|_| [0; 3].map(|_: u16| random.below(extent) as u16)).collect();
        let color =
            |random: &mut Random| [random.below(256) as u8, random.below(256) as u8, random.below(256) as u8, 255];
        let colors = (0..if colors { count } else { 0 }).map(|_| color(random)).collect();
        Self { page: Page { positions, normals, colors, triangles, borders: Vec::new() }, vertices }
    }

    /// A grid of so many squares, each two triangles, some of them missing, turned or doubled.
    pub(crate) fn grid(width: u32, height: u32, faults: usize, colors: bool, random: &mut Random) -> Self {
        let mut triangles = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let [a, b] = [0, 1].map(|side| y * (width + 1) + x + side);
                let [c, d] = [a, b].map(|corner| corner + width + 1);
                for triangle in [[a, b, d], [a, d, c]] {
                    match if random.below(100) < faults { random.below(4) } else { 9 } {
                        0 => {}
                        1 => triangles.push([triangle[1], triangle[0], triangle[2]]),
                        2 => triangles.extend([triangle, triangle]),
                        3 => triangles.push([triangle[0], triangle[0], triangle[1]]),
                        _ => triangles.push(triangle),
                    }
                }
            }
        }
        for at in (1..triangles.len()).rev() {
            triangles.swap(at, random.below(at + 1));
        }
        Self::of(triangles, (width + 1) * (height + 1), 0, colors, random)
    }

    /// Triangles with their attributes, in no order and from no corner, and points likewise: what a page is.
    pub(crate) fn meaning(&self) -> BTreeMap<Vec<u64>, usize> {
        let vertex = |at: usize| {
            let [x, y, z] = self.page.positions[at].map(u64::from);
            let color = self.page.colors.get(at).map_or(0, |color| u64::from(u32::from_le_bytes(*color)));
            [x | y << 16 | z << 32, u64::from(self.page.normals[at]) | color << 32]
        };
        let mut found = BTreeMap::new();
        for triangle in &self.page.triangles {
            let turned = |by: usize| (0..3).flat_map(|corner| vertex(triangle[(corner + by) % 3] as usize)).collect();
            let least: Vec<u64> = (0..3).map(turned).min().unwrap();
            *found.entry(least).or_insert(0) += 1;
        }
        for (at, kind) in (0..self.page.positions.len()).map(|at| (at, usize::from(at < self.vertices as usize))) {
            *found.entry([vertex(at).to_vec(), vec![kind as u64]].concat()).or_insert(0) += 1;
        }
        found
    }
}

/// Any triangles over a few vertices, so most edges have several.
pub(crate) fn soups() -> impl Strategy<Value = Made> {
    let triangles = |most: u32| prop::collection::vec(prop::array::uniform3(0..most), 0..200);
    let soup = (1u32..60).prop_flat_map(move |most| (Just(most), triangles(most)));
    let soup =
        (soup, 0usize..50, any::<bool>(), any::<u64>()).prop_map(|((vertices, triangles), points, colors, seed)| {
            Made::of(triangles, vertices, points, colors, &mut Random(seed))
        });
    let grid = (1u32..16, 1u32..16, 0usize..30, any::<bool>(), any::<u64>())
        .prop_map(|(width, height, faults, colors, seed)| Made::grid(width, height, faults, colors, &mut Random(seed)));
    prop_oneof![soup, grid]
}

/// The record of a page in no tree.
pub(crate) fn record(made: &Made, bytes: &[u8]) -> NodeRecord {
    let most = |axis: usize| made.page.positions.iter().map(|position| position[axis]).max().unwrap_or(0);
    let points = made.page.positions.len() as u32 - made.vertices;
    NodeRecord {
        level: 0,
        first_child: 1,
        children: 0,
        min_steps: [5, -7, 1000],
        extent_steps: [most(0), most(1), most(2)],
        error_geo: 0.1,
        error_total: 0.25,
        cone_axis: [0.6, 0.0, -0.8],
        cone_sine: 0.3,
        spacing: if points > 0 { 0.01 } else { 0.0 },
        vertices: made.vertices,
        triangles: made.page.triangles.len() as u32,
        points,
        borders: Page::borders_of(&made.page.triangles).len() as u32,
        bytes: bytes.len() as u32,
        checksum: checksum(bytes),
    }
}

/// Root, records and bytes of the pages of a tree in which each node has a random number of children, and its model.
pub(crate) fn tree(pages: &[Made], random: &mut Random) -> (Root, Vec<NodeRecord>, Vec<Vec<u8>>, Model) {
    let prepared: Vec<Prepared> =
        pages.iter().map(|made| Prepared::new(&made.page, made.vertices, NORMAL_BITS)).collect();
    let mut statistics = Statistics::default();
    prepared.iter().for_each(|page| statistics.count(page));
    let model = Model::of(&statistics);
    let bytes: Vec<Vec<u8>> = prepared.iter().map(|page| page.encode(&model)).collect();
    let mut nodes: Vec<NodeRecord> = pages.iter().zip(&bytes).map(|(made, bytes)| record(made, bytes)).collect();
    let mut next = 1;
    for at in 0..nodes.len() {
        let left = nodes.len() - next;
        // Never none while this is the last that could have some.
        let children = random.below(left.min(8) + 1).max(usize::from(left > 0 && at + 1 == next));
        let NodeRecord { level, min_steps, error_total, .. } = nodes[at];
        (nodes[at].children, nodes[at].first_child) = (children as u32, next as u32);
        for child in &mut nodes[next..next + children] {
            child.level = level + 1;
            child.min_steps = min_steps.map(|steps| 2 * steps + random.below(5000) as i32 - 700);
            child.error_total = error_total * (0.3 + 0.1 * random.below(8) as f32);
            child.error_geo = child.error_total * (0.1 * random.below(11) as f32);
        }
        next += children;
    }
    let root = Root {
        origin: DVec3::new(1e6, -2e6, 0.1),
        edge: 12.5,
        bounds: Aabb { min: DVec3::new(1e6, -2e6, 0.0), max: DVec3::new(1e6 + 12.5, -2e6 + 9.0, 3.0) },
        cell_bits: 12,
        normal_bits: NORMAL_BITS,
        resolution: 100,
        nodes: nodes.len() as u64,
        leaves: nodes.iter().filter(|node| node.children == 0).count() as u64,
        levels: nodes.iter().map(|node| node.level + 1).max().unwrap_or(0),
        preserves_appearance: true,
        has_colors: pages.iter().any(|made| !made.page.colors.is_empty()),
        closed: false,
        up: UpAxis::Z,
    };
    (root, nodes, bytes, model)
}

pub(crate) fn metadata() -> Metadata {
    Metadata {
        generator: "a test".into(),
        input: InputCounts { triangles: 1, vertices: 3, points: 0 },
        options: BTreeMap::new(),
        nodes: 1,
        levels: 1,
        leaves: 1,
        repeated: 0,
        raw_bytes: 0,
        closed: false,
        bounds: Bounds { min: [0.0; 3], max: [1.0; 3] },
        attributes: Vec::new(),
        dicing: None,
        per_level: Vec::new(),
        reference_system: None,
    }
}

/// A whole file.
pub(crate) fn file((root, nodes, pages, model): &(Root, Vec<NodeRecord>, Vec<Vec<u8>>, Model)) -> Vec<u8> {
    let skeleton = Skeleton::encode(root, nodes, model);
    assert_eq!(skeleton.len() as u64, Skeleton::encoded_bytes(root.nodes, model));
    let mut writer = Writer::new(Cursor::new(Vec::new()), Kind::Hybrid, skeleton.len() as u64).unwrap();
    pages.iter().for_each(|page| writer.page(page).unwrap());
    writer.finish(&skeleton, &metadata()).unwrap().0.into_inner()
}

pub(crate) fn open(bytes: &[u8]) -> Result<HybridFile, FormatError> {
    HybridFile::open(Container::open(Arc::new(MemoryStore::new(bytes.to_vec())))?)
}
