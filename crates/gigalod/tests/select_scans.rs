//! The fast traversal beside the slow one, on real scans: the same list and the same report from all around, from afar, close up, along
//! the surface and from inside; and what the report says is true of the list.

mod common;

use common::{built, scan, scene};
use gigalod::format::splats::PageId;
use gigalod::geom::{Camera, ImageSize, projected};
use gigalod::runtime::splats::plain::{CutSink, VisitedNode, Work, cut};
use gigalod::runtime::splats::{Cutting, SplatBall};
use gigalod::runtime::{
    DrawSource, FileId, Fineness, Interrupt, Limit, ModelView, Scene, SelectInput, Similarity, ViewId,
};
use glam::Vec3;

const VIEW: ViewId = ViewId(0);

#[derive(Default)]
struct Drawn(Vec<SplatBall>);

impl CutSink for Drawn {
    fn draw(&mut self, node: &VisitedNode) {
        self.0.push(SplatBall { center_in_eye: node.center_in_eye.to_array(), radius: node.radius });
    }

    fn miss(&mut self, page: PageId, _error_px: f32) {
        panic!("page {page} is missing");
    }
}

fn compare(scene: &mut Scene, camera: &Camera, fineness: &Fineness) {
    scene.select_converged(VIEW, camera, &Fineness { most_splats: u64::MAX, ..*fineness });
    let report = scene.select(VIEW, camera, fineness);
    let view = ModelView::new(camera, &Similarity::IDENTITY);
    let interrupt = Interrupt::default();
    let input = SelectInput::px(FileId(0), view, report.threshold_px, &interrupt, scene.residency());
    let mut drawn = Drawn::default();
    let mut expected = cut(&input, &Cutting::default(), &mut Work::default(), &mut drawn);
    if report.threshold_px > fineness.threshold_px && expected.max_error_px > fineness.threshold_px {
        expected.limited_by = Some(Limit::Budget);
    }
    assert_eq!(report, expected);
    let (_, selection) = scene.draws(VIEW).next().unwrap();
    let DrawSource::Splats(list) = &selection.draw else { panic!("a list on the host") };
    assert!(list.iter().map(|(ball, _)| ball).eq(&drawn.0));
    let largest = list.iter().map(|(ball, _)| {
        let center = Vec3::from_array(ball.center_in_eye);
        projected::diameter_px(center.dot(view.forward), center.length_squared(), ball.radius, view.focal_px)
    });
    assert_eq!(report.max_error_px, largest.fold(0.0, f32::max));
    assert!(report.drawn <= fineness.most_splats);
}

#[test]
fn scans_are_cut_as_by_the_slow_traversal() {
    for name in ["dragon_vrip.ply.gz", "bun_zipper.ply", "laurana.ply"] {
        let Some(model) = scan(name) else { return };
        let folder = tempfile::tempdir().unwrap();
        let file = built(&model, folder.path());
        let up = file.skeleton().root().up;
        let mut scene = scene(file);
        scene.splats_mut().set_threads(2);
        let bounds = scene.bounds();
        let size = ImageSize { width: 640, height: 480 };
        for (orbit_deg, zoom, threshold_px) in [
            ([0.0, 0.0], 1.0, 1.0),
            ([130.0, 40.0], 1.0, 0.0),
            ([250.0, -70.0], 0.1, 0.5),
            ([77.0, 5.0], 12.0, 1.0),
            ([10.0, 2.0], 400.0, 2.0),
        ] {
            let camera = Camera::orbit(&bounds, up, orbit_deg, zoom, 0.7, size);
            for most_splats in [u64::MAX, 30_000, 500] {
                compare(&mut scene, &camera, &Fineness { most_splats, ..Fineness::px(threshold_px) });
            }
        }
    }
}
