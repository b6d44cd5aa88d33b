//! What a person does with the camera, and what must hold whatever they do.

use super::*;
use proptest::prelude::*;

const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

/// Points all over a sphere.
fn sphere(middle: DVec3, radius: f64, points: u32) -> Vec<DVec3> {
    let around = |i: u32| {
        let (turn, height) = (f64::from(i) * 2.4, f64::from(2 * i) / f64::from(points) - 1.0);
        let ring = (1.0 - height * height).max(0.0).sqrt();
        middle + DVec3::new(turn.cos() * ring, height, turn.sin() * ring) * radius
    };
    (0..=points).map(around).collect()
}

/// Bounds, and points on a sphere inside: a model that fills its bounds with a surface.
fn ball(middle: DVec3, radius: f64) -> (Aabb, Vec<DVec3>) {
    (Aabb { min: middle - radius, max: middle + radius }, sphere(middle, radius, 300))
}

fn navigation(middle: DVec3, radius: f64) -> Navigation {
    let (bounds, anchors) = ball(middle, radius);
    let mut navigation = Navigation::new(bounds, UpAxis::Y, 0.7, SIZE);
    let anchors: Vec<Anchor> = anchors.into_iter().map(|at| Anchor { at, radius: radius * 0.08 }).collect();
    navigation.set_anchors(&anchors, SIZE);
    navigation
}

fn on_surface(at: DVec3) -> Anchor {
    Anchor { at, radius: 0.0 }
}

fn pixel(navigation: &Navigation, point: DVec3) -> DVec2 {
    let camera = navigation.camera(SIZE);
    camera.pixel_of_view_point(camera.view_point(point))
}

#[test]
fn it_begins_with_the_view_that_a_picture_has_by_default() {
    let (bounds, _) = ball(DVec3::new(3.0, 4.0, 5.0), 2.0);
    for up in [UpAxis::Y, UpAxis::Z] {
        let begun = Navigation::new(bounds, up, 0.7, SIZE).camera(SIZE);
        let expected = Camera::orbit(&bounds, up, [0.0, 0.0], 1.0, 0.7, SIZE);
        assert!((begun.eye - expected.eye).length() < 1e-12 && (begun.up - expected.up).length() < 1e-12);
    }
    let terrain = Aabb { min: DVec3::ZERO, max: DVec3::new(600.0, 500.0, 40.0) };
    let begun = Navigation::new(terrain, UpAxis::Z, 0.7, SIZE).camera(SIZE);
    let expected = Camera::orbit(&terrain, UpAxis::Z, default_orbit_deg(&terrain, UpAxis::Z), 1.0, 0.7, SIZE);
    assert!(begun.forward.z < -0.5, "from above");
    assert!((begun.eye - expected.eye).length() < 1e-9 && (begun.up - expected.up).length() < 1e-12);
}

#[test]
fn a_pose_in_numbers_is_taken_as_it_is_and_home_leads_back_to_it() {
    // Nearer than the balls are large: none of them is wholly in the picture.
    let (eye, target) = (DVec3::new(0.02, 0.01, 1.05), DVec3::new(0.0, 0.02, 0.99));
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    navigation.set_home(eye, target, SIZE);
    let is_there =
        |navigation: &Navigation| (navigation.eye() - eye).length() + (navigation.pivot() - target).length() < 1e-12;
    assert!(is_there(&navigation), "{navigation:?}");
    navigation.apply(&Input::Orbit { by_px: DVec2::new(3.0, 0.0) }, SIZE);
    assert!((navigation.eye() - eye).length() < 0.01, "a small drag moves it a little");
    navigation.go_to(eye * 4.0, DVec3::ZERO, SIZE);
    navigation.apply(&Input::Home, SIZE);
    assert!(is_there(&navigation), "{navigation:?}");
    // One that looks at nothing shows the model all the same.
    navigation.go_to(DVec3::X * 9.0, DVec3::X * 12.0, SIZE);
    assert!(navigation.is_in_view(&navigation.pose, SIZE) && navigation.aim.is_none(), "{navigation:?}");
}

