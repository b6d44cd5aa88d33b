//! glTF and GLB.

use crate::make::{Gltf, square};
use crate::sources::{error, read, read_with};
use gigalod_import::{ByteSource, CornerBatch, Material, NoSideFiles, Texture, Wrap, open_with, read_all};
use serde_json::{Value, json};
use std::io::{self, Cursor, Read};

const SQUARE: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn a_square_is_read_from_glb_from_json_and_from_files_beside_it() {
    let gltf = square();
    let model = read(&gltf.glb()).expect("it is a good file");
    assert_eq!((&model.positions[..], &model.normals[..]), (&SQUARE[..], &[[0.0, 0.0, 1.0]; 4][..]));
    assert_eq!(model.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(model.colors.is_empty() && model.corner_tex_coords.is_empty());
    let mut beside = gltf.json.clone();
    beside["buffers"] = json!([{ "byteLength": gltf.bytes.len(), "uri": "my%20data.bin" }]);
    let bytes = gltf.bytes.clone();
    let side = move |name: &str| -> io::Result<Box<dyn ByteSource>> {
        if name == "my data.bin" {
            Ok(Box::new(Cursor::new(bytes.clone())))
        } else {
            Err(io::ErrorKind::NotFound.into())
        }
    };
    let text = beside.to_string();
    assert_eq!(read_with(Box::new(Cursor::new(text.clone())), Box::new(side)).expect("it is a good file"), model);
    assert_eq!(
        read_with(Box::new(Cursor::new(text)), Box::new(NoSideFiles)).expect_err("its data is away").to_string(),
        "expected the file `my data.bin` beside the model, found no files beside the model can be had here (byte 0, buffer 0)"
    );
    let mut inside = gltf.json.clone();
    inside["buffers"] = json!([{ "byteLength": gltf.bytes.len(), "uri": format!("data:application/gltf-buffer;base64,{}", base64(&gltf.bytes)) }]);
    assert_eq!(read(inside.to_string().as_bytes()).expect("it is a good file"), model);
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    bytes
        .chunks(3)
        .map(|group| {
            let [a, b, c] = std::array::from_fn(|at| u32::from(*group.get(at).unwrap_or(&0)));
            let bits = a << 16 | b << 8 | c;
            let digit = |at: usize| {
                if at <= group.len() { char::from(DIGITS[(bits >> (18 - 6 * at)) as usize & 63]) } else { '=' }
            };
            [digit(0), digit(1), digit(2), digit(3)].iter().collect::<String>()
        })
        .collect()
}

/// Bytes of whole numbers of each component type, whose values are those given.
fn integers(component: u32, values: &[i64]) -> Vec<u8> {
    let bytes = match component {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    };
    values.iter().flat_map(|value| value.to_le_bytes().into_iter().take(bytes)).collect()
}

#[test]
fn positions_and_indices_have_every_type() {
    for component in [5120, 5121, 5122, 5123] {
        for index in [5121, 5123, 5125] {
            let mut gltf = Gltf::new();
            let values = [0, 0, 0, 100, 0, 0, 0, 100, 7];
            let position = gltf.accessor(component, "VEC3", 3, &integers(component, &values));
            let indices = gltf.accessor(index, "SCALAR", 3, &integers(index, &[2, 1, 0]));
            let mesh = gltf.mesh(json!({ "attributes": { "POSITION": position }, "indices": indices }));
            gltf.node(json!({ "mesh": mesh }));
            let model = read(&gltf.glb()).expect("it is a good file");
            assert_eq!(model.positions, [[0.0; 3], [100.0, 0.0, 0.0], [0.0, 100.0, 7.0]]);
            assert_eq!(model.triangles, [[2, 1, 0]]);
        }
    }
    // Shares of the largest value; negative ones end at -1.
    for (component, full) in [(5120, 127), (5121, 255), (5122, 32767), (5123, 65535)] {
        let mut gltf = Gltf::new();
        let least = if component % 2 == 0 { -full - 1 } else { 0 };
        let position = gltf.accessor(component, "VEC3", 1, &integers(component, &[full, 0, least]));
        gltf.json["accessors"][position]["normalized"] = true.into();
        let mesh = gltf.mesh(json!({ "attributes": { "POSITION": position }, "mode": 0 }));
        gltf.node(json!({ "mesh": mesh }));
        let model = read(&gltf.glb()).expect("it is a good file");
        assert_eq!(model.positions, [[1.0, 0.0, if least < 0 { -1.0 } else { 0.0 }]]);
    }
}

#[test]
fn strides_sparse_elements_and_missing_views_are_read() {
    let mut gltf = square();
    // Positions 16 bytes apart.
    let wide: Vec<u8> =
        SQUARE.iter().flat_map(|[x, y, z]| [*x, *y, *z, 9.0]).flat_map(|value| (value as f32).to_le_bytes()).collect();
    let view = gltf.view(&wide);
    gltf.json["bufferViews"][view]["byteStride"] = 16.into();
    gltf.json["accessors"][0]["bufferView"] = view.into();
    assert_eq!(read(&gltf.glb()).expect("it is a good file").positions, SQUARE);
    // Two of them replaced, with and without a view below.
    let places = gltf.view(&[1, 0, 3, 0]);
    let values =
        gltf.view(&[5f32, 5.0, 5.0, 6.0, 6.0, 6.0].iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
    gltf.json["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": { "bufferView": places, "componentType": 5123 }, "values": { "bufferView": values },
    });
    let model = read(&gltf.glb()).expect("it is a good file");
    assert_eq!(model.positions, [[0.0; 3], [5.0; 3], [1.0, 1.0, 0.0], [6.0; 3]]);
    gltf.json["accessors"][0].as_object_mut().expect("it is one").remove("bufferView");
    let model = read(&gltf.glb()).expect("it is a good file");
    assert_eq!(model.positions, [[0.0; 3], [5.0; 3], [0.0; 3], [6.0; 3]]);
    for (places, expected) in [
        ([3, 0, 1, 0], "expected sparse indices that ascend, below 4, found others (byte 0, accessor 0)"),
        ([1, 0, 4, 0], "expected sparse indices that ascend, below 4, found others (byte 0, accessor 0)"),
    ] {
        let mut gltf = gltf.clone();
        let view = gltf.view(&places);
        gltf.json["accessors"][0]["sparse"]["indices"]["bufferView"] = view.into();
        assert_eq!(error(&gltf.glb()), expected);
    }
}

#[test]
fn strips_fans_points_and_lines_are_what_they_are() {
    let with = |mode: u8, indices: Option<&[u16]>| {
        let mut gltf = square();
        let primitive = &mut gltf.json["meshes"][0]["primitives"][0];
        primitive["mode"] = mode.into();
        match indices {
            Some(indices) => {
                let indices = gltf.indices(indices);
                gltf.json["meshes"][0]["primitives"][0]["indices"] = indices.into();
            }
            None => _ = primitive.as_object_mut().expect("it is one").remove("indices"),
        }
        read(&gltf.glb()).expect("it is a good file").triangles
    };
    assert_eq!(with(4, None), [[0, 1, 2]]);
    assert_eq!(with(5, None), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(with(6, None), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(
        with(5, Some(&[3, 2, 1, 1, 0, 2])),
        [[3, 2, 1], [0, 1, 2]],
        "the winding follows the place in the strip"
    );
    assert_eq!(with(6, Some(&[3, 2, 1, 0])), [[3, 2, 1], [3, 1, 0]]);
    assert_eq!(with(0, None), [[0; 3]; 0]);
    assert_eq!(with(1, None), [[0; 3]; 0]);
    // A fan longer than what is read at once.
    let mut gltf = square();
    let long: Vec<u16> = [3].into_iter().chain((0..40_000).map(|corner| corner % 3)).collect();
    let indices = gltf.indices(&long);
    gltf.json["meshes"][0]["primitives"][0]["indices"] = indices.into();
    gltf.json["meshes"][0]["primitives"][0]["mode"] = 6.into();
    let triangles = read(&gltf.glb()).expect("it is a good file").triangles;
    let expected: Vec<_> = (0..39_999u32).map(|corner| [3, corner % 3, (corner + 1) % 3]).collect();
    assert!(triangles == expected);
}

#[test]
fn nodes_place_turn_and_mirror_meshes() {
    let mut gltf = square();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // A quarter turn about z within a doubled and moved node; then a mirror, by a matrix.
    let child = gltf.push("nodes", json!({ "mesh": 0, "rotation": [0.0, 0.0, half, half] }));
    gltf.node(json!({ "children": [child], "translation": [10.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0] }));
    gltf.node(json!({ "mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1] }));
    let model = read(&gltf.glb()).expect("it is a good file");
    let near = |found: [f64; 3], expected: [f64; 3]| (0..3).all(|axis| (found[axis] - expected[axis]).abs() < 1e-12);
    assert_eq!(model.positions.len(), 12);
    assert!(near(model.positions[5], [10.0, 2.0, 0.0]) && near(model.positions[6], [8.0, 2.0, 0.0]), "{model:?}");
    assert!(near(model.positions[9], [4.0, 6.0, 7.0]));
    assert_eq!(model.triangles[2..], [[4, 5, 6], [4, 6, 7], [8, 10, 9], [8, 11, 10]]);
    assert_eq!(model.normals[8], [0.0, 0.0, 1.0]);
}

#[test]
fn instances_are_drawn_each_by_itself() {
    let mut gltf = square();
    let translation = gltf.floats(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 0.0, 3.0]]);
    let scale = gltf.floats(&[[1.0; 3], [2.0; 3], [1.0, 1.0, -1.0]]);
    gltf.json["nodes"][0]["extensions"] =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translation, "SCALE": scale } } });
    gltf.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let model = read(&gltf.glb()).expect("it is a good file");
    assert_eq!(model.positions.len(), 12);
    assert_eq!(
        (model.positions[2], model.positions[6], model.positions[10]),
        ([1.0, 1.0, 0.0], [12.0, 2.0, 0.0], [1.0, 1.0, 3.0])
    );
    assert_eq!(model.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 10, 9], [8, 11, 10]]);
    assert_eq!((model.normals[4], model.normals[8]), ([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let other = gltf.floats(&[[1.0; 3]; 2]);
    gltf.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = other.into();
    assert_eq!(
        error(&gltf.glb()),
        "expected as many of each attribute of instances, found other numbers (byte 0, node 0)"
    );
}

#[test]
fn colours_are_made_of_vertices_and_materials() {
    let mut gltf = square();
    let color = gltf.accessor(5121, "VEC4", 4, &[255, 255, 255, 255, 0, 0, 0, 255, 128, 128, 128, 0, 255, 0, 0, 255]);
    gltf.json["accessors"][color]["normalized"] = true.into();
    let half = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1.0, 0.0, 1.0] }, "name": "half" });
    let material = gltf.push("materials", half);
    gltf.json["meshes"][0]["primitives"][0]["material"] = material.into();
    let flat = read(&gltf.glb()).expect("it is a good file");
    // 0.5 in linear light is 188 of 255 in sRGB.
    assert_eq!((flat.colors, flat.materials), (vec![[188, 255, 0]; 4], vec![0; 2]));
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = color.into();
    let model = read(&gltf.glb()).expect("it is a good file");
    assert_eq!(model.colors, [[188, 255, 0], [0, 0, 0], [137, 188, 0], [188, 0, 0]]);
}

