//! From nodes to the original: each triangle and point of a node must be near the original; and how far the normals are off.

use super::cut::places;
use super::sample::{LEAST_PARTS, area, grid, parts, point};
use super::tally::{Found, Tally, Way};
use crate::verify::measure::Steps;
use gigalod_format::FormatError;
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page};
use gigalod_reference::Bvh;
use glam::DVec3;
use rayon::prelude::*;

/// Nodes that one task measures: fixed, so that sums are, too.
const CHUNK: usize = 4;
/// Radians: nobody sees that, and stored normals are not much finer.
const UNSEEN: f64 = 0.012;

/// Of normals of inner nodes' triangles.
#[derive(Clone, Debug, Default)]
pub(super) struct Normals {
    /// How far from where they are right; model units.
    pub(super) lengths: Vec<f32>,
    /// The same as parts of the total error that is stored.
    pub(super) ratios: Vec<f32>,
}

/// Measures all chosen nodes.
///
/// # Errors
/// A page cannot be read.
pub(super) fn measure(
    file: &HybridFile,
    chosen: &[NodeId],
    original: &Bvh<'_>,
    tally: &Tally<'_>,
    steps: &Steps<'_>,
) -> Result<(Found, Normals), FormatError> {
    let chunk = |nodes: &[NodeId]| -> Result<_, FormatError> {
        let mut out = (Found::default(), Normals::default());
        for node in nodes {
            let page = file.read_page(*node)?;
            let record = tally.record(*node);
            let at = places(&page, record, file.skeleton());
            add(&mut out.0, *node, (&page, &at), original, tally, steps);
            if record.children > 0 {
                let bits = file.skeleton().root().normal_bits;
                let edge = file.skeleton().root().edge / 2f64.powi(record.level as i32);
                let normals: Vec<DVec3> = page.normals.iter().map(|code| normal(*code, bits)).collect();
                add_normals(&mut out.1, record, (&page, &at, &normals), edge, original);
            }
        }
        Ok(out)
    };
    let found: Vec<(Found, Normals)> = chosen.par_chunks(CHUNK).map(chunk).collect::<Result<_, _>>()?;
    let mut all = (Found::default(), Normals::default());
    for (found, normals) in found {
        all.0.join(found);
        all.1.lengths.extend(normals.lengths);
        all.1.ratios.extend(normals.ratios);
    }
    Ok(all)
}

fn add(
    found: &mut Found,
    node: NodeId,
    (page, at): (&Page, &[DVec3]),
    original: &Bvh<'_>,
    tally: &Tally<'_>,
    steps: &Steps<'_>,
) {
    let record = tally.record(node);
    let is_leaf = record.children == 0;
    // Places that follow each other lie side by side. What is nearer than another place of an inner node tells nothing; of leaves,
    // means are told as well.
    let mut last = None;
    let mut distance = |at: DVec3| {
        let enough = if is_leaf { 0.0 } else { tally.largest(node) };
        original.near_point(at, last, enough).map_or(f64::MAX, |near| {
            last = Some(near.triangle);
            near.distance
        })
    };
    for corners in &page.triangles {
        steps.step();
        let corners = corners.map(|corner| at[corner as usize]);
        let parts = if is_leaf { LEAST_PARTS } else { parts(corners, f64::from(record.error_geo)) };
        let weight = if is_leaf { area(corners) } else { 0.0 };
        for (weights, share) in grid(parts) {
            let at = point(corners, weights);
            found.add(tally, node, Way::Backward, at, distance(at), weight * share);
        }
    }
    for at in &at[record.vertices as usize..] {
        found.add(tally, node, Way::Backward, *at, distance(*at), 0.0);
    }
}

/// The hybrid paper, section 3.1: the angle to the original's normal, divided by how fast normals turn on the triangle, is the
/// way to where the normal is right. Where they do not turn there is no such place; then, and where it is far away, it is the cell's
/// edge.
fn add_normals(
    out: &mut Normals,
    record: &NodeRecord,
    (page, at, normals): (&Page, &[DVec3], &[DVec3]),
    edge: f64,
    original: &Bvh<'_>,
) {
    for corners in &page.triangles {
        let places = corners.map(|corner| at[corner as usize]);
        let [a, b, c] = corners.map(|corner| normals[corner as usize]);
        let middle = point(places, [1.0 / 3.0; 3]);
        let (Some(own), Some(nearest)) = ((a + b + c).try_normalize(), original.nearest_point(middle)) else {
            continue;
        };
        let Some(right) = original.mesh().smooth_normal(nearest.triangle, nearest.barycentrics) else { continue };
        let turned = angle(own, right) - UNSEEN;
        let length = if turned <= 0.0 {
            0.0
        } else {
            let [p, q, r] = places;
            let rate =
                |one: DVec3, other: DVec3, length: f64| if length > 0.0 { angle(one, other) / length } else { 0.0 };
            let curvature = rate(a, b, p.distance(q)).max(rate(b, c, q.distance(r))).max(rate(c, a, r.distance(p)));
            // By 0 it is infinite, and then the edge.
            (turned / curvature).min(edge)
        };
        out.lengths.push(length as f32);
        out.ratios.push((length / f64::from(record.error_total)) as f32);
    }
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Unit vector of a code on the octahedron: |x| + |y| + |z| = 1, the lower half folded outward.
fn normal(code: u32, bits: u32) -> DVec3 {
    let most = f64::from((1u32 << bits) - 1);
    let [x, y] = [code & 0xFFFF, code >> 16].map(|code| f64::from(code) / most * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    DVec3::new(x, y, z).normalize()
}
