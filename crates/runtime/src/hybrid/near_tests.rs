use super::*;
use crate::hybrid::look::tests::{ORIGIN, pixel, record, skeleton, view};
use crate::splats::Cutting;
use proptest::prelude::*;

fn page(positions: &[[u16; 3]], triangles: &[[u32; 3]]) -> Page {
    Page { positions: positions.to_vec(), triangles: triangles.to_vec(), ..Page::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn nothing_that_is_seen_moves_farther_than_the_error_of_a_page(
        eye in prop::array::uniform3(-1.0f64..1.0), target in prop::array::uniform3(-1.0f64..3.0), turn in -3.0f64..3.0,
        corners in prop::array::uniform3(prop::array::uniform3(0u16..1500)), alone in prop::array::uniform3(0u16..1500),
        error in 0.0f32..0.1, spacing in 0.0f32..0.1, shares in prop::array::uniform2(0.0f64..1.0), is_point in any::<bool>(),
        off in prop::array::uniform3(-1.0f64..1.0), moved in prop::array::uniform3(-1.0f64..1.0),
    ) {
        let record = NodeRecord { points: 1, spacing, ..record([0; 3], [1500; 3], error) };
        let skeleton = skeleton(false, record);
        // Amid it.
        let view = view((ORIGIN + DVec3::from(eye)).into(), target, turn);
        let look = Look::new(&view, &skeleton, Cutting::default());
        let page = page(&[corners[0], corners[1], corners[2], alone], &[[0, 1, 2]]);
        let bound = f64::from(look.error_px_of(&record, &page));
        let within = |offset: [f64; 3], most: f64| DVec3::from(offset) / DVec3::from(offset).length().max(1.0) * most;
        let at = |steps: [u16; 3]| ORIGIN + DVec3::from_array(steps.map(f64::from)) * skeleton.step(1);
        let (a, b) = if shares[0] + shares[1] > 1.0 { (1.0 - shares[0], 1.0 - shares[1]) } else { (shares[0], shares[1]) };
        let drawn = match is_point {
            true => at(alone) + within(off, f64::from(spacing) * POINT_REACH),
            false => at(corners[0]) * (1.0 - a - b) + at(corners[1]) * a + at(corners[2]) * b,
        };
        // What is in the picture may be what is drawn, or what it stands for.
        let other = drawn + within(moved, f64::from(error));
        for (seen, elsewhere) in [(drawn, other), (other, drawn)] {
            let Some(shown) = pixel(&view, seen) else { continue };
            let elsewhere = view.camera.view_point(elsewhere);
            let apart = match elsewhere.z > 0.0 {
                true => (view.camera.pixel_of_view_point(elsewhere) - shown).length(),
                false => f64::INFINITY,
            };
            prop_assert!(apart <= bound * (1.0 + 1e-6), "{apart} {bound}");
        }
    }
}

#[test]
fn a_page_around_the_eye_is_as_far_off_as_its_nearest_triangle_in_sight() {
    let record = record([0; 3], [2048; 3], 1e-4);
    let skeleton = skeleton(false, record);
    let camera = gigalod_geom::Camera::look_at(
        ORIGIN + 0.5,
        ORIGIN + DVec3::new(0.5, 0.5, 0.0),
        DVec3::Y,
        0.9,
        gigalod_geom::ImageSize { width: 320, height: 180 },
    );
    let view = crate::ModelView::new(&camera, &crate::Similarity::IDENTITY);
    let look = Look::new(&view, &skeleton, Cutting::default());
    assert_eq!(look.root().unwrap().error_px, f32::INFINITY);
    // One wall ahead, at a quarter, and one just behind the eye.
    let wall = |z: u16| [[0, 0, z], [2048, 0, z], [0, 2048, z], [2048, 2048, z]];
    let walls = page(&[wall(512), wall(1025)].concat(), &[[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]]);
    let px = look.error_px_of(&record, &walls);
    let straight = (camera.focal_px() * 1e-4 / 0.25) as f32;
    assert!(px > straight && px < straight * 2.0, "{px}, {straight} in the picture's middle");
    assert_eq!(look.error_px_of(&record, &page(&[], &[])), 0.0);
    let through_the_eye = page(&[[1000, 1000, 1024], [1050, 1000, 1024], [1024, 1050, 1024]], &[[0, 1, 2]]);
    assert_eq!(look.error_px_of(&record, &through_the_eye), f32::INFINITY);
}
