//! Which node stands for a triangle of the original: the one whose cell its middle lies in. Files do not say which cell a node has; but
//! leaves hold the original's triangles, hardly moved, so most of them have their middles in the leaf's cell.

use super::cut::places;
use super::sample::ball;
use gigalod_format::FormatError;
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Level, and smallest corner in edges of that level's cells.
type Cell = (u32, [i64; 3]);

pub(super) struct Cells<'a> {
    records: &'a [NodeRecord],
    origin: DVec3,
    edge: f64,
    /// Number of the finest level.
    finest: u32,
    nodes: HashMap<Cell, NodeId>,
}

impl<'a> Cells<'a> {
    /// # Errors
    /// A page cannot be read.
    pub(super) fn of(file: &'a HybridFile) -> Result<Self, FormatError> {
        let (root, records) = (file.skeleton().root(), file.skeleton().nodes());
        let mut cells =
            Self { records, origin: root.origin, edge: root.edge, finest: root.levels - 1, nodes: HashMap::new() };
        let leaf = |number: u32| match records[number as usize].children {
            0 => cells.of_leaf(file, NodeId(number)),
            _ => Ok(None),
        };
        let mut of: Vec<Option<Cell>> =
            (0..records.len() as u32).into_par_iter().map(leaf).collect::<Result<_, _>>()?;
        for number in (0..records.len()).rev() {
            let NodeRecord { first_child, children, .. } = records[number];
            let below = &of[first_child as usize..][..children as usize];
            if let Some((level, corner)) = below.iter().flatten().next() {
                of[number] = Some((level - 1, corner.map(|at| at >> 1)));
            }
        }
        cells.nodes = (0..).zip(of).filter_map(|(number, cell)| Some((cell?, NodeId(number)))).collect();
        Ok(cells)
    }

    /// Where most of a leaf's triangles are; `None` without any.
    fn of_leaf(&self, file: &HybridFile, node: NodeId) -> Result<Option<Cell>, FormatError> {
        let record = file.skeleton().record(node);
        let page = file.read_page(node)?;
        let at = places(&page, record, file.skeleton());
        let mut counts: BTreeMap<Cell, u32> = BTreeMap::new();
        for corners in &page.triangles {
            let (middle, _) = ball(corners.map(|corner| at[corner as usize] - self.origin));
            *counts.entry(self.cell(middle, record.level)).or_default() += 1;
        }
        Ok(counts.into_iter().max_by_key(|(_, count)| *count).map(|(cell, _)| cell))
    }

    fn cell(&self, middle: DVec3, level: u32) -> Cell {
        let edge = self.edge / 2f64.powi(level as i32);
        (level, (middle / edge).floor().to_array().map(|at| at as i64))
    }

    /// The node of a level, or the leaf above, that stands for a triangle of the original; of no level: the leaf. `None` where no cell
    /// is known.
    pub(super) fn node(&self, corners: [DVec3; 3], level: Option<u32>) -> Option<NodeId> {
        // As builders see it: relative to the origin, in single precision.
        let (middle, _) = ball(corners.map(|corner| (corner - self.origin).as_vec3().as_dvec3()));
        self.known(middle, level)
    }

    /// The node of a level, or the leaf above, whose cell a place lies in, as [`Self::node`].
    pub(super) fn node_at(&self, at: DVec3, level: Option<u32>) -> Option<NodeId> {
        self.known(at - self.origin, level)
    }

    /// Edge of a node's cell.
    pub(super) fn edge(&self, node: NodeId) -> f64 {
        self.edge / 2f64.powi(self.records[node.0 as usize].level as i32)
    }

    fn known(&self, local: DVec3, level: Option<u32>) -> Option<NodeId> {
        let finest = level.unwrap_or(self.finest);
        let known = (0..=finest).rev().find_map(|level| self.nodes.get(&self.cell(local, level)).copied())?;
        let record = &self.records[known.0 as usize];
        (record.children == 0 || Some(record.level) == level).then_some(known)
    }
}
