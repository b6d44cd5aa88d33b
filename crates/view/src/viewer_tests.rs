//! The user interface without a window, as a person uses it.

mod person;

use crate::mailbox::{Figures, Order};
use crate::navigation::Input;
use crate::pick::Ray;
use egui::{Event, Modifiers, PointerButton, pos2, vec2};
use egui_kittest::kittest::Queryable;
use gigalod_runtime::{CutReport, Limit};
use glam::{DVec2, DVec3};
pub(crate) use person::statue;
use person::{MIDDLE, Person, SIZE};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

#[test]
fn a_file_that_cannot_be_opened_is_told_and_a_folder_is_a_choice() {
    let mut person = Person::opens(&["missing.ply", "folder"]);
    assert!(person.harness.query_by_label_contains("missing.ply: no such file").is_some());
    assert!(person.harness.state().models.is_empty());
    for told in ["/models", "ready", "4.0 KiB", "built before", "7.0 MiB"] {
        assert!(person.harness.query_by_label(told).is_some(), "{told}");
    }
    person.clicks_on("statue.glod");
    person.waits_until(|viewer| viewer.models.len() == 1);
    assert!(person.harness.query_by_label("other.ply").is_none(), "the choice is made");
    let mut another = Person::opens(&["folder"]);
    another.presses(egui::Key::Escape);
    another.harness.run_steps(2);
    assert!(another.harness.query_by_label("other.ply").is_none(), "or none is");
}

/// A file that is let go over the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("the viewer opens files by their names".into())
    }
}

#[test]
fn what_is_dropped_onto_the_window_is_shown_with_the_rest() {
    let mut person = Person::opens(&["statue.glod"]);
    person.harness.input_mut().dropped_files.push(Arc::new(Dropped("statue.glod".into())));
    assert_eq!(person.viewer().names.scene, "statue.toml");
    person.waits_until(|viewer| viewer.models.len() == 2);
    assert_eq!(person.viewer().names.scene, "scene.toml");
    let orders = person.viewer().mailbox.receive(Some(Duration::ZERO)).orders;
    assert!(matches!(&orders[..], [Order::Add(first, ..), Order::Add(second, ..)] if first != second));
}

#[test]
fn the_mouse_turns_moves_and_comes_nearer() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    person.drags(MIDDLE, MIDDLE + vec2(80.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let turned = person.viewer().own_viewpoint();
    assert_eq!(turned.target, home.target);
    assert!((turned.eye - home.eye).length() > 0.1 * (home.eye - home.target).length());
    person.drags(MIDDLE, MIDDLE + vec2(0.0, 60.0), PointerButton::Secondary, Modifiers::NONE);
    let moved = person.viewer().own_viewpoint();
    assert!(((moved.eye - moved.target) - (turned.eye - turned.target)).length() < 1e-9 && moved.eye != turned.eye);
    person.turns_wheel(MIDDLE, 200.0);
    let nearer = person.viewer().own_viewpoint();
    assert!((nearer.eye - nearer.target).length() < 0.7 * (moved.eye - moved.target).length());
    person.presses(egui::Key::Home);
    assert_eq!(person.viewer().own_viewpoint(), home);
    // A drag over the panel is not one over the picture.
    person.drags(pos2(900.0, 400.0), pos2(900.0, 300.0), PointerButton::Primary, Modifiers::NONE);
    assert_eq!(person.viewer().own_viewpoint(), home);
    person.drags(MIDDLE, MIDDLE + vec2(40.0, 0.0), PointerButton::Primary, Modifiers::CTRL);
    assert_eq!(person.viewer().own_viewpoint(), home);
    assert!(person.viewer().settings.towards_light.is_some(), "with Ctrl it is the light that moves");
}

#[test]
fn a_flick_within_one_frame_turns_and_what_comes_after_it_does_not() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    let event = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    let (begin, end) = (MIDDLE, MIDDLE + vec2(100.0, 0.0));
    let flick = [Event::PointerMoved(begin), event(begin, true), Event::PointerMoved(end), event(end, false)];
    let away = Event::PointerMoved(MIDDLE - vec2(0.0, 150.0));
    // All in one frame: the harness makes one for each that it is told of.
    person.harness.input_mut().events.extend(flick.into_iter().chain([away]));
    person.harness.run_steps(2);
    let flicked = person.viewer().own_viewpoint();
    // As slowly, so that it is seen in several frames.
    person.presses(egui::Key::Home);
    assert_eq!(person.viewer().own_viewpoint(), home);
    person.drags(begin, end, PointerButton::Primary, Modifiers::NONE);
    let dragged = person.viewer().own_viewpoint();
    let apart = |a: DVec3, b: DVec3| (a - b).length() / (home.eye - home.target).length();
    assert!(apart(flicked.eye, home.eye) > 0.1 && apart(flicked.eye, dragged.eye) < 0.05, "{flicked:?} {dragged:?}");
    // A click that trembles is none.
    person.presses(egui::Key::Home);
    let near = begin + vec2(2.0, 1.0);
    person.harness.input_mut().events.extend([event(begin, true), Event::PointerMoved(near), event(near, false)]);
    person.harness.run_steps(2);
    assert_eq!(person.viewer().own_viewpoint(), home);
}

