//! Every page and every record of a hybrid file, in the order of the file; needs no original.

use crate::verify::Problems;
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page, Skeleton};
use glam::DVec3;
use rayon::prelude::*;

/// What is known of a whole hierarchy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Structure {
    /// Triangles that are drawn at each level: of its nodes, and of leaves of the levels above.
    pub cuts: Vec<u64>,
    /// Nodes with children.
    pub inner: u64,
    /// Inner nodes that use less than three quarters of the error that they may have: nothing more of them could be simplified.
    pub spare: u64,
    /// The least part of it that an inner node uses; 1 where there is none.
    pub least_use: f64,
    /// Inner nodes with more than half of their children's triangles and points.
    pub full: u64,
    /// The least ratio of children's triangles and points to their parent's, and whose it is.
    pub least_ratio: Option<(f64, NodeId)>,
}

/// Below this part of the error that it may have, a node could have been simplified more.
const USED: f64 = 0.75;
/// Pages that are decoded side by side.
const AT_ONCE: usize = 256;
/// Cones are stored in steps, rounded outwards; this is for computing.
const SLACK: f64 = 1e-5;

/// Reads all of `file` and checks checksums, counts, places, cones, errors and links. `progress` is told the pages done.
pub fn check(file: &HybridFile, progress: &mut dyn FnMut(u64)) -> (Structure, Problems) {
    let mut problems = Problems::default();
    let nodes = file.skeleton().nodes().len() as u32;
    for first in (0..nodes).step_by(AT_ONCE) {
        let some: Vec<u32> = (first..nodes.min(first + AT_ONCE as u32)).collect();
        let found: Vec<Vec<String>> = some.par_iter().map(|node| check_page(file, NodeId(*node))).collect();
        found.into_iter().flatten().for_each(|problem| problems.add(|| problem));
        progress(u64::from(first) + some.len() as u64);
    }
    check_records(file.skeleton(), &mut problems);
    (summary(file.skeleton()), problems)
}

fn check_page(file: &HybridFile, node: NodeId) -> Vec<String> {
    let record = file.skeleton().record(node);
    let page = match file.read_page(node) {
        Ok(page) => page,
        Err(error) => return vec![error.to_string()],
    };
    let mut problems = Vec::new();
    let mut expect = |is_so: bool, problem: &dyn Fn() -> String| {
        if !is_so {
            problems.push(format!("page {node}: {}", problem()));
        }
    };
    let found = [page.positions.len(), page.triangles.len(), page.borders.len()];
    let expected = [record.vertices + record.points, record.triangles, record.borders].map(|count| count as usize);
    expect(found == expected, &|| format!("{found:?} positions, triangles and borders, expected {expected:?}"));
    let per_position = [page.normals.len(), page.colors.len()];
    let count = page.positions.len();
    let colors = if file.skeleton().root().has_colors { count } else { 0 };
    expect(per_position == [count, colors], &|| {
        format!("{per_position:?} normals and colours, expected {:?}", [count, colors])
    });
    let outside = page.positions.iter().filter(|at| (0..3).any(|axis| at[axis] > record.extent_steps[axis])).count();
    expect(outside == 0, &|| format!("{outside} vertices and points outside the node's box, expected none"));
    let beyond = page.triangles.as_flattened().iter().filter(|corner| **corner >= record.vertices).count();
    expect(beyond == 0, &|| format!("{beyond} corners are no vertices, expected none"));
    if beyond == 0 && found == expected {
        let borders = borders(&page);
        expect(borders == found[2], &|| format!("{} borders, expected {borders} edges of one triangle", found[2]));
        let hidden = outside_cone(&page, record);
        expect(hidden == 0, &|| format!("{hidden} triangles whose normal the node's cone leaves out, expected none"));
    }
    problems
}

/// Edges of just one triangle. Sides whose ends are one vertex do not count.
fn borders(page: &Page) -> usize {
    let side = |[a, b]: [u32; 2]| (a != b).then_some([a.min(b), a.max(b)]);
    let sides = page.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    let mut sides: Vec<[u32; 2]> = sides.filter_map(side).collect();
    sides.sort_unstable();
    sides.chunk_by(|one, other| one == other).filter(|same| same.len() == 1).count()
}

