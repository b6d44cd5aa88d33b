//! Bytes a triangle by part, and triangles decoded a second by one thread:
//! `cargo run --release -p gigalod-format --example hybrid_speed -- [FILE [CELL_BITS [MOST_TRIANGLES [all]]]]`.
//!
//! FILE is u32 vertices, u32 triangles, then f32 × 3 a vertex and u32 × 3 a triangle; without it a noisy sphere is made. An octree cuts it
//! by the triangles' middles into pages. With `all`, vertices get colours and every fourth triangle's middle becomes a point besides, on a grid of
//! 8 steps. Each page is decoded by itself, the best of 7; prints one JSON object.

use gigalod_format::hybrid::{Model, NodeId, NodeRecord, Page, PartBits, Prepared, Root, Skeleton, Statistics};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::time::Instant;

const NORMAL_BITS: u32 = 9;

struct Mesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let mut normals = vec![Vec3::ZERO; positions.len()];
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
            for vertex in triangle {
                normals[*vertex as usize] += (b - a).cross(c - a);
            }
        }
        Self { positions, normals, triangles }
    }

    fn read(bytes: &[u8]) -> Self {
        let words: Vec<[u8; 4]> = bytes.as_chunks().0.to_vec();
        let word = |at: usize| u32::from_le_bytes(words[at]);
        let (vertices, triangles) = (word(0) as usize, word(1) as usize);
        let float = |at: usize| f32::from_bits(word(2 + at));
        let positions =
            (0..vertices).map(|at| Vec3::new(float(3 * at), float(3 * at + 1), float(3 * at + 2))).collect();
        let corner = |at: usize| word(2 + 3 * vertices + at);
        Self::new(positions, (0..triangles).map(|at| [0, 1, 2].map(|side| corner(3 * at + side))).collect())
    }

    /// A sphere of rings, with noise of a tenth of its edges.
    fn sphere() -> Self {
        let (rings, sides) = (500u32, 1000u32);
        let mut seed = 1u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut positions = Vec::new();
        for ring in 0..=rings {
            for side in 0..sides {
                let height = std::f32::consts::PI * (ring as f32 + 0.3 * noise()) / rings as f32;
                let around = std::f32::consts::TAU * (side as f32 + 0.3 * noise()) / sides as f32;
                let radius = 1.0 + 0.0006 * noise() + 0.05 * (9.0 * height).sin() * (7.0 * around).sin();
                positions
                    .push(radius * Vec3::new(height.sin() * around.cos(), height.cos(), height.sin() * around.sin()));
            }
        }
        let mut triangles = Vec::new();
        for ring in 0..rings {
            for side in 0..sides {
                let next = (side + 1) % sides;
                let [a, b] = [ring, ring + 1].map(|ring| [ring * sides + side, ring * sides + next]);
                triangles.extend([[a[0], b[1], b[0]], [a[0], a[1], b[1]]]);
            }
        }
        Self::new(positions, triangles)
    }
}

fn code(normal: Vec3) -> u32 {
    let sum = normal.x.abs() + normal.y.abs() + normal.z.abs();
    let (x, y) = if sum > 0.0 { (normal.x / sum, normal.y / sum) } else { (0.0, 0.0) };
    let (x, y) = if normal.z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    let [u, v] = [x, y].map(|c| ((c * 0.5 + 0.5) * ((1 << NORMAL_BITS) - 1) as f32 + 0.5) as u32);
    u | v << 16
}

/// Pages by an octree, each with its number of vertices and its positions' smallest and largest steps.
fn pages(mesh: &Mesh, cell_bits: u32, most: usize) -> Vec<(Page, u32, [u16; 3])> {
    let min = mesh.positions.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let max = mesh.positions.iter().copied().reduce(Vec3::max).unwrap_or_default();
    let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let mut stack = vec![(min, (max - min).max_element(), all)];
    let mut pages = Vec::new();
    while let Some((corner, edge, triangles)) = stack.pop() {
        if triangles.len() > most {
            let mut eighths: [Vec<u32>; 8] = Default::default();
            for triangle in triangles {
                let corners = mesh.triangles[triangle as usize].map(|vertex| mesh.positions[vertex as usize]);
                let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
                let above = middle.cmpgt(corner + Vec3::splat(edge / 2.0));
                eighths[above.bitmask() as usize].push(triangle);
            }
            for (eighth, triangles) in eighths.into_iter().enumerate() {
                let offset =
                    Vec3::from_array([0, 1, 2].map(|axis| if eighth >> axis & 1 == 0 { 0.0 } else { edge / 2.0 }));
                stack.push((corner + offset, edge / 2.0, triangles));
            }
            continue;
        }
        let step = f64::from(edge) / f64::from(1u32 << cell_bits);
        let mut numbers = HashMap::new();
        let mut steps: Vec<[i64; 3]> = Vec::new();
        let mut page = Page::default();
        for triangle in &triangles {
            page.triangles.push(mesh.triangles[*triangle as usize].map(|vertex| {
                *numbers.entry(vertex).or_insert_with(|| {
                    let position = (mesh.positions[vertex as usize] - min).as_dvec3() / step;
                    steps.push(position.to_array().map(|x| x.round() as i64));
                    page.normals.push(code(mesh.normals[vertex as usize]));
                    steps.len() as u32 - 1
                })
            }));
        }
        let smallest = [0, 1, 2].map(|axis| steps.iter().map(|step| step[axis]).min().unwrap_or(0));
        page.positions = steps.iter().map(|step| [0, 1, 2].map(|axis| (step[axis] - smallest[axis]) as u16)).collect();
        let extent = [0, 1, 2].map(|axis| page.positions.iter().map(|position| position[axis]).max().unwrap_or(0));
        let vertices = page.positions.len() as u32;
        pages.push((page, vertices, extent));
    }
    pages
}

