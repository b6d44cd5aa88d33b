//! Streams of symbols and of raw bits: a page has one of each.
//!
//! Symbols are dealt to lanes in turn, each with a state of its own, so a processor can work on all at once; lanes share 16-bit words.
//! The coder works backwards, so the decoder reads forwards, one kind of symbol after the other, each under one table.
//!
//! What always holds: decoding any words whatever gives symbols that the tables have; a page ends well exactly when all states are back
//! where coding began and no word is left.
//!
//! Source: Giesen, *Interleaved entropy coders*, arXiv:1402.3392, 2014.

use super::values::{BASES, EXTRA_BITS, MASKS, SYMBOLS};
use crate::rans::{self, LOW};

/// Lanes of a page: with 8, their states do not fit a processor's registers, and decoding takes a sixteenth longer.
pub(super) const LANES: usize = 4;
/// Bits of a probability.
pub(super) const SCALE_BITS: u32 = 11;
const SCALE: u32 = 1 << SCALE_BITS;

/// Probabilities of the symbols of a stream.
pub(super) type Table = rans::Table<SCALE_BITS, SYMBOLS>;

/// What a decoder looks up, by slot: frequency << 20 | place of the slot among the symbol's << 8 | symbol.
#[derive(Clone, Debug)]
pub(super) struct Slots(Box<[u32; SCALE as usize]>);

impl Slots {
    pub(super) fn of(table: &Table) -> Self {
        let mut slots = vec![0; SCALE as usize];
        for symbol in 0..SYMBOLS {
            let (start, end) = (table.start(symbol), table.end(symbol));
            for slot in start..end {
                slots[usize::from(slot)] = u32::from(end - start) << 20 | u32::from(slot - start) << 8 | symbol as u32;
            }
        }
        Self(slots.into_boxed_slice().try_into().expect("there are as many as slots"))
    }
}

/// Reads what [`Writer`] wrote.
pub(super) struct Reader {
    states: [u32; LANES],
    /// And a few zeros.
    words: Vec<u16>,
    at: usize,
}

impl Reader {
    /// `None` where there is half a word.
    pub(super) fn new(states: [u32; LANES], bytes: &[u8]) -> Option<Self> {
        let (pairs, []) = bytes.as_chunks() else { return None };
        let mut words = Vec::with_capacity(pairs.len() + LANES);
        words.extend(pairs.iter().map(|pair| u16::from_le_bytes(*pair)));
        words.extend([0; LANES]);
        Some(Self { states, words, at: 0 })
    }

    /// As many symbols as fit; `None` where the words end.
    pub(super) fn symbols(&mut self, slots: &Slots, out: &mut [u8]) -> Option<()> {
        let mut states = self.states;
        let mut at = self.at;
        let (rounds, rest) = out.as_chunks_mut::<LANES>();
        for symbols in rounds {
            let words: &[u16; LANES] = self.words.get(at..)?.first_chunk()?;
            let mut taken = 0;
            for (symbol, state) in symbols.iter_mut().zip(&mut states) {
                *symbol = step(state, slots, words, &mut taken);
            }
            at += taken;
        }
        let words: &[u16; LANES] = self.words.get(at..)?.first_chunk()?;
        let mut taken = 0;
        for (symbol, state) in rest.iter_mut().zip(&mut states) {
            *symbol = step(state, slots, words, &mut taken);
        }
        self.at = at + taken;
        self.states = states;
        Some(())
    }

    /// True when all was read, and no more.
    pub(super) fn is_at_end(&self) -> bool {
        self.states == [LOW; LANES] && self.at + LANES == self.words.len()
    }
}

#[inline(always)]
fn step(state: &mut u32, slots: &Slots, words: &[u16; LANES], taken: &mut usize) -> u8 {
    let slot = slots.0[(*state & (SCALE - 1)) as usize];
    let next = (slot >> 20) * (*state >> SCALE_BITS) + (slot >> 8 & 0xFFF);
    let word = u32::from(words[*taken & (LANES - 1)]);
    let short = next < LOW;
    *taken += usize::from(short);
    *state = if short { next << 16 | word } else { next };
    slot as u8
}

