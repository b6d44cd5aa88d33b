//! PLY, OBJ and GLB, written from front to back: a header, vertices, points, triangles.
//!
//! What is to come must be known before: a header says how much it is. Coordinates are the model's own; GLB, which has but single
//! precision, puts them relative to the hierarchy's origin, where its only node stands. glTF's sky is along y, so of a model whose is
//! along z that node is turned.

use super::{ExportError, Written};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::color::LINEAR_OF_SRGB8;
use glam::{DVec3, Vec3};
use std::io::{self, Write};

/// A format that models are exported in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Binary, little-endian.
    Ply,
    /// Text.
    Obj,
    /// glTF 2.0 in one file.
    Glb,
}

/// What is to come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    pub(super) written: Written,
    pub(super) has_colors: bool,
    /// Single precision would not do.
    pub(super) is_wide: bool,
    /// What is written relative to, where precision is single; model space.
    pub(super) origin: DVec3,
    pub(super) up: UpAxis,
    /// Around vertices and around points, relative to the origin.
    pub(super) boxes: [[Vec3; 2]; 2],
}

/// A vertex or point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Relative to the origin.
    pub(super) at: DVec3,
    /// Of unit length.
    pub(super) normal: Vec3,
    /// sRGB.
    pub(super) color: [u8; 3],
}

