//! Hybrid cuts beside a plain recursion: complete, no coarser than asked for, honest about it, whatever is missing or damaged.

mod common;

use common::octree::{CELL_BITS, Octree, RADIUS, leaves_below, open};
use gigalod_format::hybrid::{NodeId, NodeRecord, Root};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Camera, ImageSize, projected};
use gigalod_runtime::hybrid::{CHECK_NODES, CROSS_FADE, RANKS};
use gigalod_runtime::residency::InlineLoader;
use gigalod_runtime::splats::Cutting;
use gigalod_runtime::{
    CutReport, DrawSource, FileId, Fineness, HybridSelector, Instance, InstanceId, Interrupt, Limit, ModelView,
    Outcome, Residency, Scene, SelectInput, Selection, Selector, Similarity, Target, ViewId,
};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

const VIEW: ViewId = ViewId(0);
const SIZE: ImageSize = ImageSize { width: 400, height: 300 };

/// Azimuth, zoom.
const POSES: [(f64, f64); 6] = [(0.0, 1.0), (35.0, 0.3), (110.0, 2.0), (200.0, 8.0), (290.0, 30.0), (75.0, 0.02)];

fn scene(octree: &Octree, budget_bytes: u64) -> Scene {
    let mut residency = Residency::new(budget_bytes, Box::<InlineLoader>::default());
    let file = residency.add(octree.file());
    let mut scene = Scene::new(residency);
    scene.add(Instance { file, placement: Similarity::IDENTITY });
    scene
}

fn camera(scene: &Scene, (azimuth_deg, zoom): (f64, f64)) -> Camera {
    Camera::orbit(&scene.bounds(), UpAxis::Y, [azimuth_deg, 12.0], zoom, 0.7, SIZE)
}

/// Nodes that the last cut draws.
fn drawn(scene: &Scene) -> BTreeMap<NodeId, bool> {
    let (_, selection) = scene.draws(VIEW).next().expect("one instance");
    let DrawSource::Hybrid(list) = &selection.draw else { panic!("{:?}", selection.draw) };
    assert!(list.nodes.is_sorted_by_key(|node| node.node), "in order");
    let nodes: BTreeMap<_, _> = list.nodes.iter().map(|node| (node.node, node.draws_lines)).collect();
    assert_eq!(nodes.len(), list.nodes.len(), "none is drawn twice");
    nodes
}

/// How the judge sees a node.
#[derive(Clone, Copy, Debug)]
struct Judged {
    /// By its corners; no pixel shows anything of it or of what is below.
    is_outside: bool,
    /// By its corners.
    error_px: f64,
}

/// The eight corners of a node's box with `pad` around it; view space.
fn corners(root: &Root, record: &NodeRecord, camera: &Camera, pad: f64) -> [DVec3; 8] {
    let step = root.edge / f64::from(1u32 << CELL_BITS) / 2f64.powi(record.level as i32);
    std::array::from_fn(|corner| {
        let at = |axis: usize| {
            let min = f64::from(record.min_steps[axis]);
            match corner >> axis & 1 {
                0 => min * step - pad,
                _ => (min + f64::from(record.extent_steps[axis])) * step + pad,
            }
        };
        camera.view_point(root.origin + DVec3::new(at(0), at(1), at(2)))
    })
}