#[test]
fn a_double_click_makes_a_point_of_the_surface_the_pivot() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    let camera = person.viewer().camera(&home);
    person.clicks(pos2(310.0, 300.0));
    person.clicks(pos2(310.0, 300.0));
    person.waits_until(|viewer| viewer.own_viewpoint().target != home.target);
    let pivot = person.viewer().own_viewpoint().target;
    let pixel = camera.pixel_of_view_point(camera.view_point(pivot));
    assert!((pixel - DVec2::new(310.0, 300.0)).length() < 1e-6, "{pixel}: it lay under the cursor");
}

#[test]
fn whoever_drags_at_random_does_not_lose_the_model() {
    let mut person = Person::opens(&["statue.glod"]);
    person.waits_until(|viewer| viewer.navigation.has_anchors());
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    for step in 0..120 {
        let mut place = || pos2(random(700) as f32, random(700) as f32);
        let (from, to) = (place(), place());
        match random(6) {
            0 | 1 => person.drags(from, to, PointerButton::Primary, Modifiers::NONE),
            2 => person.drags(from, to, PointerButton::Secondary, Modifiers::NONE),
            3 => person.turns_wheel(from, random(800) as f32 - 300.0),
            4 => {
                person.presses(egui::Key::F);
                person.drags(from, to, PointerButton::Primary, Modifiers::NONE);
                person.presses(egui::Key::F);
            }
            _ => {
                person.clicks(from);
                person.clicks(from);
            }
        }
        // Picks come from another thread.
        for _ in 0..3 {
            std::thread::sleep(Duration::from_millis(2));
            person.harness.run_steps(1);
        }
        assert!(person.sees_the_statue(), "lost in step {step}: {:?}", person.viewer().own_viewpoint());
    }
}

#[test]
fn a_path_is_recorded_played_and_saved() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    person.clicks_on("Camera path");
    person.harness.run_steps(30);
    person.clicks_on("Record (R)");
    person.drags(MIDDLE, MIDDLE + vec2(120.0, -40.0), PointerButton::Primary, Modifiers::NONE);
    person.clicks_on("Stop (R)");
    let end = person.viewer().own_viewpoint();
    let frames = person.viewer().recorder.path().unwrap().frames.clone();
    assert_eq!((frames[0].eye, frames[frames.len() - 1].eye), (home.eye, end.eye));
    person.presses(egui::Key::Home);
    person.presses(egui::Key::Space);
    assert!(person.viewer().recorder.is_playing());
    person.waits_until(|viewer| !viewer.recorder.is_playing());
    let arrived = person.viewer().own_viewpoint();
    assert!((arrived.eye - end.eye).length() < 1e-9 && (arrived.target - end.target).length() < 1e-9);
    for button in ["Path", "Scene"] {
        // The field beside it has the same name.
        person.harness.get_by_role_and_label(egui::accesskit::Role::Button, button).click();
        person.harness.run_steps(2);
    }
    person.waits_until(|viewer| !viewer.jobs.is_writing());
    let mut written = person.files.written.lock().unwrap().clone();
    written.sort();
    let expected = [("statue.json", format!("{} poses", frames.len())), ("statue.toml", "1 models".to_string())];
    assert_eq!(written, expected.map(|(name, what)| (PathBuf::from(name), what)));
}

