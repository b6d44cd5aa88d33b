//! The surface under the cursor, from the triangles of a hybrid hierarchy's leaves: at full precision, although the display is coarse.
//!
//! Goes in: an open file, a ray in model space. Comes out: where the ray first meets a leaf's triangle. Nodes are opened in the order in
//! which the ray enters their boxes, which the skeleton knows, so only pages of leaves along the ray are read, and none behind the
//! hit. This waits for reads: it is for a thread of its own.
//!
//! What always holds: the true surface lies within [`Hit::radius`] of the hit; hostile files end the search.

use crate::navigation::Anchor;
use crate::pick::{Hit, Ray};
use gigalod_format::FormatError;
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap, btree_map};

/// Bytes of pages that are kept decoded from one pick to the next.
const MOST_BYTES: usize = 32 << 20;

/// A file with the leaves that were read of it.
#[derive(Debug, Default)]
pub struct NodePages {
    decoded: BTreeMap<NodeId, Page>,
    bytes: usize,
}

/// A node, where the ray enters its box.
#[derive(Debug)]
struct Entry {
    t: f64,
    node: NodeId,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Entry {}
impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Entry {
    /// The nearest is the greatest: a heap gives it first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.t.total_cmp(&self.t)
    }
}

/// Where a node's steps begin, and how long one is; model space.
fn grid(file: &HybridFile, record: &NodeRecord) -> (DVec3, f64) {
    let root = file.skeleton().root();
    let bits = i64::from(root.cell_bits) + i64::from(record.level);
    let step = root.edge * 2f64.powi(-(bits.min(2000) as i32));
    (root.origin + DVec3::from_array(record.min_steps.map(f64::from)) * step, step)
}

/// Where a ray enters the box of all that lies below a node, 0 from inside; `None` where it does not.
fn entry_of(file: &HybridFile, record: &NodeRecord, ray: &Ray) -> Option<f64> {
    let (min, step) = grid(file, record);
    // Around the original, within the error, lies what is below, within one that is no larger.
    let pad = f64::from(record.error_geo) + f64::from(record.error_total);
    let max = min + DVec3::from_array(record.extent_steps.map(f64::from)) * step + pad;
    let (from, to) = ((min - pad - ray.origin) / ray.direction, (max - ray.origin) / ray.direction);
    // Comparing with what is not a number leaves the bound as it is.
    let (mut enters, mut leaves) = (0.0f64, f64::INFINITY);
    for (from, to) in std::iter::zip(from.to_array(), to.to_array()) {
        enters = enters.max(from.min(to));
        leaves = leaves.min(from.max(to));
    }
    (enters <= leaves).then_some(enters)
}

/// Where a ray meets a triangle, from either side.
fn meet(ray: &Ray, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let across = ray.direction.cross(ac);
    let volume = ab.dot(across);
    if volume == 0.0 {
        return None;
    }
    let from_a = ray.origin - a;
    let u = from_a.dot(across) / volume;
    let turned = from_a.cross(ab);
    let v = ray.direction.dot(turned) / volume;
    let t = ac.dot(turned) / volume;
    // A ray through an edge must not slip between two triangles.
    const BESIDE: f64 = 1e-9;
    (u >= -BESIDE && v >= -BESIDE && u + v <= 1.0 + BESIDE && t > 0.0).then_some(t)
}

/// Edge of an equilateral triangle as large as this one: across a slim one, vertices are nearer to each other than along it.
fn edge_of([a, b, c]: [DVec3; 3]) -> f64 {
    ((b - a).cross(c - a).length() * 2.0 / 3f64.sqrt()).sqrt()
}

impl NodePages {
    fn page(&mut self, file: &HybridFile, node: NodeId) -> Result<&Page, FormatError> {
        if self.bytes > MOST_BYTES {
            self.decoded.clear();
            self.bytes = 0;
        }
        match self.decoded.entry(node) {
            btree_map::Entry::Occupied(there) => Ok(there.into_mut()),
            btree_map::Entry::Vacant(place) => {
                let page = file.read_page(node)?;
                self.bytes += page.resident_bytes();
                Ok(place.insert(page))
            }
        }
    }

    /// Where the ray first meets the surface. A leaf whose page is damaged counts as its box, where nothing else is met.
    ///
    /// # Errors
    /// None of the pages on the way can be read.
    pub fn first_hit(&mut self, file: &HybridFile, ray: &Ray) -> Result<Option<Hit>, FormatError> {
        let nodes = file.skeleton().nodes();
        if !(ray.direction.is_finite() && ray.direction.length() > 0.0) {
            return Ok(None);
        }
        let (mut nearest, mut damaged): (Option<Hit>, Option<(Hit, FormatError)>) = (None, None);
        let mut queue = BinaryHeap::new();
        let push = |queue: &mut BinaryHeap<Entry>, node: u32| {
            if let Some(t) = nodes.get(node as usize).and_then(|record| entry_of(file, record, ray)) {
                queue.push(Entry { t, node: NodeId(node) });
            }
        };
        push(&mut queue, 0);
        let mut visited = 0;
        while let Some(Entry { t: entry, node }) = queue.pop() {
            visited += 1;
            if nearest.is_some_and(|hit| hit.t < entry) || visited > nodes.len() {
                break;
            }
            let record = file.skeleton().record(node);
            if record.children > 0 && record.first_child > node.0 {
                (0..record.children.min(8)).for_each(|at| push(&mut queue, record.first_child.saturating_add(at)));
                continue;
            }
            let (origin, step) = grid(file, record);
            match self.page(file, node) {
                Ok(page) => {
                    for triangle in &page.triangles {
                        let corner = |at: u32| {
                            let steps = page.positions.get(at as usize).copied().unwrap_or_default();
                            origin + DVec3::from_array(steps.map(f64::from)) * step
                        };
                        let corners = triangle.map(corner);
                        let Some(t) = meet(ray, corners) else { continue };
                        if nearest.is_none_or(|before| t < before.t) {
                            nearest = Some(Hit { t, radius: f64::from(record.error_geo), detail: edge_of(corners) });
                        }
                    }
                }
                Err(error) => {
                    let radius = DVec3::from_array(record.extent_steps.map(f64::from)).length() * step;
                    damaged.get_or_insert((Hit { t: entry, radius, detail: radius }, error));
                }
            }
        }
        match (nearest, damaged) {
            (Some(hit), _) => Ok(Some(hit)),
            (None, Some((hit, _))) if hit.t > 0.0 => Ok(Some(hit)),
            (None, Some((_, error))) => Err(error),
            (None, None) => Ok(None),
        }
    }

    /// Balls that hold parts of the surface, all over the model, in model space: around vertices of the root.
    ///
    /// # Errors
    /// The root's page cannot be read.
    pub fn anchors(&mut self, file: &HybridFile, most: usize) -> Result<Vec<Anchor>, FormatError> {
        let Some(record) = file.skeleton().nodes().first() else { return Ok(Vec::new()) };
        let (origin, step) = grid(file, record);
        let positions = &self.page(file, NodeId(0))?.positions;
        let every = positions.len().div_ceil(most.max(1)).max(1);
        let anchor = |steps: &[u16; 3]| Anchor {
            at: origin + DVec3::from_array(steps.map(f64::from)) * step,
            radius: f64::from(record.error_geo),
        };
        Ok(positions.iter().step_by(every).map(anchor).collect())
    }
}

#[cfg(test)]
#[path = "pick_nodes_tests.rs"]
mod tests;