#[test]
fn what_is_dragged_follows_the_hand() {
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    // What is nearest to the eye goes to the right and down, as the hand.
    let front = navigation.eye().normalize();
    navigation.apply(&Input::Orbit { by_px: DVec2::new(20.0, 10.0) }, SIZE);
    let moved = pixel(&navigation, front) - DVec2::new(320.0, 240.0);
    assert!(moved.x > 5.0 && moved.y > 2.0, "{moved}");
    // The pivot moves with the cursor, to the pixel.
    navigation.apply(&Input::Home, SIZE);
    let pivot = navigation.pivot();
    navigation.apply(&Input::Pan { by_px: DVec2::new(31.0, -17.0) }, SIZE);
    assert!((pixel(&navigation, pivot) - DVec2::new(351.0, 223.0)).length() < 1e-9);
}

#[test]
fn a_zoom_keeps_what_is_under_the_cursor_there() {
    let mut navigation = navigation(DVec3::new(1e6, 2e6, 10.0), 100.0);
    let surface = DVec3::new(1e6 + 40.0, 2e6 + 30.0, 96.0);
    let at_px = pixel(&navigation, surface);
    let mut distance = (navigation.eye() - surface).length();
    for _ in 0..60 {
        assert!(navigation.apply(&Input::Zoom { factor: 0.8, at_px, surface: Some(on_surface(surface)) }, SIZE));
        let now = (navigation.eye() - surface).length();
        assert!((now / distance - 0.8).abs() < 1e-3, "{now} of {distance}");
        distance = now;
        assert!((pixel(&navigation, surface) - at_px).length() < 0.01, "{}", pixel(&navigation, surface));
    }
    assert!(distance < 1e-3);
}

#[test]
fn looking_turns_the_eye_on_the_spot_and_flying_moves_it_along_its_axes() {
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    let (eye, before) = (navigation.eye(), navigation.camera(SIZE));
    navigation.apply(&Input::Look { by_px: DVec2::new(30.0, 0.0) }, SIZE);
    assert!((navigation.eye() - eye).length() < 1e-12);
    // Dragged to the right, the picture goes to the right: the eye turns to the left.
    assert!(navigation.camera(SIZE).forward.dot(before.right) < -0.01);
    navigation.apply(&Input::Home, SIZE);
    navigation.apply(&Input::Fly { by: DVec3::new(0.0, 0.0, 0.25), ahead: None }, SIZE);
    let flown = navigation.eye() - eye;
    assert!((flown - before.forward * (eye.length() * 0.25)).length() < 1e-9, "{flown}");
}

#[test]
fn a_picked_pivot_is_in_the_middle_and_is_turned_around() {
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    let at = DVec3::new(0.5, 0.5, 0.5_f64.sqrt());
    let distance = (navigation.eye() - at).length();
    navigation.apply(&Input::Pivot(on_surface(at)), SIZE);
    navigation.apply(&Input::Orbit { by_px: DVec2::new(50.0, -20.0) }, SIZE);
    assert!((pixel(&navigation, at) - DVec2::new(320.0, 240.0)).length() < 1e-9);
    assert!(((navigation.eye() - at).length() - distance).abs() < 1e-9);
}

#[test]
fn a_pivot_does_not_move_the_eye_however_near_it_is_to_large_leaves() {
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    let at = DVec3::new(0.3, 0.2, (1.0_f64 - 0.13).sqrt());
    navigation.go_to(at * 1.05, at * 0.9, SIZE);
    let eye = navigation.eye();
    navigation.apply(&Input::Pivot(Anchor { at, radius: 0.2 }), SIZE);
    assert!((navigation.eye() - eye).length() < 1e-9, "{} {eye}", navigation.eye());
    assert!((navigation.pivot() - at).length() < 1e-9);
}

/// A ball with leaves of this radius, as the picker tells of them.
const LEAF: f64 = 0.005;

fn leaf(at: DVec3) -> Anchor {
    Anchor { at, radius: 2.0 * LEAF }
}

