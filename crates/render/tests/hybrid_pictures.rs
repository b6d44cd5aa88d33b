//! Nodes of triangles, points and lines against the ray tracer, and that every way of drawing them shows the same.
//!
//! With `GIGALOD_PICTURES` set to a folder, what was drawn lies there as PPM files.

mod drawing;
mod models;

use drawing::{FOV, SIZE, orbit, picture, renderer, renderer_at, same, show};
use gigalod_geom::Camera;
use gigalod_reference::judge::{Drawn, judge};
use gigalod_reference::raytrace::supersampled_coverage;
use gigalod_reference::{Bvh, Mesh, Shading, Truth, shade};
use gigalod_render::{GpuLevel, Lighting, Picture};
use gigalod_runtime::splats::MATERIAL_SRGB;
use gigalod_runtime::{DrawSource, Similarity};
use glam::{DQuat, DVec3, Vec3};
use models::{Extra, Grid, Model, Soup, cube, wavy};

/// Judges a picture, and how far depths and colours are off where neighbours are of one surface.
fn compare(name: &str, mesh: &Mesh, camera: &Camera, drawn: &Picture, threshold_px: f64) {
    show(name, drawn);
    let bvh = Bvh::build(mesh);
    let truth = Truth::trace(&bvh, camera, MATERIAL_SRGB);
    let touched = supersampled_coverage(&bvh, camera, 4);
    let footprint = Some(&drawn.footprint_px[..]);
    let verdict = judge(&truth, &touched, &Drawn { depth: &drawn.depth, data_footprint_px: footprint }, threshold_px);
    let (holes, fat) = (verdict.holes.len(), verdict.fat.len());
    assert!(
        holes == 0 && fat == 0,
        "{name}: {holes} holes, {fat} fat; {:?} {:?}",
        verdict.holes.first(),
        verdict.fat.first()
    );
    // What only one of them covers: where an edge passes within the rounding of a pixel's centre.
    let covered = truth.silhouette().count();
    let differing = (0..SIZE.pixels()).filter(|i| drawn.depth[*i].is_finite() != truth.surface[*i].is_some()).count();
    assert!(differing * 200 <= covered.max(200), "{name}: {differing} of {covered} pixels at the silhouette");
    let shading = Shading {
        to_light: camera.shoulder_light(),
        background_srgb: Lighting::default().background,
        plain_albedo_srgb: MATERIAL_SRGB,
    };
    let expected = shade::picture(&truth, &shading);
    let (mut far, mut off, mut most) = (0, 0, 0);
    for i in (0..SIZE.pixels()).filter(|i| verdict.judged.members[*i]) {
        let depth = truth.depth(i);
        // The plane of the triangle may be steep: what 1/200 of a pixel to the side would make.
        let point = truth.surface[i].unwrap();
        let facing = truth.ray(i).normalize().dot(point.flat_normal.as_dvec3()).abs().max(1e-3);
        let slack = depth / camera.focal_px() * (0.006 / facing) + depth * 1e-5;
        far += usize::from((f64::from(drawn.depth[i]) - depth).abs() > slack);
        // Grazing normals are turned in one way here and in another there.
        let leaning = truth.ray(i).normalize().dot(point.shading_normal.as_dvec3());
        if leaning < -0.02 {
            let difference = (0..3).map(|c| drawn.rgba[i * 4 + c].abs_diff(expected.pixels[i][c])).max().unwrap();
            off += usize::from(difference > 2);
            most = most.max(difference);
        }
    }
    let judged = verdict.judged.count();
    println!("{name}: {covered} covered, {differing} differ, {judged} judged, {far} far, {off} off, by up to {most}");
    assert!(far * 500 <= judged, "{name}: depth of {far} of {judged} pixels");
    assert!(off * 500 <= judged, "{name}: colour of {off} of {judged} pixels, by up to {most}");
}

