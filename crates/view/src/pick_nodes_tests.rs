use super::*;
use gigalod_format::hybrid::{Model, Prepared, Root, Skeleton, Statistics};
use gigalod_format::{Bounds, Container, InputCounts, Kind, MemoryStore, Metadata, Writer};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use proptest::prelude::*;
use std::sync::Arc;

const BITS: u32 = 10;
const ORIGIN: DVec3 = DVec3::new(3.0, -1.0, 8.0);
/// As files keep it.
const ERROR: f32 = 1.0 / 8192.0;
const NORMAL_BITS: u32 = 8;

/// A root, and a leaf for each of its eighths with triangles all over it: the same for the same.
fn pages() -> (Vec<NodeRecord>, Vec<Page>) {
    let record = |level: u32, min_steps: [i32; 3], page: &Page| NodeRecord {
        level,
        first_child: 1,
        children: if level == 0 { 8 } else { 0 },
        min_steps,
        extent_steps: [1 << BITS; 3],
        error_geo: ERROR,
        error_total: ERROR,
        cone_axis: [0.0, 0.0, 1.0],
        cone_sine: 1.0,
        spacing: 0.0,
        vertices: page.positions.len() as u32,
        triangles: page.triangles.len() as u32,
        points: 0,
        borders: 0,
        bytes: 0,
        checksum: 0,
    };
    let mut state = 12345u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    let mut page = |triangles: u32| {
        let mut page = Page::default();
        for at in 0..triangles {
            let corner = [(); 3].map(|()| (random() % 900) as u16);
            page.positions.extend([(); 3].map(|()| corner.map(|at| at + (random() % 120) as u16)));
            page.triangles.push([at * 3, at * 3 + 1, at * 3 + 2]);
        }
        page.normals = vec![0; page.positions.len()];
        page
    };
    let root = page(30);
    let mut records = vec![record(0, [0; 3], &root)];
    let mut pages = vec![root];
    for cell in 0..8 {
        let leaf = page(60);
        records.push(record(1, [cell & 1, cell >> 1 & 1, cell >> 2].map(|at| at << BITS), &leaf));
        pages.push(leaf);
    }
    (records, pages)
}

fn bytes() -> Vec<u8> {
    let (mut records, pages) = pages();
    let bounds = Aabb { min: ORIGIN, max: ORIGIN + 1.0 };
    let root = Root {
        origin: ORIGIN,
        edge: 1.0,
        bounds,
        cell_bits: BITS,
        normal_bits: NORMAL_BITS,
        resolution: 64,
        nodes: 9,
        leaves: 8,
        levels: 2,
        preserves_appearance: false,
        has_colors: false,
        closed: false,
        up: UpAxis::Y,
    };
    let mut statistics = Statistics::default();
    let prepare = |page: &Page| Prepared::new(page, page.positions.len() as u32, NORMAL_BITS);
    let prepared: Vec<Prepared> = pages.iter().map(prepare).collect();
    prepared.iter().for_each(|prepared| statistics.count(prepared));
    let model = Model::of(&statistics);
    let coded: Vec<Vec<u8>> = prepared.iter().map(|prepared| prepared.encode(&model)).collect();
    for ((record, prepared), bytes) in records.iter_mut().zip(&prepared).zip(&coded) {
        record.borders = prepared.page().borders.len() as u32;
        record.bytes = bytes.len() as u32;
        record.checksum = gigalod_format::checksum(bytes);
    }
    let skeleton = Skeleton::encode(&root, &records, &model);
    let metadata = Metadata {
        generator: "test".into(),
        input: InputCounts::default(),
        options: Default::default(),
        nodes: 9,
        levels: 2,
        leaves: 8,
        repeated: 0,
        raw_bytes: 0,
        closed: false,
        bounds: Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() },
        reference_system: None,
        attributes: Vec::new(),
        dicing: None,
        per_level: Vec::new(),
    };
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = Writer::new(&mut out, Kind::Hybrid, skeleton.len() as u64).unwrap();
    coded.iter().for_each(|page| writer.page(page).unwrap());
    writer.finish(&skeleton, &metadata).unwrap();
    out.into_inner()
}