fn judge(octree: &Octree, camera: &Camera, node: NodeId) -> Judged {
    let record = &octree.records[node.0 as usize];
    let (tan, geo) = (camera.tan_half_fov(), f64::from(record.error_geo));
    let below = if record.children > 0 { f64::from(record.error_total) } else { 0.0 };
    let spacing = f64::from(record.spacing);
    let padded = corners(&octree.root, record, camera, geo + below + spacing * 0.5);
    let sides: [fn(DVec3, f64, f64) -> f64; 5] = [
        |at, x, _| at.z * x + at.x,
        |at, x, _| at.z * x - at.x,
        |at, _, y| at.z * y + at.y,
        |at, _, y| at.z * y - at.y,
        |at, _, _| at.z,
    ];
    let is_outside = sides.iter().any(|side| padded.iter().all(|at| side(*at, tan.x, tan.y) < 0.0));
    // Of the original, so far around the corners that points cover it.
    let around = geo + spacing * 0.5;
    let shown = corners(&octree.root, record, camera, around);
    let depth = shown.iter().map(|at| at.z).fold(f64::INFINITY, f64::min);
    let most = |along: fn(&DVec3) -> f64| shown.iter().map(along).fold(0.0, f64::max);
    let slope = match depth > 0.0 {
        true => (most(|at| at.x.abs()).hypot(most(|at| at.y.abs())) / depth).min(tan.length()),
        false => tan.length(),
    };
    // The nearest point of the box, in the model's axes.
    let step = octree.root.edge / f64::from(1u32 << CELL_BITS) / 2f64.powi(record.level as i32);
    let min = octree.root.origin + DVec3::from_array(record.min_steps.map(f64::from)) * step - around;
    let max = min + DVec3::from_array(record.extent_steps.map(f64::from)) * step + 2.0 * around;
    let nearest = (camera.eye.clamp(min, max) - camera.eye).length();
    let depth = depth.max(nearest / slope.hypot(1.0));
    let error_px = projected::shift_px(slope, depth, f64::from(record.error_total), camera.focal_px());
    Judged { is_outside, error_px }
}

/// What a plain recursion draws, where all pages are there: nodes, and how many of those it leaves out for the picture's edge.
fn plain(octree: &Octree, camera: &Camera, threshold_px: f64, node: NodeId, out: &mut (BTreeSet<NodeId>, u64)) {
    let (record, judged) = (&octree.records[node.0 as usize], judge(octree, camera, node));
    if judged.is_outside {
        out.1 += 1;
    } else if judged.error_px > threshold_px && record.children > 0 {
        (0..record.children).for_each(|at| {
            plain(octree, camera, threshold_px, NodeId(record.first_child + at), out);
        });
    } else {
        out.0.insert(node);
    }
}

fn all_resident(octree: &Octree) -> Scene {
    let mut scene = scene(octree, 1 << 30);
    let cutting = Cutting { frustum_culling: false, ..Cutting::default() };
    scene.hybrid_mut().cutting = cutting;
    let camera = camera(&scene, (0.0, 1.0));
    scene.select_converged(VIEW, &camera, &Fineness::px(0.0));
    assert_eq!(drawn(&scene).len() as u64, octree.root.leaves, "all leaves");
    scene.hybrid_mut().cutting = Cutting::default();
    scene
}