#[test]
fn a_closed_surface_cut_into_nodes_is_what_the_ray_tracer_sees() {
    let Some(mut renderer) = renderer() else { return };
    let soup = wavy(60);
    let grid = Grid::around(&soup);
    let (mesh, model) = (soup.mesh(&grid), soup.model(&grid, 4, Extra::default()));
    assert!(model.pages.len() > 20);
    let draw = model.draw(0, false);
    for (name, orbit_deg, zoom) in [
        ("near", [30.0, 20.0], 2.5),
        ("whole", [0.0, 0.0], 1.0),
        ("above", [200.0, 85.0], 1.3),
        ("far", [77.0, -40.0], 0.1),
    ] {
        let camera = orbit(&mesh.bounds(), orbit_deg, zoom);
        let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
        compare(&format!("wavy_{name}"), &mesh, &camera, &drawn, 0.1);
    }
}

#[test]
fn from_within_and_through_the_plane_of_the_eye_nothing_is_missing() {
    let Some(mut renderer) = renderer() else { return };
    for (name, soup) in [("cube", cube()), ("wavy", wavy(40))] {
        let grid = Grid::around(&soup);
        let (mesh, model) = (soup.mesh(&grid), soup.model(&grid, 2, Extra::default()));
        let draw = model.draw(0, false);
        for (pose, eye, target) in [
            ("inside", DVec3::new(0.1, 0.2, -0.3), DVec3::new(1.0, 0.3, 0.2)),
            ("outside", DVec3::new(2.0, 1.7, 2.3), DVec3::ZERO),
            ("grazing", DVec3::new(-3.0, 1.02, 0.1), DVec3::new(0.0, 1.0, 0.0)),
            ("on_it", DVec3::new(-0.4, 1.001, 0.1), DVec3::new(1.0, 0.9, 0.0)),
            ("corner", DVec3::new(0.9999, 0.999, 0.998), DVec3::new(-1.0, 0.9, -0.2)),
        ] {
            let camera = Camera::look_at(eye, target, DVec3::Y, FOV, SIZE);
            let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
            compare(&format!("{name}_{pose}"), &mesh, &camera, &drawn, 0.1);
        }
    }
}

/// A plane of irregular triangles, farther than anybody sees, with more of them towards the middle.
fn plain(rings: u32) -> Soup {
    let mut soup = Soup::default();
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let n = rings + 1;
    for row in 0..n {
        for column in 0..n {
            let inner = |x: u32| if x > 0 && x < rings { random() * 0.9 } else { 0.0 };
            let [u, v] = [row, column].map({
                let mut inner = inner;
                move |x| (f64::from(x) + inner(x)) / f64::from(rings) * 2.0 - 1.0
            });
            let wide = |x: f64| 100.0 * x.powi(5) + x;
            soup.positions.push(DVec3::new(wide(u), 0.0, wide(v)));
            soup.normals.push(Vec3::Y);
        }
    }
    for row in 0..rings {
        for column in 0..rings {
            let at = |r: u32, c: u32| (row + r) * n + column + c;
            soup.triangles.extend([[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]]);
        }
    }
    soup
}

#[test]
fn neighbours_leave_no_pinhole_whatever_their_size_and_wherever_they_end() {
    let Some(mut renderer) = renderer() else { return };
    for rings in [1, 2, 9, 40, 300] {
        let soup = plain(rings);
        let grid = Grid::around(&soup);
        let model = soup.model(&grid, 3, Extra::default());
        let draw = model.draw(0, false);
        for (eye, target) in [
            (DVec3::new(0.3, 0.7, 0.2), DVec3::new(0.31, 0.0, 0.25)),
            (DVec3::new(0.3, 5.0, 0.2), DVec3::new(1.0, 0.0, 2.0)),
            (DVec3::new(0.0, 0.05, 0.0), DVec3::new(0.02, 0.0, 0.03)),
            (DVec3::new(0.0, 40.0, 0.0), DVec3::new(0.0, 0.0, 0.1)),
            (DVec3::new(0.0, -3.0, 0.0), DVec3::new(1.0, 0.0, 0.1)),
        ] {
            let camera = Camera::look_at(eye, target, DVec3::Z, FOV, SIZE);
            for extent in [0, 16, 60] {
                renderer.set_compute_extent(extent);
                let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
                if extent == 60 && rings < 20 {
                    compare(&format!("plain_{rings}_{}", eye.y), &soup.mesh(&grid), &camera, &drawn, 0.1);
                }
                let holes = drawn.depth.iter().filter(|depth| !depth.is_finite()).count();
                assert_eq!(holes, 0, "{rings} rings from {eye}, compute up to {extent} px");
            }
        }
    }
}

