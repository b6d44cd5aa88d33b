//! A static range coder over small alphabets: two interleaved rANS states, 10-bit probabilities, 16-bit words.
//!
//! Symbols are 0–15, each coded under one of many [`Table`]s. The two states take turns, symbol by symbol, so that a decoder
//! can work on both at once. The coder works backwards, so the decoder reads forwards.
//!
//! What always holds: decoding any words whatever ends in a symbol or in `None`, never in a panic; a stream decodes to its
//! end exactly when both states are back where coding began and no word is left.
//!
//! Source: Duda, *Asymmetric numeral systems*, arXiv:1311.2540, 2013; interleaving as in Giesen, *Interleaved entropy coders*,
//! arXiv:1402.3392, 2014.

/// Bits of a probability: a table of slots for each context is then 4 KiB.
pub(super) const SCALE_BITS: u32 = 10;
/// The whole.
pub(super) const SCALE: u32 = 1 << SCALE_BITS;
/// Symbols of an alphabet.
pub(super) const SYMBOLS: usize = 16;
/// States stay at or above this between symbols; both begin here.
const LOW: u32 = 1 << 16;

/// Probabilities of the symbols in one context, as running sums: symbol i has the slots from `ends[i − 1]` up to `ends[i]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Table {
    /// Not falling; the last is [`SCALE`], except in a context that never occurs, where all are 0.
    ends: [u16; SYMBOLS],
}

impl Table {
    /// Of a context that never occurs.
    pub(super) const UNUSED: Self = Self { ends: [0; SYMBOLS] };

    /// All symbols alike.
    pub(super) fn uniform() -> Self {
        Self { ends: std::array::from_fn(|symbol| ((symbol + 1) * SCALE as usize / SYMBOLS) as u16) }
    }

    /// From frequencies that sum to [`SCALE`] (or all 0).
    pub(super) fn of_frequencies(frequencies: &[u16; SYMBOLS]) -> Option<Self> {
        let mut sum = 0u32;
        let mut ends = [0; SYMBOLS];
        for (end, frequency) in ends.iter_mut().zip(frequencies) {
            sum += u32::from(*frequency);
            if sum > SCALE {
                return None;
            }
            *end = sum as u16;
        }
        (sum == SCALE || sum == 0).then_some(Self { ends })
    }

    /// Frequencies in proportion to `counts`, at least 1 for each symbol that occurs.
    pub(super) fn of_counts(counts: &[u64; SYMBOLS]) -> Self {
        let total: u64 = counts.iter().sum();
        if total == 0 {
            return Self::UNUSED;
        }
        let mut frequencies = counts.map(|count| {
            if count == 0 { 0 } else { ((count as u128 * u128::from(SCALE) / u128::from(total)) as u16).max(1) }
        });
        // What rounding left over or took too much goes to or comes from the largest, which feel it least.
        loop {
            let sum: i32 = frequencies.iter().map(|f| i32::from(*f)).sum();
            let missing = SCALE as i32 - sum;
            if missing == 0 {
                break;
            }
            let largest = (0..SYMBOLS).max_by_key(|symbol| (frequencies[*symbol], std::cmp::Reverse(*symbol)));
            let largest = &mut frequencies[largest.expect("there are symbols")];
            let step = missing.max(-(i32::from(*largest) - 1).min(16));
            *largest = (i32::from(*largest) + step) as u16;
        }
        Self::of_frequencies(&frequencies).expect("made to sum to the whole")
    }

    /// Frequencies of all symbols.
    pub(super) fn frequencies(&self) -> [u16; SYMBOLS] {
        std::array::from_fn(|symbol| (self.end(symbol) - self.start(symbol)) as u16)
    }

    fn start(&self, symbol: usize) -> u32 {
        if symbol == 0 { 0 } else { self.end(symbol - 1) }
    }

    fn end(&self, symbol: usize) -> u32 {
        u32::from(self.ends[symbol])
    }
}

/// What a decoder looks up: for each context and slot the symbol, and the numbers that take the state back.
#[derive(Clone, Debug)]
pub(super) struct Slots {
    /// `symbol << 22 | frequency << 10 | (slot − start)`; 0, a frequency of 0, in contexts that never occur.
    entries: Vec<u32>,
}

impl Slots {
    pub(super) fn of(tables: &[Table]) -> Self {
        let mut entries = vec![0; tables.len() << SCALE_BITS];
        for (entries, table) in entries.chunks_exact_mut(SCALE as usize).zip(tables) {
            for symbol in 0..SYMBOLS {
                let (start, end) = (table.start(symbol), table.end(symbol));
                for slot in start..end {
                    entries[slot as usize] =
                        (symbol as u32) << (2 * SCALE_BITS + 2) | (end - start) << SCALE_BITS | (slot - start);
                }
            }
        }
        Self { entries }
    }
}

