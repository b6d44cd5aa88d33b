//! The code with the smallest ball around a set of balls: what a node's code must enclose is what lies below it, not a ball
//! around that.
//!
//! A decoded parent, a point in the middle of the set, and balls of the set go in; a code of [`sphere`](super::sphere) and its
//! ball come out. A place in the parent's grid needs some size to enclose the balls; places of odd sizes lie between those of
//! even ones. So of both kinds the eight places around the middle are looked at side by side, and the one that needs the
//! smallest size is taken; of equals the one nearest to the middle, where whoever codes the nodes below expects it. Not all of
//! a large set need go in: whoever finds that what came out does not enclose a ball adds that ball and asks again.
//!
//! What always holds: what was rejected is never given again, so asking ends; and it takes the same operations in the same order
//! on every machine.

use super::sphere::{Cells, GRID, code_of, decode};
use crate::Sphere;
use glam::Vec3;

/// Places around the middle: two on each axis, for even centres (odd sizes), and as many for odd ones.
const PLACES: usize = 16;
/// Of these, side by side.
const LANES: usize = 4;

/// A search for a code.
#[derive(Clone, Debug)]
pub struct Around {
    parent: Sphere,
    /// Cells a unit of length.
    scale: f32,
    /// The lowest place of either kind, in cells from the parent's centre.
    low: [Vec3; 2],
    /// Squares of the distances of all places from the middle.
    off: [f32; PLACES],
    /// Radius in cells that each place needs.
    needs: [f32; PLACES],
    /// The place that was given last, and its size.
    last: (usize, f32),
}

/// Squares of distances to all places from a point that is so far from the lowest of each kind.
#[inline(always)]
fn squares(from_low: [Vec3; 2]) -> [f32; PLACES] {
    let mut squares = [0.0; PLACES];
    for (near, squares) in from_low.into_iter().zip(squares.as_chunks_mut::<8>().0) {
        let far = near - 2.0;
        let (near, far) = (near * near, far * far);
        let across = [near.x + near.y, far.x + near.y, near.x + far.y, far.x + far.y];
        for lane in 0..LANES {
            squares[lane] = across[lane] + near.z;
            squares[LANES + lane] = across[lane] + far.z;
        }
    }
    squares
}

/// Rounds to the nearest integer where |`value`| < 2^22; as fast as an addition.
#[inline(always)]
fn rounded(value: f32) -> f32 {
    const SHIFT: f32 = 12_582_912.0;
    (value + SHIFT) - SHIFT
}

impl Around {
    /// For a set around `middle`, any point near the centre of the smallest ball around it. `parent` is decoded and encloses the set.
    #[inline(always)]
    pub fn new(parent: &Sphere, middle: Vec3) -> Self {
        let scale = if parent.radius > 0.0 { GRID as f32 / parent.radius } else { 0.0 };
        let middle = (middle - parent.center) * scale;
        // The next lower even number, and the next lower odd one.
        let even = |at: f32| rounded((at - 1.0) * 0.5) * 2.0;
        let odd = |at: f32| even(at - 1.0) + 1.0;
        let low = [middle.to_array().map(even), middle.to_array().map(odd)].map(Vec3::from_array);
        let off = squares([middle - low[0], middle - low[1]]);
        Self { parent: *parent, scale, low, off, needs: [0.0; PLACES], last: (0, 0.0) }
    }

    /// Adds a ball of the set.
    #[inline(always)]
    pub fn include(&mut self, ball: &Sphere) {
        let at = (ball.center - self.parent.center) * self.scale;
        let radius = ball.radius * self.scale;
        let squares = squares([at - self.low[0], at - self.low[1]]);
        for (need, squared) in self.needs.iter_mut().zip(squares) {
            let this = squared.sqrt() + radius;
            *need = if this > *need { this } else { *need };
        }
    }

    /// The smallest ball that encloses what was included, but for rounding. None where only the parent itself does.
    #[inline(always)]
    pub fn best(&mut self) -> Option<(u16, Sphere)> {
        // As often as there are places at most: where numbers overflow, none is ever found to be the smallest.
        for _ in 0..PLACES {
            let (place, size) = self.smallest();
            self.last = (place, size);
            if size >= GRID as f32 {
                return None;
            }
            let up = Vec3::new((place & 1) as f32, (place >> 1 & 1) as f32, (place >> 2 & 1) as f32);
            let corner = (self.low[place / 8] + up * 2.0 + (GRID as f32 - size)) * 0.5;
            // Places may lie outside the grid: what no `u8` is, or no code, is no place.
            let cells =
                Cells { edge: size as u8, corner: corner.to_array().map(|at| if at < 0.0 { 255 } else { at as u8 }) };
            if let Some(code) = code_of(cells) {
                return Some((code, decode(&self.parent, code)));
            }
            self.needs[place] = GRID as f32 + 1.0;
        }
        None
    }

    /// Says that the last ball does not enclose the set.
    pub fn reject(&mut self) {
        let (place, size) = self.last;
        self.needs[place] = self.needs[place].max(size + 0.5);
    }

