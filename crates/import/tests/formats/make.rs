//! Makes small files of binary formats, with writers that share no line with the readers.

#[path = "make_points.rs"]
mod make_points;

pub(crate) use make_points::{e57, las};
use serde_json::{Value, json};

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
