//! Numbers as symbols: small ones are a symbol each, larger ones a class and raw bits.
//!
//! In: a number. Out: its class, and how far it is from the smallest of that. What always holds: each number has one class; whatever class
//! and bits there are, they are a number.

/// Most symbols of an alphabet.
pub(super) const SYMBOLS: usize = 64;
/// Numbers below this are their own classes; from here on there are two classes for each power of two.
const SINGLE: u32 = 8;

/// Entries of tables of classes, so that a byte needs no check; the rest is never used.
const CLASSES: usize = 256;

/// Smallest number of each class.
pub(super) const BASES: [u32; CLASSES] = bases();
/// Raw bits of each.
pub(super) const EXTRA_BITS: [u8; CLASSES] = extra_bits();

/// The lowest so many bits.
pub(super) const MASKS: [u32; CLASSES] = masks();

const fn bases() -> [u32; CLASSES] {
    let mut bases = [0; CLASSES];
    let mut class = 1;
    while class < CLASSES {
        bases[class] = if class < SYMBOLS { bases[class - 1] + (1 << EXTRA_BITS[class - 1]) } else { 0 };
        class += 1;
    }
    bases
}

const fn extra_bits() -> [u8; CLASSES] {
    let mut bits = [0; CLASSES];
    let mut class = SINGLE as usize;
    while class < CLASSES {
        let bits_of_class = 2 + (class - SINGLE as usize) as u8 / 2;
        // Classes beyond these are in no alphabet.
        bits[class] = if bits_of_class > 21 { 21 } else { bits_of_class };
        class += 1;
    }
    bits
}

const fn masks() -> [u32; CLASSES] {
    let mut masks = [0; CLASSES];
    let mut class = 0;
    while class < CLASSES {
        masks[class] = (1 << EXTRA_BITS[class]) - 1;
        class += 1;
    }
    masks
}

/// Class of a number.
pub(super) fn class_of(number: u32) -> u8 {
    if number < SINGLE {
        return number as u8;
    }
    let top = number.ilog2();
    (SINGLE + 2 * (top - 3) + (number >> (top - 1) & 1)) as u8
}

/// 0, −1, 1, −2, 2, …: signed numbers as unsigned ones.
#[inline(always)]
pub(super) fn folded(number: i32) -> u32 {
    (number << 1 ^ number >> 31) as u32
}

/// Undoes [`folded`].
#[inline(always)]
pub(super) fn unfolded(number: u32) -> i32 {
    (number >> 1) as i32 ^ -((number & 1) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_class_and_classes_follow_each_other() {
        for number in (0..70_000).chain([1 << 20, (1 << 21) + 5, (1 << 23) - 1]) {
            let class = usize::from(class_of(number));
            assert!(class < 48, "{number}");
            assert!(BASES[class] <= number && number - BASES[class] < 1 << EXTRA_BITS[class], "{number}");
            assert_eq!(BASES[class + 1], BASES[class] + (1 << EXTRA_BITS[class]));
        }
        for number in [0, 1, -1, 5, -32_768, 32_767, 1 << 20] {
            assert_eq!(unfolded(folded(number)), number);
        }
    }
}
