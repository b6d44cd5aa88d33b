//! Pages on the device: uploaded once, kept while there is room, the least recently drawn ones go first.
//!
//! Takes the lists of a frame; leaves each of their pages somewhere in one texture and says where. What always holds: a copy is of the
//! page that a list names, by identity; those of one frame never displace each other.

use crate::memory::Pool;
use crate::splats::store::WIDTH;
use crate::staging::Staging;
use crate::{Gpu, RenderError};
use gigalod_format::hybrid::{NodeRecord, Page};
use gigalod_runtime::hybrid::{HybridList, HybridNode};
use gigalod_runtime::{Interrupt, Similarity};
use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

/// Bytes of a texel.
pub(crate) const TEXEL_BYTES: u64 = 8;
/// Bytes of a row of the texture.
pub(crate) const ROW_BYTES: u64 = WIDTH * TEXEL_BYTES;

/// Texels that are sent in one go.
const AT_ONCE: usize = 1 << 16;

/// Vertices of a page: its triangles name them with 21 bits.
pub(crate) const MOST_VERTICES: usize = 1 << 21;

/// A page of a file.
type Key = (u32, u32);

/// What is on the device.
#[derive(Debug, Default)]
pub(crate) struct Arena {
    /// Which texture this is about.
    texture: Option<wgpu::Texture>,
    copies: BTreeMap<Key, Copy>,
    /// Free ranges: where each begins, texels.
    free: BTreeMap<u32, u32>,
    frame: u64,
}

#[derive(Debug)]
struct Copy {
    page: Weak<Page>,
    at: u32,
    texels: u32,
    /// When it was drawn last.
    frame: u64,
}

/// Texels of a page with so many of each.
fn texels_of(places: usize, triangles: usize, borders: usize) -> u64 {
    2 * places as u64 + triangles as u64 + borders as u64
}

/// Texels of a page.
pub(crate) fn texels(page: &Page) -> u64 {
    texels_of(page.positions.len(), page.triangles.len(), page.borders.len())
}

/// Bytes that a node's page takes on the device.
pub(crate) fn page_bytes(record: &NodeRecord) -> u64 {
    let places = record.vertices as usize + record.points as usize;
    texels_of(places, record.triangles as usize, record.borders as usize) * TEXEL_BYTES
}

fn key(list: &HybridList, node: &HybridNode) -> Key {
    (list.file.0, node.node.0)
}

/// Bytes that pages of a frame may have: those of one texture.
pub(crate) fn most_bytes(gpu: &Gpu) -> u64 {
    u64::from(gpu.max_picture_edge()) * ROW_BYTES
}

/// Bytes to ask for, best first: while there are pages, room for those of later frames too.
pub(crate) fn wishes(gpu: &Gpu, needed: u64, held: u64) -> Vec<u64> {
    const MOST_MORE: u64 = 32 << 20;
    if needed == 0 {
        return vec![0];
    }
    let larger = if needed <= held { held } else { (needed + needed.min(MOST_MORE)).min(most_bytes(gpu)) };
    vec![larger.max(needed), needed]
}

/// Bytes that the pages of a frame need, each counted once.
pub(crate) fn needed_bytes<'a>(lists: impl Iterator<Item = &'a HybridList>) -> u64 {
    let mut pages = BTreeMap::new();
    for list in lists {
        pages.extend(list.nodes.iter().map(|node| (key(list, node), texels(&node.page))));
    }
    // A texture has a texel at least.
    pages.values().sum::<u64>().max(u64::from(!pages.is_empty())) * TEXEL_BYTES
}

impl Arena {
    /// Where the page of a node begins; it has been placed for this frame.
    pub(crate) fn place_of(&self, list: &HybridList, node: &HybridNode) -> u32 {
        self.copies[&key(list, node)].at
    }