#[test]
fn zoom_and_flight_end_before_the_surface_while_its_leaves_are_small() {
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    let surface = leaf(DVec3::new(0.3, 0.2, (1.0_f64 - 0.13).sqrt()));
    let leaves_in_height = |navigation: &Navigation| {
        let camera = navigation.camera(SIZE);
        2.0 * camera.tan_half_fov().y * camera.view_point(surface.at).z / (2.0 * LEAF)
    };
    let at_px = pixel(&navigation, surface.at);
    for _ in 0..100 {
        navigation.apply(&Input::Zoom { factor: 0.7, at_px, surface: Some(surface) }, SIZE);
    }
    let zoomed = leaves_in_height(&navigation);
    assert!((zoomed / LEAST_LEAVES - 1.0).abs() < 1e-6, "{zoomed}");
    // Who is there can go back.
    navigation.apply(&Input::Zoom { factor: 2.0, at_px, surface: Some(surface) }, SIZE);
    assert!((leaves_in_height(&navigation) / zoomed - 2.0).abs() < 1e-3);

    navigation.apply(&Input::Home, SIZE);
    navigation.apply(&Input::Pivot(surface), SIZE);
    for _ in 0..200 {
        navigation.apply(&Input::Fly { by: DVec3::Z * 0.2, ahead: Some(surface) }, SIZE);
    }
    let flown = leaves_in_height(&navigation);
    assert!((LEAST_LEAVES * 0.999..LEAST_LEAVES * 1.1).contains(&flown), "{flown}");
    // One step that is larger than the room ends there too.
    navigation.apply(&Input::Home, SIZE);
    navigation.apply(&Input::Pivot(surface), SIZE);
    navigation.apply(&Input::Fly { by: DVec3::Z * 50.0, ahead: Some(surface) }, SIZE);
    assert!((leaves_in_height(&navigation) / LEAST_LEAVES - 1.0).abs() < 1e-6);
}

#[test]
fn zooming_out_leads_back_to_the_whole_wherever_the_cursor_is() {
    for at_px in [DVec2::new(320.0, 240.0), DVec2::new(10.0, 10.0), DVec2::new(630.0, 300.0)] {
        let mut navigation = navigation(DVec3::ZERO, 1.0);
        navigation.apply(&Input::Pan { by_px: DVec2::new(180.0, -100.0) }, SIZE);
        let surface = leaf(DVec3::new(0.4, -0.5, 0.59_f64.sqrt()));
        let over = pixel(&navigation, surface.at);
        for _ in 0..8 {
            navigation.apply(&Input::Zoom { factor: 0.8, at_px: over, surface: Some(surface) }, SIZE);
        }
        let mut before = navigation.clone();
        for _ in 0..40 {
            navigation.apply(&Input::Zoom { factor: 1.1, at_px, surface: None }, SIZE);
            let moved = (pixel(&navigation, surface.at) - pixel(&before, surface.at)).length();
            assert!(moved < 120.0, "{moved}: no jumps");
            before = navigation.clone();
            let camera = navigation.camera(SIZE);
            let middle = camera.view_point(DVec3::ZERO);
            let whole = 2.0 * (middle.z / navigation.fit);
            if whole > 3.0 {
                // All of the ball is in the picture.
                let at = pixel(&navigation, DVec3::ZERO);
                let radius = camera.focal_px() / middle.z;
                assert!(at.y - radius > 0.0 && at.y + radius < 480.0, "{at} {radius}");
                assert!(at.x - radius > 0.0 && at.x + radius < 640.0, "{at} {radius}");
            }
        }
        assert!(pixel(&navigation, DVec3::ZERO).distance(DVec2::new(320.0, 240.0)) < 1.0);
    }
}

#[test]
fn who_zooms_in_beside_the_model_comes_to_it() {
    let mut navigation = navigation(DVec3::ZERO, 1.0);
    for _ in 0..12 {
        navigation.apply(&Input::Zoom { factor: 0.8, at_px: DVec2::new(600.0, 20.0), surface: None }, SIZE);
    }
    let at = pixel(&navigation, DVec3::ZERO);
    assert!((navigation.eye().length() - 1.0).abs() < 1.0, "{}", navigation.eye());
    let camera = navigation.camera(SIZE);
    let seen = sphere(DVec3::ZERO, 1.0, 5000).into_iter().filter(|point| {
        let at = pixel(&navigation, *point);
        camera.view_point(*point).z > 0.0 && (0.0..640.0).contains(&at.x) && (0.0..480.0).contains(&at.y)
    });
    assert!(seen.count() > 20, "the middle is at {at}");
}

