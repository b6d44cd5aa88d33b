//! Nodes on the device: what stays there, what a budget refuses, what a device without storage says.

mod drawing;
mod models;

use drawing::{SIZE, orbit, picture, renderer, renderer_at, same};
use gigalod_render::{Frame, GpuLevel, Look, RenderError, Renderer};
use gigalod_runtime::{DrawSource, Similarity};
use models::{Extra, Grid, Model, cube, wavy};

#[test]
fn without_storage_there_is_an_error_and_not_a_black_picture() {
    let Some(mut renderer) = renderer_at(GpuLevel::WebGl) else { return };
    let model = cube().model(&Grid::around(&cube()), 1, Extra::default());
    let draw = model.draw(0, false);
    let frame = Frame {
        camera: orbit(&model.bounds(), [0.0; 2], 1.0),
        look: Look::default(),
        draws: vec![(Similarity::IDENTITY, &draw)],
    };
    assert_eq!(renderer.picture(&frame).unwrap_err(), RenderError::NeedsStorage);
}

#[test]
fn pages_stay_on_the_device_within_the_budget_and_a_frame_beyond_it_is_refused() {
    let Some(mut renderer) = renderer() else { return };
    let soup = wavy(200);
    let model = soup.model(&Grid::around(&soup), 4, Extra::default());
    let small = wavy(20).model(&Grid::around(&wavy(20)), 2, Extra::default());
    let camera = orbit(&model.bounds(), [30.0, 20.0], 1.0);
    let (large, small) = (model.draw(0, false), small.draw(1, false));
    let draw = |renderer: &mut Renderer, draws: &[&DrawSource]| {
        let draws = draws.iter().map(|draw| (Similarity::IDENTITY, *draw)).collect();
        let drawn = renderer.picture(&Frame { camera, look: Look::default(), draws });
        (drawn, renderer.uploaded_bytes())
    };
    let page_bytes: u64 = model.file.skeleton().nodes().iter().map(Renderer::page_bytes).sum();
    let (first, uploaded) = draw(&mut renderer, &[&large]);
    let (first, tables) = (first.unwrap(), uploaded - page_bytes);
    assert!(tables < 100_000, "{tables}");
    let (again, uploaded) = draw(&mut renderer, &[&large]);
    assert!(same(&again.unwrap(), &first));
    assert!(uploaded < 100_000, "{uploaded}: pages are there");
    draw(&mut renderer, &[&small]).0.unwrap();
    let (again, uploaded) = draw(&mut renderer, &[&large, &large]);
    assert!(same(&again.unwrap(), &first) && uploaded < 100_000);
    // A page of the same name that is another: it is not taken for the old one.
    let other = wavy(60).model(&Grid::around(&wavy(60)), 4, Extra::default()).draw(0, false);
    let (expected, _) = draw(&mut drawing::renderer().unwrap(), &[&other]);
    assert!(same(&draw(&mut renderer, &[&other]).0.unwrap(), &expected.unwrap()));
    let (again, _) = draw(&mut renderer, &[&large]);
    assert!(same(&again.unwrap(), &first));
    let mut refused = 0;
    let comfort = renderer.gpu_bytes();
    for share in [100u64, 80, 70, 60, 50, 40, 20] {
        let budget = comfort * share / 100;
        renderer.set_budget(Some(budget));
        let fits = renderer.most_page_bytes(SIZE, &Look::default()) >= page_bytes;
        let (drawn, _) = draw(&mut renderer, &[&large]);
        match drawn {
            Ok(drawn) => assert!(same(&drawn, &first) && renderer.gpu_bytes() <= budget),
            Err(RenderError::Budget { needed, .. }) => {
                assert!(needed > budget && !fits, "{needed} {budget}");
                refused += 1;
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert!(refused > 0 && refused < 7, "{refused}");
    renderer.set_budget(None);
    assert!(same(&draw(&mut renderer, &[&large]).0.unwrap(), &first));
}

/// Frames of ever other nodes, within ever other budgets: each is that of a renderer that has seen nothing else.
#[test]
fn whatever_was_drawn_before_a_frame_is_the_same() {
    let (Some(mut renderer), Some(mut fresh)) = (renderer(), renderer()) else { return };
    let models = [120, 70].map(|rows| wavy(rows).model(&Grid::around(&wavy(rows)), 5, Extra::default()));
    let camera = orbit(&models[0].bounds(), [30.0, 20.0], 1.5);
    let least = {
        let nothing = Frame { camera, look: Look::default(), draws: Vec::new() };
        fresh.picture(&nothing).unwrap();
        fresh.gpu_bytes()
    };
    let mut state = 3u64;
    let mut random = |most: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % most
    };
    let mut drawn = 0;
    for frame in 0..24 {
        let sources = [0, 1].map(|at| {
            let DrawSource::Hybrid(mut list) = models[at].draw(at as u32, false) else { unreachable!() };
            let keep = 1 + random(4);
            list.nodes.retain(|_| random(4) < keep);
            DrawSource::Hybrid(list)
        });
        let draws: Vec<_> = sources.iter().map(|source| (Similarity::IDENTITY, source)).collect();
        renderer.set_budget((frame % 4 > 0).then(|| least + (random(10) << 18)));
        match renderer.picture(&Frame { camera, look: Look::default(), draws: draws.clone() }) {
            Ok(found) => {
                fresh.recover().unwrap();
                assert!(same(&found, &picture(&mut fresh, &camera, &draws)), "frame {frame}");
                drawn += 1;
            }
            Err(RenderError::Budget { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
    assert!(drawn > 8, "{drawn}");
}

#[test]
fn a_node_without_anything_is_nothing() {
    let Some(mut renderer) = renderer() else { return };
    let soup = cube();
    let grid = Grid::around(&soup);
    let whole = soup.model(&grid, 1, Extra::default());
    let mut record = whole.record(0);
    (record.vertices, record.triangles, record.borders) = (0, 0, 0);
    let model = Model::new(&grid, false, vec![(record, gigalod_format::hybrid::Page::default())]);
    let draw = model.draw(0, true);
    let camera = orbit(&whole.bounds(), [30.0, 20.0], 1.0);
    let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
    assert!(drawn.depth.iter().all(|depth| *depth == f32::INFINITY));
}
