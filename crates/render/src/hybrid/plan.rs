//! What a frame draws: its nodes, cut into runs, in slices.
//!
//! Takes the lists of a frame; gives tables for the device. What always holds: runs of triangles come first, then those of points,
//! then those of lines, so that of what is equally near a triangle wins; within a kind they stand in the order of the lists.

use crate::hybrid::arena::{Arena, MOST_VERTICES};
use crate::hybrid::params::{NodeParams, RUN_LOG2, Seen};
use crate::{Gpu, RenderError};
use gigalod_format::hybrid::{HybridFile, Page};
use gigalod_geom::Camera;
use gigalod_runtime::Similarity;
use gigalod_runtime::hybrid::HybridList;
use gigalod_runtime::splats::{MATERIAL_SRGB, Tint, level_color};
use glam::DVec2;
use std::ops::Range;

/// Kinds of primitives, as in `hybrid_kinds.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Triangles,
    Points,
    Lines,
}

impl Kind {
    pub(crate) const ALL: [Self; 3] = [Self::Triangles, Self::Points, Self::Lines];
}

/// What a run is: node, where in it and how much, as `hybrid_store.wgsl` reads it.
pub(crate) type RunParams = [u32; 2];

/// Runs that primitives' numbers can name.
const MOST_RUNS: u64 = 1 << (32 - RUN_LOG2);

/// What is drawn in one go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Slice {
    pub(crate) kind: Kind,
    pub(crate) runs: Range<u32>,
}

/// What a frame draws.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    pub(crate) runs: Vec<RunParams>,
    /// First runs of points and of lines.
    pub(crate) first_runs: [u32; 2],
    pub(crate) slices: Vec<Slice>,
    /// Nodes.
    pub(crate) nodes: u32,
    /// Some vertices have colours.
    pub(crate) has_colors: bool,
    /// Columns and rows that may show something: to look up what shows takes the software adapter as long where nothing does.
    pub(crate) window: [Range<u32>; 2],
}

/// Lists that hold something, with their files.
fn filled<'a>(
    lists: &'a [(Similarity, &'a HybridList)],
) -> impl Iterator<Item = (&'a Similarity, &'a HybridList, &'a HybridFile)> {
    lists.iter().filter_map(|(placement, list)| Some((placement, *list, list.hybrid.as_deref()?)))
}

fn points(page: &Page, vertices: u32) -> u32 {
    (page.positions.len() as u32).saturating_sub(vertices)
}

impl Plan {
    /// Cuts the lists of a frame into runs, and those into slices of at most `most_runs`.
    ///
    /// # Errors
    /// [`RenderError::TooMany`] where primitives have no numbers left.
    pub(crate) fn new(
        camera: &Camera,
        lists: &[(Similarity, &HybridList)],
        most_runs: u32,
    ) -> Result<Self, RenderError> {
        let mut plan = Self::default();
        let mut by_kind: [Vec<RunParams>; 3] = Default::default();
        let mut total = 0u64;
        let mut shown = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        for (placement, list, file) in filled(lists) {
            let skeleton = file.skeleton();
            let seen = Seen::new(camera, placement, skeleton);
            plan.has_colors |= skeleton.root().has_colors && list.tint == Tint::Model;
            for node in &list.nodes {
                let record = skeleton.record(node.node);
                let page = &node.page;
                if page.positions.len() > MOST_VERTICES {
                    return Err(RenderError::TooMany(page.positions.len() as u64));
                }
                let counts = [
                    page.triangles.len() as u32,
                    points(page, record.vertices),
                    if node.draws_lines { page.borders.len() as u32 } else { 0 },
                ];
                for (runs, count) in by_kind.iter_mut().zip(counts) {
                    for first in (0..count).step_by(1 << RUN_LOG2) {
                        let in_run = (count - first).min(1 << RUN_LOG2);
                        runs.push([plan.nodes, first | (in_run - 1)]);
                    }
                }
                let of_node = seen.window_px(record);
                shown = [shown[0].min(of_node[0]), shown[1].max(of_node[1])];
                plan.nodes += 1;
                total += counts.map(u64::from).iter().sum::<u64>();
            }
        }
        if by_kind.iter().map(Vec::len).sum::<usize>() as u64 > MOST_RUNS {
            return Err(RenderError::TooMany(total));
        }
        let columns = shown[0].x as u32..(shown[1].x.ceil() as u32).min(camera.size.width);
        let rows = shown[0].y as u32..(shown[1].y.ceil() as u32).min(camera.size.height);
        plan.window = [columns, rows];
        for (kind, runs) in Kind::ALL.into_iter().zip(&by_kind) {
            let first = plan.runs.len() as u32;
            if kind > Kind::Triangles {
                plan.first_runs[kind as usize - 1] = first;
            }
            plan.runs.extend(runs);
            let end = plan.runs.len() as u32;
            let starts = (first..end).step_by(most_runs as usize);
            plan.slices.extend(starts.map(|start| Slice { kind, runs: start..end.min(start + most_runs) }));
        }
        Ok(plan)
    }

    /// True where there is nothing to draw.
    pub(crate) fn is_empty(&self) -> bool {
        self.slices.is_empty()
    }

    /// True where there are lines.
    pub(crate) fn has_lines(&self) -> bool {
        self.slices.last().is_some_and(|slice| slice.kind == Kind::Lines)
    }

    /// True where there are points or lines.
    pub(crate) fn has_spots(&self) -> bool {
        self.slices.iter().any(|slice| slice.kind != Kind::Triangles)
    }

    /// The nodes, once their pages have been placed.
    pub(crate) fn node_params(camera: &Camera, lists: &[(Similarity, &HybridList)], arena: &Arena) -> Vec<NodeParams> {
        let mut out = Vec::new();
        for (placement, list, file) in filled(lists) {
            let skeleton = file.skeleton();
            let seen = Seen::new(camera, placement, skeleton);
            for node in &list.nodes {
                let record = skeleton.record(node.node);
                let (page, at) = (&node.page, arena.place_of(list, node));
                let normals_at = at + page.positions.len() as u32;
                let triangles_at = normals_at + page.positions.len() as u32;
                out.push(NodeParams {
                    positions_at: at,
                    normals_at,
                    triangles_at,
                    borders_at: triangles_at + page.triangles.len() as u32,
                    ranks: u32::from(node.ranks.from) | u32::from(node.ranks.end) << 8,
                    color: color(list.tint, record.level, !page.colors.is_empty()),
                    ..seen.node(record)
                });
            }
        }
        out
    }
}

/// As [`NodeParams::color`] holds it.
fn color(tint: Tint, level: u32, has_colors: bool) -> u32 {
    let [r, g, b] = match tint {
        Tint::Level => {
            let packed = u32::from(level_color(level));
            let whole = |steps: u32, most: u32| (steps * 255 + most / 2) / most;
            [whole(packed >> 11, 31), whole(packed >> 5 & 63, 63), whole(packed & 31, 31)]
        }
        Tint::Model if has_colors => return u32::MAX,
        Tint::Model => MATERIAL_SRGB.map(u32::from),
    };
    r | g << 8 | b << 16
}

/// Runs of a slice: enough to keep a device busy, and few enough to be broken off soon after.
pub(crate) fn most_runs(gpu: &Gpu) -> u32 {
    if gpu.is_software() { 64 } else { 1024 }
}
