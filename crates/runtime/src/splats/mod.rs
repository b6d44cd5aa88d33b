//! Splats: the cut through a bounding-sphere hierarchy.
//!
//! Source: the splats paper, section 2.1, `TraverseHierarchy`.

mod list;
mod traverse;

pub use list::{NormalColor, SplatBall, SplatList, SplatPiece};
pub use traverse::{Culled, CutSink, Cutting, VisitedNode, Work, cut};

use crate::residency::{PageKey, PageRequest};
use crate::selection::{DrawSource, SelectInput, Selection, Selector, Target};
use gigalod_geom::color::rgb565_of_srgb8;
use std::collections::BTreeMap;

/// Where a splat's colour comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tint {
    /// The model's colours; where it has none, one material.
    #[default]
    Model,
    /// A colour for each level of the hierarchy, from red (coarse) around the colour circle.
    Level,
}

/// The 8-bit sRGB colour of a model without colours: warm stone, one of those that 5-6-5 holds exactly.
pub const MATERIAL_SRGB: [u8; 3] = [197, 190, 173];

/// Cuts splat hierarchies on the host.
#[derive(Debug, Default)]
pub struct SplatSelector {
    /// How to cut; the same picture comes out whatever is set here, slower or faster.
    pub cutting: Cutting,
    /// How to colour.
    pub tint: Tint,
    states: BTreeMap<Target, Work>,
}

impl Selector for SplatSelector {
    fn select(&mut self, target: Target, input: &SelectInput<'_>, out: &mut Selection) {
        let mut splats = match std::mem::take(&mut out.draw) {
            DrawSource::Splats(splats) => splats,
            DrawSource::OnDevice(_) => SplatList::default(),
        };
        splats.clear();
        if splats.pieces.is_empty() {
            splats.pieces.push(SplatPiece::default());
        }
        out.requests.clear();
        let work = self.states.entry(target).or_default();
        let mut sink = DrawSink { splats: &mut splats.pieces[0], requests: &mut out.requests, tint: self.tint, input };
        out.report = cut(input, &self.cutting, work, &mut sink);
        // Siblings ask for the same page one after the other: sum up before residency has to.
        out.requests.sort_by_key(|request| request.key);
        out.requests.dedup_by(|next, first| {
            let same = next.key == first.key;
            if same {
                first.benefit += next.benefit;
            }
            same
        });
        out.draw = DrawSource::Splats(splats);
    }

    fn forget(&mut self, target: Target) {
        self.states.remove(&target);
    }
}

/// Collects what is drawn and what is missing.
struct DrawSink<'a> {
    splats: &'a mut SplatPiece,
    requests: &'a mut Vec<PageRequest>,
    tint: Tint,
    input: &'a SelectInput<'a>,
}

impl CutSink for DrawSink<'_> {
    fn draw(&mut self, node: &VisitedNode) {
        let color = match self.tint {
            Tint::Model => node.color.unwrap_or(const { packed_material() }),
            Tint::Level => level_color(node.level),
        };
        let ball = SplatBall { center_in_eye: node.center_in_eye.to_array(), radius: node.radius };
        self.splats.push(ball, u32::from(node.node.normal()) | u32::from(color) << 16);
    }

    fn miss(&mut self, page: gigalod_format::splats::PageId, benefit: f32) {
        // Twice the threshold wanted is worth twice as much, but a node at the eye is not worth everything.
        let benefit = benefit.min(1e6);
        self.requests.push(PageRequest { key: PageKey { file: self.input.file, page }, benefit });
    }
}

/// [`MATERIAL_SRGB`] in 5-6-5.
const fn packed_material() -> u16 {
    let [r, g, b] = MATERIAL_SRGB;
    ((r as u16 * 31 + 127) / 255) << 11 | ((g as u16 * 63 + 127) / 255) << 5 | ((b as u16 * 31 + 127) / 255)
}

/// Colours that differ from one level to the next and still tell coarse from fine.
fn level_color(level: u32) -> u16 {
    const CIRCLE: [[u8; 3]; 12] = [
        [230, 60, 50],
        [235, 130, 40],
        [240, 200, 50],
        [170, 210, 60],
        [80, 190, 80],
        [50, 190, 150],
        [60, 190, 220],
        [70, 140, 230],
        [100, 90, 225],
        [160, 90, 220],
        [220, 90, 200],
        [235, 100, 140],
    ];
    rgb565_of_srgb8(CIRCLE[level as usize % CIRCLE.len()])
}