#[test]
fn zooming_in_anywhere_and_out_again_there_changes_nothing() {
    for at in [DVec3::new(0.4, -0.5, 0.59_f64.sqrt()), DVec3::new(0.0, 0.9, 0.19_f64.sqrt())] {
        let mut navigation = navigation(DVec3::ZERO, 1.0);
        let (surface, eye) = (leaf(at), navigation.eye());
        let at_px = pixel(&navigation, at);
        for factor in [0.8, 0.8, 0.8, 1.25, 1.25, 1.25] {
            navigation.apply(&Input::Zoom { factor, at_px, surface: Some(surface) }, SIZE);
        }
        assert!((navigation.eye() - eye).length() < 1e-9 * eye.length(), "{} {eye}", navigation.eye());
    }
}

fn any_input() -> impl Strategy<Value = Input> {
    let px = || {
        let wild = prop_oneof![-2000.0..2000.0, Just(f64::NAN), Just(f64::INFINITY), Just(1e300)];
        (wild, -2000.0..2000.0).prop_map(|(x, y)| DVec2::new(x, y))
    };
    let point = || [-3.0..3.0, -3.0..3.0, -3.0..3.0].prop_map(|[x, y, z]: [f64; 3]| DVec3::new(x, y, z));
    let factor = prop_oneof![0.01..100.0, Just(0.0), Just(f64::NAN), Just(1e-300), Just(1e300)];
    prop_oneof![
        px().prop_map(|by_px| Input::Orbit { by_px }),
        px().prop_map(|by_px| Input::Pan { by_px }),
        (factor, px(), proptest::option::of(point())).prop_map(|(factor, at_px, direction)| Input::Zoom {
            factor,
            at_px,
            // On the surface, as picked points are.
            surface: direction.map(|direction| on_surface(direction.normalize_or(DVec3::X))),
        }),
        px().prop_map(|by_px| Input::Look { by_px }),
        point().prop_map(|by| Input::Fly { by: by * 10.0, ahead: None }),
        point().prop_map(|at| Input::Pivot(on_surface(at.normalize_or(DVec3::X)))),
        Just(Input::Home),
    ]
}

proptest! {
    #[test]
    fn nobody_loses_the_model(
        inputs in proptest::collection::vec((any_input(), 100u32..2000, 100u32..2000), 1..60),
        scale in prop_oneof![Just(1.0), Just(1e-4), Just(1e5)],
    ) {
        let middle = DVec3::new(7.0, -3.0, 11.0) * scale;
        let mut navigation = navigation(middle, scale);
        let whole = (navigation.eye() - middle).length();
        let mut surface = sphere(middle, scale, 5000);
        for (input, width, height) in inputs {
            // Points of inputs are those of a unit ball around the origin.
            let place = |anchor: Anchor| on_surface(middle + anchor.at * scale);
            let input = match input {
                Input::Zoom { factor, at_px, surface } => {
                    Input::Zoom { factor, at_px, surface: surface.map(place) }
                }
                Input::Pivot(at) => Input::Pivot(place(at)),
                other => other,
            };
            if let Input::Pivot(picked) | Input::Zoom { surface: Some(picked), .. } = &input {
                surface.push(picked.at);
            }
            let size = ImageSize { width, height };
            navigation.apply(&Input::Orbit { by_px: DVec2::ZERO }, size);
            navigation.apply(&input, size);
            let camera = navigation.camera(size);
            let finite = [camera.eye, camera.right, camera.up, camera.forward].iter().all(|v| v.is_finite());
            prop_assert!(finite, "{camera:?} after {input:?}");
            let distance = (camera.eye - middle).length();
            prop_assert!(distance <= whole * FARTHEST * 1.001, "{distance} after {input:?}");
            prop_assert!((camera.eye - navigation.pivot()).length() >= scale * NEAREST * 0.99);
            // Other points of the ball's surface than those that hold the camera.
            let is_seen = surface.iter().any(|point| {
                let view = camera.view_point(*point);
                let pixel = camera.pixel_of_view_point(view);
                view.z > 0.0
                    && (0.0..=f64::from(width)).contains(&pixel.x)
                    && (0.0..=f64::from(height)).contains(&pixel.y)
            });
            // Closer to the surface than its samples lie to each other there is what was picked, or nothing.
            let is_close = (distance - scale).abs() < scale * 0.1;
            prop_assert!(is_seen || is_close, "lost after {input:?}: {camera:?}");
        }
    }
}