#[test]
fn triangles_and_points_far_below_a_pixel_are_what_lies_at_its_centre() {
    let Some(mut renderer) = renderer() else { return };
    let soup = wavy(300);
    let grid = Grid::around(&soup);
    let (mesh, model) = (soup.mesh(&grid), soup.model(&grid, 8, Extra::default()));
    let draw = model.draw(0, false);
    for (name, zoom) in [("tiny", 0.3), ("tinier", 0.05)] {
        let camera = orbit(&mesh.bounds(), [10.0, 30.0], zoom);
        let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
        compare(&format!("wavy_{name}"), &mesh, &camera, &drawn, 0.1);
    }
}

/// The wavy surface as points alone.
fn as_points(rows: u32) -> (Soup, f32) {
    let mut soup = wavy(rows);
    soup.triangles.clear();
    (soup, (std::f64::consts::PI * 2.2 / f64::from(rows)) as f32)
}

#[test]
fn points_as_large_as_they_are_apart_close_a_surface() {
    let Some(mut renderer) = renderer() else { return };
    let mesh = wavy(100).mesh(&Grid::around(&wavy(100)));
    let bvh = Bvh::build(&mesh);
    let (soup, spacing) = as_points(100);
    let model = soup.model(&Grid::around(&soup), 2, Extra { spacing, ..Extra::default() });
    let draw = model.draw(0, false);
    for (name, zoom) in [("points", 1.0), ("points_near", 3.0), ("points_far", 0.1)] {
        let camera = orbit(&mesh.bounds(), [30.0, 20.0], zoom);
        let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
        show(name, &drawn);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        let footprint = Some(&drawn.footprint_px[..]);
        let spacing_px = f64::from(spacing) * camera.focal_px() / (truth.depth(SIZE.pixels() / 2 + 240) * 0.8);
        let drawn = Drawn { depth: &drawn.depth, data_footprint_px: footprint };
        let verdict = judge(&truth, &touched, &drawn, spacing_px.max(1.0));
        assert!(verdict.is_clean(), "{name}: {:?} {:?}", verdict.holes.first(), verdict.fat.first());
    }
}

/// A model whose nodes are apart: each is shrunk towards its middle by a part of its error.
fn with_gaps(soup: &Soup, error: f64) -> (Mesh, Model) {
    let grid = Grid::around(soup);
    let mesh = soup.mesh(&grid);
    let whole = soup.model(&grid, 4, Extra { error_geo: error as f32, ..Extra::default() });
    let most = (error * 0.55 / grid.step()) as i32;
    let nodes = whole.pages.iter().enumerate().map(|(at, page)| {
        let record = whole.record(at);
        let mut page = (**page).clone();
        let on_border: std::collections::BTreeSet<u32> = page.borders.as_flattened().iter().copied().collect();
        for vertex in on_border {
            let place = &mut page.positions[vertex as usize];
            let half = record.extent_steps.map(|x| i32::from(x) / 2);
            let towards = DVec3::from_array(std::array::from_fn(|i| f64::from(half[i] - i32::from(place[i]))));
            let moved = towards.normalize_or_zero() * f64::from(most);
            *place = std::array::from_fn(|i| (i32::from(place[i]) + moved[i].round() as i32) as u16);
        }
        (record, page)
    });
    let model = Model::new(&grid, true, nodes.collect());
    (mesh, model)
}