#[test]
fn a_distance_is_that_of_the_points_that_were_clicked() {
    let mut person = Person::opens(&["statue.glod"]);
    person.clicks_on("Pick points (M)");
    for at in [pos2(260.0, 300.0), pos2(400.0, 420.0)] {
        person.clicks(at);
        // Two clicks in one place at once would be a double click.
        person.harness.run_steps(60);
    }
    person.waits_until(|viewer| viewer.measuring.distance().is_some());
    let viewer = person.viewer();
    let camera = viewer.camera(&viewer.own_viewpoint());
    let points: Vec<DVec3> = viewer.measuring.points().map(|found| found.point).collect();
    for (point, clicked) in points.iter().zip([DVec2::new(260.0, 300.0), DVec2::new(400.0, 420.0)]) {
        let pixel = camera.pixel_of_view_point(camera.view_point(*point));
        assert!((pixel - clicked).length() < 1e-6, "{pixel}");
    }
    assert_eq!(viewer.measuring.distance().unwrap().0, (points[0] - points[1]).length());
    assert!(person.harness.query_by_label_contains("Distance ").is_some());
    assert!(person.harness.query_by_label_contains("from the splats").is_some());
}

#[test]
fn a_point_is_where_the_click_was_and_not_where_the_mouse_went_in_the_same_frame() {
    let mut person = Person::opens(&["statue.glod"]);
    person.clicks_on("Pick points (M)");
    let (at, button, modifiers) = (pos2(260.0, 300.0), PointerButton::Primary, Modifiers::NONE);
    person.harness.event(Event::PointerMoved(at));
    person.harness.run_steps(1);
    let [down, up] = [true, false].map(|pressed| Event::PointerButton { pos: at, button, pressed, modifiers });
    person.harness.input_mut().events.extend([down, up, Event::PointerMoved(pos2(20.0, 560.0))]);
    person.harness.run_steps(1);
    person.waits_until(|viewer| viewer.measuring.points().count() == 1);
    let viewer = person.viewer();
    let camera = viewer.camera(&viewer.own_viewpoint());
    let point = viewer.measuring.points().next().unwrap().point;
    let pixel = camera.pixel_of_view_point(camera.view_point(point));
    assert!((pixel - DVec2::new(260.0, 300.0)).length() < 1e-6, "{pixel}");
}

#[test]
fn a_click_is_one_where_the_button_comes_up_a_long_frame_later() {
    let mut person = Person::opens(&["statue.glod"]);
    person.clicks_on("Pick points (M)");
    let at = pos2(260.0, 300.0);
    person.button(at, PointerButton::Primary, true, Modifiers::NONE);
    // Two seconds, which egui on its own takes for a button that was held.
    person.harness.run_steps(120);
    person.button(at, PointerButton::Primary, false, Modifiers::NONE);
    person.waits_until(|viewer| viewer.measuring.points().count() == 1);
}

#[test]
fn a_click_on_a_models_name_looks_at_it() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    person.viewer().steer(&Input::Pan { by_px: DVec2::new(90.0, 40.0) }, 0.0);
    person.viewer().steer(&Input::Orbit { by_px: DVec2::new(50.0, 0.0) }, 0.0);
    let leaves = person.files.statue.file.splats().expect("a statue of splats").skeleton().root().leaves;
    person.clicks_on(&format!("statue.glod, {} splats", crate::panel::count(leaves)));
    let now = person.viewer().own_viewpoint();
    assert!((now.target - home.target).length() < 1e-6, "at its middle");
    assert!(((now.eye - now.target).length() / (home.eye - home.target).length() - 1.0).abs() < 1e-6, "all of it");
    assert!((now.eye - home.eye).length() > 0.1, "from where the person was");
    // Also while the camera follows a path.
    person.presses(egui::Key::R);
    person.drags(MIDDLE, MIDDLE + vec2(120.0, -40.0), PointerButton::Secondary, Modifiers::NONE);
    person.presses(egui::Key::R);
    person.presses(egui::Key::Space);
    assert!(person.viewer().recorder.is_playing());
    person.clicks_on(&format!("statue.glod, {} splats", crate::panel::count(leaves)));
    assert!(!person.viewer().recorder.is_playing());
    assert!((person.viewer().own_viewpoint().target - home.target).length() < 1e-6);
}

