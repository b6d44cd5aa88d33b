//! What all codecs of pages share: tables of probabilities for a range coder over small alphabets (rANS), and their bytes.
//!
//! A codec says how many bits its probabilities have and how many symbols its alphabets at most. States are 32 bits, at or above
//! [`LOW`] between symbols, and trade 16-bit words with a page.
//!
//! What always holds: frequencies of a table sum to the whole, or there is no symbol in it; every legal symbol has at least 1.
//!
//! Source: Duda, *Asymmetric numeral systems*, arXiv:1311.2540, 2013.

use crate::FormatError;

/// States stay at or above this between symbols; all begin here.
pub(crate) const LOW: u32 = 1 << 16;

/// Probabilities of symbols, as running sums: symbol i has the slots from `ends[i − 1]` up to `ends[i]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Table<const BITS: u32, const SYMBOLS: usize> {
    /// Not falling; the last is the whole, or all are 0 where there are no symbols.
    ends: [u16; SYMBOLS],
}

impl<const BITS: u32, const SYMBOLS: usize> Table<BITS, SYMBOLS> {
    /// The whole.
    const SCALE: u32 = 1 << BITS;

    /// All of some symbols alike, the first taking what is left over.
    pub(crate) fn uniform(legal: u64) -> Self {
        if legal == 0 {
            return Self { ends: [0; SYMBOLS] };
        }
        let share = (Self::SCALE / legal.count_ones()) as u16;
        let mut frequencies = std::array::from_fn(|symbol| if legal >> symbol & 1 != 0 { share } else { 0 });
        frequencies[legal.trailing_zeros() as usize] += (Self::SCALE % legal.count_ones()) as u16;
        Self::of_frequencies(&frequencies)
    }

    /// From frequencies that sum to the whole.
    pub(crate) fn of_frequencies(frequencies: &[u16; SYMBOLS]) -> Self {
        let mut sum = 0;
        let ends = frequencies.map(|frequency| {
            sum += frequency;
            sum
        });
        debug_assert_eq!(u32::from(sum), Self::SCALE);
        Self { ends }
    }

    /// Frequencies in proportion to `counts`, at least 1 for each legal symbol.
    pub(crate) fn of_counts(counts: &[u64; SYMBOLS], legal: u64) -> Self {
        let weights: [u128; SYMBOLS] =
            std::array::from_fn(|symbol| if legal >> symbol & 1 != 0 { 8 * u128::from(counts[symbol]) + 1 } else { 0 });
        let total: u128 = weights.iter().sum();
        if total == u128::from(legal.count_ones()) {
            return Self::uniform(legal);
        }
        let share =
            |weight| (((weight * u128::from(Self::SCALE) + total / 2) / total) as u16).max(u16::from(weight > 0));
        let mut frequencies = weights.map(share);
        // What rounding left over or took too much goes to or comes from the largest, which feel it least.
        loop {
            let sum: i32 = frequencies.iter().map(|f| i32::from(*f)).sum();
            let missing = Self::SCALE as i32 - sum;
            if missing == 0 {
                break;
            }
            let largest = (0..SYMBOLS).max_by_key(|symbol| (frequencies[*symbol], std::cmp::Reverse(*symbol)));
            let largest = &mut frequencies[largest.expect("there are symbols")];
            let step = missing.max(-(i32::from(*largest) - 1).min(16));
            *largest = (i32::from(*largest) + step) as u16;
        }
        Self::of_frequencies(&frequencies)
    }

    /// Frequencies of all symbols.
    pub(crate) fn frequencies(&self) -> [u16; SYMBOLS] {
        std::array::from_fn(|symbol| self.end(symbol) - self.start(symbol))
    }

    /// First slot of a symbol.
    pub(crate) fn start(&self, symbol: usize) -> u16 {
        if symbol == 0 { 0 } else { self.ends[symbol - 1] }
    }

    /// The slot behind its last.
    pub(crate) fn end(&self, symbol: usize) -> u16 {
        self.ends[symbol]
    }