fn outside_cone(page: &Page, record: &NodeRecord) -> usize {
    if record.cone_sine >= 1.0 {
        return 0;
    }
    // In steps, so that what has no area has no normal either.
    let at: Vec<DVec3> = page.positions.iter().map(|at| DVec3::from_array(at.map(f64::from))).collect();
    let axis = DVec3::from_array(record.cone_axis.map(f64::from));
    let least = (1.0 - f64::from(record.cone_sine).powi(2)).sqrt() - SLACK;
    let normals = page.triangles.iter().filter_map(|corners| {
        let [a, b, c] = corners.map(|corner| at[corner as usize]);
        (b - a).cross(c - a).try_normalize()
    });
    normals.filter(|normal| normal.dot(axis) < least).count()
}

fn children(record: &NodeRecord) -> std::ops::Range<usize> {
    record.first_child as usize..(record.first_child + record.children) as usize
}

/// Largest error of geometry that a node may have, model units.
fn allowed(skeleton: &Skeleton, record: &NodeRecord) -> f64 {
    skeleton.root().edge / 2f64.powi(record.level as i32) / f64::from(skeleton.root().resolution)
}

fn check_records(skeleton: &Skeleton, problems: &mut Problems) {
    let (root, records) = (skeleton.root(), skeleton.nodes());
    let mut next = 1;
    for (number, record) in records.iter().enumerate() {
        if record.children > 0 && children(record) != (next..next + record.children as usize) {
            problems.add(|| format!("node {number}: children from {}, expected from {next}", record.first_child));
            return;
        }
        next += record.children as usize;
        let Some(below) = records.get(children(record)).filter(|_| record.children <= 8) else {
            problems.add(|| format!("node {number}: {} children, expected at most 8 that are there", record.children));
            return;
        };
        for child in below {
            if child.level != record.level + 1 {
                problems
                    .add(|| format!("node {number}: a child of level {}, its own is {}", child.level, record.level));
            }
            if child.error_total > record.error_total {
                let (found, own) = (child.error_total, record.error_total);
                problems.add(|| format!("node {number}: a child's error is {found}, expected at most its own {own}"));
            }
        }
        let (geo, total, allowed) = (record.error_geo, record.error_total, allowed(skeleton, record));
        if geo > total {
            problems
                .add(|| format!("node {number}: an error of geometry of {geo}, expected at most the total {total}"));
        }
        // It is stored in parts of 255 of the total, rounded up.
        if f64::from(geo) > allowed * (1.0 + 1e-6) + f64::from(total) / 255.0 {
            problems.add(|| format!("node {number}: an error of geometry of {geo}, expected at most {allowed}"));
        }
    }
    let leaves = records.iter().filter(|record| record.children == 0).count() as u64;
    let levels = records.iter().map(|record| record.level + 1).max().unwrap_or(0);
    let found = (records.len() as u64, leaves, levels);
    let expected = (root.nodes, root.leaves, root.levels);
    if found != expected {
        problems.add(|| format!("nodes, leaves and levels are {found:?}, expected {expected:?}"));
    }
}

fn summary(skeleton: &Skeleton) -> Structure {
    let (root, records) = (skeleton.root(), skeleton.nodes());
    let mut out = Structure { cuts: vec![0; root.levels as usize], least_use: 1.0, ..Structure::default() };
    for (number, record) in (0..).zip(records) {
        let is_leaf = record.children == 0;
        let level = record.level as usize;
        let last = if is_leaf { out.cuts.len().max(level + 1) } else { level + 1 };
        out.cuts.iter_mut().take(last).skip(level).for_each(|cut| *cut += u64::from(record.triangles));
        if is_leaf {
            continue;
        }
        out.inner += 1;
        let used = f64::from(record.error_geo) / allowed(skeleton, record);
        out.spare += u64::from(used < USED);
        out.least_use = out.least_use.min(used);
        let held = |record: &NodeRecord| f64::from(record.triangles) + f64::from(record.points);
        let below: f64 = records.get(children(record)).unwrap_or_default().iter().map(held).sum();
        let ratio = if held(record) > 0.0 { below / held(record) } else { f64::INFINITY };
        out.full += u64::from(ratio < 2.0);
        if out.least_ratio.is_none_or(|(least, _)| ratio < least) {
            out.least_ratio = Some((ratio, NodeId(number)));
        }
    }
    out
}
