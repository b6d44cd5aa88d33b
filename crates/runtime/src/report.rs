//! What a frame says about itself.

/// Why the drawn error exceeds the threshold that was asked for; later ones win over earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Limit {
    /// The original itself is coarser.
    Data,
    /// Finer pages are not resident: not loaded yet, damaged, or no room for them.
    Residency,
    /// A time or memory budget was hit.
    Budget,
}

impl Limit {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Data => "data",
            Self::Residency => "residency",
            Self::Budget => "budget",
        }
    }
}

/// Figures of one cut, or of all cuts of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CutReport {
    /// Nodes drawn.
    pub drawn: u64,
    /// Triangles that these hold.
    pub triangles: u64,
    /// Points that these hold; each splat is one.
    pub points: u64,
    /// Lines that are drawn over their borders.
    pub lines: u64,
    /// Nodes left out, with all that is below them, because the picture does not show where they are.
    pub culled_frustum: u64,
    /// Nodes left out because they show their back.
    pub culled_backface: u64,
    /// Nodes looked at.
    pub visited: u64,
    /// The threshold of the cut, in pixels: what was asked for, or more where a budget raised it.
    pub threshold_px: f32,
    /// Largest projected error of what is drawn, in pixels.
    pub max_error_px: f32,
    /// Set where that is above the threshold that was asked for.
    pub limited_by: Option<Limit>,
    /// The file contradicts itself: the traversal was cut short, and something may be missing.
    pub inconsistent: bool,
}

impl CutReport {
    /// Triangles and points: what a cut is bounded by, and what its frame costs.
    pub fn primitives(&self) -> u64 {
        self.triangles + self.points
    }

    /// Takes note of a splat that is drawn with an error; `limit` says why that is above the threshold.
    pub fn drew(&mut self, error_px: f32, limit: Option<Limit>) {
        self.drawn += 1;
        self.points += 1;
        self.max_error_px = self.max_error_px.max(error_px);
        self.limited_by = self.limited_by.max(limit);
    }

    /// Sums and maxima of both.
    pub fn merge(self, other: Self) -> Self {
        Self {
            drawn: self.drawn + other.drawn,
            triangles: self.triangles + other.triangles,
            points: self.points + other.points,
            lines: self.lines + other.lines,
            culled_frustum: self.culled_frustum + other.culled_frustum,
            culled_backface: self.culled_backface + other.culled_backface,
            visited: self.visited + other.visited,
            threshold_px: self.threshold_px.max(other.threshold_px),
            max_error_px: self.max_error_px.max(other.max_error_px),
            limited_by: self.limited_by.max(other.limited_by),
            inconsistent: self.inconsistent || other.inconsistent,
        }
    }
}