#[test]
fn lines_close_the_gaps_between_nodes() {
    let Some(mut renderer) = renderer() else { return };
    for (name, zoom, error_px) in
        [("gaps", 1.0, 1.0), ("gaps_coarse", 1.0, 3.0), ("gaps_near", 2.0, 1.0), ("gaps_fine", 1.0, 0.3)]
    {
        let mesh = wavy(80).mesh(&Grid::around(&wavy(80)));
        let camera = orbit(&mesh.bounds(), [20.0, 15.0], zoom);
        // As large as the threshold at the nearest point.
        let nearest = Truth::trace(&Bvh::build(&mesh), &camera, MATERIAL_SRGB)
            .depths_f32()
            .into_iter()
            .fold(f32::INFINITY, f32::min);
        let (mesh, model) = with_gaps(&wavy(80), error_px * f64::from(nearest) / camera.focal_px());
        let bvh = Bvh::build(&mesh);
        let truth = Truth::trace(&bvh, &camera, MATERIAL_SRGB);
        let touched = supersampled_coverage(&bvh, &camera, 4);
        let (mut holes, mut beyond) = (Vec::new(), Vec::new());
        for draws_lines in [false, true] {
            let draw = model.draw(0, draws_lines);
            let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &draw)]);
            let is_beyond = |at: &usize| drawn.depth[*at].is_finite() && !touched.members[*at];
            beyond.push((0..drawn.depth.len()).filter(is_beyond).count());
            show(&format!("{name}_{draws_lines}"), &drawn);
            let verdict = judge(&truth, &touched, &Drawn { depth: &drawn.depth, data_footprint_px: None }, error_px);
            assert_eq!(verdict.fat.len(), 0, "{name}: fat {:?}", verdict.fat.first());
            // What is steep and a little to the side is a hole by the letter.
            let (grazing, holes_here): (Vec<_>, Vec<_>) = verdict.holes.into_iter().partition(|hole| hole.within_error);
            assert!(
                grazing.len() * 500 < verdict.judged.count() || !draws_lines,
                "{name}: {} {:?}",
                grazing.len(),
                grazing.first()
            );
            holes.push(holes_here);
        }
        println!("{name}: {} holes without lines", holes[0].len());
        assert!(!holes[0].is_empty(), "{name}: there is something to close");
        assert!(holes[1].is_empty(), "{name}: {} holes, {:?}", holes[1].len(), holes[1].first());
        println!("{name}: {beyond:?} pixels beyond the outline, without lines and with them");
        // Where a gap meets the outline it is closed too.
        assert!(
            beyond[1] <= beyond[0] + 5 + (15.0 * error_px) as usize,
            "{name}: {beyond:?}, lines close gaps and no more"
        );
    }
}

/// A level square, `rows` × `rows` quads, that faces upwards.
fn sheet(rows: u32) -> Soup {
    let mut soup = Soup::default();
    let place = |at: u32| 2.0 * f64::from(at) / f64::from(rows) - 1.0;
    for row in 0..=rows {
        for column in 0..=rows {
            soup.positions.push(DVec3::new(place(row), 0.0, place(column)));
            soup.normals.push(Vec3::Y);
        }
    }
    let at = |row: u32, column: u32| row * (rows + 1) + column;
    for (row, column) in (0..rows).flat_map(|row| (0..rows).map(move |column| (row, column))) {
        let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
        soup.triangles.extend([[a, b, c], [a, c, d]]);
    }
    soup
}

