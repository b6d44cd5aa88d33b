//! Splat files: centres of the spheres of a cut, as points. The whole tree is in memory, since a sphere is known by its parent's.

use super::format::{Format, Plan, Vertex};
use super::{ExportError, Written};
use crate::verify::{SplatTree, check};
use gigalod_build::Progress;
use gigalod_format::splats::SplatFile;
use gigalod_geom::color::srgb8_of_rgb565;
use gigalod_geom::quantise::normal;
use std::io::Write;

/// Writes the coarsest spheres whose diameter is at most `error`, and leaves where there are none; a leaf that is repeated, once.
///
/// # Errors
/// The file is damaged, the format has no room for it, or `out` does not take it.
pub fn splats(
    file: &SplatFile,
    error: f64,
    format: Format,
    progress: &dyn Progress,
    out: &mut dyn Write,
) -> Result<Written, ExportError> {
    progress.begin("count", file.skeleton().pages().len() as u64);
    let (tree, problems) = check(file, &mut |pages| progress.at(pages));
    if let Some(problem) = problems.told.first() {
        return Err(ExportError::Unsound(problem.clone()));
    }
    let nodes = nodes_of(&tree, error);
    let root = file.skeleton().root();
    let mut plan = Plan {
        written: Written { points: nodes.len() as u64, ..Written::default() },
        has_colors: root.has_colors,
        is_wide: false,
        origin: root.origin,
        up: root.up,
        boxes: [Plan::EMPTY_BOX; 2],
    };
    // Centres are in single precision, relative to the middle. Far from there it does not suffice for the model's coordinates.
    let largest = root.bounds.min.abs().max(root.bounds.max.abs()).max_element();
    plan.is_wide = largest > 2.0 * f64::from(root.sphere.radius);
    for node in &nodes {
        let center = tree.nodes[*node as usize].sphere.center;
        plan.boxes[1] = [plan.boxes[1][0].min(center), plan.boxes[1][1].max(center)];
    }
    plan.begin(format, out)?;
    progress.begin("points", nodes.len() as u64);
    const OFTEN: u64 = 1 << 12;
    for (done, number) in (0u64..).zip(&nodes) {
        let node = &tree.nodes[*number as usize];
        let vertex = Vertex {
            at: node.sphere.center.as_dvec3(),
            normal: normal::decode(node.node.normal()),
            color: node.color.map_or([255; 3], srgb8_of_rgb565),
        };
        plan.vertex(format, &vertex, out)?;
        if done.is_multiple_of(OFTEN) {
            progress.at(done);
        }
    }
    Ok(plan.written)
}

/// The coarsest nodes that are good enough, in the order of the tree.
fn nodes_of(tree: &SplatTree, error: f64) -> Vec<u32> {
    let mut nodes = Vec::new();
    let mut open = vec![false; tree.nodes.len()];
    if let Some(root) = open.first_mut() {
        *root = true;
    }
    for (number, node) in (0u32..).zip(&tree.nodes) {
        if !open[number as usize] {
            continue;
        }
        if node.children == 0 || 2.0 * f64::from(node.sphere.radius) <= error {
            nodes.push(number);
            continue;
        }
        let children = node.first_child as usize..node.first_child as usize + usize::from(node.children);
        open[children.clone()].fill(true);
        if let [one, other] = &tree.nodes[children.clone()]
            && one.children + other.children == 0
            && (one.node, one.sphere, one.color) == (other.node, other.sphere, other.color)
        {
            open[children.end - 1] = false;
        }
    }
    nodes
}
