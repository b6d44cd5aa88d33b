//! How near to the eye a node comes whose box holds the eye: by its triangles, where a box has nothing to say.
//!
//! In: a page, its record, a view. Out: the node's error on the screen, as [`Look::see`] gives it, but no larger. What always holds: it
//! is sound, as that is. It takes some nanoseconds a triangle, so it is for the few nodes around the eye ([`Look::is_near`]) that have
//! nothing finer below. Where there is not time for all, what counts most comes first: for that, a few of the vertices tell
//! ([`Look::pressing_px`]), about, and fast.

use super::look::{Look, NodeBox, POINT_REACH};
use gigalod_format::hybrid::{NodeRecord, Page};
use glam::DVec3;

/// Vertices of a node that tell how near it is.
const SAMPLED: usize = 256;

impl Look<'_> {
    /// True where a node's box is nearer to the eye than it is large.
    pub(super) fn is_near(&self, record: &NodeRecord) -> bool {
        let NodeBox { center, half } = self.node_box(record);
        (center.abs() - half).max(DVec3::ZERO).length_squared() <= (2.0 * half).length_squared()
    }

    /// How far off on the screen a node probably is of which this is the page, by some of its vertices that lie before the eye; 0 where none
    /// do. No bound: it tells what comes first.
    pub(super) fn pressing_px(&self, record: &NodeRecord, page: &Page) -> f32 {
        let grid = self.grid(record);
        let step = (page.positions.len() / SAMPLED).max(1);
        let before = page.positions.iter().step_by(step).filter_map(|steps| {
            let at = grid.min + DVec3::from_array(steps.map(f64::from)) * grid.step;
            self.is_before(at).then(|| at.length_squared())
        });
        let nearest = before.fold(f64::INFINITY, f64::min).sqrt();
        self.error_px_beyond(nearest, f64::from(record.error_total))
    }

    /// How far off on the screen a node may be drawn of which this is the page.
    pub(super) fn error_px_of(&self, record: &NodeRecord, page: &Page) -> f32 {
        let grid = self.grid(record);
        let at = |vertex: u32| {
            let steps = page.positions.get(vertex as usize).copied().unwrap_or_default();
            grid.min + DVec3::from_array(steps.map(f64::from)) * grid.step
        };
        // What is drawn may stand for what is in the picture where it is not.
        let off = f64::from(record.error_geo).max(0.0);
        let wide = f64::from(record.spacing).max(0.0) * POINT_REACH;
        let mut nearest = f64::INFINITY;
        for triangle in &page.triangles {
            let corners = triangle.map(at);
            if self.may_show(&corners, off) {
                nearest = nearest.min(least_distance(corners) - off);
            }
        }
        for point in (record.vertices..).take(page.positions.len().saturating_sub(record.vertices as usize)).map(at) {
            if self.may_show(&[point], off + wide) {
                nearest = nearest.min(point.length() - off - wide);
            }
        }
        self.error_px_beyond(nearest, f64::from(record.error_total))
    }
}

/// A distance from the origin that no point of a triangle is nearer than: that of its box or of its plane.
fn least_distance([a, b, c]: [DVec3; 3]) -> f64 {
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let to_box = min.max(-max).max(DVec3::ZERO).length();
    // Of a triangle without area there is no plane.
    let to_plane = (b - a).cross(c - a).try_normalize().map_or(0.0, |normal| normal.dot(a).abs());
    to_box.max(to_plane)
}

#[cfg(test)]
#[path = "near_tests.rs"]
mod tests;