#[test]
fn a_model_is_stood_up_whatever_its_format_says() {
    let mut person = Person::opens(&["statue.glod"]);
    person.waits_until(|viewer| viewer.navigation.has_anchors());
    let home = person.viewer().own_viewpoint();
    person.clicks_on("z");
    let upright = person.viewer().own_viewpoint();
    assert_eq!((home.up, upright.up, upright.target), (DVec3::Y, DVec3::Z, home.target));
    assert!(person.viewer().navigation.has_anchors() && person.sees_the_statue());
    person.drags(MIDDLE, MIDDLE + vec2(60.0, 20.0), PointerButton::Primary, Modifiers::NONE);
    person.presses(egui::Key::Home);
    assert_eq!(person.viewer().own_viewpoint(), upright);
    assert_eq!(person.viewer().scene().up, Some(gigalod_geom::camera::UpAxis::Z));
    person.clicks_on("y");
    assert_eq!(person.viewer().own_viewpoint(), home);
}

#[test]
fn what_is_chosen_in_the_panel_is_wished_for() {
    let mut person = Person::opens(&["statue.glod"]);
    let wished = |person: &mut Person| person.viewer().mailbox.receive(Some(Duration::ZERO));
    let before = wished(&mut person).wish.unwrap().1;
    person.clicks_on("levels");
    let levels = wished(&mut person).wish.unwrap().1;
    assert!(levels.tint != before.tint && levels.camera == before.camera);
    person.presses(egui::Key::P);
    let orders = wished(&mut person).orders;
    assert!(matches!(&orders[..], [Order::Picture(name, of)] if name == Path::new("statue-1.png") && *of == levels));
    assert_eq!(person.viewer().names.picture, "statue-2.png");
    person.presses(egui::Key::F);
    let mode = person.harness.get_by_label_contains("turns the head").rect();
    assert!(mode.width() > 100.0 && mode.height() < 30.0, "in one line: {mode:?}");
    person.presses(egui::Key::F);
    assert!(person.harness.query_by_label_contains("turns the head").is_none());
    person.presses(egui::Key::F1);
    assert!(person.harness.query_by_label("Mouse and keys").is_some());
    person.presses(egui::Key::F2);
    assert!(person.harness.query_by_label("levels").is_none(), "the panel is hidden");
}

#[test]
fn the_error_at_rest_suits_the_models_until_somebody_says() {
    let mut person = Person::opens(&["hybrid.glod"]);
    let wished_px =
        |person: &mut Person| person.viewer().mailbox.receive(Some(Duration::ZERO)).wish.map(|it| it.1.finest_px);
    assert_eq!(wished_px(&mut person), Some(0.5), "half a pixel, of triangles");
    person.viewer().open(Path::new("statue.glod"));
    person.waits_until(|viewer| viewer.models.len() == 2);
    assert_eq!(wished_px(&mut person), Some(1.0), "a pixel, where splats are among them");
    for px in [0.0, 0.1, 3.0] {
        person.viewer().settings.finest_px = Some(px);
        person.harness.run_steps(3);
        assert_eq!(wished_px(&mut person), Some(px), "even where the slider ends earlier");
    }
}