#[test]
fn a_cut_is_that_of_a_plain_recursion_and_its_report_is_true() {
    let octree = Octree::sphere(7, false);
    let mut scene = all_resident(&octree);
    let mut told_by_page = 0;
    let far = POSES.map(|pose| camera(&scene, pose));
    // In front of the surface, and turned away from its nearest point.
    let (center, out) = (scene.bounds().center(), DVec3::new(0.3, 0.5, 0.8).normalize());
    let near = [1.0005, 1.01].map(|radii| {
        let eye = center + out * (RADIUS * radii);
        Camera::look_at(eye, eye + DVec3::new(1.0, -0.6, -0.3), DVec3::Y, 0.7, SIZE)
    });
    for (at, camera) in far.iter().chain(&near).enumerate() {
        for threshold_px in [0.0, 0.25, 0.5, 1.0, 4.0, 40.0, f32::INFINITY] {
            let report = scene.select(VIEW, camera, &Fineness::px(threshold_px));
            scene.serve();
            let mut expected = (BTreeSet::new(), 0);
            plain(&octree, camera, f64::from(threshold_px), NodeId(0), &mut expected);
            let nodes = drawn(&scene);
            assert!(nodes.keys().eq(&expected.0), "view {at} at {threshold_px} px");
            let sum = |of: fn(&NodeRecord) -> u32| {
                nodes.keys().map(|node| u64::from(of(&octree.records[node.0 as usize]))).sum::<u64>()
            };
            let worst = nodes.keys().map(|node| judge(&octree, camera, *node).error_px).fold(0.0, f64::max);
            assert_eq!(report.drawn, nodes.len() as u64);
            assert_eq!((report.triangles, report.points), (sum(|at| at.triangles), sum(|at| at.points)));
            assert_eq!((report.culled_frustum, report.culled_backface), (expected.1, 0));
            let told = f64::from(report.max_error_px);
            let is_that = |worst: f64| told == worst || (told / worst - 1.0).abs() < 1e-6;
            // By its box a leaf around the eye could be anywhere.
            let by_box = nodes.is_empty() || is_that(worst);
            let by_page = at >= POSES.len() && worst > f64::from(threshold_px) && told < worst;
            assert!(by_box || by_page && told >= least_error_px(&scene, camera), "{report:?}");
            assert_eq!(report.limited_by, (told > f64::from(threshold_px)).then_some(Limit::Data));
            told_by_page += u32::from(by_page);
            assert!(!report.inconsistent && report.visited <= octree.root.nodes);
        }
    }
    assert!(told_by_page > 0);
}

/// What a frame has for an error at least: that of the vertices that the picture shows.
fn least_error_px(scene: &Scene, camera: &Camera) -> f64 {
    let (_, selection) = scene.draws(VIEW).next().expect("one instance");
    let DrawSource::Hybrid(list) = &selection.draw else { panic!("{:?}", selection.draw) };
    let skeleton = list.hybrid.as_ref().unwrap().skeleton();
    let errors_px = list.nodes.iter().flat_map(|drawn| {
        let record = skeleton.record(drawn.node);
        drawn.page.positions.iter().filter_map(|at| {
            let steps =
                DVec3::from_array(std::array::from_fn(|axis| f64::from(at[axis]) + f64::from(record.min_steps[axis])));
            let at = camera.view_point(skeleton.root().origin + steps * skeleton.step(record.level));
            let pixel = camera.pixel_of_view_point(at);
            let [width, height] = [SIZE.width, SIZE.height].map(f64::from);
            let is_in = at.z > 0.0 && (0.0..width).contains(&pixel.x) && (0.0..height).contains(&pixel.y);
            is_in.then(|| f64::from(record.error_total) * camera.focal_px() / at.z)
        })
    });
    errors_px.fold(0.0, f64::max)
}

/// Each leaf is below one drawn node, or below one that is out of sight or wholly shows its back.
fn assert_complete(octree: &Octree, camera: &Camera, nodes: &BTreeMap<NodeId, bool>) {
    let mut reached = BTreeMap::<NodeId, u32>::new();
    for leaf in nodes.keys().flat_map(|node| leaves_below(&octree.records, *node)) {
        *reached.entry(leaf).or_default() += 1;
    }
    assert!(reached.values().all(|times| *times == 1), "no leaf is drawn twice");
    fn walk(octree: &Octree, camera: &Camera, node: NodeId, reached: &BTreeMap<NodeId, u32>) {
        if judge(octree, camera, node).is_outside {
            return;
        }
        let record = &octree.records[node.0 as usize];
        if record.children > 0 {
            (0..record.children).for_each(|at| walk(octree, camera, NodeId(record.first_child + at), reached));
        } else {
            assert!(reached.contains_key(&node), "leaf {node} is in sight and not drawn");
        }
    }
    walk(octree, camera, NodeId(0), &reached);
}

