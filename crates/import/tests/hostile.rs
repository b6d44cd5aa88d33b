//! Damaged files of every family of formats give a model or an error, soon and in bounded memory. Alone in its program,
//! because the allocator counts for all threads.
//!
//! With `GIGALOD_CORPUS` set to a folder, the good files are left in a folder of it for each reader, for fuzzers to begin with.

#[path = "../../gigalod/tests/counting/mod.rs"]
mod counting;
mod fuzzing;
#[path = "formats/make.rs"]
mod make;

use counting::peak_of;
use fuzzing::sources::read;
use fuzzing::{READERS, Random, any, damaged};
use std::path::PathBuf;

/// Most memory that any of these small files may take.
const MOST_BYTES: usize = 64 << 20;
const CUTS: usize = 200;
const COPIES: usize = 2000;

/// Two hundred truncations and two thousand damaged copies of a good file.
fn survives(name: &str, reader: &str, good: &[u8]) {
    survives_damage(name, reader, good, COPIES);
}

fn survives_damage(name: &str, reader: &str, good: &[u8], copies: usize) {
    let (_, body) = READERS.iter().find(|(known, _)| *known == reader).expect("it is in the list");
    assert!(read(good).is_ok(), "{name}: {:?}", read(good).err());
    assert!(body(good), "{name} is of this reader");
    if let Some(corpus) = std::env::var_os("GIGALOD_CORPUS").map(|corpus| PathBuf::from(corpus).join(reader)) {
        std::fs::create_dir_all(&corpus).expect("the corpus can be written");
        std::fs::write(corpus.join(name.replace(' ', "-")), good).expect("the corpus can be written");
    }
    let ((), peak) = peak_of(|| {
        let mut whole = 0;
        for (number, bytes) in damaged(good, CUTS, copies).enumerate() {
            let is_whole = any(&bytes);
            if number >= CUTS {
                whole += usize::from(is_whole);
            }
            // Where the damage is in what tells the reader, it never comes to see the rest.
            if !is_whole && number % 4 == 0 {
                body(&bytes);
            }
        }
        println!("{name}: {whole} of {copies} were read");
        assert!(whole < copies, "{name}: no damage was seen");
    });
    assert!(peak < MOST_BYTES, "{name} took {peak} bytes");
}

#[test]
fn ply() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nproperty float y\n\
        property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n";
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend((0..27).flat_map(|value| (value as f32).to_le_bytes()));
    for face in 0..4i32 {
        bytes.push(3);
        bytes.extend([face, face + 1, face + 2].iter().flat_map(|corner| corner.to_le_bytes()));
    }
    survives("PLY", "ply", &bytes);
}

#[test]
fn obj() {
    let mut text = String::from("mtllib a.mtl\n# made\no one\n");
    for number in 0..20 {
        text.push_str(&format!("v {number} {} 0.5 0.1 0.2 0.3\nvt 0.{number} 1\n", number * number));
    }
    text.push_str("usemtl a\nf 1/1 2/2 3/3\nf 1 2 3 4 5 6 7 \\\n8 9\nf -1 -2 -3\nf 1/1/1 5/5 9/9 13/13 17//\n");
    survives("OBJ", "obj", text.as_bytes());
}

#[test]
fn stl_and_off() {
    let mut stl = vec![b' '; 80];
    stl.extend(10u32.to_le_bytes());
    for facet in 0..10 {
        stl.extend([0; 12]);
        stl.extend((0..9).flat_map(|value| ((value * facet % 5) as f32).to_le_bytes()));
        stl.extend([0; 2]);
    }
    survives("STL", "stl", &stl);
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n";
    survives("text STL", "stl", format!("solid a\n{}endsolid a\n", facet.repeat(5)).as_bytes());
    survives("OFF", "off", b"COFF\n4 2 0\n0 0 0 1 2 3\n1 0 0 4 5 6\n1 1 0 7 8 9\n0 1 0 1 1 1\n3 0 1 2\n4 0 1 2 3\n");
}

#[test]
fn gltf() {
    let mut gltf = make::square();
    let base64 = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let text: String = gltf
        .bytes
        .chunks(3)
        .flat_map(|three| {
            let word = (0..3).fold(0, |word, at| word << 8 | usize::from(three.get(at).copied().unwrap_or(0)));
            [18, 12, 6, 0].map(|shift| char::from(base64[word >> shift & 63]))
        })
        .collect();
    let uri = format!("data:application/octet-stream;base64,{text}");
    gltf.json["buffers"] = serde_json::json!([{ "byteLength": gltf.bytes.len(), "uri": uri }]);
    survives("glTF", "gltf", gltf.json.to_string().as_bytes());
}

#[test]
fn glb() {
    survives("GLB", "glb", &make::square().glb());
    survives("GLB of meshoptimizer", "glb", &make::meshopt(6).0.glb());
    survives("GLB of Draco", "glb", &make::draco(6).0.glb());
}

#[test]
fn las_and_laz() {
    survives("LAS", "las", &make::las(3, 0, 50, None));
    survives("LAZ", "las", &make::las(3, 2, 60, Some(40)));
    // Most of the time goes into preparing each chunk: fewer of the rarer kinds.
    survives_damage("LAZ in chunks of any size", "las", &make::las(1, 0, 130, Some(0)), 500);
    survives_damage("LAZ in layers", "las", &make::las(7, 2, 60, Some(40)), 500);
    survives_damage("LAZ with waveforms", "las", &make::las(10, 0, 60, Some(40)), 500);
}