    /// The place that needs the smallest size, and that size.
    #[inline(always)]
    fn smallest(&self) -> (usize, f32) {
        let mut keys = [0.0_f32; PLACES];
        // Odd sizes have even centres. A little less than needed will do: whether it is enough is decided exactly, by the caller.
        for (place, (key, (need, off))) in keys.iter_mut().zip(self.needs.iter().zip(&self.off)).enumerate() {
            let least = if place < PLACES / 2 { 1.0 } else { 2.0 };
            let twos = rounded((need - least) * 0.5 + 0.4999);
            // The distance decides among equals: its square is at most 12.
            *key = (if twos > 0.0 { twos } else { 0.0 } * 2.0 + least) * 16.0 + off;
        }
        let mut best = (0, keys[0]);
        for (place, key) in keys.into_iter().enumerate().skip(1) {
            best = if key < best.1 { (place, key) } else { best };
        }
        (best.0, ((best.1 - self.off[best.0]) * (1.0 / 16.0) + 0.5) as u8 as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sphere::{CODES, encode};
    use super::*;
    use proptest::prelude::*;

    /// As a builder asks.
    fn code_around(parent: &Sphere, balls: &[Sphere]) -> Option<(u16, Sphere)> {
        let middle = balls.iter().map(|ball| ball.center).sum::<Vec3>() / balls.len() as f32;
        let mut around = Around::new(parent, middle);
        around.include(&balls[0]);
        loop {
            let (code, ball) = around.best()?;
            match balls.iter().find(|inner| !ball.encloses(inner)) {
                None => return Some((code, ball)),
                Some(outside) => {
                    around.include(outside);
                    around.reject();
                }
            }
        }
    }

    proptest! {
        #[test]
        fn the_code_encloses_the_set_and_few_are_smaller(
            at in prop::array::uniform3(-1e4f32..1e4), parent_radius in 1e-6f32..1e3,
            inner in prop::collection::vec((prop::array::uniform3(-0.5f32..0.5), 0f32..0.3), 1..8), shrink in 0.05f32..1.0,
            shift in prop::array::uniform3(-0.5f32..0.5),
        ) {
            let parent = Sphere { center: Vec3::from_array(at), radius: parent_radius };
            let balls: Vec<Sphere> = inner.iter().map(|(center, radius)| Sphere {
                center: parent.center + (Vec3::from_array(*center) * shrink + Vec3::from_array(shift) * (1.0 - shrink)) * parent.radius,
                radius: radius * shrink * parent.radius * 0.4,
            }).collect();
            prop_assume!(balls.iter().all(|ball| parent.encloses(ball)));
            let found = code_around(&parent, &balls);
            let enclosing = |ball: &Sphere| balls.iter().all(|inner| ball.encloses(inner));
            let best = (0..CODES as u16).map(|code| decode(&parent, code)).filter(enclosing)
                .map(|ball| ball.radius).fold(f32::INFINITY, f32::min);
            let (code, ball) = found.unwrap_or((super::super::sphere::SELF, parent));
            prop_assert!(enclosing(&ball));
            prop_assert_eq!(decode(&parent, code), ball);
            // The middle is a guess: no place around it may be the best one.
            prop_assert!(ball.radius <= best + 2.01 / 13.0 * parent.radius, "{} {}", ball.radius, best);
        }

        #[test]
        fn one_ball_gets_at_most_a_step_more_than_alone(
            direction in prop::array::uniform3(-1f32..1.0), inner in 0.01f32..1.0, out in 0f32..1.0,
        ) {
            let parent = Sphere { center: Vec3::ZERO, radius: 1.0 };
            let center = Vec3::from_array(direction).normalize_or_zero() * ((1.0 - inner) * out * 0.999);
            let child = Sphere { center, radius: inner };
            prop_assume!(parent.encloses(&child));
            let (_, alone) = encode(&parent, &child);
            // At the parent's border none of the places around the middle may be a code.
            if let Some((_, found)) = code_around(&parent, &[child]) {
                let step = 1.0 / GRID as f32;
                prop_assert!(found.radius <= alone.radius + step * 1.01, "{} {}", found.radius, alone.radius);
            }
        }
    }

    #[test]
    fn parents_without_a_size_have_no_smaller_code() {
        let point = Sphere { center: Vec3::ONE, radius: 0.0 };
        let found = code_around(&point, &[point]);
        assert!(found.is_none_or(|(_, ball)| ball.encloses(&point)));
        for (radius, middle) in
            [(0.0, f32::NAN), (1e-42, 1.0), (1e-42, 1.0 + 1e-42), (1.0, f32::INFINITY), (f32::INFINITY, 1.0)]
        {
            let parent = Sphere { center: Vec3::ONE, radius };
            let mut around = Around::new(&parent, Vec3::splat(middle));
            around.include(&point);
            let mut asked = 0;
            while around.best().is_some() {
                around.reject();
                asked += 1;
            }
            assert!(asked <= PLACES * GRID, "{asked}");
        }
    }
}
