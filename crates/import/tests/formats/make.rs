//! Makes small files of binary formats, with writers that share no line with the readers.

use e57::{E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation};
use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlrBuilder};
use serde_json::{Value, json};
use std::io::Cursor;

/// Records of a point format: positions (n, 2n, 3n), and a colour where there is one.
fn las_records(format: u8, extra: usize, count: usize) -> Vec<Vec<u8>> {
    let bytes = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67][usize::from(format)];
    let color = [0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30][usize::from(format)];
    (0..count)
        .map(|number| {
            let mut record = vec![0; bytes + extra];
            for axis in 0..3 {
                let value = (number * (axis + 1)) as i32;
                record[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
            }
            record[12] = (number % 251) as u8;
            if format > 5 {
                // One return of one, in one of two scanner channels.
                record[14] = 0x11;
                record[15] = ((number / 100 % 2) as u8) << 4;
            }
            if color > 0 {
                for channel in 0..3 {
                    let value = ((number * 7 + channel) % 256 * 257) as u16;
                    record[color + 2 * channel..][..2].copy_from_slice(&value.to_le_bytes());
                }
            }
            record
        })
        .collect()
}

/// A LAS file of version 1.4, or LAZ with chunks of a given number of points; 0 for varying ones.
pub(crate) fn las(format: u8, extra: usize, count: usize, chunk: Option<u32>) -> Vec<u8> {
    let records = las_records(format, extra, count);
    let record_bytes = records.first().map_or(20, Vec::len);
    let mut bytes = vec![0; 375];
    bytes[..4].copy_from_slice(b"LASF");
    bytes[24..26].copy_from_slice(&[1, 4]);
    bytes[94..96].copy_from_slice(&375u16.to_le_bytes());
    bytes[104] = format | if chunk.is_some() { 0x80 } else { 0 };
    bytes[105..107].copy_from_slice(&(record_bytes as u16).to_le_bytes());
    bytes[107..111].copy_from_slice(&(count as u32).to_le_bytes());
    for axis in 0..3 {
        bytes[131 + 8 * axis..][..8].copy_from_slice(&0.001f64.to_le_bytes());
        bytes[155 + 8 * axis..][..8].copy_from_slice(&500_000.0f64.to_le_bytes());
    }
    bytes[247..255].copy_from_slice(&(count as u64).to_le_bytes());
    let mut points = Vec::new();
    if let Some(chunk) = chunk {
        let items = LazItemRecordBuilder::default_for_point_format_id(format, extra as u16).expect("it is a format");
        let builder = LazVlrBuilder::new(items);
        let builder =
            if chunk == 0 { builder.with_variable_chunk_size() } else { builder.with_fixed_chunk_size(chunk) };
        let vlr = builder.build();
        let mut data = Vec::new();
        vlr.write_to(&mut data).expect("memory takes all");
        let mut head = [0; 54];
        head[2..16].copy_from_slice(b"laszip encoded");
        head[18..20].copy_from_slice(&22204u16.to_le_bytes());
        head[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
        bytes[100..104].copy_from_slice(&2u32.to_le_bytes());
        // Another record first: one that must be skipped.
        bytes.extend([0; 20]);
        bytes.extend(5u16.to_le_bytes());
        bytes.extend([0; 32 + 5]);
        bytes.extend(head);
        bytes.extend(data);
        let start = bytes.len() as u64;
        let mut out = Cursor::new(vec![0; start as usize]);
        out.set_position(start);
        let mut compressor = LasZipCompressor::new(&mut out, vlr).expect("it is a known kind");
        for (number, record) in records.iter().enumerate() {
            compressor.compress_one(record).expect("memory takes all");
            if chunk == 0 && number % 70 == 69 {
                compressor.finish_current_chunk().expect("memory takes all");
            }
        }
        compressor.done().expect("memory takes all");
        drop(compressor);
        points.extend(&out.into_inner()[start as usize..]);
    } else {
        points.extend(records.concat());
    }
    let offset = bytes.len() as u32;
    bytes[96..100].copy_from_slice(&offset.to_le_bytes());
    bytes.extend(points);
    bytes
}

/// Two scans, the second moved, with invalid points.
pub(crate) fn e57(points: usize) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "a file").expect("memory takes all");
    let scaled = |name| Record {
        name,
        data_type: RecordDataType::ScaledInteger { min: -5000, max: 100_000, scale: 0.001, offset: 2.0 },
    };
    let color = |name| Record { name, data_type: RecordDataType::Integer { min: 0, max: 255 } };
    let prototype = vec![
        scaled(RecordName::CartesianX),
        Record::CARTESIAN_Y_F32,
        Record::CARTESIAN_Z_F64,
        Record { name: RecordName::CartesianInvalidState, data_type: RecordDataType::Integer { min: 0, max: 2 } },
        Record { name: RecordName::RowIndex, data_type: RecordDataType::Integer { min: 0, max: 1000 } },
        color(RecordName::ColorRed),
        color(RecordName::ColorGreen),
        Record { name: RecordName::ColorBlue, data_type: RecordDataType::Integer { min: 7, max: 7 } },
    ];
    for scan in 0..2 {
        let mut cloud = writer.add_pointcloud(&format!("scan {scan}"), prototype.clone()).expect("memory takes all");
        if scan == 1 {
            // A quarter turn about z.
            let half = std::f64::consts::FRAC_1_SQRT_2;
            cloud.set_transform(Some(Transform {
                rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
                translation: Translation { x: 600_000.0, y: 0.0, z: 0.0 },
            }));
        }
        for number in 0..points {
            let values = vec![
                RecordValue::ScaledInteger(number as i64),
                RecordValue::Single(number as f32 * 0.5),
                RecordValue::Double(number as f64 * 0.25),
                RecordValue::Integer(i64::from(number % 10 == 3)),
                RecordValue::Integer(number as i64 % 1000),
                RecordValue::Integer(number as i64 % 256),
                RecordValue::Integer(255),
                RecordValue::Integer(7),
            ];
            cloud.add_point(values).expect("memory takes all");
        }
        cloud.finalize().expect("memory takes all");
    }
    writer.finalize().expect("memory takes all");
    drop(writer);
    bytes.into_inner()
}