#[test]
fn e57() {
    survives("E57", "e57", &make::e57(300));
}

/// An E57 file whose checksums are made right again after the damage: what lies behind them must hold as well.
#[test]
fn e57_with_right_checksums() {
    let good = make::e57(300);
    let ((), peak) = peak_of(|| {
        for bytes in damaged(&good, 0, COPIES) {
            fuzzing::e57(&bytes);
        }
    });
    assert!(peak < MOST_BYTES, "{peak} bytes");
}

/// Nothing but noise behind what tells the reader.
#[test]
fn noise() {
    /// Of which text formats are made.
    const LETTERS: &[u8] = b"0123456789.-+e \n\n\t/vfn#\\{}[]\":,";
    let mut random = Random(9);
    for (name, body) in READERS {
        let ((), peak) = peak_of(|| {
            for _ in 0..200 {
                let length = random.below(3000);
                let bytes: Vec<u8> = match random.below(2) {
                    0 => (0..length).map(|_| random.next() as u8).collect(),
                    _ => (0..length).map(|_| LETTERS[random.below(LETTERS.len())]).collect(),
                };
                body(&bytes);
            }
        });
        assert!(peak < MOST_BYTES, "{name} took {peak} bytes");
    }
}

#[test]
fn points_as_text() {
    survives("XYZ", "xyz", "1 2 3 10 20 30\n4.5 5 6 1 2 3\n".repeat(20).as_bytes());
    let header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\nPOINTS 9\nDATA ";
    survives("text PCD", "pcd", format!("{header}ascii\n{}", "1 2 3\n".repeat(9)).as_bytes());
    survives("PCD", "pcd", &[format!("{header}binary\n").as_bytes(), &[60; 108]].concat());
    let mut packed = format!("{header}binary_compressed\n").into_bytes();
    packed.extend([5, 0, 0, 0, 108, 0, 0, 0, 0, 60, 7 << 5, 98, 0]);
    survives("compressed PCD", "pcd", &packed);
}

/// Small files that promise much: each is an error, or ends where the file does, and nothing is set aside for the promise.
#[test]
fn claims_allocate_next_to_nothing() {
    let las = |at: usize, bytes: &[u8], chunk: Option<u32>| {
        let mut file = make::las(7, 0, 300, chunk);
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let gltf = |path: &str, value: serde_json::Value| {
        let mut gltf = make::square();
        *gltf.json.pointer_mut(path).expect("it is there") = value;
        gltf.glb()
    };
    let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 20000000\nHEIGHT 1\nDATA ";
    let mut packed = format!("{pcd}binary_compressed\n").into_bytes();
    packed.extend([255, 255, 255, 255, 0, 0x38, 0x9c, 0x1c, 0, 7]);
    let mut stl = vec![0; 84 + 50];
    stl[80..84].fill(255);
    let mut laz = make::las(6, 0, 300, Some(100));
    // The sizes of the layers of the first chunk, after the first point and the number of points.
    let start = u32::from_le_bytes(*laz[96..].first_chunk().expect("it is long")) as usize + 8 + 30 + 4;
    laz[start..start + 36].fill(0x7f);
    // Where the points of a scan begin.
    let mut e57 = make::e57(300);
    e57[48 + 16..48 + 24].fill(255);
    let e57 = fuzzing::e57_mended(&e57);
    // A code that no packer writes: behind the first point, and behind the sizes of the layers.
    let mut code = make::las(1, 0, 300, Some(100));
    let start = u32::from_le_bytes(*code[96..].first_chunk().expect("it is long")) as usize + 8;
    code[start + 28..start + 32].fill(255);
    let mut layer = make::las(6, 0, 300, Some(100));
    let start = u32::from_le_bytes(*layer[96..].first_chunk().expect("it is long")) as usize + 8 + 30;
    layer[start + 40..start + 44].fill(255);
    let files = [
        ("E57", e57),
        ("LAZ", code),
        ("LAZ", layer),
        ("OFF", b"OFF\n4000000000 4000000000 0\n0 0 0\n".to_vec()),
        ("OFF", b"OFF\n1 1 0\n0 0 0\n4000000000 0 0 0 0\n".to_vec()),
        ("PCD", format!("{pcd}binary\n1234").into_bytes()),
        ("PCD", packed),
        ("STL", stl),
        ("LAS", las(247, &[254, 255, 255, 255, 0, 0, 0, 0], None)),
        ("LAS", las(105, &[255, 255], None)),
        ("LAZ", las(247, &[254, 255, 255, 255, 0, 0, 0, 0], Some(100))),
        ("LAZ", laz),
        ("glTF", gltf("/accessors/0/count", 4_000_000_000u32.into())),
        ("glTF", gltf("/bufferViews/0/byteLength", (1u64 << 60).into())),
        (
            "glTF",
            gltf(
                "/accessors/0",
                serde_json::json!({ "componentType": 5126, "type": "VEC3", "count": 4_000_000_000u32 }),
            ),
        ),
    ];
    for (name, file) in files {
        let (found, peak) = peak_of(|| read(&file).map(|model| model.positions.len()));
        let error = found.expect_err(name).to_string();
        assert!(peak < 16 << 20, "{name} took {peak} bytes: {error}");
    }
}
