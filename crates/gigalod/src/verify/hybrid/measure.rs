//! How far nodes are from the original, both ways.

use super::cells::Cells;
use super::choice::{chosen, passes};
use super::cut::Cut;
use super::tally::{Found, Tally, Violation};
use super::{backward, forward};
use crate::verify::measure::Steps;
use gigalod_format::FormatError;
use gigalod_format::hybrid::{HybridFile, NodeId};
use gigalod_reference::{Bvh, Mesh};

/// Lengths are in model units.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Largest distance of a leaf, over both ways.
    pub hausdorff: f64,
    /// Root mean square distance of the leaves, by area; the larger of both ways.
    pub rms: f64,
    /// Largest ratio of a node's distance to its stored error; at most 1 in a sound file.
    pub worst_ratio: f64,
    /// Median of that over the inner nodes; of a file without any, over all.
    pub median_ratio: f64,
    /// How many nodes were measured.
    pub nodes: u64,
    /// 95 of 100 triangles of inner nodes have normals that are right within this length along the surface,
    pub normal_p95: f64,
    /// or within so many of their nodes' total errors.
    pub normal_ratio_p95: f64,
    /// Nodes beyond their stored error.
    pub violations: Vec<Violation>,
}

/// What [`against`] has to look at: triangles of the original, for each pass, and of nodes.
pub fn steps(file: &HybridFile, original: &Mesh) -> u64 {
    let skeleton = file.skeleton();
    let triangles = original.triangles().len();
    let chosen = chosen(skeleton.nodes(), triangles);
    let nodes = skeleton.nodes().iter().zip(&chosen).filter(|(_, chosen)| **chosen);
    let passes = passes(skeleton, &chosen).len() as u64;
    passes * triangles as u64 + nodes.map(|(record, _)| u64::from(record.triangles)).sum::<u64>()
}

/// Measures a file that [`super::check`] found sound. `at` is told from time to time, by any thread, how many of the [`steps`] are
/// done.
///
/// # Errors
/// A page cannot be read.
pub fn against(file: &HybridFile, original: &Mesh, at: &(dyn Fn(u64) + Sync)) -> Result<Measured, FormatError> {
    let steps = Steps::new(at);
    let records = file.skeleton().nodes();
    let is_chosen = chosen(records, original.triangles().len());
    let tally = Tally::new(records);

    let cells = Cells::of(file)?;
    let mut found = Found::default();
    for pass in passes(file.skeleton(), &is_chosen) {
        let cut = Cut::of(file, &pass.nodes)?;
        found.join(forward::measure(original, (&pass, &cut.near()), &cells, &tally, &steps));
    }
    let forward_rms = found.rms();
    let chosen: Vec<NodeId> = (0..).map(NodeId).zip(&is_chosen).filter(|(_, is)| **is).map(|(node, _)| node).collect();
    let (back, mut normals) = backward::measure(file, &chosen, &Bvh::build(original), &tally, &steps)?;
    let rms = forward_rms.max(back.rms());
    found.join(back);

    let is_leaf = |node: &&NodeId| records[node.0 as usize].children == 0;
    let hausdorff = chosen.iter().filter(is_leaf).map(|node| tally.largest(*node)).fold(0.0, f64::max);
    let mut inner: Vec<f64> = chosen.iter().filter(|node| !is_leaf(node)).map(|node| tally.ratio(*node)).collect();
    let mut all: Vec<f64> = chosen.iter().map(|node| tally.ratio(*node)).collect();
    let worst_ratio = all.iter().copied().fold(0.0, f64::max);
    Ok(Measured {
        hausdorff,
        rms,
        worst_ratio,
        median_ratio: if inner.is_empty() { quantile(&mut all, 0.5) } else { quantile(&mut inner, 0.5) },
        nodes: chosen.len() as u64,
        normal_p95: f64::from(quantile(&mut normals.lengths, 0.95)),
        normal_ratio_p95: f64::from(quantile(&mut normals.ratios, 0.95)),
        violations: found.violations(),
    })
}

/// 0 of nothing.
fn quantile<T: PartialOrd + Copy + Default>(numbers: &mut [T], part: f64) -> T {
    let at = ((numbers.len() as f64 * part) as usize).min(numbers.len().saturating_sub(1));
    if numbers.is_empty() {
        return T::default();
    }
    *numbers.select_nth_unstable_by(at, |a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal)).1
}