    /// Brings all pages of a frame to the device; `pool` has room for them. False where that was broken off.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn place(
        &mut self,
        gpu: &Gpu,
        staging: &mut Staging,
        pool: &Pool,
        lists: &[(Similarity, &HybridList)],
        interrupt: Option<&Interrupt>,
    ) -> Result<bool, RenderError> {
        if lists.is_empty() {
            return Ok(true);
        }
        let texture = pool.texture();
        if self.texture.as_ref() != Some(texture) {
            self.forget(texture);
        }
        self.frame += 1;
        let mut new = self.missing(lists);
        let mut places = self.allocate_all(&new);
        if places.is_none() {
            // What is free is in pieces: all over again, without a gap.
            self.forget(texture);
            new = self.missing(lists);
            places = self.allocate_all(&new);
        }
        let places = places.expect("the pool has room for all pages of a frame");
        let sending = Sending { gpu, staging, texture, at: 0, texels: Vec::new() };
        let sent = self.send(sending, new.into_iter().zip(places), interrupt);
        if sent.is_err() {
            // Who knows what is there.
            self.texture = None;
        }
        sent
    }

    fn send<'a>(
        &mut self,
        mut sending: Sending<'_>,
        pages: impl Iterator<Item = ((Key, &'a Arc<Page>), u32)>,
        interrupt: Option<&Interrupt>,
    ) -> Result<bool, RenderError> {
        let mut is_whole = true;
        for ((key, page), at) in pages {
            is_whole &= !interrupt.is_some_and(Interrupt::is_set);
            let texels = texels(page) as u32;
            if is_whole {
                sending.send(at, page)?;
                self.copies.insert(key, Copy { page: Arc::downgrade(page), at, texels, frame: self.frame });
            } else {
                self.give_back(at, texels);
            }
        }
        sending.flush()?;
        Ok(is_whole)
    }

    /// All is free.
    fn forget(&mut self, texture: &wgpu::Texture) {
        self.copies.clear();
        self.free = BTreeMap::from([(0, WIDTH as u32 * texture.height())]);
        self.texture = Some(texture.clone());
    }

    /// Pages that are not there, each once; the others are marked as drawn.
    fn missing<'a>(&mut self, lists: &[(Similarity, &'a HybridList)]) -> BTreeMap<Key, &'a Arc<Page>> {
        let mut missing = BTreeMap::new();
        for (list, node) in lists.iter().flat_map(|(_, list)| list.nodes.iter().map(move |node| (*list, node))) {
            let key = key(list, node);
            match self.copies.get_mut(&key) {
                Some(copy) if copy.page.as_ptr() == Arc::as_ptr(&node.page) => copy.frame = self.frame,
                _ => {
                    missing.insert(key, &node.page);
                }
            }
        }
        // Copies of what these pages were before.
        for key in missing.keys() {
            if let Some(stale) = self.copies.remove(key) {
                self.give_back(stale.at, stale.texels);
            }
        }
        missing
    }

    /// Room for each, or nothing.
    fn allocate_all(&mut self, pages: &BTreeMap<Key, &Arc<Page>>) -> Option<Vec<u32>> {
        let mut least_recent: Option<std::vec::IntoIter<Key>> = None;
        let mut places = Vec::with_capacity(pages.len());
        for page in pages.values() {
            let texels = texels(page) as u32;
            let at = loop {
                if let Some(at) = self.allocate(texels) {
                    break at;
                }
                let keys = least_recent.get_or_insert_with(|| self.least_recent().into_iter());
                let copy = self.copies.remove(&keys.next()?).expect("listed just now");
                self.give_back(copy.at, copy.texels);
            };
            places.push(at);
        }
        Some(places)
    }

    /// What this frame does not draw, the least recently drawn first.
    fn least_recent(&self) -> Vec<Key> {
        let others = self.copies.iter().filter(|(_, copy)| copy.frame < self.frame);
        let mut keys: Vec<_> = others.map(|(key, copy)| (copy.frame, *key)).collect();
        keys.sort_unstable();
        keys.into_iter().map(|(_, key)| key).collect()
    }

    fn allocate(&mut self, texels: u32) -> Option<u32> {
        if texels == 0 {
            return Some(0);
        }
        let (at, room) = self.free.iter().find(|(_, room)| **room >= texels).map(|(at, room)| (*at, *room))?;
        self.free.remove(&at);
        if room > texels {
            self.free.insert(at + texels, room - texels);
        }
        Some(at)
    }

    fn give_back(&mut self, mut at: u32, mut texels: u32) {
        if texels == 0 {
            return;
        }
        if let Some((before, room)) = self.free.range(..at).next_back().map(|(at, room)| (*at, *room))
            && before + room == at
        {
            self.free.remove(&before);
            (at, texels) = (before, texels + room);
        }
        if let Some(room) = self.free.remove(&(at + texels)) {
            texels += room;
        }
        self.free.insert(at, texels);
    }
}

