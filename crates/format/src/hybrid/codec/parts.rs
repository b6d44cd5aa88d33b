//! What the parts of a page cost, for whoever tunes the coder or a builder.

use super::model::Model;
use super::points;
use super::prepare::Prepared;
use super::streams::{KEYS, Kind, RARE, STREAMS, TOKENS, table_of};
use super::values::{EXTRA_BITS, class_of};

/// Bits of the parts of a page under a model; the head and rounding up are in none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PartBits {
    /// Which vertices are triangles, and which edges are borders.
    pub connectivity: f64,
    /// Positions of vertices.
    pub positions: f64,
    /// Normals of vertices.
    pub normals: f64,
    /// Colours of vertices.
    pub colors: f64,
    /// All of points.
    pub points: f64,
}

impl PartBits {
    /// Of one page.
    pub fn of(page: &Prepared, model: &Model) -> Self {
        let classes = |numbers: &[u32]| numbers.iter().map(|number| class_of(*number)).collect::<Vec<_>>();
        let coded = |table: usize, classes: &[u8]| {
            let frequencies = model.table(table).frequencies();
            classes.iter().map(|class| -(f64::from(frequencies[usize::from(*class)]) / 2048.0).log2()).sum::<f64>()
        };
        let raw = |classes: &[u8]| classes.iter().map(|class| f64::from(EXTRA_BITS[usize::from(*class)])).sum::<f64>();
        let rare = classes(&page.rare);
        let mut parts = Self {
            connectivity: coded(TOKENS, &page.tokens) + coded(RARE, &rare) + raw(&rare),
            points: coded(KEYS, &page.key_classes)
                + page.key_classes.iter().map(|class| f64::from(points::bits_of(*class))).sum::<f64>(),
            ..Self::default()
        };
        for (kind, numbers) in STREAMS.iter().zip(&page.differences) {
            let classes = classes(numbers);
            let part = match kind {
                Kind::Position => &mut parts.positions,
                Kind::Normal => &mut parts.normals,
                Kind::Color => &mut parts.colors,
                Kind::PointNormal | Kind::PointColor => &mut parts.points,
            };
            *part += coded(table_of(*kind, model.best_size(*kind, &classes)), &classes) + raw(&classes);
        }
        parts
    }
}
