//! Which nodes are measured: all, or of a large model the top levels and others by chance; and together with what.

use super::cut::box_of;
use gigalod_format::hybrid::{NodeId, NodeRecord, Skeleton};
use glam::DVec3;
use std::collections::HashMap;

/// All nodes of models of up to so many triangles are measured.
const MOST_MEASURED: usize = 7_500_000;
/// Of larger ones, all of the first so many levels,
const TOP_LEVELS: u32 = 4;
/// and so many others.
const OTHERS: usize = 2000;
/// Chooses the others.
const SEED: u64 = 0x6769_6761_6C6F_6431;

/// Which nodes are measured.
pub(super) fn chosen(records: &[NodeRecord], triangles: usize) -> Vec<bool> {
    let mut chosen: Vec<bool> =
        records.iter().map(|record| triangles <= MOST_MEASURED || record.level < TOP_LEVELS).collect();
    let mut others: Vec<usize> = (0..records.len()).filter(|number| !chosen[*number]).collect();
    others.sort_unstable_by_key(|number| (mixed(*number as u64 ^ SEED), *number));
    others.iter().take(OTHERS).for_each(|number| chosen[*number] = true);
    chosen
}

/// A number that looks like chance (Steele, Lea & Flood, *Fast Splittable Pseudorandom Number Generators*, OOPSLA 2014).
fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ z >> 31
}

/// Nodes that are measured together, from the original to them.
pub(super) struct Pass {
    /// Whole cut, or as much of it as can be nearest to what is asked.
    pub(super) nodes: Vec<NodeId>,
    /// The inner nodes of this level are measured, among leaves of levels above; or else leaves.
    pub(super) level: Option<u32>,
    /// Where the original is asked; everywhere if there is none.
    pub(super) region: Option<Region>,
}

/// A pass for each level that has inner nodes to measure, and one for leaves.
pub(super) fn passes(skeleton: &Skeleton, chosen: &[bool]) -> Vec<Pass> {
    let levels = skeleton.root().levels;
    let inner = (0..levels).filter_map(|level| pass(skeleton, chosen, Some(level)));
    inner.chain(pass(skeleton, chosen, None)).collect()
}

fn pass(skeleton: &Skeleton, chosen: &[bool], level: Option<u32>) -> Option<Pass> {
    let records = skeleton.nodes();
    let is_measured = |record: &NodeRecord| match level {
        Some(level) => record.level == level && record.children > 0,
        None => record.children == 0,
    };
    let is_in_cut = |record: &NodeRecord| match level {
        Some(level) => record.level == level || (record.level < level && record.children == 0),
        None => record.children == 0,
    };
    let numbered = || records.iter().zip(chosen).zip(0..).map(|((record, chosen), number)| (record, *chosen, number));
    let asked: Vec<&NodeRecord> =
        numbered().filter(|(record, chosen, _)| *chosen && is_measured(record)).map(|(record, ..)| record).collect();
    if asked.is_empty() {
        return None;
    }
    let is_whole = numbered().all(|(record, chosen, _)| chosen || !is_measured(record));
    let region = (!is_whole).then(|| Region::new(skeleton, &asked));
    let nodes = numbered().filter(|(record, ..)| {
        is_in_cut(record) && region.as_ref().is_none_or(|region| region.is_beside(box_of(record, skeleton)))
    });
    Some(Pass { nodes: nodes.map(|(.., number)| NodeId(number)).collect(), level, region })
}

/// Boxes in each cube of a lattice.
type Cubes = HashMap<[i64; 3], Vec<u32>>;

/// Boxes of several nodes.
pub(super) struct Region {
    origin: DVec3,
    boxes: Vec<[DVec3; 2]>,
    /// Lattices of cubes: their edge, and the boxes in each.
    lattices: Vec<(f64, Cubes)>,
    /// What is farther from a box cannot be nearest to what is in it, in a file that is right.
    margin: f64,
}

/// A box is in a lattice of which it meets at most so many cubes.
const MOST_CUBES: f64 = 64.0;

impl Region {
    fn new(skeleton: &Skeleton, asked: &[&NodeRecord]) -> Self {
        let root = skeleton.root();
        let mut region = Self { origin: root.origin, boxes: Vec::new(), lattices: Vec::new(), margin: 0.0 };
        for record in asked {
            let number = region.boxes.len() as u32;
            let [least, most] = box_of(record, skeleton);
            region.boxes.push([least, most]);
            region.margin = region.margin.max(f64::from(record.error_geo));
            let mut edge = root.edge / 2f64.powi(record.level as i32);
            let cubes = |edge: f64| (((most - least) / edge).floor() + 2.0).element_product();
            while cubes(edge) > MOST_CUBES {
                edge *= 2.0;
            }
            let lattice = match region.lattices.iter().position(|(known, _)| *known == edge) {
                Some(known) => known,
                None => {
                    region.lattices.push((edge, HashMap::new()));
                    region.lattices.len() - 1
                }
            };
            let [from, to] = [least, most].map(|corner| cube(corner - root.origin, edge));
            for x in from[0]..=to[0] {
                for y in from[1]..=to[1] {
                    for z in from[2]..=to[2] {
                        region.lattices[lattice].1.entry([x, y, z]).or_default().push(number);
                    }
                }
            }
        }
        region
    }

    /// True for a point in one of the boxes.
    pub(super) fn holds(&self, at: DVec3) -> bool {
        self.lattices.iter().any(|(edge, cubes)| {
            let here = cubes.get(&cube(at - self.origin, *edge)).map_or(&[][..], Vec::as_slice);
            here.iter().any(|number| {
                let [least, most] = self.boxes[*number as usize];
                at.cmpge(least).all() && at.cmple(most).all()
            })
        })
    }

    fn is_beside(&self, [least, most]: [DVec3; 2]) -> bool {
        let (least, most) = (least - self.margin, most + self.margin);
        self.boxes.iter().any(|[from, to]| least.cmple(*to).all() && most.cmpge(*from).all())
    }
}

fn cube(at: DVec3, edge: f64) -> [i64; 3] {
    (at / edge).floor().to_array().map(|at| at as i64)
}