/// Texels on their way, those that lie side by side together.
struct Sending<'a> {
    gpu: &'a Gpu,
    staging: &'a mut Staging,
    texture: &'a wgpu::Texture,
    at: u32,
    texels: Vec<[u32; 2]>,
}

impl Sending<'_> {
    fn send(&mut self, at: u32, page: &Page) -> Result<(), RenderError> {
        if self.texels.len() >= AT_ONCE || self.at + self.texels.len() as u32 != at {
            self.flush()?;
            self.at = at;
        }
        encode(page, &mut self.texels);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RenderError> {
        let bytes = bytemuck::cast_slice(&self.texels);
        self.staging.write_texels(self.gpu, self.texture, u64::from(self.at), bytes)?;
        self.at += self.texels.len() as u32;
        self.texels.clear();
        Ok(())
    }
}

/// Appends a page as `hybrid_store.wgsl` reads it.
fn encode(page: &Page, out: &mut Vec<[u32; 2]>) {
    let word = |[x, y]: [u16; 2]| u32::from(x) | u32::from(y) << 16;
    out.extend(page.positions.iter().map(|[x, y, z]| [word([*x, *y]), u32::from(*z)]));
    // u and v have up to 12 bits each.
    let colors = page.colors.iter().map(|[r, g, b, _]| u32::from_le_bytes([*r, *g, *b, 0]));
    let normals = page.normals.iter().map(|code| code & 0xfff | (code >> 16 & 0xfff) << 12);
    out.extend(normals.zip(colors.chain(std::iter::repeat(0))).map(|(normal, color)| [normal, color]));
    let three = |[a, b, c]: [u32; 3]| [a | b << 21, b >> 11 | c << 10];
    out.extend(page.triangles.iter().map(|corners| three(*corners)));
    out.extend(page.borders.iter().map(|[a, b]| three([*a, *b, 0])));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_back_becomes_one_range_again() {
        let mut arena = Arena { free: BTreeMap::from([(0, 100)]), ..Arena::default() };
        let places: Vec<_> = [10, 20, 30, 40].map(|texels| arena.allocate(texels).unwrap()).into();
        assert_eq!(places, [0, 10, 30, 60]);
        assert_eq!(arena.allocate(1), None);
        for (at, texels) in [(10, 20), (60, 40), (0, 10), (30, 30)] {
            arena.give_back(at, texels);
        }
        assert_eq!(arena.free, BTreeMap::from([(0, 100)]));
    }

    #[test]
    fn the_largest_numbers_of_vertices_survive_packing() {
        let most = MOST_VERTICES as u32 - 1;
        let page = Page {
            positions: vec![[1, 0xffff, 7]],
            normals: vec![0xabc | 0xdef << 16],
            colors: vec![[1, 2, 3, 255]],
            triangles: vec![[most, 1, most - 1], [0, most, 0]],
            borders: vec![[most, 5]],
        };
        let mut words = Vec::new();
        encode(&page, &mut words);
        assert_eq!(words.len() as u64, texels(&page));
        assert_eq!(words[..2], [[0xffff_0001, 7], [0xabc | 0xdef << 12, 0x03_0201]]);
        let mask = (1 << 21) - 1;
        let unpacked = |[x, y]: [u32; 2]| [x & mask, (x >> 21 | y << 11) & mask, y >> 10];
        assert_eq!(unpacked(words[2]), [most, 1, most - 1]);
        assert_eq!(unpacked(words[3]), [0, most, 0]);
        assert_eq!(unpacked(words[4]), [most, 5, 0]);
    }
}