/// A glTF document: JSON, and a buffer with a view for each accessor.
#[derive(Clone)]
pub(crate) struct Gltf {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Gltf {
    pub(crate) fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "scenes": [{ "nodes": [] }],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [], "materials": [],
        });
        Self { json, bytes: Vec::new() }
    }

    /// Appends to a list of the document; returns the number of the item.
    pub(crate) fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().expect("it is a list");
        list.push(value);
        list.len() - 1
    }

    /// A view of bytes, and its number.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// An accessor of its own view.
    pub(crate) fn accessor(&mut self, component: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }))
    }

    pub(crate) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.accessor(5126, shape, values.len(), &bytes)
    }

    pub(crate) fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(5123, "SCALAR", values.len(), &bytes)
    }

    /// A mesh of one primitive.
    pub(crate) fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    /// A node of the scene.
    pub(crate) fn node(&mut self, node: Value) {
        let number = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().expect("it is a list").push(number.into());
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if json["buffers"].is_null() {
            json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        }
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut chunk = self.bytes.clone();
        chunk.resize(chunk.len().next_multiple_of(4), 0);
        let length = 12 + 8 + text.len() + 8 + chunk.len();
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((length as u32).to_le_bytes());
        for (kind, content) in [(b"JSON", &text), (b"BIN\0", &chunk)] {
            glb.extend((content.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(content);
        }
        glb
    }
}

/// A square of two triangles as GLB, with what most files have.
pub(crate) fn square() -> Gltf {
    let mut gltf = Gltf::new();
    let position = gltf.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let normal = gltf.floats(&[[0.0, 0.0, 1.0]; 4]);
    let indices = gltf.indices(&[0, 1, 2, 0, 2, 3]);
    let mesh =
        gltf.mesh(json!({ "attributes": { "POSITION": position, "NORMAL": normal }, "indices": indices, "mode": 4 }));
    gltf.node(json!({ "mesh": mesh }));
    gltf
}

/// A mesh of a bent grid, its vertices and indices packed by meshoptimizer: the file, positions and triangles.
pub(crate) fn meshopt(size: u16) -> (Gltf, Vec<[f32; 3]>, Vec<u32>) {
    let (positions, indices) = grid(size);
    let mut gltf = Gltf::new();
    let packed = meshopt::encode_vertex_buffer_level(&positions, 2, Some(0)).expect("it is a good mesh");
    let index_bytes = meshopt::encode_index_buffer(&indices, positions.len()).expect("it is a good mesh");
    let mut add = |packed: &[u8], mode: &str, stride: usize, count: usize, component: u32, shape: &str| {
        let view = gltf.view(packed);
        let offset = gltf.json["bufferViews"][view]["byteOffset"].clone();
        gltf.json["bufferViews"][view] = json!({
            "buffer": 1, "byteLength": stride * count, "byteStride": stride,
            "extensions": { "EXT_meshopt_compression": {
                "buffer": 0, "byteOffset": offset, "byteLength": packed.len(), "byteStride": stride, "count": count,
                "mode": mode,
            } },
        });
        gltf.push("accessors", json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }))
    };
    let position = add(&packed, "ATTRIBUTES", 12, positions.len(), 5126, "VEC3");
    let triangles = add(&index_bytes, "TRIANGLES", 4, indices.len(), 5125, "SCALAR");
    let mesh = gltf.mesh(json!({ "attributes": { "POSITION": position }, "indices": triangles }));
    gltf.node(json!({ "mesh": mesh }));
    gltf.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    let fallback = json!({ "EXT_meshopt_compression": { "fallback": true } });
    gltf.json["buffers"] =
        json!([{ "byteLength": gltf.bytes.len() }, { "byteLength": 1 << 20, "extensions": fallback }]);
    (gltf, positions, indices)
}