impl Plan {
    /// Around nothing.
    pub(super) const EMPTY_BOX: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];

    /// Writes what comes before the vertices.
    pub(super) fn begin(&self, format: Format, out: &mut dyn Write) -> Result<(), ExportError> {
        let Written { vertices, points, .. } = self.written;
        let most = u64::from(u32::MAX);
        if vertices + points > most {
            let (found, format) = (vertices + points, format.name());
            return Err(ExportError::TooMuch { what: "vertices", found, most, format });
        }
        match format {
            Format::Ply => self.ply_header(out)?,
            Format::Obj => {}
            Format::Glb => self.glb_header(out)?,
        }
        Ok(())
    }

    pub(super) fn vertex(&self, format: Format, vertex: &Vertex, out: &mut dyn Write) -> io::Result<()> {
        let Vertex { at, normal, color } = vertex;
        let model = self.origin + *at;
        match format {
            Format::Ply => {
                let mut bytes = [0; 39];
                let mut end = 0;
                let mut put = |some: &[u8]| {
                    bytes[end..end + some.len()].copy_from_slice(some);
                    end += some.len();
                };
                for value in model.to_array() {
                    if self.is_wide { put(&value.to_le_bytes()) } else { put(&(value as f32).to_le_bytes()) }
                }
                normal.to_array().iter().for_each(|value| put(&value.to_le_bytes()));
                if self.has_colors {
                    put(color);
                }
                out.write_all(&bytes[..end])
            }
            Format::Obj => {
                let [x, y, z] = model.to_array();
                if self.is_wide {
                    write!(out, "v {x} {y} {z}")?
                } else {
                    write!(out, "v {} {} {}", x as f32, y as f32, z as f32)?
                }
                if self.has_colors {
                    let [r, g, b] = color.map(|value| f32::from(value) / 255.0);
                    write!(out, " {r:.4} {g:.4} {b:.4}")?;
                }
                let [x, y, z] = normal.to_array();
                writeln!(out, "\nvn {x:.4} {y:.4} {z:.4}")
            }
            Format::Glb => {
                let mut bytes = [0; 32];
                for (to, value) in
                    bytes.chunks_exact_mut(4).zip(at.as_vec3().to_array().into_iter().chain(normal.to_array()))
                {
                    to.copy_from_slice(&value.to_le_bytes());
                }
                let linear = color.map(|value| (LINEAR_OF_SRGB8[usize::from(value)] * 65_535.0).round() as u16);
                for (to, value) in bytes[24..].chunks_exact_mut(2).zip(linear.into_iter().chain([u16::MAX])) {
                    to.copy_from_slice(&value.to_le_bytes());
                }
                out.write_all(&bytes[..self.stride()])
            }
        }
    }

    pub(super) fn triangle(&self, format: Format, corners: [u32; 3], out: &mut dyn Write) -> io::Result<()> {
        match format {
            Format::Ply => {
                let mut bytes = [3; 13];
                for (to, corner) in bytes[1..].chunks_exact_mut(4).zip(corners) {
                    to.copy_from_slice(&corner.to_le_bytes());
                }
                out.write_all(&bytes)
            }
            Format::Obj => {
                let [a, b, c] = corners.map(|corner| u64::from(corner) + 1);
                writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")
            }
            Format::Glb => corners.iter().try_for_each(|corner| out.write_all(&corner.to_le_bytes())),
        }
    }

    fn ply_header(&self, out: &mut dyn Write) -> io::Result<()> {
        let Written { vertices, triangles, points } = self.written;
        let scalar = if self.is_wide { "double" } else { "float" };
        write!(out, "ply\nformat binary_little_endian 1.0\ncomment Gigalod\nelement vertex {}\n", vertices + points)?;
        ["x", "y", "z"].iter().try_for_each(|axis| writeln!(out, "property {scalar} {axis}"))?;
        ["nx", "ny", "nz"].iter().try_for_each(|axis| writeln!(out, "property float {axis}"))?;
        if self.has_colors {
            ["red", "green", "blue"].iter().try_for_each(|name| writeln!(out, "property uchar {name}"))?;
        }
        if triangles > 0 {
            // What most programs know is signed.
            let index = if vertices + points <= i32::MAX as u64 { "int" } else { "uint" };
            write!(out, "element face {triangles}\nproperty list uchar {index} vertex_indices\n")?;
        }
        out.write_all(b"end_header\n")
    }

    /// Bytes of a vertex in a GLB.
    fn stride(&self) -> usize {
        if self.has_colors { 32 } else { 24 }
    }

    fn glb_header(&self, out: &mut dyn Write) -> Result<(), ExportError> {
        let Written { vertices, triangles, points } = self.written;
        let (vertex_bytes, index_bytes) = ((vertices + points) * self.stride() as u64, triangles * 12);
        let mut json = self.glb_json(vertex_bytes, index_bytes).to_string();
        while !json.len().is_multiple_of(4) {
            json.push(' ');
        }
        let bytes = vertex_bytes + index_bytes;
        let has_bytes = if bytes > 0 { 8 } else { 0 };
        let total = 12 + 8 + json.len() as u64 + has_bytes + bytes;
        let most = u64::from(u32::MAX);
        let Ok(whole) = u32::try_from(total) else {
            return Err(ExportError::TooMuch { what: "bytes", found: total, most, format: Format::Glb.name() });
        };
        out.write_all(b"glTF")?;
        [2, whole, json.len() as u32].iter().try_for_each(|number: &u32| out.write_all(&number.to_le_bytes()))?;
        out.write_all(b"JSON")?;
        out.write_all(json.as_bytes())?;
        if bytes > 0 {
            out.write_all(&(bytes as u32).to_le_bytes())?;
            out.write_all(b"BIN\0")?;
        }
        Ok(())
    }

    fn glb_json(&self, vertex_bytes: u64, index_bytes: u64) -> serde_json::Value {
        use serde_json::json;
        let Written { vertices, triangles, points } = self.written;
        let asset = json!({ "version": "2.0", "generator": concat!("Gigalod ", env!("CARGO_PKG_VERSION")) });
        if vertices + points == 0 {
            return json!({ "asset": asset });
        }
        let stride = self.stride() as u64;
        let mut views = vec![json!({ "buffer": 0, "byteLength": vertex_bytes, "byteStride": stride, "target": 34962 })];
        let (mut accessors, mut primitives) = (Vec::new(), Vec::new());
        let parts = [(0, vertices, 4, self.boxes[0]), (vertices, points, 0, self.boxes[1])];
        for (first, count, mode, [least, most]) in parts.into_iter().filter(|(_, count, ..)| *count > 0) {
            let mut accessor = |offset: u64, component: u32, kind: &str| {
                let mut made = json!({ "bufferView": 0, "byteOffset": first * stride + offset, "componentType": component, "count": count, "type": kind });
                match offset {
                    0 => {
                        made["min"] = json!(least.to_array());
                        made["max"] = json!(most.to_array());
                    }
                    12 => {}
                    _ => made["normalized"] = json!(true),
                }
                accessors.push(made);
                accessors.len() - 1
            };
            let mut attributes = json!({ "POSITION": accessor(0, 5126, "VEC3"), "NORMAL": accessor(12, 5126, "VEC3") });
            if self.has_colors {
                attributes["COLOR_0"] = json!(accessor(24, 5123, "VEC4"));
            }
            primitives.push(json!({ "attributes": attributes, "mode": mode }));
        }
        if triangles > 0 {
            views.push(json!({ "buffer": 0, "byteOffset": vertex_bytes, "byteLength": index_bytes, "target": 34963 }));
            accessors.push(json!({ "bufferView": 1, "componentType": 5125, "count": triangles * 3, "type": "SCALAR" }));
            primitives[0]["indices"] = json!(accessors.len() - 1);
        }
        let [x, y, z] = self.origin.to_array();
        let matrix = match self.up {
            UpAxis::Y => [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0],
            UpAxis::Z => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, x, z, -y, 1.0],
        };
        json!({
            "asset": asset,
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0, "matrix": matrix }],
            "meshes": [{ "primitives": primitives }],
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{ "byteLength": vertex_bytes + index_bytes }],
        })
    }
}

impl Format {
    /// By the ending of a file's name.
    pub fn of_extension(extension: &str) -> Option<Self> {
        match extension.to_ascii_lowercase().as_str() {
            "ply" => Some(Self::Ply),
            "obj" => Some(Self::Obj),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::Glb => "GLB",
        }
    }
}
