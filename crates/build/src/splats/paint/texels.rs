//! The mean colour of an area of a picture, from tiles that are read as they are needed.
//!
//! In: a parallelogram of a picture, and which places of it count. Out: the mean of taps spread evenly over it, each interpolated
//! in the level whose texels are as large as what a tap stands for: so texels weigh as much as they cover, and none are missed.

use super::pictures::{Picture, TILE};
use super::{Edge, Look, Paint, Texel};
use crate::spool::Spool;
use gigalod_geom::color::LINEAR_OF_SRGB8;
use glam::Vec3;
use std::collections::HashMap;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

type Tile = Vec<Texel>;

/// Tiles by number, and when each was used last.
type Shard = HashMap<u64, (Arc<Tile>, u64)>;

/// Tiles in memory, those that were used last; many threads share them.
pub(in super::super) struct Tiles<'a> {
    texels: &'a Spool<Texel>,
    shards: Vec<Mutex<Shard>>,
    /// Most tiles of a shard.
    most: usize,
    clock: AtomicU64,
}

const SHARDS: u64 = 16;

impl<'a> Tiles<'a> {
    /// Keeps so many bytes in memory, and at least some tiles.
    pub(in super::super) fn new(texels: &'a Spool<Texel>, bytes: u64) -> Self {
        let tiles = bytes / (TILE * TILE * size_of::<Texel>()) as u64;
        let shards = (0..SHARDS).map(|_| Mutex::default()).collect();
        Self { texels, shards, most: (tiles / SHARDS).max(2) as usize, clock: AtomicU64::new(0) }
    }

    fn tile(&self, number: u64) -> io::Result<Arc<Tile>> {
        let now = self.clock.fetch_add(1, Ordering::Relaxed);
        let mut shard =
            self.shards[(number % SHARDS) as usize].lock().expect("no thread panics while it holds the lock");
        if let Some((tile, used)) = shard.get_mut(&number) {
            *used = now;
            return Ok(tile.clone());
        }
        let mut tile = Vec::new();
        self.texels.read_vec(number * (TILE * TILE) as u64, TILE * TILE, &mut tile)?;
        if shard.len() >= self.most
            && let Some(oldest) = shard.iter().min_by_key(|(_, (_, used))| *used).map(|(number, _)| *number)
        {
            shard.remove(&oldest);
        }
        let tile = Arc::new(tile);
        shard.insert(number, (tile.clone(), now));
        Ok(tile)
    }
}

/// An area of a picture: a corner and two sides, in texture coordinates.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Area {
    pub(in super::super) corner: [f64; 2],
    pub(in super::super) sides: [[f64; 2]; 2],
}

/// What an area shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Shown {
    /// Linear.
    pub(in super::super) color: Vec3,
    /// The greatest of any tap, from 0 to 255.
    pub(in super::super) alpha: f32,
}

/// Most taps along a side.
const MOST_TAPS: f64 = 16.0;
/// Along the shorter side, where texels are small, so many are enough.
const ENOUGH_TAPS: f64 = 2.0;

impl Paint {
    /// The mean over an area of a look's picture, of the taps that `counts` — a tap is named by its shares of both sides —, or of
    /// the middle if none does. White without a picture.
    pub(in super::super) fn shown(
        &self,
        tiles: &Tiles<'_>,
        look: &Look,
        area: &Area,
        counts: impl Fn([f64; 2]) -> bool,
    ) -> io::Result<Shown> {
        let Some(picture) = look.picture.map(|picture| &self.pictures[picture as usize]) else {
            return Ok(Shown { color: Vec3::ONE, alpha: 255.0 });
        };
        let size = picture.levels[0].size;
        let moved = |by: [f64; 2]| {
            std::array::from_fn(|axis| area.corner[axis] + area.sides[0][axis] * by[0] + area.sides[1][axis] * by[1])
        };
        let corner = look.texel(area.corner, size);
        let texels_along = |by: [f64; 2]| {
            let [x, y] = look.texel(moved(by), size);
            ((x - corner[0]) * (x - corner[0]) + (y - corner[1]) * (y - corner[1])).sqrt()
        };
        let lengths = [texels_along([1.0, 0.0]), texels_along([0.0, 1.0])];
        let (level, taps) = level_and_taps(lengths, picture.levels.len());
        let mut sum = Sum::default();
        let mut reader = Reader { tiles, picture, level, edges: look.edges, last: None };
        for (row, column) in (0..taps[1]).flat_map(|row| (0..taps[0]).map(move |column| (row, column))) {
            let by = [(f64::from(column) + 0.5) / f64::from(taps[0]), (f64::from(row) + 0.5) / f64::from(taps[1])];
            if counts(by) {
                reader.tap(look.texel(moved(by), size), &mut sum)?;
            }
        }
        if sum.taps == 0 {
            reader.tap(look.texel(moved([0.5; 2]), size), &mut sum)?;
        }
        Ok(sum.shown())
    }
}