#[test]
fn textured_materials_come_with_texture_coordinates() {
    let mut gltf = square();
    let coords = gltf.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    gltf.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    gltf.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 1, "texCoord": 1 } } }));
    gltf.json["textures"] = json!([{ "source": 1 }, { "source": 0 }]);
    gltf.json["images"] = json!([{ "bufferView": 0, "mimeType": "image/png" }, { "uri": "a%20wall.jpg" }]);
    let primitive = &mut gltf.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = coords.into();
    primitive["material"] = 0.into();
    let mut second = primitive.clone();
    second["material"] = 1.into();
    second["attributes"]["TEXCOORD_1"] = coords.into();
    second["attributes"].as_object_mut().expect("it is one").remove("TEXCOORD_0");
    let plain = json!({ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2 });
    gltf.json["meshes"][0]["primitives"].as_array_mut().expect("it is a list").extend([plain, second]);
    let mut stream = open_with(Box::new(Cursor::new(gltf.glb())), Box::new(NoSideFiles)).expect("it is a good file");
    let all = read_all(&mut *stream, &mut |_, _| {}).expect("it is a good file");
    let none = CornerBatch::NONE;
    assert_eq!(all.tex_coords, [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]; 2].concat());
    assert_eq!(all.corners.tex_coords, [[0, 1, 2], [0, 2, 3], [none; 3], [none; 3], [4, 5, 6], [4, 6, 7]]);
    assert_eq!(all.corners.materials, [0, 0, none, none, 1, 1]);
    let material =
        |texture| Material { is_in_vertices: true, texture: Some(texture), ..Material::plain(String::new()) };
    assert_eq!(stream.materials(), [material(Texture::File("a wall.jpg".to_owned())), material(Texture::Embedded(0))]);
}

