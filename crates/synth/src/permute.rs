//! A pseudo-random permutation of `0 .. count` in no memory.
//!
//! Takes an index, returns where it goes, and back. A balanced Feistel network permutes the smallest even power of two
//! that holds `count`; what falls outside is sent through again ("cycle walking"), fewer than four times on average.
//!
//! # Source
//! Black & Rogaway, *Ciphers with Arbitrary Finite Domains*, CT-RSA 2002, §3 (cycle walking) and §5 (Feistel).

use crate::noise::hash32;

/// A permutation of `0 .. count`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Permutation {
    count: u64,
    half_bits: u32,
    keys: [u32; 4],
}

impl Permutation {
    /// The permutation of `0 .. count` that `seed` names; `count` is at most 2⁶⁰.
    pub(crate) fn new(count: u64, seed: u64) -> Self {
        let bits = 64 - count.max(2).saturating_sub(1).leading_zeros();
        let keys = std::array::from_fn(|round| {
            hash32(
                (seed as u32).wrapping_add((round as u32).wrapping_mul(0x9e37_79b9))
                    ^ hash32((seed >> 32) as u32 ^ round as u32),
            )
        });
        Self { count, half_bits: bits.div_ceil(2), keys }
    }

    /// Where `index` goes.
    pub(crate) fn apply(&self, index: u64) -> u64 {
        self.walk(index, |left, right, key| (right, left ^ self.scramble(right, key)), false)
    }

    /// What goes to `index`.
    pub(crate) fn invert(&self, index: u64) -> u64 {
        self.walk(index, |left, right, key| (right ^ self.scramble(left, key), left), true)
    }

    fn scramble(&self, value: u32, key: u32) -> u32 {
        hash32(value ^ key) & ((1_u64 << self.half_bits) - 1) as u32
    }

    fn walk(&self, index: u64, round: impl Fn(u32, u32, u32) -> (u32, u32), backwards: bool) -> u64 {
        assert!(index < self.count, "index {index} of {}", self.count);
        let mask = (1_u64 << self.half_bits) - 1;
        let mut value = index;
        loop {
            let (mut left, mut right) = ((value >> self.half_bits) as u32, (value & mask) as u32);
            for step in 0..4 {
                (left, right) = round(left, right, self.keys[if backwards { 3 - step } else { step }]);
            }
            value = u64::from(left) << self.half_bits | u64::from(right);
            if value < self.count {
                return value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_index_is_hit_once_and_comes_back() {
        for count in [1_u64, 2, 3, 5, 16, 17, 1000, 4097] {
            let permutation = Permutation::new(count, 0x1234_5678_9abc);
            let mut hit = vec![false; count as usize];
            for index in 0..count {
                let to = permutation.apply(index);
                assert!(!std::mem::replace(&mut hit[to as usize], true), "{to} of {count} was hit twice");
                assert_eq!(permutation.invert(to), index);
            }
        }
    }

    proptest! {
        #[test]
        fn large_permutations_come_back(count in 1_u64..2_000_000_000, seed: u64, at: u64) {
            let permutation = Permutation::new(count, seed);
            prop_assert_eq!(permutation.invert(permutation.apply(at % count)), at % count);
        }
    }
}
