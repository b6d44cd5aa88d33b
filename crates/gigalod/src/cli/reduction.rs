//! How much coarser the nodes of a hybrid file are than their children, and where they are hardly, why.
//!
//! Goes in: a skeleton. Comes out: a line for each level that has inner nodes. Errors halve from level to
//! level. So a smooth surface gives two, as its error grows with the square of its triangles' edges, and details as small as the error give four;
//! below two a level hardly helps who draws.

use gigalod_format::hybrid::{NodeRecord, Skeleton};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Of all inner nodes of a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(super) struct Reduction {
    pub(super) level: u32,
    pub(super) inner_nodes: u64,
    /// Triangles and points of their children, over their own.
    pub(super) ratio: f64,
    /// Nodes with a ratio of less than two.
    pub(super) below_two: u64,
    /// Of these, each counted once: with one child, so that there is nothing to join;
    pub(super) one_child: u64,
    /// with more error in shading than in shape: the shading is what allows no more;
    pub(super) shading: u64,
    /// above leaves only: the original is about as coarse itself;
    pub(super) original: u64,
    /// and all others.
    pub(super) shape: u64,
}

/// Least ratio of a node that helps.
const HELPS: f64 = 2.0;

/// Of each level with inner nodes, the root's first.
pub(super) fn of(skeleton: &Skeleton) -> Vec<Reduction> {
    let nodes = skeleton.nodes();
    let primitives = |node: &NodeRecord| f64::from(node.triangles) + f64::from(node.points);
    let mut levels: BTreeMap<u32, (Reduction, [f64; 2])> = BTreeMap::new();
    for node in nodes.iter().filter(|node| node.children > 0) {
        let children = &nodes[node.first_child as usize..][..node.children as usize];
        let (own, of_children) = (primitives(node), children.iter().map(primitives).sum::<f64>());
        let (reduction, sums) = levels.entry(node.level).or_default();
        reduction.level = node.level;
        reduction.inner_nodes += 1;
        *sums = [sums[0] + own, sums[1] + of_children];
        if of_children >= HELPS * own {
            continue;
        }
        reduction.below_two += 1;
        // Both are orthogonal (hybrid paper, section 3.1).
        let is_shading = node.error_total.powi(2) > 2.0 * node.error_geo.powi(2);
        let why = if children.len() == 1 {
            &mut reduction.one_child
        } else if is_shading {
            &mut reduction.shading
        } else if children.iter().all(|child| child.children == 0) {
            &mut reduction.original
        } else {
            &mut reduction.shape
        };
        *why += 1;
    }
    let of_level = |(reduction, [own, of_children]): (Reduction, [f64; 2])| Reduction {
        ratio: of_children / own.max(1.0),
        ..reduction
    };
    levels.into_values().map(of_level).collect()
}

/// What all levels together have to say.
pub(super) fn describe(levels: &[Reduction]) -> String {
    let sum = |of: fn(&Reduction) -> u64| levels.iter().map(of).sum::<u64>();
    let (inner, below) = (sum(|level| level.inner_nodes), sum(|level| level.below_two));
    let mut text = String::new();
    if inner == 0 {
        return text;
    }
    let _ = write!(text, "{below} of {inner} inner nodes have more than half of what their children have");
    let reasons = [
        (sum(|level| level.shading), "for their shading"),
        (sum(|level| level.original), "above leaves that are about as coarse"),
        (sum(|level| level.one_child), "with one child"),
        (sum(|level| level.shape), "for their shape"),
    ];
    let reasons = reasons.iter().filter(|(count, _)| *count > 0).map(|(count, why)| format!("{count} {why}"));
    let reasons: Vec<String> = reasons.collect();
    if !reasons.is_empty() {
        let _ = write!(text, ": {}", reasons.join(", "));
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_format::hybrid::Root;
    use gigalod_geom::Aabb;
    use gigalod_geom::camera::UpAxis;
    use glam::DVec3;

    #[test]
    fn each_node_that_hardly_helps_is_counted_once_with_its_reason() {
        let plain = NodeRecord { error_geo: 1.0, error_total: 1.0, ..NodeRecord::default() };
        let inner =
            |level, first_child, children, triangles| NodeRecord { level, first_child, children, triangles, ..plain };
        let nodes = vec![
            // For its shape: 300 of 100 + 100 + 100 + 150.
            inner(0, 1, 4, 300),
            // Helps.
            inner(1, 5, 2, 100),
            // For its shading.
            NodeRecord { error_total: 1.5, ..inner(1, 7, 2, 100) },
            // With one child.
            inner(1, 9, 1, 100),
            // As coarse as the original.
            NodeRecord { points: 50, ..inner(1, 10, 2, 100) },
            inner(2, 0, 0, 100),
            inner(2, 0, 0, 100),
            inner(2, 0, 0, 90),
            inner(2, 0, 0, 90),
            inner(2, 0, 0, 100),
            inner(2, 0, 0, 100),
            inner(2, 0, 0, 100),
        ];
        let root = Root {
            origin: DVec3::ZERO,
            edge: 1.0,
            bounds: Aabb { min: DVec3::ZERO, max: DVec3::ONE },
            cell_bits: 10,
            normal_bits: 9,
            resolution: 64,
            nodes: nodes.len() as u64,
            leaves: 7,
            levels: 3,
            preserves_appearance: true,
            has_colors: false,
            closed: false,
            up: UpAxis::Y,
        };
        let levels = of(&Skeleton::new(root, nodes, 0));
        let top = Reduction { level: 0, inner_nodes: 1, ratio: 1.5, below_two: 1, shape: 1, ..Reduction::default() };
        assert_eq!(levels[0], top);
        let Reduction { inner_nodes, ratio, below_two, one_child, shading, original, shape, .. } = levels[1];
        assert_eq!([inner_nodes, below_two, one_child, shading, original, shape], [4, 3, 1, 1, 1, 0]);
        assert!((ratio - 680.0 / 450.0).abs() < 1e-12, "{ratio}");
        let text = describe(&levels);
        let expected = "4 of 5 inner nodes have more than half of what their children have: 1 for their shading, \
            1 above leaves that are about as coarse, 1 with one child, 1 for their shape\n";
        assert_eq!(text, expected);
    }
}
