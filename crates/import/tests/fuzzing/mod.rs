//! What is done with hostile bytes: by fuzzers (`fuzz/`), and by tests with damaged copies of good files.
//!
//! In: any bytes. Out: whether there was a model in them; a panic where a promise of the readers is broken. One function for
//! each reader: it makes the bytes begin as that reader's files do, so that a fuzzer need not find out.

#![allow(dead_code, reason = "each fuzzer and each test uses its own part")]

#[path = "../ply/sources.rs"]
pub(crate) mod sources;

/// What is done with bytes: whether there was a model in them.
pub(crate) type Body = fn(&[u8]) -> bool;

/// All of them, by the name of the fuzzer.
pub(crate) const READERS: [(&str, Body); 10] = [
    ("ply", ply),
    ("obj", obj),
    ("stl", stl),
    ("off", off),
    ("glb", glb),
    ("gltf", gltf),
    ("las", las),
    ("e57", e57),
    ("pcd", pcd),
    ("xyz", xyz),
];

/// As they are.
pub(crate) fn any(bytes: &[u8]) -> bool {
    match sources::read(bytes) {
        Ok(_) => true,
        Err(error) => {
            let line = error.to_string();
            assert!(!line.contains(['\n', '\r']) && line.len() < 600, "{line}");
            false
        }
    }
}

/// With `start` before them, unless they begin so.
fn after(start: &[u8], bytes: &[u8]) -> bool {
    if bytes.starts_with(start) { any(bytes) } else { any(&[start, bytes].concat()) }
}

/// With `start` instead of what they begin with.
fn under(start: &[u8], bytes: &[u8]) -> bool {
    any(&[start, bytes.get(start.len()..).unwrap_or_default()].concat())
}

pub(crate) fn ply(bytes: &[u8]) -> bool {
    after(b"ply\n", bytes)
}

pub(crate) fn obj(bytes: &[u8]) -> bool {
    after(b"o\n", bytes)
}

/// Text, or as many facets as there are bytes for.
pub(crate) fn stl(bytes: &[u8]) -> bool {
    if bytes.starts_with(b"solid") || bytes.len() < 84 {
        return after(b"solid ", bytes);
    }
    let facets = (bytes.len() - 84) / 50;
    let mut bytes = bytes[..84 + 50 * facets].to_vec();
    bytes[80..84].copy_from_slice(&(facets as u32).to_le_bytes());
    any(&bytes)
}

pub(crate) fn off(bytes: &[u8]) -> bool {
    if bytes.starts_with(b"COFF") { any(bytes) } else { after(b"OFF\n", bytes) }
}

/// GLB; with its length right.
pub(crate) fn glb(bytes: &[u8]) -> bool {
    let length = (bytes.len() as u32).to_le_bytes();
    under(&[&b"glTF\x02\0\0\0"[..], &length].concat(), bytes)
}

pub(crate) fn gltf(bytes: &[u8]) -> bool {
    after(b"{", bytes)
}

/// LAS and LAZ.
pub(crate) fn las(bytes: &[u8]) -> bool {
    under(b"LASF", bytes)
}

/// With the checksums of its pages right.
pub(crate) fn e57(bytes: &[u8]) -> bool {
    any(&e57_mended(bytes))
}

pub(crate) fn e57_mended(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = [b"ASTM-E57", bytes.get(8..).unwrap_or_default()].concat();
    for page in bytes.chunks_exact_mut(1024) {
        let (content, sum) = page.split_at_mut(1020);
        sum.copy_from_slice(&crc32c::crc32c(content).to_be_bytes());
    }
    bytes
}

pub(crate) fn pcd(bytes: &[u8]) -> bool {
    after(b"VERSION ", bytes)
}

pub(crate) fn xyz(bytes: &[u8]) -> bool {
    if bytes.first().is_some_and(u8::is_ascii_digit) { any(bytes) } else { after(b"1 2 3\n", bytes) }
}

/// SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }
}

/// Damaged copies of a good file: first cut at evenly spread places, then with one to three bytes changed, in half of them near
/// the beginning, where most can go wrong.
pub(crate) fn damaged(good: &[u8], cuts: usize, copies: usize) -> impl Iterator<Item = Vec<u8>> {
    let mut random = Random(good.len() as u64);
    let cut = (0..cuts).map(move |number| good[..number * good.len() / cuts].to_vec());
    cut.chain((0..copies).map(move |number| {
        let mut damaged = good.to_vec();
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
        damaged
    }))
}
