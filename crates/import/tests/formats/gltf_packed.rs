//! glTF whose buffers are packed: EXT_meshopt_compression and KHR_draco_mesh_compression, against their own encoders.

use crate::make::{Gltf, draco, meshopt, square};
use crate::sources::read;
use serde_json::{Value, json};

/// Corners of each triangle as positions, in an order that does not depend on the numbers of vertices.
fn soup(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<[[i64; 3]; 3]> {
    let mut soup: Vec<_> = triangles
        .iter()
        .map(|triangle| {
            let corners = triangle.map(|corner| positions[corner as usize].map(|value| (value * 100.0).round() as i64));
            let first = (0..3).min_by_key(|&corner| corners[corner]).expect("there are three");
            std::array::from_fn(|corner| corners[(first + corner) % 3])
        })
        .collect();
    soup.sort_unstable();
    soup
}

#[test]
fn packed_meshes_are_those_that_were_packed() {
    for size in [1, 3, 20, 100] {
        let wide = |positions: Vec<[f32; 3]>| -> Vec<_> { positions.iter().map(|it| it.map(f64::from)).collect() };
        let (gltf, positions, indices) = meshopt(size);
        let model = read(&gltf.glb()).expect("it is a good file");
        // The packer keeps vertices, and turns triangles in themselves.
        let positions = wide(positions);
        assert_eq!(model.positions, positions);
        let expected = soup(&positions, indices.as_chunks().0);
        assert!(soup(&model.positions, &model.triangles) == expected, "{size}");
        // Draco moves vertices a little, less than a hundredth here, and numbers them anew.
        let (gltf, positions, indices) = draco(size);
        let model = read(&gltf.glb()).expect("it is a good file");
        assert_eq!((model.positions.len(), model.triangles.len()), (positions.len(), indices.len() / 3));
        let expected = soup(&wide(positions), indices.as_chunks().0);
        assert!(soup(&model.positions, &model.triangles) == expected, "{size}");
    }
}

/// The bytes of a packed view, as positions of points: of a stride of 12 or 8 bytes.
fn unpacked(packed: &[u8], mode: &str, stride: usize, count: usize, filter: &str, accessor: Value) -> Vec<[f64; 3]> {
    let mut gltf = Gltf::new();
    let view = gltf.view(packed);
    gltf.json["bufferViews"][view] = json!({
        "buffer": 0, "byteLength": stride * count, "byteStride": stride,
        "extensions": { "EXT_meshopt_compression": {
            "buffer": 0, "byteLength": packed.len(), "byteStride": stride, "count": count, "mode": mode, "filter": filter,
        } },
    });
    let position = gltf.push("accessors", accessor);
    let mesh = gltf.mesh(json!({ "attributes": { "POSITION": position }, "mode": 0 }));
    gltf.node(json!({ "mesh": mesh }));
    read(&gltf.glb()).expect("it is a good file").positions
}

#[test]
fn filters_of_meshoptimizer_give_what_its_own_decoder_gives() {
    let mut state = 5u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let count = 500;
    let vectors: Vec<[f32; 4]> = (0..count)
        .map(|_| {
            let vector: [f32; 4] = [random(), random(), random(), random()];
            let length = vector.iter().map(|value| value * value).sum::<f32>().sqrt();
            vector.map(|value| value / length)
        })
        .collect();
    let units: Vec<[f32; 4]> = vectors
        .iter()
        .map(|&[x, y, z, _]| {
            let length = (x * x + y * y + z * z).sqrt();
            [x / length, y / length, z / length, 0.0]
        })
        .collect();
    let accessor =
        |component: u32| json!({ "bufferView": 0, "componentType": component, "type": "VEC3", "count": count });
    let wide = |values: &[[i16; 4]]| -> Vec<[f64; 3]> {
        values.iter().map(|&[x, y, z, _]| [x, y, z].map(f64::from)).collect()
    };
    let pack = |bytes: Vec<u8>| -> Vec<u8> {
        let (rows, _) = bytes.as_chunks::<8>();
        meshopt::encode_vertex_buffer_level(rows, 2, Some(0)).expect("memory takes all")
    };
    let bytes = |values: &[[i16; 4]]| -> Vec<u8> {
        values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect()
    };
    let mut octahedral = meshopt::encode_filter_oct::<i16>(&units, 12);
    let packed = pack(bytes(&octahedral));
    meshopt::decode_filter_oct(&mut octahedral);
    assert_eq!(unpacked(&packed, "ATTRIBUTES", 8, count, "OCTAHEDRAL", accessor(5122)), wide(&octahedral));
    let mut quaternion = meshopt::encode_filter_quat(&vectors, 14);
    let packed = pack(bytes(&quaternion));
    meshopt::decode_filter_quat(&mut quaternion);
    assert_eq!(unpacked(&packed, "ATTRIBUTES", 8, count, "QUATERNION", accessor(5122)), wide(&quaternion));
    let positions: Vec<[f32; 3]> = vectors.iter().map(|&[x, y, z, _]| [x * 1e3, y * 1e-3, z]).collect();
    let coarse: Vec<[u32; 3]> = positions
        .iter()
        .map(|position| {
            // A mantissa of 16 bits and an exponent.
            position.map(|value| {
                let exponent = (value.abs().log2().ceil() as i32 - 15).clamp(-100, 100);
                let mantissa = (f64::from(value) / 2f64.powi(exponent)).round() as i32;
                (exponent << 24 | (mantissa & 0xff_ffff)) as u32
            })
        })
        .collect();
    let packed = meshopt::encode_vertex_buffer_level(&coarse, 2, Some(0)).expect("memory takes all");
    let mut decoded = coarse;
    meshopt::decode_filter_exp(&mut decoded);
    let expected: Vec<[f64; 3]> = decoded.iter().map(|row| row.map(|bits| f64::from(f32::from_bits(bits)))).collect();
    let found = unpacked(&packed, "ATTRIBUTES", 12, count, "EXPONENTIAL", accessor(5126));
    assert_eq!(found, expected);
    let near = |(found, position): (&[f64; 3], &[f32; 3])| {
        (0..3).all(|axis| (found[axis] - f64::from(position[axis])).abs() <= f64::from(position[axis].abs()) * 1e-4)
    };
    assert!(found.iter().zip(&positions).all(near));
}

#[test]
fn sequences_of_indices_are_unpacked() {
    let mut gltf = square();
    let indices = [0u32, 1, 2, 0, 2, 3, 3, 2, 0, 3, 0, 1];
    let packed = meshopt::encode_index_sequence(&indices, 4).expect("memory takes all");
    let view = gltf.view(&packed);
    let offset = gltf.json["bufferViews"][view]["byteOffset"].clone();
    gltf.json["bufferViews"][view] = json!({
        "buffer": 0, "byteLength": 2 * indices.len(),
        "extensions": { "EXT_meshopt_compression": {
            "buffer": 0, "byteOffset": offset, "byteLength": packed.len(), "byteStride": 2, "count": indices.len(),
            "mode": "INDICES",
        } },
    });
    gltf.json["accessors"][2] =
        json!({ "bufferView": view, "componentType": 5123, "type": "SCALAR", "count": indices.len() });
    assert_eq!(read(&gltf.glb()).expect("it is a good file").triangles.as_flattened(), indices);
}
