use super::*;
use crate::Similarity;
use gigalod_format::hybrid::Root;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera, ImageSize};
use glam::{DQuat, Vec3};
use proptest::prelude::*;

const SIZE: ImageSize = ImageSize { width: 320, height: 180 };
pub(in crate::hybrid) const ORIGIN: DVec3 = DVec3::new(-1.0, 2.0, 0.5);

pub(in crate::hybrid) fn skeleton(closed: bool, record: NodeRecord) -> Skeleton {
    let root = Root {
        origin: ORIGIN,
        edge: 1.0,
        bounds: Aabb { min: ORIGIN, max: ORIGIN + 1.0 },
        cell_bits: 10,
        normal_bits: 8,
        resolution: 64,
        nodes: 1,
        leaves: 1,
        levels: 1,
        preserves_appearance: false,
        has_colors: false,
        closed,
        up: UpAxis::Y,
    };
    Skeleton::new(root, vec![record], 0)
}

pub(in crate::hybrid) fn record(min_steps: [i32; 3], extent_steps: [u16; 3], error: f32) -> NodeRecord {
    NodeRecord {
        level: 1,
        first_child: 0,
        children: 0,
        min_steps,
        extent_steps,
        error_geo: error,
        error_total: error,
        cone_axis: [0.0, 0.0, 1.0],
        cone_sine: 1.0,
        spacing: 0.0,
        vertices: 3,
        triangles: 1,
        points: 0,
        borders: 0,
        bytes: 0,
        checksum: 0,
    }
}

/// A placement and a camera that looks at about where its model stands.
pub(in crate::hybrid) fn view(eye: [f64; 3], target: [f64; 3], turn: f64) -> ModelView {
    let camera = Camera::look_at(eye.into(), target.into(), DVec3::Y, 0.9, SIZE);
    let placement =
        Similarity { position: DVec3::new(0.3, 0.1, 0.0), rotation: DQuat::from_rotation_z(turn), scale: 1.5 };
    ModelView::new(&camera, &placement)
}