/// The level to be read, and taps along both sides, by their lengths in texels of the finest one.
fn level_and_taps(lengths: [f64; 2], levels: usize) -> (usize, [u32; 2]) {
    let (long, short) = (lengths[0].max(lengths[1]), lengths[0].min(lengths[1]));
    let (mut level, mut scale) = (0, 1.0);
    while level + 1 < levels && (long * scale > MOST_TAPS || short * scale > 2.0 * ENOUGH_TAPS) {
        (level, scale) = (level + 1, scale * 0.5);
    }
    (level, lengths.map(|length| (length * scale).ceil().clamp(1.0, MOST_TAPS) as u32))
}

#[derive(Default)]
struct Sum {
    color: Vec3,
    weight: f32,
    alpha: f32,
    taps: u32,
}

impl Sum {
    fn shown(&self) -> Shown {
        let color = if self.weight > 0.0 { self.color / self.weight } else { Vec3::ZERO };
        Shown { color, alpha: self.alpha }
    }
}

struct Reader<'a> {
    tiles: &'a Tiles<'a>,
    picture: &'a Picture,
    level: usize,
    edges: [Edge; 2],
    /// The tile that was read last.
    last: Option<(u64, Arc<Tile>)>,
}

impl Reader<'_> {
    /// Adds what is at a place, in texels of the finest level: interpolated between the four nearest.
    fn tap(&mut self, at: [f64; 2], sum: &mut Sum) -> io::Result<()> {
        let (finest, size) = (self.picture.levels[0].size, self.picture.levels[self.level].size);
        let place: [f64; 2] =
            std::array::from_fn(|axis| at[axis] * f64::from(size[axis]) / f64::from(finest[axis]) - 0.5);
        let low = place.map(f64::floor);
        let [fx, fy]: [f32; 2] = std::array::from_fn(|axis| (place[axis] - low[axis]) as f32);
        for (dx, dy, share) in
            [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)]
        {
            // Casting saturates.
            let x = self.edges[0].place((low[0] as i64).saturating_add(dx), size[0]);
            let y = self.edges[1].place((low[1] as i64).saturating_add(dy), size[1]);
            let [r, g, b, alpha] = self.texel(x, y)?;
            let weight = share * f32::from(alpha) / 255.0;
            sum.color += Vec3::from_array([r, g, b].map(|value| LINEAR_OF_SRGB8[usize::from(value)])) * weight;
            sum.weight += weight;
            if share > 0.0 {
                sum.alpha = sum.alpha.max(f32::from(alpha));
            }
        }
        sum.taps += 1;
        Ok(())
    }

    fn texel(&mut self, x: u32, y: u32) -> io::Result<Texel> {
        let number = self.picture.levels[self.level].tile(x, y);
        let within = y as usize % TILE * TILE + x as usize % TILE;
        if let Some((last, tile)) = &self.last
            && *last == number
        {
            return Ok(tile[within]);
        }
        let tile = self.tiles.tile(number)?;
        let texel = tile[within];
        self.last = Some((number, tile));
        Ok(texel)
    }
}
