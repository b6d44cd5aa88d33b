//! Values of the points of a scan, a column for each: numbers of some bits, back to back.

use e57::RecordDataType;

/// How the bits of a value are a number.
#[derive(Clone, Copy, Debug)]
pub(super) enum Number {
    Single,
    Double,
    /// `min` plus the bits, scaled.
    Integer {
        min: i64,
        scale: f64,
        offset: f64,
    },
}

/// The values of a column that have come and were not taken.
pub(super) struct Column {
    number: Number,
    /// Of a value; 0 where all are the same.
    bits: u32,
    /// False where only the number of values matters.
    is_kept: bool,
    bytes: Vec<u8>,
    /// Bits that have come, and that were taken, since the beginning of `bytes`.
    come: u64,
    taken: u64,
}

impl Column {
    pub(super) fn new(data_type: &RecordDataType, is_kept: bool) -> Self {
        let (number, bits) = match *data_type {
            RecordDataType::Single { .. } => (Number::Single, 32),
            RecordDataType::Double { .. } => (Number::Double, 64),
            RecordDataType::Integer { min, max } => {
                (Number::Integer { min, scale: 1.0, offset: 0.0 }, bits_of(min, max))
            }
            RecordDataType::ScaledInteger { min, max, scale, offset } => {
                (Number::Integer { min, scale, offset }, bits_of(min, max))
            }
        };
        Self { number, bits, is_kept, bytes: Vec::new(), come: 0, taken: 0 }
    }

    /// True where all values are the same, and take no bits.
    pub(super) fn is_constant(&self) -> bool {
        self.bits == 0
    }

    /// Values that have come and were not taken; none where there is no end of them.
    pub(super) fn available(&self) -> Option<u64> {
        (self.come - self.taken).checked_div(self.bits.into())
    }

    /// True for a column whose bytes are wanted.
    pub(super) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Makes room for bytes that come next, to be filled by the caller.
    pub(super) fn extend(&mut self, bytes: usize) -> &mut [u8] {
        let used = (self.taken / 8) as usize;
        self.bytes.drain(..used);
        self.taken -= 8 * used as u64;
        self.come = self.come + 8 * bytes as u64 - 8 * used as u64;
        let before = self.bytes.len();
        self.bytes.resize(before + bytes, 0);
        &mut self.bytes[before..]
    }

    /// Counts bytes that come next and are not kept.
    pub(super) fn pass(&mut self, bytes: usize) {
        self.come += 8 * bytes as u64;
    }

    /// Steps over values that have come.
    pub(super) fn skip(&mut self, count: u64) {
        self.taken += count * u64::from(self.bits);
    }

    /// Value `index` of those that have come.
    pub(super) fn get(&self, index: u64) -> f64 {
        let at = self.taken + index * u64::from(self.bits);
        let bytes = &self.bytes[(at / 8) as usize..];
        let mut wide = [0; 16];
        let count = bytes.len().min(9);
        wide[..count].copy_from_slice(&bytes[..count]);
        let raw = (u128::from_le_bytes(wide) >> (at % 8)) as u64;
        match self.number {
            Number::Single => f64::from(f32::from_bits(raw as u32)),
            Number::Double => f64::from_bits(raw),
            Number::Integer { min, scale, offset } => {
                let mask = if self.bits == 64 { u64::MAX } else { (1 << self.bits) - 1 };
                min.wrapping_add((raw & mask) as i64) as f64 * scale + offset
            }
        }
    }
}

/// Bits that tell the integers from `min` to `max` apart; at most 64.
fn bits_of(min: i64, max: i64) -> u32 {
    let range = (i128::from(max) - i128::from(min)).max(0) as u128;
    u128::BITS - range.leading_zeros()
}
