//! Damaged files of every family of formats give a model or an error, soon and in bounded memory. Alone in its program,
//! because the allocator counts for all threads.

#[path = "../../gigalod/tests/counting/mod.rs"]
mod counting;
#[path = "formats/make.rs"]
mod make;
#[allow(dead_code)]
#[path = "ply/sources.rs"]
mod sources;

use counting::peak_of;
use sources::read;

/// Most memory that any of these small files may take.
const MOST_BYTES: usize = 64 << 20;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }
}

/// Two hundred truncations and two thousand damaged copies of a good file.
fn survives(name: &str, good: &[u8]) {
    survives_damage(name, good, 2000);
}

fn survives_damage(name: &str, good: &[u8], copies: usize) {
    assert!(read(good).is_ok(), "{name}: {:?}", read(good).err());
    let mut random = Random(good.len() as u64);
    let ((), peak) = peak_of(|| {
        let check = |bytes: &[u8]| match read(bytes) {
            Ok(_) => true,
            Err(error) => {
                let line = error.to_string();
                assert!(!line.contains(['\n', '\r']) && line.len() < 600, "{name}: {line}");
                false
            }
        };
        for number in 0..200 {
            check(&good[..number * good.len() / 200]);
        }
        let mut whole = 0;
        for number in 0..copies {
            let mut damaged = good.to_vec();
            // Most of what can go wrong is at the beginning.
            let end = if number % 2 == 0 { good.len() } else { good.len().min(512) };
            for _ in 0..=random.below(3) {
                let at = random.below(end);
                damaged[at] = match random.below(4) {
                    0 => damaged[at] ^ (1 << random.below(8)),
                    1 => 255,
                    2 => 0,
                    _ => random.next() as u8,
                };
            }
            whole += usize::from(check(&damaged));
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
    survives("PLY", &bytes);
}

#[test]
fn obj() {
    let mut text = String::from("mtllib a.mtl\n# made\no one\n");
    for number in 0..20 {
        text.push_str(&format!("v {number} {} 0.5 0.1 0.2 0.3\nvt 0.{number} 1\n", number * number));
    }
    text.push_str("usemtl a\nf 1/1 2/2 3/3\nf 1 2 3 4 5 6 7 \\\n8 9\nf -1 -2 -3\nf 1/1/1 5/5 9/9 13/13 17//\n");
    survives("OBJ", text.as_bytes());
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
    survives("STL", &stl);
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n";
    survives("text STL", format!("solid a\n{}endsolid a\n", facet.repeat(5)).as_bytes());
    survives("OFF", b"COFF\n4 2 0\n0 0 0 1 2 3\n1 0 0 4 5 6\n1 1 0 7 8 9\n0 1 0 1 1 1\n3 0 1 2\n4 0 1 2 3\n");
}

#[test]
fn glb() {
    survives("GLB", &make::square().glb());
    survives("GLB of meshoptimizer", &make::meshopt(6).0.glb());
    survives("GLB of Draco", &make::draco(6).0.glb());
}

#[test]
fn las_and_laz() {
    survives("LAS", &make::las(3, 0, 50, None));
    survives("LAZ", &make::las(3, 2, 60, Some(40)));
    // Most of the time goes into preparing each chunk: fewer of the rarer kinds.
    survives_damage("LAZ in chunks of any size", &make::las(1, 0, 130, Some(0)), 500);
    survives_damage("LAZ in layers", &make::las(7, 2, 60, Some(40)), 500);
    survives_damage("LAZ with waveforms", &make::las(10, 0, 60, Some(40)), 500);
}

#[test]
fn e57() {
    survives("E57", &make::e57(300));
}

/// An E57 file whose checksums are made right again after the damage: what lies behind them must hold as well.
#[test]
fn e57_with_right_checksums() {
    let good = make::e57(300);
    let mut random = Random(3);
    let ((), peak) = peak_of(|| {
        for _ in 0..2000 {
            let mut damaged = good.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(good.len());
                damaged[at] = random.next() as u8;
            }
            for page in damaged.chunks_exact_mut(1024) {
                let (content, sum) = page.split_at_mut(1020);
                sum.copy_from_slice(&crc32c::crc32c(content).to_be_bytes());
            }
            _ = read(&damaged);
        }
    });
    assert!(peak < MOST_BYTES, "{peak} bytes");
}

#[test]
fn points_as_text() {
    survives("XYZ", "1 2 3 10 20 30\n4.5 5 6 1 2 3\n".repeat(20).as_bytes());
    let header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\nPOINTS 9\nDATA ";
    survives("text PCD", format!("{header}ascii\n{}", "1 2 3\n".repeat(9)).as_bytes());
    survives("PCD", &[format!("{header}binary\n").as_bytes(), &[60; 108]].concat());
    let mut packed = format!("{header}binary_compressed\n").into_bytes();
    packed.extend([5, 0, 0, 0, 108, 0, 0, 0, 0, 60, 7 << 5, 98, 0]);
    survives("compressed PCD", &packed);
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
    let files = [
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
