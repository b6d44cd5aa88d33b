//! Vertices that are the same become one.

use super::octree::Piece;
use super::patch::{Face, Patch, Vertex};
use super::simplify::up;
use glam::{Vec2, Vec3};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Vertices at one place look different where the cosine between their normals is below: then it is an edge of the shading.
const SAME_COSINE: f32 = 0.9;

type Hashed<K, V> = HashMap<K, V, BuildHasherDefault<PlaceHasher>>;

/// Mixes words.
#[derive(Default)]
pub(super) struct PlaceHasher(u64);

impl Hasher for PlaceHasher {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }

    fn write(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(8) {
            let mut padded = [0; 8];
            padded[..word.len()].copy_from_slice(word);
            self.write_u64(u64::from_le_bytes(padded));
        }
    }

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 ^= self.0 >> 31;
    }

    fn write_u32(&mut self, word: u32) {
        self.write_u64(u64::from(word));
    }

    fn write_usize(&mut self, word: usize) {
        self.write_u64(word as u64);
    }
}

/// A patch of triangles as they were read, but for `rounding`, once and for each cut.
pub(super) fn patch_of(pieces: &[Piece], rounding: f32) -> Patch {
    let mut patch = Patch {
        vertices: Vec::with_capacity(pieces.len() / 2),
        faces: Vec::with_capacity(pieces.len()),
        spots: Vec::new(),
    };
    let mut known: Hashed<[u32; 5], u32> = Hashed::default();
    for piece in pieces {
        let mut corners = [0; 3];
        for (side, corner) in corners.iter_mut().enumerate() {
            let (at, normal, color) = (piece.at[side], piece.normals[side], piece.colors[side]);
            let [x, y, z] = at.map(f32::to_bits);
            let [red, green, blue] = color;
            let look = [u32::from(normal[0]) | u32::from(normal[1]) << 16, u32::from_le_bytes([red, green, blue, 0])];
            let key = [x, y, z, look[0], look[1]];
            *corner = *known.entry(key).or_insert_with(|| {
                patch.vertices.push(Vertex {
                    at: Vec3::from_array(at).as_dvec3(),
                    normal: normal_of(normal),
                    color: Vec3::from_array(color.map(f32::from)),
                });
                patch.vertices.len() as u32 - 1
            });
        }
        let geo = up(f64::from(rounding) * (1.0 + f64::from(piece.cuts)));
        patch.faces.push(Face { corners, geo, app: 0.0 });
    }
    patch
}

/// All patches as one: vertices at the same place that look alike are one.
pub(super) fn gather(patches: Vec<Patch>) -> Patch {
    let mut all = Patch {
        vertices: Vec::with_capacity(patches.iter().map(|patch| patch.vertices.len()).sum()),
        faces: Vec::with_capacity(patches.iter().map(|patch| patch.faces.len()).sum()),
        spots: patches.iter().flat_map(|patch| patch.spots.iter().copied()).collect(),
    };
    // The last vertex at a place, and for each the one before it at the same.
    let mut last: Hashed<[u64; 3], u32> = Hashed::default();
    let mut before: Vec<u32> = Vec::new();
    for patch in patches {
        let names: Vec<u32> = patch
            .vertices
            .iter()
            .map(|vertex| {
                let key = vertex.at.to_array().map(f64::to_bits);
                let there = last.get(&key).copied();
                let mut candidate = there;
                while let Some(known) = candidate {
                    if all.vertices[known as usize].normal.dot(vertex.normal) > SAME_COSINE {
                        return known;
                    }
                    candidate = Some(before[known as usize]).filter(|earlier| *earlier != u32::MAX);
                }
                let name = all.vertices.len() as u32;
                all.vertices.push(*vertex);
                before.push(there.unwrap_or(u32::MAX));
                last.insert(key, name);
                name
            })
            .collect();
        let rename = |face: &Face| Face { corners: face.corners.map(|corner| names[corner as usize]), ..*face };
        all.faces.extend(patch.faces.iter().map(rename));
    }
    all
}

/// Direction of a code of 16 bits for each coordinate.
pub(super) fn normal_of(code: [u16; 2]) -> Vec3 {
    let at = Vec2::from_array(code.map(|value| f32::from(value) / 32_767.5 - 1.0));
    let z = 1.0 - at.x.abs() - at.y.abs();
    let fold = (-z).max(0.0);
    let away = |value: f32| if value >= 0.0 { value - fold } else { value + fold };
    Vec3::new(away(at.x), away(at.y), z).normalize_or(Vec3::Z)
}

/// Code of a direction.
pub(super) fn code_of(normal: Vec3) -> [u16; 2] {
    let code = super::round::octahedral(normal, 16);
    [code as u16, (code >> 16) as u16]
}