/// Where a point of the model is in the picture, if it is.
pub(in crate::hybrid) fn pixel(view: &ModelView, point: DVec3) -> Option<glam::DVec2> {
    let in_view = view.camera.view_point(point);
    let pixel = view.camera.pixel_of_view_point(in_view);
    let is_in = in_view.z > 0.0 && (0.0..=320.0).contains(&pixel.x) && (0.0..=180.0).contains(&pixel.y);
    is_in.then_some(pixel)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn nothing_that_is_seen_lies_in_a_culled_box_or_moves_farther_than_its_error(
        eye in prop::array::uniform3(-3.0f64..6.0), target in prop::array::uniform3(-1.0f64..3.0), turn in -3.0f64..3.0,
        min in prop::array::uniform3(-500i32..1500), extent in prop::array::uniform3(0u16..1500),
        error in 0.0f32..0.3, inside in prop::array::uniform3(0.0f64..1.0), off in prop::array::uniform3(-1.0f64..1.0),
        moved in prop::array::uniform3(-1.0f64..1.0),
    ) {
        let view = view(eye, target, turn);
        let record = record(min, extent, error);
        let skeleton = skeleton(false, record);
        let look = Look::new(&view, &skeleton, Cutting::default());
        // A point of the original or of the node: in the box, or off by no more than the error.
        let within = |offset: [f64; 3]| {
            let offset = DVec3::from(offset);
            offset / offset.length().max(1.0) * f64::from(error)
        };
        let step = skeleton.step(1);
        let in_box = DVec3::from_array(min.map(f64::from)) + DVec3::from_array(extent.map(f64::from)) * DVec3::from(inside);
        let point = ORIGIN + in_box * step + within(off);
        let Some(shown) = pixel(&view, point) else { return Ok(()) };
        let sight = look.see(0, &record);
        prop_assert!(sight.is_some(), "it is in the picture");
        let bound = f64::from(sight.unwrap().error_px);
        let elsewhere = view.camera.view_point(point + within(moved));
        let apart = match elsewhere.z > 0.0 {
            true => (view.camera.pixel_of_view_point(elsewhere) - shown).length(),
            false => f64::INFINITY,
        };
        prop_assert!(apart <= bound * (1.0 + 1e-6), "{apart} {bound}");
    }

    #[test]
    fn a_small_box_is_told_about_the_error_that_it_has(
        turn in -3.0f64..3.0, depth in 2.0f64..20.0, x in -0.6f64..0.6, y in -0.4f64..0.4, error in 1e-6f32..1e-3,
    ) {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.9, SIZE);
        let view = ModelView::new(&camera, &Similarity {
            position: DVec3::new(x * depth, y * depth, -depth), rotation: DQuat::from_rotation_z(turn), scale: 1.0,
        });
        let record = record([0; 3], [1; 3], error);
        let mut skeleton = skeleton(false, record);
        skeleton = Skeleton::new(Root { origin: DVec3::ZERO, ..*skeleton.root() }, vec![record], 0);
        let look = Look::new(&view, &skeleton, Cutting { frustum_culling: false, ..Cutting::default() });
        let px = f64::from(look.see(0, &record).unwrap().error_px);
        let slope = x.hypot(y).min(camera.tan_half_fov().length());
        let exact = projected::shift_px(slope, depth, f64::from(error), camera.focal_px());
        // The rectangle around the box in the picture is a little larger than the box.
        prop_assert!(px >= exact * 0.99 && px <= exact * 1.02, "{px} {exact}");
    }

    #[test]
    fn what_is_hidden_shows_its_back_wherever_it_is(
        eye in prop::array::uniform3(-3.0f64..6.0), axis in prop::array::uniform3(-1.0f32..1.0), sine in 0.0f32..0.9,
        min in prop::array::uniform3(0i32..1500), extent in prop::array::uniform3(0u16..500),
        inside in prop::array::uniform3(0.0f64..1.0),
    ) {
        let Some(axis) = Vec3::from(axis).try_normalize() else { return Ok(()) };
        let camera = Camera::look_at(eye.into(), ORIGIN, DVec3::Y, 0.9, SIZE);
        let view = ModelView::new(&camera, &Similarity::IDENTITY);
        let record = NodeRecord { cone_axis: axis.to_array(), cone_sine: sine, ..record(min, extent, 0.0) };
        let [open, closed] = [false, true].map(|closed| skeleton(closed, record));
        prop_assert!(!Look::new(&view, &open, Cutting::default()).is_hidden(&record), "backs of open surfaces show");
        let look = Look::new(&view, &closed, Cutting::default());
        if look.is_hidden(&record) {
            prop_assert!(!closed.root().bounds.contains(eye.into()));
            let at = DVec3::from_array(min.map(f64::from)) + DVec3::from_array(extent.map(f64::from)) * DVec3::from(inside);
            let from_eye = ORIGIN + at * closed.step(1) - DVec3::from(eye);
            // The normal of the cone that is the least turned away.
            let along = axis.as_dvec3().dot(from_eye) / from_eye.length();
            prop_assert!(along > f64::from(sine), "{along} {sine}");
            prop_assert!(!look.is_hidden(&NodeRecord { points: 1, ..record }), "of points nothing is known");
        }
    }
}

#[test]
fn a_box_around_the_eye_and_records_without_sense_have_no_bound() {
    let view = view([0.0; 3], [0.0, 0.0, -1.0], 0.0);
    let eye_steps = ((view.camera.eye - ORIGIN) * 2048.0).round().to_array().map(|at| at as i32);
    let around = record(eye_steps.map(|at| at - 100), [200; 3], 1e-4);
    let sense = record([0; 3], [100; 3], 0.0);
    for strange in [
        around,
        NodeRecord { error_total: f32::NAN, ..sense },
        NodeRecord { error_geo: f32::NAN, error_total: f32::NAN, ..sense },
        NodeRecord { error_geo: f32::INFINITY, error_total: f32::INFINITY, ..sense },
    ] {
        let skeleton = skeleton(false, strange);
        let look = Look::new(&view, &skeleton, Cutting { frustum_culling: false, ..Cutting::default() });
        assert_eq!(look.root().map(|sight| sight.error_px), Some(f32::INFINITY), "{strange:?}");
    }
    // Neither panics.
    for strange in [
        NodeRecord { level: u32::MAX, min_steps: [i32::MIN; 3], extent_steps: [u16::MAX; 3], ..sense },
        NodeRecord { spacing: f32::NAN, cone_axis: [f32::NAN; 3], cone_sine: 0.1, ..sense },
        NodeRecord { error_geo: -1.0, error_total: -1.0, ..sense },
    ] {
        let skeleton = skeleton(true, strange);
        let look = Look::new(&view, &skeleton, Cutting::default());
        let _ = (look.root(), look.is_hidden(&strange), look.area_px(&strange, 320.0, 180.0));
    }
}