#[test]
fn of_each_rank_of_pixels_a_cross_fade_shows_a_whole_cut_within_the_threshold() {
    let octree = Octree::sphere(7, false);
    let mut scene = all_resident(&octree);
    scene.set_cross_fade(true);
    let mut fading = 0;
    for pose in POSES {
        let camera = camera(&scene, pose);
        for threshold_px in [0.0, 0.5, 1.0, 4.0, 40.0, f32::INFINITY] {
            let report = scene.select(VIEW, &camera, &Fineness::px(threshold_px));
            scene.serve();
            let (_, selection) = scene.draws(VIEW).next().expect("one instance");
            let DrawSource::Hybrid(list) = &selection.draw else { panic!("{:?}", selection.draw) };
            let shown =
                |rank: u8| list.nodes.iter().filter(move |node| (node.ranks.from..node.ranks.end).contains(&rank));
            for rank in 0..RANKS {
                assert_complete(&octree, &camera, &shown(rank).map(|node| (node.node, node.draws_lines)).collect());
            }
            for node in &list.nodes {
                let record = &octree.records[node.node.0 as usize];
                let error_px = judge(&octree, &camera, node.node).error_px as f32;
                assert!(record.children == 0 || error_px <= threshold_px && error_px <= report.max_error_px);
                // The nearer to the threshold, the fewer; below, all that the parent has left.
                let begins_px = threshold_px * (1.0 - CROSS_FADE);
                if record.children > 0 && error_px > begins_px && threshold_px.is_finite() {
                    let kept = f32::from(RANKS) * (threshold_px - error_px) / (threshold_px - begins_px);
                    assert_eq!(node.ranks.end, RANKS);
                    assert!((f32::from(node.ranks.end - node.ranks.from) - kept).abs() <= 1.01, "{node:?} {kept}");
                    fading += 1;
                }
            }
        }
    }
    assert!(fading > 20, "{fading}");
}

#[test]
fn where_pages_are_missing_parents_are_drawn_and_children_requested_until_nothing_is_missing() {
    let octree = Octree::sphere(6, false);
    let mut scene = scene(&octree, 1 << 30);
    let camera = camera(&scene, (20.0, 2.0));
    let first = scene.select(VIEW, &camera, &Fineness::px(0.5));
    assert_eq!((first.drawn, first.max_error_px), (0, f32::INFINITY), "there is nothing to draw from");
    assert_eq!(first.limited_by, Some(Limit::Residency));
    let mut rounds = 0;
    loop {
        scene.serve();
        while scene.residency().is_loading() {
            scene.residency_mut().receive(true);
        }
        let report = scene.select(VIEW, &camera, &Fineness::px(0.5));
        let nodes = drawn(&scene);
        assert_complete(&octree, &camera, &nodes);
        let (_, selection) = scene.draws(VIEW).next().unwrap();
        let wanted: BTreeMap<_, _> = selection.requests.iter().map(|wish| (wish.key.page.0, wish.benefit)).collect();
        for node in nodes.keys() {
            let record = &octree.records[node.0 as usize];
            let error_px = judge(&octree, &camera, *node).error_px;
            if error_px <= 0.5 || record.children == 0 {
                continue;
            }
            let mut is_missing = false;
            for child in record.first_child..record.first_child + record.children {
                let is_there = scene.residency().node(FileId(0), NodeId(child)).is_some();
                let in_sight = !judge(&octree, &camera, NodeId(child)).is_outside;
                assert_eq!(wanted.contains_key(&child), in_sight && !is_there, "child {child} of {node}");
                is_missing |= in_sight && !is_there;
                if let Some(benefit) = wanted.get(&child) {
                    assert!((f64::from(*benefit) / error_px.min(1e6) - 1.0).abs() < 1e-5);
                }
            }
            assert!(is_missing, "{node} is too coarse, and its children are there");
        }
        assert_eq!(report.limited_by == Some(Limit::Residency), !wanted.is_empty());
        rounds += 1;
        if wanted.is_empty() {
            break;
        }
    }
    assert!((4..=8).contains(&rounds), "a level a round: {rounds}");
}

