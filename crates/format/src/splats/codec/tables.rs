//! Tables and small functions behind [`super::context`]: what follows from a face, an edge, a step.
//!
//! In: numbers in their ranges, or any; indices are masked. Out: numbers. `docs/format.md` defines each of them.

use gigalod_geom::quantise::{normal, sphere};

/// A difference of colours too large for one symbol; the value itself follows.
pub(super) const ESCAPE: u32 = 15;

/// By 8 · face before + turn: the same face, the opposite one, then those of the next two axes, positive first.
pub(super) static FACES: [u8; 64] = {
    let mut table = [0; 64];
    let mut at = 0;
    while at < 48 {
        let (before, symbol) = (at / 8, at % 8);
        let axis = (before / 2 + symbol / 2) % 3;
        let negative = if symbol < 2 { (before % 2) ^ symbol } else { symbol % 2 };
        table[at] = (2 * axis + negative) as u8;
        at += 1;
    }
    table
};

/// By 8 · face before + face: the turn.
pub(super) static TURNS: [u8; 64] = {
    let mut table = [0; 64];
    let mut at = 0;
    while at < 48 {
        if at % 8 < 6 {
            table[at / 8 * 8 + FACES[at] as usize] = (at % 8) as u8;
        }
        at += 1;
    }
    table
};

pub(super) const GRID: u32 = normal::GRID as u32;
pub(super) const CELLS: u32 = sphere::GRID as u32;

/// 4096 · tan(π/4 · ((2i + 1)/52 − 1)) for columns and rows i from 26 on, rounded; those below are their negatives.
pub(super) const SLOPES_ABOVE: [i16; 26] = [
    62, 186, 310, 435, 560, 687, 815, 944, 1075, 1209, 1345, 1483, 1625, 1770, 1918, 2071, 2229, 2392, 2561, 2737,
    2920, 3110, 3310, 3520, 3741, 3974,
];
/// By 64 · (1 on a negative face) + column or row: how the tangent plane rises, against the sign of the face.
pub(super) static SLOPES: [i16; 128] = {
    let mut table = [0; 128];
    let mut i = 0;
    while i < 26 {
        (table[26 + i], table[64 + 26 + i]) = (-SLOPES_ABOVE[i], SLOPES_ABOVE[i]);
        (table[25 - i], table[64 + 25 - i]) = (SLOPES_ABOVE[i], -SLOPES_ABOVE[i]);
        i += 1;
    }
    table
};

/// Three small numbers, one an axis, lie in a `u64` at 20 bits each.
pub(super) const FIELD: u32 = 20;
/// The same number on all axes.
pub(super) const ALL: u64 = 1 | 1 << FIELD | 1 << (2 * FIELD);

/// What a face decides.
#[derive(Clone, Copy)]
pub(super) struct Face {
    /// What its normals count as on its axis: 51 or 0, in place.
    pub(super) top: u64,
    /// Where numbers lie on its axis, and on the two along it.
    pub(super) across: u32,
    pub(super) along_1: u32,
    pub(super) along_2: u32,
}

pub(super) static FACE: [Face; 8] = {
    let mut table = [Face { top: 0, across: 0, along_1: FIELD, along_2: 2 * FIELD }; 8];
    let mut face = 0;
    while face < 6 {
        let axis = face / 2;
        table[face as usize] = Face {
            top: if face % 2 == 0 { 51 << (axis * FIELD) } else { 0 },
            across: axis * FIELD,
            along_1: (axis + 1) % 3 * FIELD,
            along_2: (axis + 2) % 3 * FIELD,
        };
        face += 1;
    }
    table
};

/// By column or row: 8 · distance from the nearer border + which border that is, 0 where none is near. Columns, then rows.
pub(super) static BORDERS: [[u8; 64]; 2] = {
    let mut table = [[0xF8; 64]; 2];
    let mut at = 0;
    while at < 52 {
        let from = if at < 26 { at } else { 51 - at };
        if from < 8 {
            let side = (at >= 26) as u8;
            (table[0][at], table[1][at]) = (8 * from as u8 + 1 + side, 8 * from as u8 + 3 + side);
        }
        at += 1;
    }
    table
};

/// By 2 · corner + edge: how far out that is, min(2, ⌊|offset| / 3⌋).
pub(super) static OUT: [u8; 32] = {
    let mut table = [0; 32];
    let mut at = 0;
    while at < 32 {
        let offset = (at as i32 - 13).unsigned_abs();
        table[at] = if offset < 3 {
            0
        } else if offset < 6 {
            1
        } else {
            2
        };
        at += 1;
    }
    table
};

/// Where on an axis the siblings before lie, by 128 · their number + the sum of 2 · corner + edge: 0 without siblings.
pub(super) static SIDES: [u8; 512] = {
    let mut table = [0; 512];
    let mut at = 128;
    while at < 512 {
        let sum = (at % 128) as i32 - 13 * (at / 128) as i32;
        table[at] = match sum {
            ..-8 => 1,
            -8..-2 => 2,
            -2..=2 => 3,
            3..=8 => 4,
            _ => 5,
        };
        at += 1;
    }
    table
};

