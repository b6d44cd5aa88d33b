//! Positions of vertices that went by, for the few polygons that need them, in bounded memory.
//!
//! In: each vertex as it is read, with where its line is. Out: the position of any of them. The last [`Positions::KEPT`] or
//! so are in memory; older ones are read again from the file, a block at a time, where it can be read twice.
//!
//! What always holds: memory is that of the kept blocks, and 8 bytes for each block of the model.

use crate::{ImportError, Place, input::Input, text::ends_in_backslash};
use glam::DVec3;
use memchr::memchr;

/// Vertices of a block.
const BLOCK: usize = 256;
/// Blocks in memory.
const SLOTS: usize = 1024;
/// Read at a time when a block is read again; about its size.
const PIECE_BYTES: usize = 8 << 10;
/// Slots that a block may be in.
const WAYS: usize = 4;

pub(crate) struct Positions {
    /// Number of vertices so far.
    count: u64,
    /// Where each block begins in the file.
    offsets: Vec<u64>,
    slots: Vec<Slot>,
    /// Counts uses, to tell the least recent.
    clock: u64,
    /// The position that a line of the file has, if it is a vertex.
    parse: fn(&[u8]) -> Option<DVec3>,
    /// Last byte of a line.
    line_end: u8,
}

struct Slot {
    block: Option<u64>,
    used: u64,
    positions: Vec<DVec3>,
}

impl Positions {
    /// Vertices in memory.
    pub(crate) const KEPT: usize = BLOCK * SLOTS;

    /// `parse` gives the position that a line has, if it is one of a vertex.
    pub(crate) fn new(line_end: u8, parse: fn(&[u8]) -> Option<DVec3>) -> Self {
        let slots = (0..SLOTS).map(|_| Slot { block: None, used: 0, positions: Vec::new() }).collect();
        Self { count: 0, offsets: Vec::new(), slots, clock: 0, parse, line_end }
    }

    /// Vertices so far.
    pub(crate) fn len(&self) -> u64 {
        self.count
    }

    /// Adds the next vertex, whose line begins at `offset`.
    #[inline]
    pub(crate) fn push(&mut self, position: DVec3, offset: u64) {
        let block = self.count / BLOCK as u64;
        if self.count.is_multiple_of(BLOCK as u64) {
            self.offsets.push(offset);
            self.free_slot(block).positions.clear();
        }
        self.count += 1;
        self.clock += 1;
        let clock = self.clock;
        match self.slot(block) {
            Some(slot) => {
                slot.positions.push(position);
                slot.used = clock;
            }
            None => unreachable!("the block being filled is the one used last in its set"),
        }
    }

    /// The position of a vertex that was added.
    ///
    /// # Errors
    /// It is no longer in memory and the file cannot be read twice, or no longer has it; `place` is that of its use.
    pub(crate) fn get(&mut self, vertex: u32, input: &mut Input, place: &Place) -> Result<DVec3, ImportError> {
        let block = u64::from(vertex) / BLOCK as u64;
        self.clock += 1;
        let clock = self.clock;
        if self.slot(block).is_none() {
            self.read_again(block, input, place)?;
        }
        let slot = self.slot(block).expect("it is there now");
        slot.used = clock;
        Ok(slot.positions[vertex as usize % BLOCK])
    }

    fn set(block: u64) -> std::ops::Range<usize> {
        let first = block as usize % (SLOTS / WAYS) * WAYS;
        first..first + WAYS
    }

    #[inline]
    fn slot(&mut self, block: u64) -> Option<&mut Slot> {
        self.slots[Self::set(block)].iter_mut().find(|slot| slot.block == Some(block))
    }

    /// The least recently used slot of a block's set, given to it.
    fn free_slot(&mut self, block: u64) -> &mut Slot {
        // Never the block that is being filled: it was used after all others of its set, unless those were looked up since.
        let filling = self.count / BLOCK as u64;
        let slots = &mut self.slots[Self::set(block)];
        let free = slots.iter_mut().filter(|slot| slot.block != Some(filling)).min_by_key(|slot| slot.used);
        let slot = free.expect("a set has several slots");
        slot.block = Some(block);
        slot
    }

    #[cold]
    fn read_again(&mut self, block: u64, input: &mut Input, place: &Place) -> Result<(), ImportError> {
        if !input.is_plain() {
            return Err(ImportError::malformed(
                format!("in a packed file, polygons of more than three corners among the last {} vertices", Self::KEPT),
                "one that needs an older vertex; unpack the file",
                place.clone(),
            ));
        }
        let changed = || ImportError::malformed("a file that stays as it is", "other vertices", place.clone());
        let (mut at, parse, line_end) = (self.offsets[block as usize], self.parse, self.line_end);
        let mut positions = std::mem::take(&mut self.free_slot(block).positions);
        positions.clear();
        let mut bytes = Vec::new();
        while positions.len() < BLOCK {
            let before = bytes.len();
            bytes.resize(before + PIECE_BYTES, 0);
            let read = input.reread(at, &mut bytes[before..])?;
            bytes.truncate(before + read);
            at += read as u64;
            let (mut start, mut searched) = (0, 0);
            while let Some(length) = memchr(line_end, &bytes[searched..])
                && positions.len() < BLOCK
            {
                let end = searched + length;
                searched = end + 1;
                if !ends_in_backslash(&bytes[start..end]) {
                    positions.extend(parse(&bytes[start..end]));
                    start = searched;
                }
            }
            if read == 0 {
                positions.extend(parse(&bytes[start..]));
                break;
            }
            bytes.drain(..start);
            if bytes.len() > Input::CAPACITY {
                break;
            }
        }
        let is_whole = positions.len() == BLOCK;
        let slot = self.slot(block).expect("it was just given");
        (slot.positions, slot.block) = (positions, is_whole.then_some(block));
        if is_whole { Ok(()) } else { Err(changed()) }
    }
}