#[test]
fn what_is_interrupted_looks_at_few_more_nodes_and_keeps_no_pages() {
    let octree = Octree::sphere(7, false);
    let scene = all_resident(&octree);
    let interrupt = Interrupt::default();
    let view = ModelView::new(&camera(&scene, (0.0, 1.0)), &Similarity::IDENTITY);
    let input = SelectInput::px(FileId(0), view, 0.0, &interrupt, scene.residency());
    let target = Target { instance: InstanceId(7), view: VIEW };
    let (mut selector, mut selection) = (HybridSelector::default(), Selection::default());
    assert_eq!(selector.select(target, &input, &mut selection), Outcome::Complete);
    assert!(selection.report.visited > 4 * CHECK_NODES);
    interrupt.set();
    assert_eq!(selector.select(target, &input, &mut selection), Outcome::Interrupted);
    assert!(selection.report.visited <= CHECK_NODES + 8, "{:?}", selection.report);
    let DrawSource::Hybrid(list) = &selection.draw else { panic!("{:?}", selection.draw) };
    assert!(list.nodes.is_empty());
}

#[test]
fn a_damaged_page_is_told_and_its_parent_is_drawn() {
    let octree = Octree::sphere(5, false);
    let intact = octree.file();
    let last = NodeId(octree.records.len() as u32 - 1);
    let mut bytes = octree.bytes();
    bytes[intact.skeleton().page_offset(last) as usize + 40] ^= 0x10;
    let mut residency = Residency::new(1 << 30, Box::<InlineLoader>::default());
    let file = residency.add(open(bytes));
    let mut scene = Scene::new(residency);
    scene.add(Instance { file, placement: Similarity::IDENTITY });
    let camera = camera(&scene, (0.0, 0.5));
    let report = scene.select_converged(VIEW, &camera, &Fineness::px(0.0));
    let damaged: Vec<_> = scene.residency().damaged().map(|(key, why)| (key.page, why.to_string())).collect();
    assert_eq!(damaged.len(), 1);
    assert_eq!(damaged[0].0, last.into());
    assert!(damaged[0].1.starts_with(&format!("page {last} has checksum")), "{}", damaged[0].1);
    let parent = octree.records.iter().position(|record| {
        record.children > 0 && (record.first_child..record.first_child + record.children).contains(&last.0)
    });
    let nodes = drawn(&scene);
    assert!(nodes.contains_key(&NodeId(parent.unwrap() as u32)) && !nodes.contains_key(&last));
    assert_complete(&octree, &camera, &nodes);
    assert_eq!(report.limited_by, Some(Limit::Residency));
    assert!(!report.inconsistent);
}

#[test]
fn of_a_closed_model_what_wholly_shows_its_back_is_left_out_and_nothing_else_changes() {
    let (open, closed) = (Octree::sphere(6, false), Octree::sphere(6, true));
    let (mut all, mut front) = (all_resident(&open), scene(&closed, 1 << 30));
    let mut left_out = 0;
    for pose in [(0.0, 1.0), (120.0, 0.5), (200.0, 1.5)] {
        let camera = camera(&all, pose);
        for threshold_px in [0.5, 2.0] {
            let with = all.select(VIEW, &camera, &Fineness::px(threshold_px));
            front.select_converged(VIEW, &camera, &Fineness::px(threshold_px));
            let without = front.select(VIEW, &camera, &Fineness::px(threshold_px));
            let (everything, seen) = (drawn(&all), drawn(&front));
            let hidden: Vec<_> = everything.keys().filter(|node| !seen.contains_key(node)).collect();
            assert!(seen.keys().all(|node| everything.contains_key(node)), "{pose:?}");
            assert_eq!(hidden.len() as u64, without.culled_backface);
            assert_eq!(with.drawn, without.drawn + without.culled_backface);
            for node in hidden {
                let record = &closed.records[node.0 as usize];
                assert_eq!(record.points, 0);
                // Beyond the horizon of the sphere itself.
                let towards = DVec3::from_array(record.cone_axis.map(f64::from));
                assert!(towards.dot(camera.eye - closed.root.bounds.center()) < RADIUS);
            }
            left_out += without.culled_backface;
        }
    }
    assert!(left_out > 100, "{left_out}");
    // From inside its bounds all of it may show.
    let inside = Camera::look_at(closed.root.bounds.center(), closed.root.origin, DVec3::Y, 1.2, SIZE);
    let report = front.select_converged(VIEW, &inside, &Fineness::px(0.5));
    assert_eq!(report.culled_backface, 0);
}

