//! Hybrid files: the nodes of a cut, one after the other, three times: to count, for vertices and points, for triangles.

use super::format::{Format, Plan, Vertex};
use super::merge::Merge;
use super::{ExportError, Written};
use gigalod_build::Progress;
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::io::Write;

/// Pages that are decoded side by side.
const AT_ONCE: usize = 32;

/// Writes the coarsest nodes whose error of geometry is at most `error`, and leaves where there are none. Vertices at exactly the same
/// place become one: of normals and colours, the first one's stay.
///
/// # Errors
/// The file is damaged, the format has no room for it, or `out` does not take it.
pub fn hybrid(
    file: &HybridFile,
    error: f64,
    format: Format,
    progress: &dyn Progress,
    out: &mut dyn Write,
) -> Result<Written, ExportError> {
    let (root, records) = (file.skeleton().root(), file.skeleton().nodes());
    let cut = Cut { file, nodes: nodes_of(records, error), finest: root.levels - 1 };
    let mut plan = Plan {
        written: Written::default(),
        has_colors: root.has_colors,
        is_wide: false,
        origin: root.origin,
        up: root.up,
        boxes: [Plan::EMPTY_BOX; 2],
    };
    // Rounding to single precision may take an eighth of the finest step.
    let largest = root.bounds.min.abs().max(root.bounds.max.abs()).max_element();
    plan.is_wide = largest * f64::from(f32::EPSILON) * 0.5 > file.skeleton().step(cut.finest) / 8.0;

    let mut merge = Merge::default();
    // Numbers of what comes first in each node.
    let mut first = Vec::with_capacity(cut.nodes.len());
    cut.for_each("count", progress, |record, page, places| {
        let next = plan.written.vertices;
        first.push(next);
        let numbers = merge.number(page, record, cut.finest - record.level, next);
        plan.written.vertices += numbers.new.len() as u64;
        plan.written.triangles += u64::from(record.triangles);
        plan.written.points += u64::from(record.points);
        let around = |[least, most]: [Vec3; 2], at: &DVec3| [least.min(at.as_vec3()), most.max(at.as_vec3())];
        let (vertices, points) = places.split_at(record.vertices as usize);
        plan.boxes = [vertices.iter().fold(plan.boxes[0], around), points.iter().fold(plan.boxes[1], around)];
        Ok(())
    })?;

    plan.begin(format, out)?;
    let vertex = |page: &Page, places: &[DVec3], number: u32| Vertex {
        at: places[number as usize],
        normal: normal(page.normals[number as usize], root.normal_bits),
        color: page.colors.get(number as usize).map_or([255; 3], |[r, g, b, _]| [*r, *g, *b]),
    };
    let mut node = 0;
    cut.for_each("vertices", progress, |record, page, places| {
        let numbers = merge.number(page, record, cut.finest - record.level, first[node]);
        node += 1;
        numbers.new.iter().try_for_each(|number| plan.vertex(format, &vertex(page, places, *number), out))?;
        Ok(())
    })?;
    if plan.written.points > 0 {
        cut.for_each("points", progress, |record, page, places| {
            let points = record.vertices..record.vertices + record.points;
            points.into_iter().try_for_each(|number| plan.vertex(format, &vertex(page, places, number), out))?;
            Ok(())
        })?;
    }
    let mut node = 0;
    cut.for_each("triangles", progress, |record, page, _| {
        let numbers = merge.number(page, record, cut.finest - record.level, first[node]);
        node += 1;
        let named = page.triangles.iter().map(|corners| corners.map(|corner| numbers.of[corner as usize]));
        named.into_iter().try_for_each(|corners| plan.triangle(format, corners, out))?;
        Ok(())
    })?;
    Ok(plan.written)
}

/// The coarsest nodes that are good enough, in the order of the file.
fn nodes_of(records: &[NodeRecord], error: f64) -> Vec<NodeId> {
    let mut nodes = Vec::new();
    let mut open = vec![false; records.len()];
    if let Some(root) = open.first_mut() {
        *root = true;
    }
    for (number, record) in records.iter().enumerate() {
        if !open[number] {
            continue;
        }
        if record.children == 0 || exported_error(record) <= error {
            nodes.push(NodeId(number as u32));
        } else {
            open[record.first_child as usize..(record.first_child + record.children) as usize].fill(true);
        }
    }
    nodes
}

/// Points have no size any more: what was within half a spacing of one is so far away.
fn exported_error(record: &NodeRecord) -> f64 {
    let bare = if record.points > 0 { 0.5 * f64::from(record.spacing) } else { 0.0 };
    f64::from(record.error_geo) + bare
}

/// Nodes that are exported.
struct Cut<'a> {
    file: &'a HybridFile,
    nodes: Vec<NodeId>,
    /// Number of the finest level.
    finest: u32,
}

impl Cut<'_> {
    /// Calls `each` for all nodes in order, with places relative to the origin.
    fn for_each(
        &self,
        phase: &'static str,
        progress: &dyn Progress,
        mut each: impl FnMut(&NodeRecord, &Page, &[DVec3]) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        progress.begin(phase, self.nodes.len() as u64);
        let skeleton = self.file.skeleton();
        let mut done = 0;
        for some in self.nodes.chunks(AT_ONCE) {
            let pages: Vec<Page> = some.par_iter().map(|node| self.file.read_page(*node)).collect::<Result<_, _>>()?;
            for (node, page) in some.iter().zip(&pages) {
                let record = skeleton.record(*node);
                let step = skeleton.step(record.level);
                let place = |at: &[u16; 3]| {
                    DVec3::from_array([0, 1, 2].map(|axis| f64::from(record.min_steps[axis]) + f64::from(at[axis])))
                        * step
                };
                let places: Vec<DVec3> = page.positions.iter().map(place).collect();
                each(record, page, &places)?;
            }
            done += some.len() as u64;
            progress.at(done);
        }
        Ok(())
    }
}

/// Unit vector of a code on the octahedron: |x| + |y| + |z| = 1, the lower half folded outward.
fn normal(code: u32, bits: u32) -> Vec3 {
    let most = ((1u32 << bits) - 1) as f32;
    let [x, y] = [code & 0xFFFF, code >> 16].map(|code| code as f32 / most * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    Vec3::new(x, y, z).normalize()
}