#[test]
fn textures_say_how_they_are_mapped_and_their_pictures_can_be_had() {
    let mut gltf = square();
    let coords = gltf.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.25, 0.5]]);
    let transform =
        json!({ "offset": [0.5, -1.0], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2.0, 4.0], "texCoord": 1 });
    let used = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    let factor = json!([1.0, 1.0, 1.0, 0.5]);
    gltf.push("materials", json!({
        "pbrMetallicRoughness": { "baseColorTexture": used, "baseColorFactor": factor }, "alphaMode": "MASK", "alphaCutoff": 0.2
    }));
    gltf.push(
        "materials",
        json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } }, "alphaMode": "BLEND" }),
    );
    gltf.push(
        "materials",
        json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 2 } }, "alphaMode": "MASK" }),
    );
    gltf.push("materials", json!({}));
    gltf.json["textures"] = json!([{ "source": 0, "sampler": 0 }, { "source": 1, "sampler": 9 }, { "source": 2 }]);
    gltf.json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648 }]);
    let inside = base64(b"in the text");
    gltf.json["images"] =
        json!([{ "bufferView": 0 }, { "uri": "a%20wall.jpg" }, { "uri": format!("data:image/png;base64,{inside}") }]);
    gltf.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    let primitive = &mut gltf.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_1"] = coords.into();
    primitive["material"] = 0.into();
    let side = |name: &str| -> io::Result<Box<dyn ByteSource>> {
        let file: &[u8] = if name == "a wall.jpg" { b"beside" } else { return Err(io::ErrorKind::NotFound.into()) };
        Ok(Box::new(Cursor::new(file.to_vec())))
    };
    let mut stream = open_with(Box::new(Cursor::new(gltf.glb())), Box::new(side)).expect("it is a good file");
    let all = read_all(&mut *stream, &mut |_, _| {}).expect("it is a good file");
    // Scaled, turned (x to −y, y to x, downwards), moved; then upwards.
    let expected = [[4.5, 2.0], [4.5, 4.0], [0.5, 4.0], [2.5, 2.5]];
    for (coord, expected) in all.tex_coords.iter().zip(expected) {
        assert!(coord.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{:?}", all.tex_coords);
    }
    let wraps: Vec<_> = stream.materials().iter().map(|material| material.mapping.wrap).collect();
    assert_eq!(wraps[..2], [[Wrap::Clamp, Wrap::Mirror], [Wrap::Repeat; 2]]);
    // 0.2 of a factor of 0.5; the default is a half.
    let cutoffs: Vec<_> = stream.materials().iter().map(|material| material.alpha_cutoff).collect();
    assert_eq!(cutoffs, [Some(102), None, Some(127), None]);
    let mut picture = |material: u32| {
        let texture = stream.materials()[material as usize].texture.clone().unwrap_or(Texture::Embedded(9));
        let mut bytes = Vec::new();
        let opened = stream.open_picture(material, &texture);
        opened.map(|mut source| source.read_to_end(&mut bytes).map(|_| bytes).expect("it is there"))
    };
    assert_eq!(picture(0).expect("it is in the buffer")[..4], gltf.bytes[..4]);
    assert_eq!(picture(1).expect("it is beside"), b"beside");
    assert_eq!(picture(2).expect("it is in the text"), b"in the text");
    assert!(picture(3).is_err());
}