#[test]
fn lines_are_drawn_over_borders_but_not_of_leaves_without_anything_finer_beside_them() {
    let octree = Octree::sphere(6, false);
    let mut uneven = all_resident(&octree);
    let report: CutReport = uneven.select(VIEW, &camera(&uneven, (0.0, 1.0)), &Fineness::px(0.5));
    let nodes = drawn(&uneven);
    let borders = |node: &NodeId| u64::from(octree.records[node.0 as usize].borders);
    let record = |node: &NodeId| &octree.records[node.0 as usize];
    let deepest = nodes.keys().map(|node| record(node).level).max().unwrap();
    let expected = |node: &NodeId| borders(node) > 0 && (record(node).children > 0 || record(node).level < deepest);
    assert!(nodes.iter().all(|(node, lines)| *lines == expected(node)));
    assert_eq!(report.lines, nodes.keys().filter(|node| expected(node)).map(borders).sum::<u64>());
    assert!(report.lines > 0);
    let leaves_with = nodes.keys().filter(|node| record(node).children == 0).map(expected);
    assert_eq!(leaves_with.collect::<std::collections::BTreeSet<_>>().len(), 2, "of both kinds");
    // Three levels are even.
    let even = Octree::sphere(3, false);
    assert!(even.records.iter().all(|record| record.children > 0 || record.level == 2));
    let mut leaves = all_resident(&even);
    let report = leaves.select(VIEW, &camera(&leaves, (0.0, 1.0)), &Fineness::px(0.0));
    assert!(drawn(&leaves).values().all(|lines| !lines) && report.lines == 0 && report.drawn > 20);
}

#[test]
fn records_that_lie_end_in_a_picture_that_says_so() {
    let honest = Octree::sphere(5, false);
    let inner = honest.records.iter().rposition(|record| record.children > 0).unwrap();
    /// What it says of a record.
    type Lie = fn(&mut NodeRecord);
    // Where children are, the format has no numbers to lie with.
    let lies: [(&str, Lie); 2] = [
        ("no cone", |record| (record.cone_axis, record.cone_sine) = ([f32::NAN; 3], f32::NAN)),
        ("no number", |record| (record.error_geo, record.error_total) = (f32::NAN, f32::NAN)),
    ];
    for (name, lie) in lies {
        for at in [0, inner] {
            let mut octree = honest.clone();
            lie(&mut octree.records[at]);
            let bytes = octree.bytes();
            let container =
                gigalod_format::Container::open(std::sync::Arc::new(gigalod_format::MemoryStore::new(bytes)));
            // Refused when it is opened, or drawn as far as it goes.
            let Ok(file) = gigalod_format::hybrid::HybridFile::open(container.unwrap()) else { continue };
            let mut residency = Residency::new(1 << 30, Box::<InlineLoader>::default());
            let file = residency.add(std::sync::Arc::new(file));
            let mut scene = Scene::new(residency);
            scene.add(Instance { file, placement: Similarity::IDENTITY });
            for pose in POSES {
                let camera = camera(&scene, pose);
                for most_splats in [u64::MAX, 3000] {
                    let report = scene.select_converged(VIEW, &camera, &Fineness { most_splats, ..Fineness::px(0.25) });
                    assert!(report.visited <= octree.root.nodes, "{name}");
                    drawn(&scene);
                }
            }
        }
    }
}
