//! From the original to what is drawn of it: each triangle of the original must be near what is drawn at each level.
//!
//! A triangle is held against the error of the node that stands for it. How far it is from what is drawn may be measured to any node of
//! the level.

use super::cells::Cells;
use super::choice::Pass;
use super::cut::{Last, Near};
use super::sample::{LEAST_PARTS, area, ball, grid, parts, point};
use super::tally::{Found, Tally, Way};
use crate::verify::measure::Steps;
use gigalod_format::hybrid::NodeId;
use gigalod_reference::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles that one task measures: fixed, so that sums are, too.
const CHUNK: usize = 4096;

/// Measures the whole original, or what of it a pass asks for.
pub(super) fn measure(
    original: &Mesh,
    (pass, near): (&Pass, &Near<'_>),
    cells: &Cells<'_>,
    tally: &Tally<'_>,
    steps: &Steps<'_>,
) -> Found {
    let chunk = |triangles: &[[u32; 3]]| {
        let (mut found, mut last) = (Found::default(), Last::default());
        for triangle in triangles {
            steps.step();
            let corners = triangle.map(|corner| original.positions()[corner as usize]);
            add((&mut found, &mut last), corners, (pass, near), cells, tally);
        }
        found
    };
    let found: Vec<Found> = original.triangles().par_chunks(CHUNK).map(chunk).collect();
    found.into_iter().fold(Found::default(), |mut all, found| {
        all.join(found);
        all
    })
}

fn add(
    (found, last): (&mut Found, &mut Last),
    corners: [DVec3; 3],
    (pass, near): (&Pass, &Near<'_>),
    cells: &Cells<'_>,
    tally: &Tally<'_>,
) {
    let (middle, radius) = ball(corners);
    if pass.region.as_ref().is_some_and(|region| !region.holds(middle)) {
        return;
    }
    // Where nothing is drawn at all, whoever is first answers for it.
    let known = cells.node(corners, pass.level);
    let enough = known.map_or(0.0, |node| (tally.largest(node) - radius).max(0.0));
    let (distance, nearest) = near.near(middle, last, enough).unwrap_or_else(|| nothing(pass));
    let node = known.unwrap_or(nearest);
    // A triangle so large may have been cut: then whoever's cell a part lies in stands for it.
    if radius > cells.edge(node) / 2.0 {
        return add_large((found, last), corners, node, (pass, near), cells, tally);
    }
    let record = tally.record(node);
    let is_leaf = record.children == 0;
    if is_leaf != pass.level.is_none() {
        return;
    }
    // No point of the triangle can be farther away than that.
    if !is_leaf && distance + radius <= tally.largest(node) {
        return;
    }
    // A leaf's error is a fraction of its triangles' size, everywhere.
    let parts = if is_leaf { LEAST_PARTS } else { parts(corners, f64::from(record.error_geo)) };
    let weight = if is_leaf { area(corners) } else { 0.0 };
    for (weights, share) in grid(parts) {
        let at = point(corners, weights);
        // Of leaves, means are told as well.
        let enough = if is_leaf { 0.0 } else { tally.largest(node) };
        let (distance, _) = near.near(at, last, enough).unwrap_or_else(|| nothing(pass));
        found.add(tally, node, Way::Forward, at, distance, weight * share);
    }
}

/// Holds each part against the larger error of two nodes: that with the triangle's middle in its cell, and that with the part.
fn add_large(
    (found, last): (&mut Found, &mut Last),
    corners: [DVec3; 3],
    whole: NodeId,
    (pass, near): (&Pass, &Near<'_>),
    cells: &Cells<'_>,
    tally: &Tally<'_>,
) {
    let is_leaf = pass.level.is_none();
    let is_measured = |node: &NodeId| (tally.record(*node).children == 0) == is_leaf;
    let error = |node: &NodeId| tally.record(*node).error_geo;
    let parts = if is_leaf { LEAST_PARTS } else { parts(corners, f64::from(error(&whole))) };
    let weight = if is_leaf { area(corners) } else { 0.0 };
    for (weights, share) in grid(parts) {
        let at = point(corners, weights);
        let (distance, nearest) = near.near(at, last, 0.0).unwrap_or_else(|| nothing(pass));
        let part = cells.node_at(at, pass.level).unwrap_or(nearest);
        let larger = [part, whole].into_iter().filter(is_measured).max_by(|a, b| error(a).total_cmp(&error(b)));
        if let Some(node) = larger {
            found.add(tally, node, Way::Forward, at, distance, weight * share);
        }
    }
}

fn nothing(pass: &Pass) -> (f64, NodeId) {
    (f64::MAX, pass.nodes[0])
}
