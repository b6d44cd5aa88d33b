//! A static range coder over small alphabets: rANS with 9-bit probabilities and 16-bit words.
//!
//! Each symbol is coded under one of many [`Table`]s. A page has several lanes, each with its own [`State`], so that a processor can
//! work on all at once; they share [`Words`]. The coder works backwards, so the decoder reads forwards.
//!
//! What always holds: decoding any words whatever gives symbols that the tables have, and never a panic; a page ends well
//! exactly when all states are back where coding began and no word is left.
//!
//! Source: Duda, *Asymmetric numeral systems*, arXiv:1311.2540, 2013; interleaving as in Giesen, *Interleaved entropy coders*,
//! arXiv:1402.3392, 2014.

use super::model::{CONTEXTS, STORED};
pub(super) use crate::rans::LOW;

/// Bits of a probability. What a decoder looks up must stay in a processor's nearest cache: with 10 bits it is a tenth slower, and files
/// are 0.2 % smaller.
pub(super) const SCALE_BITS: u32 = 9;
/// The whole.
pub(super) const SCALE: u32 = 1 << SCALE_BITS;
/// Most symbols of an alphabet.
pub(super) const SYMBOLS: usize = 48;
/// Places of a context in a table of symbols; one that has more symbols takes several numbers.
pub(super) const ROW: usize = 16;

/// Probabilities of the symbols in one context.
pub(super) type Table = crate::rans::Table<SCALE_BITS, SYMBOLS>;

/// What a decoder looks up.
#[derive(Clone, Debug)]
pub(super) struct Slots {
    /// By 512 · context + slot: a byte each, so that what is in use fits a processor's cache.
    symbols: Box<[u8; CONTEXTS * SCALE as usize]>,
    /// By 16 · context + symbol: `frequency << 16 | start`.
    shares: Box<[u32; CONTEXTS * ROW]>,
}

impl Slots {
    pub(super) fn of(tables: &[Table]) -> Self {
        let mut symbols = vec![0; CONTEXTS * SCALE as usize];
        let mut shares = vec![0; CONTEXTS * ROW];
        for (context, table) in tables.iter().enumerate() {
            for symbol in 0..SYMBOLS {
                let (start, end) = (table.start(symbol), table.end(symbol));
                let slots = context * SCALE as usize + usize::from(start)..context * SCALE as usize + usize::from(end);
                symbols[slots].fill(symbol as u8);
                if end > start {
                    shares[context * ROW + symbol] = u32::from(end - start) << 16 | u32::from(start);
                }
            }
        }
        let all = "there are as many as contexts";
        Self {
            symbols: symbols.into_boxed_slice().try_into().expect(all),
            shares: shares.into_boxed_slice().try_into().expect(all),
        }
    }
}

/// Most words of a page, less one: enough for any that is shorter than a raw page.
pub(super) const MOST_WORDS: usize = 1 << 15;

/// The words of a page, and zeros: whichever lane needs one takes the next.
pub(super) struct Words {
    words: Box<[u16; MOST_WORDS]>,
    length: usize,
}

impl Words {
    /// `None` where there are too many, or half of one.
    pub(super) fn new(bytes: &[u8]) -> Option<Self> {
        let (bytes, []) = bytes.as_chunks() else { return None };
        let mut words: Box<[u16; MOST_WORDS]> = vec![0; MOST_WORDS].into_boxed_slice().try_into().ok()?;
        if bytes.len() >= MOST_WORDS {
            return None;
        }
        for (word, bytes) in words.iter_mut().zip(bytes) {
            *word = u16::from_le_bytes(*bytes);
        }
        Some(Self { words, length: bytes.len() })
    }

    pub(super) fn reader(&self) -> Reader<'_> {
        Reader { words: &self.words, at: 0, length: self.length }
    }
}

/// How far [`Words`] were read.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    words: &'a [u16; MOST_WORDS],
    at: usize,
    length: usize,
}

impl Reader<'_> {
    /// True when all were taken, and no more were asked for.
    pub(super) fn is_at_end(&self) -> bool {
        self.at == self.length
    }

    /// The state that comes of `next`, with a word if it needs one.
    #[inline(always)]
    fn filled(&mut self, next: u32) -> u32 {
        let word = u32::from(self.words[self.at & (MOST_WORDS - 1)]);
        let short = next < LOW;
        self.at += usize::from(short);
        if short { next << 16 | word } else { next }
    }
}

/// One lane of what [`Coder`] wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct State(pub(super) u32);

impl State {
    /// Where coding begins, and decoding ends.
    pub(super) const END: Self = Self(LOW);

