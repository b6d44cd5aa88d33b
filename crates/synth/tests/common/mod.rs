//! A slow and obvious PLY reader for what this crate writes, and helpers on meshes.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::collections::HashSet;

/// A mesh read back.
pub(crate) struct Mesh {
    pub(crate) header: String,
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Reads a PLY; panics where it is not exactly as promised.
pub(crate) fn read(bytes: &[u8]) -> Mesh {
    const END: &[u8] = b"end_header\n";
    let header_len = bytes.windows(END.len()).position(|window| window == END).expect("an end of header") + END.len();
    let header = String::from_utf8(bytes[..header_len].to_vec()).expect("ASCII");
    let count = |element: &str| -> usize {
        let line = header.lines().find_map(|line| line.strip_prefix(element)).expect(element);
        line.trim().parse().expect(element)
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let vertex_bytes = if header.contains("uchar red") { 15 } else { 12 };
    let (vertex_part, face_part) = bytes[header_len..].split_at(vertices * vertex_bytes);
    assert_eq!(face_part.len(), faces * 13, "bytes after the vertices");
    let float = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    let index = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap());
    let positions = vertex_part.chunks(vertex_bytes).map(|v| [float(&v[..4]), float(&v[4..8]), float(&v[8..12])]);
    let colors = vertex_part.chunks(vertex_bytes).filter(|v| v.len() == 15).map(|v| [v[12], v[13], v[14]]);
    let triangles = face_part.chunks(13).map(|face| {
        assert_eq!(face[0], 3);
        let corners = [index(&face[1..5]), index(&face[5..9]), index(&face[9..])];
        assert!(corners.iter().all(|corner| (*corner as usize) < vertices), "{corners:?}");
        corners
    });
    Mesh { positions: positions.collect(), colors: colors.collect(), triangles: triangles.collect(), header }
}

impl Mesh {
    /// All directed edges; panics when one occurs twice.
    pub(crate) fn directed_edges(&self) -> HashSet<(u32, u32)> {
        let mut edges = HashSet::new();
        for &[a, b, c] in &self.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                assert!(edges.insert(edge), "directed edge {edge:?} occurs twice");
            }
        }
        edges
    }

    /// Triangles as bits of positions (and colours), each from its smallest corner on, sorted: equal for two meshes that
    /// differ only in numbering.
    pub(crate) fn triangle_soup(&self) -> Vec<[[u32; 4]; 3]> {
        let mut soup: Vec<_> = self
            .triangles
            .iter()
            .map(|triangle| {
                let mut corners = triangle.map(|corner| {
                    let [x, y, z] = self.positions[corner as usize].map(f32::to_bits);
                    let [r, g, b] = self.colors.get(corner as usize).copied().unwrap_or_default();
                    [x, y, z, u32::from_le_bytes([r, g, b, 0])]
                });
                let smallest = (0..3).min_by_key(|at| corners[*at]).unwrap();
                corners.rotate_left(smallest);
                corners
            })
            .collect();
        soup.sort_unstable();
        soup
    }

    /// Lengths of all triangle sides, sorted.
    pub(crate) fn edge_lengths(&self) -> Vec<f64> {
        let point = |corner: u32| self.positions[corner as usize].map(f64::from);
        let mut lengths: Vec<f64> = self
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| {
                let (a, b) = (point(a), point(b));
                (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
            })
            .collect();
        lengths.sort_unstable_by(f64::total_cmp);
        lengths
    }

    /// Six times the volume enclosed; positive when triangles face outwards.
    pub(crate) fn volume(&self) -> f64 {
        let six: f64 = self
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|corner| self.positions[corner as usize].map(f64::from));
                a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
            })
            .sum();
        six / 6.0
    }
}

/// FNV-1a, 64 bits: a fingerprint anyone can recompute.
pub(crate) fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Runs `make` on as many threads.
pub(crate) fn on_threads<T: Send>(threads: usize, make: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(make)
}