    /// A model's tables, one after the other; `legal` says which symbols each of them may have.
    pub(crate) fn put_all(tables: &[Self], legal: impl Fn(usize) -> u64) -> Vec<u8> {
        let mut out = Vec::new();
        for (number, table) in tables.iter().enumerate() {
            table.put(legal(number), &mut out);
        }
        out
    }

    /// Undoes [`Self::put_all`]; `name` is what one of the `count` tables is called.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] where the bytes end early or late, a symbol occurs that cannot, or frequencies do not sum to
    /// the whole.
    pub(crate) fn take_all(
        bytes: &[u8],
        (count, name): (usize, &str),
        legal: impl Fn(usize) -> u64,
    ) -> Result<Vec<Self>, FormatError> {
        let mut rest = bytes.iter().copied();
        let mut byte = || {
            rest.next()
                .ok_or_else(|| FormatError::invalid("the model", format!("{} bytes, expected more", bytes.len())))
        };
        let table = |number| {
            let wrong = |problem| FormatError::invalid("the model", format!("{name} {number} {problem}"));
            Self::take(legal(number), &mut byte, wrong)
        };
        let tables = (0..count).map(table).collect::<Result<_, _>>()?;
        match rest.count() {
            0 => Ok(tables),
            more => Err(FormatError::invalid("the model", format!("{more} bytes too many"))),
        }
    }

    /// As many bytes as the legal symbols need, with a bit for each symbol of a frequency above 1, then these frequencies but the last, as LEB128. No
    /// bit: all legal symbols alike.
    fn put(&self, legal: u64, out: &mut Vec<u8>) {
        let frequencies = self.frequencies();
        let present = |symbol: &usize| frequencies[*symbol] > 1 && *self != Self::uniform(legal);
        let mask = (0..SYMBOLS).filter(present).fold(0u64, |mask, symbol| mask | 1 << symbol);
        out.extend(&mask.to_le_bytes()[..mask_bytes(legal)]);
        let mut left = mask.count_ones();
        for symbol in (0..SYMBOLS).filter(present) {
            left -= 1;
            if left > 0 {
                let frequency = frequencies[symbol];
                if frequency >= 128 {
                    out.push(frequency as u8 | 0x80);
                }
                out.push(if frequency >= 128 { (frequency >> 7) as u8 } else { frequency as u8 });
            }
        }
    }

    /// Undoes [`Self::put`].
    ///
    /// # Errors
    /// What `byte` says where there is none, and what is wrong with the frequencies.
    fn take<E>(legal: u64, mut byte: impl FnMut() -> Result<u8, E>, wrong: impl Fn(String) -> E) -> Result<Self, E> {
        let mut mask = 0;
        for at in 0..mask_bytes(legal) {
            mask |= u64::from(byte()?) << (8 * at);
        }
        if mask & !legal != 0 {
            return Err(wrong(format!("has symbols {mask:#06x}, expected none beyond {legal:#06x}")));
        }
        if mask == 0 {
            return Ok(Self::uniform(legal));
        }
        let mut frequencies: [u16; SYMBOLS] = std::array::from_fn(|symbol| (legal >> symbol & 1) as u16);
        let mut left = Self::SCALE - (legal & !mask).count_ones();
        for (symbol, frequency) in frequencies.iter_mut().enumerate().filter(|(symbol, _)| mask >> symbol & 1 != 0) {
            let is_last = mask >> symbol == 1;
            let value = if is_last {
                left
            } else {
                let low = u32::from(byte()?);
                if low < 128 { low } else { low - 128 + (u32::from(byte()?) << 7) }
            };
            if value == 0 || value > left {
                return Err(wrong(format!("has frequencies that sum to more than {}, or one of 0", Self::SCALE)));
            }
            left -= value;
            *frequency = value as u16;
        }
        Ok(Self::of_frequencies(&frequencies))
    }
}

/// Bytes that say which symbols have a frequency of their own.
fn mask_bytes(legal: u64) -> usize {
    (64 - legal.leading_zeros() as usize).div_ceil(8)
}