#[test]
fn primitives_that_share_vertices_bring_those_they_use() {
    let mut gltf = square();
    let many: Vec<[f32; 3]> = (0..1000).map(|x| [x as f32, 0.0, 1.0]).collect();
    let position = gltf.floats(&many);
    let primitives: Vec<Value> = (0..10)
        .map(|part: u16| {
            let indices = gltf.indices(&[100 * part + 50, 100 * part + 60, 100 * part + 51]);
            json!({ "attributes": { "POSITION": position }, "indices": indices })
        })
        .collect();
    gltf.json["meshes"][0]["primitives"] = primitives.into();
    let model = read(&gltf.glb()).expect("it is a good file");
    assert_eq!(model.positions.len(), 110);
    let corners = model.triangles.iter().map(|triangle| triangle.map(|corner| model.positions[corner as usize][0]));
    let expected: Vec<_> =
        (0..10).map(|part| 100.0 * f64::from(part)).map(|x| [x + 50.0, x + 60.0, x + 51.0]).collect();
    assert_eq!(corners.collect::<Vec<_>>(), expected);
}

#[test]
fn errors_name_what_is_wrong() {
    let with = |path: &str, value: Value| {
        let mut gltf = square();
        *gltf.json.pointer_mut(path).unwrap_or_else(|| panic!("{path} is there")) = value;
        error(&gltf.glb())
    };
    for (path, value, expected) in [
        ("/asset", json!({ "version": "1.0" }), "expected glTF 2, found version 1.0 (byte 0)"),
        ("/asset", Value::Null, "expected the property `asset` of glTF, found JSON without it (byte 0)"),
        ("/nodes/0/mesh", json!(7), "expected a number of `mesh` below 1, found 7 (byte 0)"),
        (
            "/scenes/0/nodes",
            json!([0, 0]),
            "expected each node at one place of a tree, found it at two (byte 0, node 0)",
        ),
        ("/scenes/0/nodes", json!([4]), "expected a number of `node` below 1, found 4 (byte 0)"),
        (
            "/accessors/0/count",
            json!(5),
            "expected 5 elements within the 48 bytes of the view, found more (byte 0, accessor 0)",
        ),
        (
            "/accessors/0/count",
            json!(u64::MAX),
            "expected fewer than 4294967295 elements, found 18446744073709551615 (byte 0, accessor 0)",
        ),
        ("/accessors/0/type", json!("VEC2"), "expected elements of [3] numbers, found 2 (byte 0, accessor 0)"),
        ("/accessors/0/type", json!("MAT9"), "expected SCALAR or VEC2 to VEC4, found MAT9 (byte 0, accessor 0)"),
        (
            "/accessors/0/componentType",
            json!(5124),
            "expected a component type of glTF, found 5124 (byte 0, accessor 0)",
        ),
        (
            "/accessors/1/count",
            json!(3),
            "expected 4 elements, as there are positions, found another number (byte 0, accessor 1)",
        ),
        ("/accessors/2/bufferView", json!(9), "expected a number of `bufferView` below 3, found 9 (byte 0)"),
        (
            "/accessors/2/componentType",
            json!(5122),
            "expected indices of unsigned integers, found component type 5122 (byte 0, accessor 2)",
        ),
        (
            "/bufferViews/0/byteOffset",
            json!(1u64 << 40),
            "expected a view within the 108 bytes of the buffer, found 48 bytes at byte 1099511627776 (byte 0, bufferView 0)",
        ),
        (
            "/bufferViews/0/buffer",
            json!(3),
            "expected a view within the 0 bytes of the buffer, found 48 bytes at byte 0 (byte 0, bufferView 0)",
        ),
        ("/meshes/0/primitives/0/mode", json!(7), "expected a mode from 0 to 6, found 7 (byte 0, mesh 0)"),
        (
            "/meshes/0/primitives/0/indices",
            json!("two"),
            "expected JSON of glTF, found invalid type: string \"two\", expected usize at line 1 column ",
        ),
    ] {
        let found = with(path, value);
        assert!(
            found == expected || expected.ends_with("column ") && found.starts_with(expected),
            "{found}\n{expected}"
        );
    }
    let mut gltf = square();
    gltf.json["extensionsRequired"] = json!(["KHR_materials_unlit", "ACME_boxes"]);
    assert_eq!(
        error(&gltf.glb()),
        "expected extensions of glTF that are understood, found `ACME_boxes`, which is required (byte 0)"
    );
    let mut gltf = square();
    let indices = gltf.indices(&[0, 1, 4]);
    gltf.json["meshes"][0]["primitives"][0]["indices"] = indices.into();
    assert_eq!(error(&gltf.glb()), "expected an index below 4 as element 2, found 4 (byte 0, accessor 3)");
    let mut gltf = square();
    let position = gltf.floats(&[[0.0; 3], [f32::INFINITY, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = position.into();
    assert_eq!(error(&gltf.glb()), "expected a finite position, found (inf, 0, 0) (byte 0, position 1)");
}
