//! The slow traversal as a judge: what a cut must be.

use gigalod_geom::{Camera, projected};
use gigalod_runtime::splats::plain::{CutSink, VisitedNode, Work, cut};
use gigalod_runtime::splats::{Cutting, MATERIAL_SRGB, NormalColor, SplatBall, SplatList};
use gigalod_runtime::{
    CutReport, DrawSource, FileId, Interrupt, ModelView, Residency, Scene, SelectInput, Similarity, ViewId,
};
use std::collections::BTreeMap;

/// What the plain traversal gives.
#[derive(Default)]
pub(crate) struct Plain {
    pub(crate) report: CutReport,
    pub(crate) splats: Vec<(SplatBall, NormalColor)>,
    /// Pixels that are drawn for want of each page, and by how many nodes.
    pub(crate) wanted: BTreeMap<u32, (f64, f64)>,
    /// Largest diameter of inner nodes that are drawn.
    pub(crate) coarsest_inner_px: f32,
    focal_px: f32,
    forward: glam::Vec3,
}

impl CutSink for Plain {
    fn draw(&mut self, node: &VisitedNode) {
        let [r, g, b] = MATERIAL_SRGB.map(u16::from);
        let material = ((r * 31 + 127) / 255) << 11 | ((g * 63 + 127) / 255) << 5 | ((b * 31 + 127) / 255);
        let ball = SplatBall { center_in_eye: node.center_in_eye.to_array(), radius: node.radius };
        let color = node.color.unwrap_or(material);
        self.splats.push((ball, u32::from(node.node.normal()) | u32::from(color) << 16));
        if !node.node.is_leaf() {
            self.coarsest_inner_px = self.coarsest_inner_px.max(diameter_px(&ball, self.forward, self.focal_px));
        }
    }

    fn miss(&mut self, page: gigalod_format::splats::PageId, error_px: f32) {
        let (sum, nodes) = self.wanted.entry(page.0).or_default();
        *sum += f64::from(error_px.min(1e6));
        *nodes += 1.0;
    }
}

/// Of a splat in a list.
pub(crate) fn diameter_px(ball: &SplatBall, forward: glam::Vec3, focal_px: f32) -> f32 {
    let center = glam::Vec3::from_array(ball.center_in_eye);
    projected::diameter_px(center.dot(forward), center.length_squared(), ball.radius, focal_px)
}

/// The largest in a list.
pub(crate) fn largest_px<'a>(list: impl Iterator<Item = &'a SplatBall>, view: &ModelView) -> f32 {
    list.map(|ball| diameter_px(ball, view.forward, view.focal_px)).fold(0.0, f32::max)
}

/// Cuts the slow way.
pub(crate) fn plain(residency: &Residency, view: ModelView, threshold_px: f32, cutting: Cutting) -> Plain {
    let interrupt = Interrupt::default();
    let input = SelectInput::px(FileId(0), view, threshold_px, &interrupt, residency);
    let mut plain = Plain { focal_px: view.focal_px, forward: view.forward, ..Plain::default() };
    plain.report = cut(&input, &cutting, &mut Work::default(), &mut plain);
    plain
}

/// The same where the one model of a scene stands where its file has it.
pub(crate) fn plain_of(scene: &Scene, camera: &Camera, threshold_px: f32, cutting: Cutting) -> Plain {
    plain(scene.residency(), ModelView::new(camera, &Similarity::IDENTITY), threshold_px, cutting)
}

/// What a scene of one instance draws.
pub(crate) fn list_of(scene: &Scene, view: ViewId) -> &SplatList {
    let (_, selection) = scene.draws(view).next().expect("one instance");
    match &selection.draw {
        DrawSource::Splats(list) => list,
        other => panic!("{other:?}"),
    }
}

/// Panics where a cut is not the judge's.
pub(crate) fn assert_same(scene: &Scene, view: ViewId, report: &CutReport, plain: &Plain) {
    let list = list_of(scene, view);
    assert_eq!(list.len(), plain.splats.len());
    for (at, ((ball, normal_color), expected)) in list.iter().zip(&plain.splats).enumerate() {
        assert_eq!((*ball, normal_color), *expected, "splat {at} of {}", plain.splats.len());
    }
    assert_eq!(*report, plain.report);
    let (_, selection) = scene.draws(view).next().expect("one instance");
    let wanted: Vec<u32> = selection.requests.iter().map(|request| request.key.page.0).collect();
    assert_eq!(wanted, plain.wanted.keys().copied().collect::<Vec<_>>());
    for (request, (page, (benefit, nodes))) in selection.requests.iter().zip(&plain.wanted) {
        // Each node is rounded down, by a millionth of a pixel.
        let near = (f64::from(request.benefit) - benefit).abs() <= benefit * 1e-4 + nodes * 1e-6;
        assert!(near, "page {page}: {} instead of {benefit}", request.benefit);
    }
}