/// Codes symbols with their tables, in order; returns the bytes.
pub(super) fn encode(symbols: &[(u16, u8)], tables: &[Table], out: &mut Vec<u8>) {
    let mut states = [LOW; 2];
    let mut words: Vec<u16> = Vec::with_capacity(symbols.len() / 4);
    for (at, (context, symbol)) in symbols.iter().enumerate().rev() {
        let table = &tables[usize::from(*context)];
        let start = table.start(usize::from(*symbol));
        let frequency = table.end(usize::from(*symbol)) - start;
        debug_assert!(frequency > 0, "symbol {symbol} never occurs in context {context}");
        let state = &mut states[at & 1];
        if u64::from(*state) >= u64::from(frequency) << (32 - SCALE_BITS) {
            words.push(*state as u16);
            *state >>= 16;
        }
        *state = ((*state / frequency) << SCALE_BITS) + *state % frequency + start;
    }
    out.extend(states.iter().flat_map(|state| state.to_le_bytes()));
    out.extend(words.iter().rev().flat_map(|word| word.to_le_bytes()));
}

/// Reads what [`encode`] wrote.
pub(super) struct Decoder<'a> {
    /// Whose turn it is comes first.
    states: [u32; 2],
    words: &'a [[u8; 2]],
    slots: &'a Slots,
}

impl<'a> Decoder<'a> {
    /// `None` where the bytes are too few or odd.
    pub(super) fn new(bytes: &'a [u8], slots: &'a Slots) -> Option<Self> {
        let (a, rest) = bytes.split_first_chunk()?;
        let (b, rest) = rest.split_first_chunk()?;
        let (words, []) = rest.as_chunks() else { return None };
        Some(Self { states: [u32::from_le_bytes(*a), u32::from_le_bytes(*b)], words, slots })
    }

    /// The next symbol; `None` where there cannot be one.
    #[inline(always)]
    pub(super) fn symbol(&mut self, context: usize) -> Option<u8> {
        let state = self.states[0];
        let entry = self.slots.entries[context << SCALE_BITS | (state & (SCALE - 1)) as usize];
        let frequency = entry >> SCALE_BITS & (2 * SCALE - 1);
        if frequency == 0 {
            return None;
        }
        let mut next = frequency * (state >> SCALE_BITS) + (entry & (SCALE - 1));
        if next < LOW {
            let (word, rest) = self.words.split_first()?;
            self.words = rest;
            next = next << 16 | u32::from(u16::from_le_bytes(*word));
        }
        self.states = [self.states[1], next];
        Some((entry >> (2 * SCALE_BITS + 2)) as u8)
    }

    /// True when everything was read and nothing is left.
    pub(super) fn is_at_end(&self) -> bool {
        self.words.is_empty() && self.states == [LOW; 2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn symbols_come_back_in_order_and_nothing_is_left(
            symbols in prop::collection::vec((0u16..3, 0u8..16), 0..400), skew in 0u64..40,
        ) {
            let mut counts = [[0u64; SYMBOLS]; 3];
            for (context, symbol) in &symbols {
                counts[usize::from(*context)][usize::from(*symbol)] += 1 + skew * u64::from(16 - symbol);
            }
            let tables = counts.map(|counts| Table::of_counts(&counts));
            let mut bytes = Vec::new();
            encode(&symbols, &tables, &mut bytes);
            let slots = Slots::of(&tables);
            let mut decoder = Decoder::new(&bytes, &slots).unwrap();
            for (context, symbol) in &symbols {
                prop_assert_eq!(decoder.symbol(usize::from(*context)), Some(*symbol));
            }
            prop_assert!(decoder.is_at_end());
        }

        #[test]
        fn any_bytes_decode_to_symbols_or_to_an_end(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let tables = [Table::uniform(), Table::UNUSED];
            let slots = Slots::of(&tables);
            if let Some(mut decoder) = Decoder::new(&bytes, &slots) {
                prop_assert!((0..300).all(|_| decoder.symbol(0).is_none_or(|symbol| symbol < 16)));
                prop_assert_eq!(decoder.symbol(1), None);
            }
        }

        #[test]
        fn frequencies_sum_to_the_whole_and_forget_no_symbol(counts in prop::array::uniform16(0u64..1 << 40)) {
            let frequencies = Table::of_counts(&counts).frequencies();
            let sum: u32 = frequencies.iter().map(|f| u32::from(*f)).sum();
            prop_assert!(sum == SCALE || counts.iter().all(|count| *count == 0));
            prop_assert!(std::iter::zip(frequencies, counts).all(|(f, count)| (f > 0) == (count > 0)));
        }
    }

    #[test]
    fn a_symbol_that_is_certain_costs_nothing() {
        let mut counts = [0; SYMBOLS];
        counts[7] = 1000;
        let mut bytes = Vec::new();
        encode(&[(0, 7); 1000], &[Table::of_counts(&counts)], &mut bytes);
        assert_eq!(bytes.len(), 8, "two states and no word");
    }
}