/// Codes of the sub-cubes by edge, then x, y, z; `NONE` where there is none. As many as a masked index needs.
pub(super) static CODES: [u16; 1 << 14] = {
    let mut table = [NONE; 1 << 14];
    let (mut s, mut at, mut code) = (1, 0, 0);
    while s <= 13i32 {
        let places = 14 - s;
        let mut i = 0;
        while i < places * places * places {
            let c = [2 * (i / places / places) + s - 13, 2 * (i / places % places) + s - 13, 2 * (i % places) + s - 13];
            let d = c[0] * c[0] + c[1] * c[1] + c[2] * c[2] - 169 - 3 * s * s;
            if d <= 0 || d * d <= 2028 * s * s {
                table[at] = code;
                code += 1;
            }
            at += 1;
            i += 1;
        }
        s += 1;
    }
    table
};
/// Not a code: it has a bit that no code has.
pub(super) const NONE: u16 = u16::MAX;
/// Where the sub-cubes of an edge begin in [`CODES`].
pub(super) static FIRST_OF_EDGE: [u16; 16] = {
    let mut table = [0; 16];
    let mut s = 1;
    while s < 15 {
        let places = 15 - s;
        table[s] = if s == 1 { 0 } else { table[s - 1] + (places * places * places) as u16 };
        s += 1;
    }
    table
};

/// By 1 + a folded step: the step, modulo 52.
pub(super) static STEPS: [u8; 64] = {
    let mut table = [0; 64];
    let mut at = 1;
    while at < 64 {
        table[at as usize] = (unfolded(at - 1) + GRID as i32) as u8 % GRID as u8;
        at += 1;
    }
    table
};

/// The column or row by its guess, class and the bits within the class: round the corner where it must.
#[inline(always)]
pub(super) fn stepped(guess: u32, class: u32, bits: u32) -> u32 {
    let at = guess + u32::from(STEPS[(1 << class | bits) as usize & 63]);
    if at >= GRID { at - GRID } else { at }
}

/// Class of the step from a guess, of which it has as many bits, and the bits.
#[inline(always)]
pub(super) fn classed(guess: u32, at: u32) -> (u32, u32) {
    const HALF: i32 = GRID as i32 / 2;
    let step = at as i32 - guess as i32;
    let step = if step < -HALF { step + GRID as i32 } else { step };
    let folded = zigzag(if step >= HALF { step - GRID as i32 } else { step }) + 1;
    let class = folded.ilog2();
    (class, folded - (1 << class))
}

/// 0, −1, 1, −2, 2 … as 0, 1, 2, 3, 4 ….
#[inline(always)]
pub(super) fn zigzag(step: i32) -> u32 {
    (step << 1 ^ step >> 31) as u32
}

/// 0, −1, 1, −2, 2 … as 0, 1, 2, 3, 4 …, those from 15 on as the escape.
pub(super) fn folded(step: i32) -> u32 {
    zigzag(step).min(ESCAPE)
}

#[inline(always)]
pub(super) const fn unfolded(code: u32) -> i32 {
    (code >> 1) as i32 ^ -((code & 1) as i32)
}

/// How large a folded difference is, in four classes: none, up to 1, up to 3, more.
#[inline(always)]
pub(super) fn size_class(folded: u32) -> u32 {
    const CLASSES: u32 = 0xFFFF_EA94;
    CLASSES >> (2 * folded) & 3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_what_they_are_said_to_be() {
        for at in 0..52 {
            let slope = 4096.0 * (std::f64::consts::FRAC_PI_4 * (f64::from(2 * at + 1) / 52.0 - 1.0)).tan();
            assert_eq!([0, 64].map(|side| f64::from(SLOPES[side + at as usize])), [-slope.round(), slope.round()]);
        }
        for (code, cells) in sphere::cells_table().iter().enumerate() {
            let places = 14 - usize::from(cells.edge);
            let [x, y, z] = cells.corner.map(usize::from);
            let at = usize::from(FIRST_OF_EDGE[usize::from(cells.edge)]) + (x * places + y) * places + z;
            assert_eq!(usize::from(CODES[at]), code);
        }
        assert_eq!(CODES.iter().filter(|code| **code != NONE).count(), sphere::CODES);
        for (face, turn) in (0..6).flat_map(|face| (0..6).map(move |turn| (face, turn))) {
            let found = u32::from(FACES[(8 * face + turn) as usize]);
            assert_eq!(u32::from(TURNS[(8 * face + found) as usize]), turn);
            let expected = if turn < 2 { face ^ turn } else { (face / 2 + turn / 2) % 3 * 2 + turn % 2 };
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn every_step_has_a_class() {
        for (guess, at) in (0..GRID).flat_map(|guess| (0..GRID).map(move |at| (guess, at))) {
            let (class, bits) = classed(guess, at);
            assert!(class < 6 && bits < 1 << class && stepped(guess, class, bits) == at);
        }
        assert!((0..32).all(|bits| stepped(51, 5, bits) < GRID), "even steps that no writer takes");
    }
}
