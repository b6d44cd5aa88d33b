//! Cross-fades between levels: which of a picture's pixels show a node, and which its children.
//!
//! Each pixel has a rank, and each node a range of ranks. A node that is nearly too coarse gives the pixels of some of its ranks to its
//! children, more the nearer its error is to the threshold, until they have all: so nothing pops when the camera moves.
//!
//! What always holds: of each rank there is a whole cut, whose error is within the threshold; where ranges of ranks are not used, all
//! pixels show the same.

/// How many ranks there are; `RANKS` of hybrid_fade.wgsl.
pub const RANKS: u8 = 64;

/// A cross-fade begins where a node's error is less than the threshold by this share of it: errors halve from level to level, so a fade
/// is over before the next begins.
pub const CROSS_FADE: f32 = 0.3;

/// Some ranks of pixels: from one, before another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ranks {
    /// The first.
    pub from: u8,
    /// The one after the last.
    pub end: u8,
}

impl Ranks {
    /// Every pixel.
    pub const ALL: Self = Self { from: 0, end: RANKS };

    /// True where there are none.
    pub fn is_empty(self) -> bool {
        self.from >= self.end
    }

    /// What children get of these, and what their parent keeps, whose error is so large.
    pub(super) fn shared(self, error_px: f32, threshold_px: f32, cross_fade: f32) -> [Self; 2] {
        let fade_px = threshold_px * cross_fade;
        let part = match error_px > threshold_px {
            true => 1.0,
            false if fade_px > 0.0 => (error_px - (threshold_px - fade_px)) / fade_px,
            false => 0.0,
        };
        // Nothing of what is no number.
        let given = (f32::from(self.end - self.from) * part.clamp(0.0, 1.0)) as u8;
        let middle = self.from + given;
        [Self { from: self.from, end: middle }, Self { from: middle, end: self.end }]
    }
}

impl Default for Ranks {
    fn default() -> Self {
        Self::ALL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_get_more_until_they_have_all() {
        let given = |error_px: f32| Ranks::ALL.shared(error_px, 2.0, 0.25)[0].end;
        assert_eq!([0.0, 1.5, 1.75, 2.0, 9.0, f32::INFINITY].map(given), [0, 0, 32, 64, 64, 64]);
        assert_eq!(given(f32::NAN), 0);
        let some = Ranks { from: 10, end: 20 };
        assert_eq!(some.shared(1.75, 2.0, 0.25), [Ranks { from: 10, end: 15 }, Ranks { from: 15, end: 20 }]);
        assert_eq!(some.shared(1.75, 2.0, 0.0), [Ranks { from: 10, end: 10 }, some]);
        assert_eq!(some.shared(2.25, 2.0, 0.0), [some, Ranks { from: 20, end: 20 }]);
        assert_eq!(some.shared(2.25, 0.0, 0.3)[0], some);
    }
}