/// Seconds that this thread has had a processor, where the system says so; else those that have passed since the first call.
fn cpu_seconds() -> f64 {
    static BEGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let begin = *BEGIN.get_or_init(Instant::now);
    let nanoseconds = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next().and_then(|field| field.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| begin.elapsed().as_secs_f64(), |nanoseconds| nanoseconds / 1e9)
}

/// Colours by place, with noise, and a point for every fourth triangle.
fn with_colors_and_points(page: &mut Page, extent: [u16; 3]) {
    for triangle in page.triangles.iter().step_by(4) {
        let corners = triangle.map(|vertex| page.positions[vertex as usize].map(u32::from));
        let middle = [0, 1, 2].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<u32>() / 3);
        page.positions.push([0, 1, 2].map(|axis| (middle[axis] as u16 & !7).min(extent[axis])));
        page.normals.push(page.normals[triangle[0] as usize]);
    }
    page.colors = (page.positions.iter().enumerate())
        .map(|(at, position)| {
            let noise = (at as u32).wrapping_mul(2_654_435_761) >> 30;
            let [red, green, blue] = position.map(|x| (u32::from(x) / 16 + noise) as u8);
            [red, green, blue, 255]
        })
        .collect();
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mesh = match arguments.next() {
        Some(path) => Mesh::read(&std::fs::read(path)?),
        None => Mesh::sphere(),
    };
    let cell_bits = arguments.next().map_or(Ok(11), |bits| bits.parse())?;
    let most = arguments.next().map_or(Ok(8000), |most| most.parse())?;
    let mut pages = pages(&mesh, cell_bits, most);
    let is_all = arguments.next().is_some();
    if is_all {
        pages.iter_mut().for_each(|(page, _, extent)| with_colors_and_points(page, *extent));
    }
    let prepared: Vec<Prepared> =
        pages.iter().map(|(page, vertices, _)| Prepared::new(page, *vertices, NORMAL_BITS)).collect();
    let mut statistics = Statistics::default();
    prepared.iter().for_each(|page| statistics.count(page));
    let model = Model::of(&statistics);
    let coded: Vec<Vec<u8>> = prepared.iter().map(|page| page.encode(&model)).collect();
    let mut parts = PartBits::default();
    let mut records = Vec::new();
    for ((prepared, bytes), (_, vertices, extent)) in prepared.iter().zip(&coded).zip(&pages) {
        let more = PartBits::of(prepared, &model);
        parts.connectivity += more.connectivity;
        parts.positions += more.positions;
        parts.normals += more.normals;
        parts.colors += more.colors;
        parts.points += more.points;
        records.push(NodeRecord {
            level: 1,
            first_child: 0,
            children: 0,
            min_steps: [0; 3],
            extent_steps: *extent,
            error_geo: 0.0,
            error_total: 0.0,
            cone_axis: [0.0, 0.0, 1.0],
            cone_sine: 1.0,
            spacing: 0.0,
            vertices: *vertices,
            triangles: prepared.page().triangles.len() as u32,
            points: prepared.page().positions.len() as u32 - vertices,
            borders: prepared.page().borders.len() as u32,
            bytes: bytes.len() as u32,
            checksum: 0,
        });
    }
    let root = Root {
        origin: DVec3::ZERO,
        edge: 1.0,
        bounds: Aabb { min: DVec3::ZERO, max: DVec3::ONE },
        cell_bits,
        normal_bits: NORMAL_BITS,
        resolution: 1,
        nodes: records.len() as u64,
        leaves: records.len() as u64,
        levels: 1,
        preserves_appearance: true,
        has_colors: is_all,
        closed: false,
        up: UpAxis::Y,
    };
    let model_bytes = model.to_bytes().len();
    let skeleton = Skeleton::new(root, records, 0).with_model(model);
    let mut best = f64::INFINITY;
    for round in 0..7 {
        let begun = cpu_seconds();
        for (at, bytes) in coded.iter().enumerate() {
            let page = std::hint::black_box(Page::decode(bytes, &skeleton, NodeId(at as u32))?);
            if round == 0 {
                assert!(page == *prepared[at].page(), "page {at} is another");
            }
        }
        if round > 0 {
            best = best.min(cpu_seconds() - begun);
        }
    }
    let triangles = mesh.triangles.len() as f64;
    let bytes: usize = coded.iter().map(Vec::len).sum();
    let part = |bits: f64| bits / 8.0 / triangles;
    println!(
        "{{\"pages\":{},\"triangles\":{triangles},\"bytes_per_triangle\":{:.3},\"connectivity\":{:.3},\"positions\":{:.3},\"normals\":{:.3},\"colors\":{:.3},\"points\":{:.3},\"model_bytes\":{model_bytes},\"m_triangles_per_second\":{:.2}}}",
        pages.len(),
        bytes as f64 / triangles,
        part(parts.connectivity),
        part(parts.positions),
        part(parts.normals),
        part(parts.colors),
        part(parts.points),
        triangles / best / 1e6
    );
    Ok(())
}