/// The same grid packed by Draco.
pub(crate) fn draco(size: u16) -> (Gltf, Vec<[f32; 3]>, Vec<u32>) {
    use draco_core::{
        DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute,
    };
    let (positions, indices) = grid(size);
    let mut mesh = Mesh::new();
    mesh.set_num_points(positions.len());
    let mut attribute = PointAttribute::new();
    attribute.init(GeometryAttributeType::Position, 3, DataType::Float32, false, positions.len());
    for (number, position) in positions.iter().enumerate() {
        let bytes: Vec<u8> = position.iter().flat_map(|value| value.to_le_bytes()).collect();
        attribute.buffer_mut().write(number * 12, &bytes);
    }
    let number = mesh.add_attribute(attribute);
    mesh.set_num_faces(indices.len() / 3);
    mesh.set_faces_from_flat_indices(&indices);
    let unique = mesh.attribute(number).unique_id();
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut packed = EncoderBuffer::new();
    encoder.encode(&EncoderOptions::new(), &mut packed).expect("it is a good mesh");
    let mut gltf = Gltf::new();
    let view = gltf.view(packed.data());
    let position = gltf.push("accessors", json!({ "componentType": 5126, "type": "VEC3", "count": positions.len() }));
    let triangles = gltf.push("accessors", json!({ "componentType": 5125, "type": "SCALAR", "count": indices.len() }));
    let extension = json!({ "bufferView": view, "attributes": { "POSITION": unique } });
    let mesh = gltf.mesh(json!({
        "attributes": { "POSITION": position }, "indices": triangles,
        "extensions": { "KHR_draco_mesh_compression": extension },
    }));
    gltf.node(json!({ "mesh": mesh }));
    gltf.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    (gltf, positions, indices)
}

fn grid(size: u16) -> (Vec<[f32; 3]>, Vec<u32>) {
    let size = u32::from(size);
    let positions = (0..=size)
        .flat_map(|y| (0..=size).map(move |x| [x as f32, y as f32 * 0.5, (x * y % 7) as f32 * 0.125]))
        .collect();
    let corner = |x: u32, y: u32| y * (size + 1) + x;
    let quads = (0..size).flat_map(|y| (0..size).map(move |x| (x, y)));
    let indices = quads
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
            [a, b, c, a, c, d]
        })
        .collect();
    (positions, indices)
}