#[test]
fn a_preview_is_shown_until_the_model_is_there_and_nobody_is_moved() {
    let mut person = Person::opens(&[]);
    person.viewer().open(Path::new("raw.ply"));
    person.waits_until(|viewer| viewer.models.len() == 1 && viewer.navigation.has_anchors());
    for told in ["a preview of 1 234 points", "a preview: its error is not known", "1 min 30 s left", "tree, 40 %"] {
        assert!(person.harness.query_by_label_contains(told).is_some(), "{told}");
    }
    person.drags(MIDDLE, MIDDLE + vec2(80.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let before = person.viewer().own_viewpoint();
    person.files.built.store(true, Ordering::Relaxed);
    person.waits_until(|viewer| viewer.jobs.running().is_empty());
    assert!(person.viewer().models.iter().all(|staged| staged.preview.is_none()));
    assert_eq!(person.viewer().models.len(), 1);
    assert_ne!(person.viewer().names.scene, "scene.toml", "a model is not a scene because of its preview");
    assert_eq!(person.viewer().own_viewpoint(), before);
    let orders = person.viewer().mailbox.receive(Some(Duration::ZERO)).orders;
    let [Order::Add(preview, ..), Order::Add(model, ..), Order::Remove(gone)] = &orders[..] else {
        panic!("{}: something is shown all the time", orders.len());
    };
    assert!(gone == preview && model != preview);
}

#[test]
fn models_stand_as_they_were_asked_for_whichever_is_there_first() {
    let mut person = Person::opens(&[]);
    person.viewer().open(Path::new("raw.ply"));
    person.viewer().open(Path::new("statue.glod"));
    person.waits_until(|viewer| viewer.models.len() == 2 && viewer.jobs.running().len() == 1);
    let quick = person.viewer().models[1].key;
    assert!(person.viewer().models[0].preview.is_some(), "what is still built stands first");
    person.files.built.store(true, Ordering::Relaxed);
    person.waits_until(|viewer| viewer.jobs.running().is_empty());
    let keys: Vec<_> = person.viewer().models.iter().map(|staged| staged.key).collect();
    assert_eq!(keys.len(), 2);
    assert_eq!(keys[1], quick, "and so does what it has become");
}

#[test]
fn a_build_that_is_cancelled_takes_its_preview_along() {
    let mut person = Person::opens(&[]);
    person.viewer().open(Path::new("raw.ply"));
    person.waits_until(|viewer| viewer.models.len() == 1);
    person.clicks_on("Cancel");
    person.waits_until(|viewer| viewer.jobs.running().is_empty());
    assert!(person.viewer().models.is_empty());
    assert!(person.harness.query_by_label_contains("raw.ply: cancelled").is_some());
}

#[test]
fn the_panel_fits_a_small_window_and_says_how_fine_the_picture_is() {
    let person = Person::opens(&[]);
    assert!(person.harness.query_by_label("nothing to show yet").is_some());
    let mut person = {
        drop(person);
        Person::opens(&["statue.glod"])
    };
    let mut shows = |limited_by, settled| {
        let report = CutReport { max_error_px: 7.3, threshold_px: 1.0, limited_by, ..Default::default() };
        let figures = Figures { report, typical_px: 2.1, settled, finished: settled, frames: 1, ..Default::default() };
        person.viewer().mailbox.show(None, figures);
        person.harness.run_steps(2);
        let told = |text: &str| person.harness.query_by_label(text).is_some();
        assert!(told("7.30 px") && told("2.10 px"));
        [
            "as fine as the data are",
            "as fine as asked for",
            "as fine as a budget allows",
            "being loaded",
            "being refined",
        ]
        .into_iter()
        .filter(|text| told(text))
        .collect::<Vec<_>>()
    };
    assert_eq!(shows(Some(Limit::Data), true), ["as fine as the data are"]);
    assert_eq!(shows(Some(Limit::Data), false), ["being refined"]);
    assert_eq!(shows(Some(Limit::Residency), false), ["being loaded"]);
    assert_eq!(shows(Some(Limit::Budget), true), ["as fine as a budget allows"]);
    assert_eq!(shows(None, true), ["as fine as asked for"]);
    let last = person.harness.get_by_label("Budgets").rect();
    assert!(last.bottom() < SIZE.height as f32, "{last}: all sections can be seen");
}

#[test]
fn who_comes_near_stops_before_the_surface() {
    let mut person = Person::opens(&["statue.glod"]);
    person.waits_until(|viewer| viewer.navigation.has_anchors());
    for _ in 0..30 {
        person.turns_wheel(MIDDLE, 300.0);
    }
    let at = person.viewer().own_viewpoint();
    let camera = person.viewer().camera(&at);
    let (x, y) = (f64::from(MIDDLE.x), f64::from(MIDDLE.y));
    let ray = Ray { origin: camera.eye, direction: camera.ray_through(DVec2::new(x, y)) };
    let hit = crate::pick::Pages::default()
        .first_hit(person.files.statue.file.splats().unwrap(), &ray)
        .unwrap()
        .expect("a surface");
    let leaves = hit.t * 2.0 * camera.tan_half_fov().y / (2.0 * hit.radius);
    assert!((8.0..40.0).contains(&leaves), "{leaves} leaves, one above the other");
}