    /// The next symbol.
    #[inline(always)]
    pub(super) fn symbol(&mut self, slots: &Slots, words: &mut Reader<'_>, context: u32) -> u32 {
        let slot = self.0 & (SCALE - 1);
        let symbol = slots.symbols[(context << SCALE_BITS | slot) as usize & (CONTEXTS * SCALE as usize - 1)];
        let share = slots.shares[(context as usize * ROW + usize::from(symbol)) & (CONTEXTS * ROW - 1)];
        self.0 = words.filled((share >> 16) * (self.0 >> SCALE_BITS) + slot - (share & 0xFFFF));
        u32::from(symbol)
    }

    /// A number of at most 10 bits, all alike.
    #[inline(always)]
    pub(super) fn bits(&mut self, words: &mut Reader<'_>, bits: u32) -> u32 {
        let value = self.0 & ((1 << bits) - 1);
        self.0 = words.filled(self.0 >> bits);
        value
    }
}

/// What a coder looks up for a symbol in a context: the state x becomes x + steps · ⌊x · reciprocal / 2^64⌋ + bias.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// 2^64 / frequency, rounded up: with it ⌊x / frequency⌋ is exact for every state. For a frequency of 1 one less than that, so
    /// x − 1 takes its place, and `bias` makes up for it.
    reciprocal: u64,
    /// From here on, in units of 2^22, the state must lose a word before.
    full: u16,
    steps: u16,
    bias: u32,
}

impl Entry {
    /// Of what has `frequency` of `scale` slots, from `start` on.
    fn new(frequency: u32, start: u32, scale: u32) -> Self {
        let (reciprocal, bias) = match frequency {
            1 => (u64::MAX, start + scale - 1),
            _ => (u64::MAX / u64::from(frequency) + 1, start),
        };
        let full = ((u64::from(frequency) << 32) / u64::from(scale)) >> (32 - MOST_BITS);
        Self { reciprocal, full: full as u16, steps: (scale - frequency) as u16, bias }
    }
}

/// Most bits of a number that is coded as it is; no probability has more.
const MOST_BITS: u32 = 10;
const _: () = assert!(SCALE_BITS <= MOST_BITS);
/// Entries of such numbers, by [`entry_of_bits`].
const FIRST_OF_BITS: usize = (CONTEXTS - 1) * ROW - (2 << MOST_BITS);
const _: () = assert!(STORED * ROW <= FIRST_OF_BITS);

/// What a coder takes in place of 16 · context + symbol for a number of some bits.
#[inline(always)]
pub(super) fn entry_of_bits(bits: u32, value: u32) -> u16 {
    (FIRST_OF_BITS as u32 + (1 << bits) + value) as u16
}

/// Entries by 16 · context + symbol.
#[derive(Clone, Debug)]
pub(super) struct Entries(Box<[Entry; CONTEXTS * ROW]>);

impl Entries {
    pub(super) fn of(tables: &[Table]) -> Self {
        let mut entries = vec![Entry::default(); CONTEXTS * ROW];
        for (context, table) in tables.iter().enumerate() {
            for (symbol, frequency) in table.frequencies().into_iter().enumerate().filter(|(_, f)| *f > 0) {
                entries[context * ROW + symbol] =
                    Entry::new(u32::from(frequency), u32::from(table.start(symbol)), SCALE);
            }
        }
        for bits in 0..=MOST_BITS {
            for value in 0..1 << bits {
                entries[usize::from(entry_of_bits(bits, value))] = Entry::new(1, value, 1 << bits);
            }
        }
        Self(entries.into_boxed_slice().try_into().expect("there are as many as contexts have symbols"))
    }
}

/// Codes symbols backwards: the last that is to be read comes first.
pub(super) struct Coder<'a> {
    entries: &'a Entries,
    /// The last first.
    words: &'a mut [u16],
    at: usize,
}

impl<'a> Coder<'a> {
    /// There must be room for as many words as symbols will come.
    pub(super) fn new(entries: &'a Entries, words: &'a mut [u16]) -> Self {
        Self { entries, words, at: 0 }
    }

    /// One symbol, as 16 · context + symbol.
    #[inline(always)]
    pub(super) fn put(&mut self, state: &mut State, symbol: u16) {
        let entry = &self.entries.0[usize::from(symbol) & (CONTEXTS * ROW - 1)];
        let full = state.0 >> (32 - MOST_BITS) >= u32::from(entry.full);
        if let Some(word) = self.words.get_mut(self.at) {
            *word = state.0 as u16;
        }
        self.at += usize::from(full);
        let fits = if full { state.0 >> 16 } else { state.0 };
        let quotient = ((u128::from(fits) * u128::from(entry.reciprocal)) >> 64) as u32;
        state.0 = fits + quotient * u32::from(entry.steps) + entry.bias;
    }

    /// The words so far, the last first.
    pub(super) fn words(self) -> &'a [u16] {
        &self.words[..self.at]
    }
}
