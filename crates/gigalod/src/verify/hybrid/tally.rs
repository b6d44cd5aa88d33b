//! What was measured of each node so far, from any number of threads: the largest distance, and where it is more than is stored.

use gigalod_format::hybrid::{NodeId, NodeRecord};
use glam::DVec3;
use std::collections::HashMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

/// Rounding of what is measured may come to this part of it.
const SLACK: f64 = 1e-6;

/// Which way was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// From the original to the node.
    Forward,
    /// From the node to the original.
    Backward,
}

/// A node that is farther from the original than it says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Which.
    pub node: NodeId,
    /// Of the node.
    pub level: u32,
    /// Largest distance, model units.
    pub measured: f64,
    /// What it says.
    pub stored: f64,
    /// The point that is so far away; model space.
    pub at: DVec3,
    /// From what to what.
    pub way: Way,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, level, measured, stored, at, way } = self;
        let what = match way {
            Way::Forward => "the original is",
            Way::Backward => "it is",
        };
        let [x, y, z] = at.to_array();
        write!(
            f,
            "node {node} (level {level}): {what} {measured:.6e} away at {x} {y} {z}, expected at most {stored:.6e}"
        )
    }
}

/// Largest distances of all nodes.
pub(super) struct Tally<'a> {
    records: &'a [NodeRecord],
    /// Bits of numbers that are not negative have their order.
    largest: Vec<AtomicU64>,
}

impl<'a> Tally<'a> {
    pub(super) fn new(records: &'a [NodeRecord]) -> Self {
        Self { records, largest: records.iter().map(|_| AtomicU64::new(0)).collect() }
    }

    pub(super) fn record(&self, node: NodeId) -> &'a NodeRecord {
        &self.records[node.0 as usize]
    }

    /// Largest distance of a node so far.
    pub(super) fn largest(&self, node: NodeId) -> f64 {
        f64::from_bits(self.largest[node.0 as usize].load(Ordering::Relaxed))
    }

    fn add(&self, node: NodeId, distance: f64) {
        self.largest[node.0 as usize].fetch_max(distance.to_bits(), Ordering::Relaxed);
    }

    /// Largest distance, as a part of what is stored.
    pub(super) fn ratio(&self, node: NodeId) -> f64 {
        let (measured, stored) = (self.largest(node), f64::from(self.record(node).error_geo));
        if measured > 0.0 { measured / stored } else { 0.0 }
    }
}

/// What one task has found; joined in a fixed order, so that sums are always the same.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Sums of squares of leaves' distances, weighted by area, and of weights.
    squares: f64,
    weights: f64,
    worst: HashMap<u32, Violation>,
}

impl Found {
    /// A point of a node, or one that stands for it, is so far away. `weight` is 0 where the mean does not count it.
    pub(super) fn add(&mut self, tally: &Tally<'_>, node: NodeId, way: Way, at: DVec3, distance: f64, weight: f64) {
        tally.add(node, distance);
        self.squares += weight * distance * distance;
        self.weights += weight;
        let record = tally.record(node);
        let stored = f64::from(record.error_geo);
        if distance > stored * (1.0 + SLACK) {
            self.keep(Violation { node, level: record.level, measured: distance, stored, at, way });
        }
    }

    fn keep(&mut self, violation: Violation) {
        let known = self.worst.entry(violation.node.0).or_insert(violation);
        if violation.measured > known.measured {
            *known = violation;
        }
    }

    pub(super) fn join(&mut self, later: Self) {
        self.squares += later.squares;
        self.weights += later.weights;
        later.worst.into_values().for_each(|violation| self.keep(violation));
    }

    pub(super) fn rms(&self) -> f64 {
        if self.weights > 0.0 { (self.squares / self.weights).sqrt() } else { 0.0 }
    }

    /// In the order of nodes.
    pub(super) fn violations(self) -> Vec<Violation> {
        let mut all: Vec<Violation> = self.worst.into_values().collect();
        all.sort_unstable_by_key(|violation| violation.node);
        all
    }
}