fn open(bytes: Vec<u8>) -> HybridFile {
    HybridFile::open(Container::open(Arc::new(MemoryStore::new(bytes))).unwrap()).unwrap()
}

/// The nearest of all leaves' triangles, by another way: the ray's plane crossing, and on which side of each edge it is.
fn nearest(ray: &Ray) -> Option<f64> {
    let (records, pages) = pages();
    let mut nearest: Option<f64> = None;
    for (record, page) in records.iter().zip(&pages).skip(1) {
        let step = 0.5 / f64::from(1 << BITS);
        let at = |corner: u32| {
            let steps = page.positions[corner as usize].map(f64::from);
            ORIGIN + (DVec3::from_array(record.min_steps.map(f64::from)) + DVec3::from_array(steps)) * step
        };
        for [a, b, c] in page.triangles.iter().map(|triangle| triangle.map(at)) {
            let normal = (b - a).cross(c - a);
            let t = (a - ray.origin).dot(normal) / ray.direction.dot(normal);
            let point = ray.origin + ray.direction * t;
            let side = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal);
            if t > 0.0 && side(a, b) >= 0.0 && side(b, c) >= 0.0 && side(c, a) >= 0.0 {
                nearest = Some(nearest.map_or(t, |before| before.min(t)));
            }
        }
    }
    nearest
}

proptest! {
    #[test]
    fn the_first_triangle_of_all_leaves_is_hit(
        eye in prop::array::uniform3(-2.0f64..3.0), target in prop::array::uniform3(0.0f64..1.0), along in 0usize..4,
        length in 0.1f64..10.0,
    ) {
        // Some rays are parallel to axes.
        let mut direction = DVec3::from(target) - DVec3::from(eye);
        if along < 3 {
            direction = DVec3::AXES[along] * direction[along].signum();
        }
        let ray = Ray { origin: ORIGIN + DVec3::from(eye), direction: direction.normalize() * length };
        let mut pages = NodePages::default();
        let file = open(bytes());
        let hit = pages.first_hit(&file, &ray).unwrap();
        match (hit, nearest(&ray)) {
            (Some(hit), Some(t)) => {
                prop_assert!((hit.t - t).abs() < 1e-9, "{hit:?} {t}");
                prop_assert_eq!(hit.radius, f64::from(ERROR));
                prop_assert!(hit.detail > 0.0 && hit.detail < 0.2);
            }
            (hit, expected) => prop_assert!(hit.is_none() && expected.is_none(), "{hit:?} {expected:?}"),
        }
        prop_assert!(pages.decoded.len() <= 8 && !pages.decoded.contains_key(&NodeId(0)));
    }
}

#[test]
fn rays_without_sense_hit_nothing_and_damaged_leaves_count_as_their_boxes() {
    let file = open(bytes());
    for direction in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
        let ray = Ray { origin: ORIGIN - 1.0, direction };
        assert_eq!(NodePages::default().first_hit(&file, &ray).unwrap(), None);
    }
    let mut damaged = bytes();
    for node in 1..9 {
        damaged[file.skeleton().page_offset(NodeId(node)) as usize + 3] ^= 1;
    }
    let ray = Ray { origin: ORIGIN - 1.0, direction: DVec3::ONE };
    let hit = NodePages::default().first_hit(&open(damaged), &ray).unwrap().unwrap();
    assert!((0.9..=1.6).contains(&hit.t) && hit.radius > 0.5, "{hit:?}");
}

#[test]
fn anchors_are_where_the_root_has_vertices() {
    let file = open(bytes());
    let anchors = NodePages::default().anchors(&file, 20).unwrap();
    assert_eq!(anchors.len(), 18, "90 vertices, every fifth");
    for Anchor { at, radius } in anchors {
        assert!(file.skeleton().root().bounds.contains(at));
        assert_eq!(radius, f64::from(ERROR));
    }
}