#[test]
fn lines_seen_from_behind_look_like_what_is_beside_them() {
    let Some(mut renderer) = renderer() else { return };
    // From below, and so flat that normals which point away are taken for those of a silhouette (light.wgsl, GRAZING).
    let camera = Camera::look_at(DVec3::new(0.0, -0.12, -1.6), DVec3::ZERO, DVec3::Y, FOV, SIZE);
    let (_, model) = with_gaps(&sheet(60), 3.0 / camera.focal_px());
    let [without, with] = [false, true].map(|draws_lines| {
        let drawn = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &model.draw(0, draws_lines))]);
        show(&format!("behind_{draws_lines}"), &drawn);
        drawn
    });
    let color = |picture: &Picture, at: usize| picture.rgba.as_chunks::<4>().0[at];
    let shown = |at: &usize| without.depth[*at].is_finite();
    let sheet = color(&without, (0..SIZE.pixels()).find(shown).expect("the sheet is in view"));
    let closed: Vec<usize> = (0..SIZE.pixels()).filter(|at| with.depth[*at].is_finite() && !shown(at)).collect();
    assert!(closed.len() > 100, "{} pixels of lines", closed.len());
    for at in closed {
        let of_line = color(&with, at);
        let off = std::iter::zip(of_line, sheet).map(|(a, b)| a.abs_diff(b)).max();
        assert!(off <= Some(2), "pixel {at} is {of_line:?}, the sheet {sheet:?}");
    }
}

#[test]
fn small_or_large_in_one_phase_or_two_all_ways_show_the_same() {
    let (Some(mut native), Some(mut baseline)) = (renderer(), renderer_at(GpuLevel::WebGpu)) else { return };
    assert!(!baseline.gpu().has_wide_keys());
    let (_, gaps) = with_gaps(&wavy(80), 0.01);
    let (points, spacing) = as_points(50);
    let points = points.model(&Grid::around(&points), 2, Extra { spacing, ..Extra::default() });
    let cube = cube().model(&Grid::around(&cube()), 1, Extra { error_geo: 0.01, ..Extra::default() });
    let turned = Similarity { position: DVec3::new(0.7, 0.1, 0.2), rotation: DQuat::from_rotation_x(0.4), scale: 0.8 };
    let sources = [gaps.draw(0, true), points.draw(1, false), cube.draw(2, true)];
    let draws = [(Similarity::IDENTITY, &sources[0]), (turned, &sources[1]), (turned, &sources[2])];
    let bounds = gaps.bounds();
    for (name, zoom) in [("ways", 1.0), ("ways_near", 3.0), ("ways_within", 30.0)] {
        let camera = orbit(&bounds, [30.0, 20.0], zoom);
        let expected = picture(&mut native, &camera, &draws);
        show(name, &expected);
        assert!(expected.depth.iter().filter(|depth| depth.is_finite()).count() > 1000);
        for extent in [0, 3, 16, 60] {
            for (bits, renderer) in [(64, &mut native), (32, &mut baseline)] {
                renderer.set_compute_extent(extent);
                let drawn = picture(renderer, &camera, &draws);
                assert!(same(&drawn, &expected), "{name}: {bits} bits, one invocation up to {extent} px");
            }
        }
    }
}

#[test]
fn splats_and_nodes_hide_each_other() {
    use gigalod_runtime::splats::{SplatList, SplatPiece};
    let Some(mut renderer) = renderer() else { return };
    let model = cube().model(&Grid::around(&cube()), 1, Extra::default());
    let camera = Camera::look_at(DVec3::Z * 6.0, DVec3::ZERO, DVec3::Y, FOV, SIZE);
    let mut piece = SplatPiece::default();
    // One before the cube, one behind it, which sticks out.
    for (center_in_eye, radius) in [([0.0, 0.0, -4.0], 0.3), ([0.0, 1.2, -8.0], 1.0)] {
        piece.push(gigalod_runtime::SplatBall { center_in_eye, radius }, 0xf800_0000);
    }
    let splats = DrawSource::Splats(SplatList { pieces: vec![piece] });
    let cube = model.draw(0, false);
    let both = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &splats), (Similarity::IDENTITY, &cube)]);
    let other = picture(&mut renderer, &camera, &[(Similarity::IDENTITY, &cube), (Similarity::IDENTITY, &splats)]);
    assert!(same(&both, &other));
    show("both", &both);
    let alone = [&splats, &cube].map(|draw| picture(&mut renderer, &camera, &[(Similarity::IDENTITY, draw)]));
    for i in 0..SIZE.pixels() {
        assert_eq!(both.depth[i], alone[0].depth[i].min(alone[1].depth[i]));
    }
}
