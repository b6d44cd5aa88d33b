//! Makes one copy of the scan: warp, cut, re-sample, turn, scale, place.
//!
//! Takes a copy's number; gives a mesh without unused vertices. Every choice is drawn from a random stream of that
//! number, so copies can be made in any order and as often as needed.

use super::mesh::Mesh;
use super::resample::{cluster, subdivide};
use super::{ReplicaOptions, Scan};
use crate::noise::{Random, noise3};
use crate::permute::Permutation;
use crate::{Order, SynthError};
use glam::{Mat3, Vec3};
use std::f32::consts::TAU;

/// Copies above this many triangles are not subdivided further.
const MOST_TO_SUBDIVIDE: usize = 1_000_000;
/// How close copies lie: edge of the cube each has to itself, as a share of the scan's diagonal. Boxes of turned copies
/// touch at about 1; scans fill little of their boxes.
const CLOSENESS: f32 = 0.72;

/// The scan, made ready: centred, one unit along its diagonal.
pub(super) struct CopyMaker {
    options: ReplicaOptions,
    scan: Mesh,
    /// Length of the scan's diagonal, scan units.
    diagonal: f32,
    /// Mean length of an edge, diagonals.
    edge: f32,
}

impl CopyMaker {
    /// Checks the scan, and centres it.
    pub(super) fn new(scan: &Scan, options: ReplicaOptions) -> Result<Self, SynthError> {
        let (vertices, triangles) = (scan.positions.len(), scan.triangles.len());
        if let Some(vertex) = scan.positions.iter().position(|p| !p.iter().all(|x| x.abs() <= 1e30)) {
            return Err(SynthError::NotFinite { vertex });
        }
        for (triangle, corners) in scan.triangles.iter().enumerate() {
            if let Some(&found) = corners.iter().find(|corner| **corner as usize >= vertices) {
                return Err(SynthError::BadIndex { triangle, found, vertices });
            }
        }
        if let Some(colors) = &scan.colors
            && colors.len() != vertices
        {
            return Err(SynthError::ColorCount { expected: vertices, found: colors.len() });
        }
        let mut mesh = Mesh {
            positions: scan.positions.iter().copied().map(Vec3::from).collect(),
            triangles: scan.triangles.clone(),
            colors: scan.colors.clone().unwrap_or_default(),
        };
        let solid = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| Vec3::from(scan.positions[corner as usize]).as_dvec3());
            (b - a).cross(c - a).length_squared() > 0.0
        };
        mesh.triangles.retain(solid);
        if mesh.triangles.is_empty() {
            return Err(SynthError::EmptyScan { vertices, triangles });
        }
        let mut mesh = mesh.without_unused();
        let low = mesh.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min).as_dvec3();
        let high = mesh.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max).as_dvec3();
        let (center, diagonal) = ((low + high) * 0.5, (high - low).length());
        for p in &mut mesh.positions {
            *p = ((p.as_dvec3() - center) / diagonal).as_vec3();
        }
        let edges: f64 = mesh
            .triangles
            .iter()
            .map(|&triangle| {
                let [a, b, c] = mesh.corners(triangle);
                f64::from((b - a).length() + (c - b).length() + (a - c).length())
            })
            .sum();
        let edge = (edges / (3.0 * mesh.triangles.len() as f64)) as f32;
        Ok(Self { options, scan: mesh, diagonal: diagonal as f32, edge })
    }

    /// Triangles wanted in all.
    pub(super) fn triangles(&self) -> u64 {
        self.options.triangles
    }

    /// Copy number `index`; at least one triangle.
    pub(super) fn copy(&self, index: u64) -> Mesh {
        let mut random = Random::new(self.options.seed, 100 + index);
        let mut mesh = self.scan.clone();
        let noise_seed = random.next_u32();
        // Warp: waves of a quarter to a half of the scan, up to a twentieth of it high.
        let (frequency, height) = (random.between(2.0, 4.0), random.between(0.01, 0.05));
        for p in &mut mesh.positions {
            *p += noise3(noise_seed, *p * frequency) * height;
        }
        let cuts = 1 + u32::from(random.unit() < 0.4);
        for _ in 0..cuts {
            let (normal, offset) = (random.direction(), random.between(0.02, 0.22));
            mesh.keep_triangles(|centroid| centroid.dot(normal) < offset);
        }
        mesh = mesh.without_unused();
        let kind = random.unit();
        let rough = self.edge * random.between(0.05, 0.2);
        if kind < 0.35 {
            let times = if kind < 0.1 { 2 } else { 1 };
            for time in 0..times {
                if mesh.triangles.len() <= MOST_TO_SUBDIVIDE {
                    let finer = 1.0 / f32::from(1_u8 << time);
                    mesh = subdivide(&mesh, self.edge * finer, rough * finer, noise_seed ^ (77 + time as u32));
                }
            }
        } else if kind < 0.62 {
            mesh = cluster(mesh, self.edge * random.between(1.5, 5.0)).without_unused();
        }
        self.place(&mut mesh, index, &mut random);
        mesh
    }

    /// Turns, scales and lays down a copy; tints its colours a little.
    fn place(&self, mesh: &mut Mesh, index: u64, random: &mut Random) {
        let turn = rotation(random);
        // Log-uniform from 0.5 to 2.
        let scale = libm::exp2f(random.between(-1.0, 1.0)) * self.diagonal;
        let cell = CLOSENESS * self.diagonal;
        // A flattened half ball, filled from the middle outwards: directions from a Fibonacci lattice without end
        // (additive golden-ratio sequences), radii from the volume used so far.
        let n = index as f64 + 0.5;
        let height = (n * 0.618_033_988_749_894_9).fract() as f32;
        let angle = TAU * (n * 0.754_877_666_246_692_7).fract() as f32;
        let level = (1.0 - height * height).sqrt();
        // Volume of a half ball flattened to 0.6: 0.4 π r³.
        let reach = libm::cbrt(n / (0.4 * std::f64::consts::PI)) as f32 * cell * 1.1;
        let jitter = random.direction() * (0.25 * cell);
        let direction = Vec3::new(level * libm::cosf(angle), 0.6 * height, level * libm::sinf(angle));
        let at = direction * reach + jitter + Vec3::Y * (0.3 * self.diagonal);
        for p in &mut mesh.positions {
            *p = turn * *p * scale + at;
        }
        let tint: [f32; 3] = std::array::from_fn(|_| random.between(0.82, 1.0));
        for color in &mut mesh.colors {
            *color = std::array::from_fn(|channel| (f32::from(color[channel]) * tint[channel]) as u8);
        }
    }

    /// `copy`, cut by one more plane so that exactly `triangles` remain.
    pub(super) fn cut_to(&self, mut copy: Mesh, index: u64, triangles: usize) -> Mesh {
        let normal = Random::new(self.options.seed, 100 + index).direction();
        let mut by_depth: Vec<(f32, usize)> =
            copy.triangles.iter().map(|&triangle| copy.centroid(triangle).dot(normal)).zip(0..).collect();
        by_depth.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut kept: Vec<usize> = by_depth[..triangles].iter().map(|&(_, at)| at).collect();
        kept.sort_unstable();
        copy.triangles = kept.into_iter().map(|at| copy.triangles[at]).collect();
        copy.without_unused()
    }

    /// `copy` with vertices and triangles in the order asked for.
    pub(super) fn ordered(&self, copy: Mesh, index: u64) -> Mesh {
        if self.options.order == Order::Coherent {
            return copy;
        }
        let seed = self.options.seed ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let vertices = Permutation::new(copy.positions.len() as u64, seed);
        let triangles = Permutation::new(copy.triangles.len() as u64, seed ^ 1);
        let old_vertex = |place: usize| vertices.invert(place as u64) as usize;
        Mesh {
            positions: (0..copy.positions.len()).map(|place| copy.positions[old_vertex(place)]).collect(),
            colors: (0..copy.colors.len()).map(|place| copy.colors[old_vertex(place)]).collect(),
            triangles: (0..copy.triangles.len())
                .map(|place| copy.triangles[triangles.invert(place as u64) as usize])
                .map(|corners| corners.map(|corner| vertices.apply(u64::from(corner)) as u32))
                .collect(),
        }
    }
}

/// A uniformly random rotation, from a uniform unit quaternion (Marsaglia 1972). Written out, since `glam::Quat` adds in
/// another order on some machines.
fn rotation(random: &mut Random) -> Mat3 {
    let mut pair = || loop {
        let (a, b) = (random.between(-1.0, 1.0), random.between(-1.0, 1.0));
        let s = a * a + b * b;
        if s < 1.0 && s > 0.0 {
            return (a, b, s);
        }
    };
    let ((x, y, s1), (c, d, s2)) = (pair(), pair());
    let root = ((1.0 - s1) / s2).sqrt();
    let (z, w) = (c * root, d * root);
    Mat3::from_cols(
        Vec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        Vec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        Vec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
}