/// Codes streams backwards: the last symbol of the last stream first.
pub(super) struct Writer {
    states: [u32; LANES],
    /// The last first.
    words: Vec<u16>,
}

impl Writer {
    pub(super) fn new() -> Self {
        Self { states: [LOW; LANES], words: Vec::new() }
    }

    /// All symbols of a stream.
    pub(super) fn symbols(&mut self, table: &Table, symbols: &[u8]) {
        for (at, symbol) in symbols.iter().enumerate().rev() {
            let (start, end) = (table.start(usize::from(*symbol)), table.end(usize::from(*symbol)));
            let frequency = u32::from(end - start);
            let state = &mut self.states[at % LANES];
            if *state >> (32 - SCALE_BITS) >= frequency {
                self.words.push(*state as u16);
                *state >>= 16;
            }
            *state = ((*state / frequency) << SCALE_BITS) + *state % frequency + u32::from(start);
        }
    }

    /// States and words.
    pub(super) fn finish(self, out: &mut Vec<u8>) {
        out.extend(self.states.iter().flat_map(|state| state.to_le_bytes()));
        out.extend(self.words.iter().rev().flat_map(|word| word.to_le_bytes()));
    }
}

/// Raw bits, the lowest of each byte first.
#[derive(Default)]
pub(super) struct BitWriter {
    bytes: Vec<u8>,
    used: u32,
}

impl BitWriter {
    /// The lowest `bits` of a value.
    pub(super) fn put(&mut self, value: u64, bits: u32) {
        for bit in 0..bits {
            if self.used.is_multiple_of(8) {
                self.bytes.push(0);
            }
            let byte = self.bytes.last_mut().expect("there is one");
            *byte |= ((value >> bit & 1) as u8) << (self.used % 8);
            self.used += 1;
        }
    }

    pub(super) fn bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reads what [`BitWriter`] wrote.
pub(super) struct BitReader {
    /// And eight zeros.
    bytes: Vec<u8>,
    /// In bits.
    at: usize,
}

impl BitReader {
    pub(super) fn new(bytes: &[u8]) -> Self {
        let mut padded = Vec::with_capacity(bytes.len() + 8);
        padded.extend(bytes);
        padded.extend([0; 8]);
        Self { bytes: padded, at: 0 }
    }

    /// The numbers that classes and the next bits are, each given to `set`; `None` where bits end. So many are taken from the bits at a
    /// time; their classes must not have more than 57 bits together.
    #[inline(always)]
    pub(super) fn numbers<const TOGETHER: usize, T>(
        &mut self,
        classes: &[u8],
        out: &mut [T],
        set: impl Fn(&mut T, u32),
    ) -> Option<()> {
        let mut at = self.at;
        let mut some = |classes: &[u8], out: &mut [T]| {
            let chunk: &[u8; 8] = self.bytes.get(at >> 3..)?.first_chunk()?;
            let mut bits = u64::from_le_bytes(*chunk) >> (at & 7);
            for (class, out) in classes.iter().zip(out) {
                let class = usize::from(*class);
                set(out, BASES[class] + (bits as u32 & MASKS[class]));
                bits >>= EXTRA_BITS[class];
                at += usize::from(EXTRA_BITS[class]);
            }
            Some(())
        };
        let (rounds, rest) = classes.as_chunks::<TOGETHER>();
        let (out_rounds, out_rest) = out.as_chunks_mut::<TOGETHER>();
        for (classes, out) in rounds.iter().zip(out_rounds) {
            some(classes, out)?;
        }
        some(rest, out_rest)?;
        self.at = at;
        Some(())
    }

    /// The next bits, at most 48.
    #[inline(always)]
    pub(super) fn bits(&mut self, bits: u32) -> Option<u64> {
        let chunk: &[u8; 8] = self.bytes.get(self.at >> 3..)?.first_chunk()?;
        let found = u64::from_le_bytes(*chunk) >> (self.at & 7) & ((1 << bits) - 1);
        self.at += bits as usize;
        Some(found)
    }

    /// True where no more was read than there is.
    pub(super) fn is_within(&self) -> bool {
        self.at <= 8 * (self.bytes.len() - 8)
    }
}
