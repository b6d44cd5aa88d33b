//! Places of points, in the order of an octree: keys with the bits of all three coordinates in turn, sorted.
//!
//! A key shares its high bits with the one before it; what is coded is how many, and the bits below the first that differs, which is 1.
//!
//! Source: Botsch, Wiratanaya & Kobbelt, *Efficient high quality rendering of point sampled geometry*, EGWR 2002. Differs: depth first, so
//! that each point is a symbol and raw bits.

/// The bits of three coordinates in turn, those of z the highest of each level.
pub(super) fn key_of([x, y, z]: [u16; 3]) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// Undoes [`key_of`].
pub(super) fn position_of(key: u64) -> [u16; 3] {
    [gathered(key), gathered(key >> 1), gathered(key >> 2)]
}

fn spread(number: u16) -> u64 {
    let mut bits = u64::from(number);
    bits = (bits | bits << 16) & 0x001F_0000_FF00_00FF;
    bits = (bits | bits << 8) & 0x100F_00F0_0F00_F00F;
    bits = (bits | bits << 4) & 0x10C3_0C30_C30C_30C3;
    (bits | bits << 2) & 0x1249_2492_4924_9249
}

fn gathered(key: u64) -> u16 {
    let mut bits = key & 0x1249_2492_4924_9249;
    bits = (bits | bits >> 2) & 0x10C3_0C30_C30C_30C3;
    bits = (bits | bits >> 4) & 0x100F_00F0_0F00_F00F;
    bits = (bits | bits >> 8) & 0x001F_0000_FF00_00FF;
    (bits | bits >> 16) as u16
}

/// 0 where a key is the one before it, else one more than the place of the highest bit that differs.
pub(super) fn class_of(key: u64, before: u64) -> u8 {
    (64 - (key ^ before).leading_zeros()) as u8
}

/// Raw bits of a class.
pub(super) fn bits_of(class: u8) -> u32 {
    u32::from(class.saturating_sub(1))
}

/// The key of a class, after another, with these raw bits.
#[inline(always)]
pub(super) fn key_from(class: u8, before: u64, bits: u64) -> u64 {
    if class == 0 {
        return before;
    }
    let top = 1u64 << (class - 1);
    before & !(2 * top - 1) | top | bits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_hold_all_bits_in_turn_and_follow_from_each_other() {
        let mut before = 0;
        for number in [0u16, 1, 2, 77, 255, 256, 0x5555, 0xAAAA, 0x8000, 0xFFFF] {
            for position in [[number, 0, 0], [0, number, 0], [0, 0, number], [number, !number, number / 3]] {
                let key = key_of(position);
                assert_eq!(position_of(key), position);
                let slow = (0..48).fold(0u64, |key, bit| key | u64::from(position[bit % 3] >> (bit / 3) & 1) << bit);
                assert_eq!(key, slow);
                if key >= before {
                    let class = class_of(key, before);
                    assert_eq!(key_from(class, before, key & ((1 << bits_of(class)) - 1)), key);
                }
                before = key;
            }
        }
    }
}
