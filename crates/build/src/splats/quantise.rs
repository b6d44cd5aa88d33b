//! Top-down quantisation: each kept node's sphere becomes a code relative to its parent's *decoded* sphere.

use super::contract::ChildList;
use super::tree::Binary;
use gigalod_geom::Sphere;
use gigalod_geom::quantise::sphere;
use gigalod_geom::sphere::round_up;

pub(super) struct Quantised {
    /// How far decoded descendants reach from a node's centre, in units of its radius; the largest of all nodes, ≥ 1.
    pub(super) overhang: f32,
}

/// Sets `code` of all kept nodes and replaces their true spheres by the decoded ones. The root keeps its own.
pub(super) fn top_down(nodes: &mut [Binary]) -> Quantised {
    nodes[0].code = sphere::SELF;
    let (_, overhang) = subtree(nodes);
    // The sum of rounded distances, rounded outwards once more.
    Quantised { overhang: round_up(overhang * (1.0 + 1e-6)) }
}

/// Quantises what lies below the first node, whose sphere is decoded already. Returns how far decoded spheres reach from
/// its centre (in model units, by the triangle inequality along the tree), and the largest overhang in the subtree.
fn subtree(nodes: &mut [Binary]) -> (f64, f64) {
    let parent: Sphere = nodes[0].sphere;
    let (mut reach, mut overhang) = (f64::from(parent.radius), 1.0_f64);
    let children = ChildList::of(nodes, 0);
    for child in children.as_slice() {
        let child = *child as usize;
        (nodes[child].code, nodes[child].sphere) = sphere::encode(&parent, &nodes[child].sphere);
    }
    for child in children.as_slice() {
        let child = *child as usize;
        let end = child + 2 * nodes[child].leaves as usize - 1;
        let apart = f64::from(nodes[child].sphere.center.distance(parent.center));
        let (child_reach, child_overhang) = subtree(&mut nodes[child..end]);
        reach = reach.max(apart + child_reach);
        overhang = overhang.max(child_overhang);
    }
    if parent.radius > 0.0 {
        overhang = overhang.max(reach / f64::from(parent.radius));
    }
    (reach, overhang)
}
