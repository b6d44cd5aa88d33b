//! The skeleton of a hybrid file: what holds for all of it, a record for each node, coarse ones first, and the model that its pages
//! need. Its bytes are `stored`'s business.

use super::codec::Model;
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use glam::DVec3;
use std::fmt;

/// Number of a node, from 0, the root; also that of its page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What holds for the whole hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// Smallest corner of the root's cell, and origin of local space; model space.
    pub origin: DVec3,
    /// Edge of the root's cell, in model units; > 0.
    pub edge: f64,
    /// Around everything; model space.
    pub bounds: Aabb,
    /// Steps along the edge of any node's cell are 2 to this: 4–14.
    pub cell_bits: u32,
    /// Bits of each of the two coordinates of a normal on the octahedron: 6–12.
    pub normal_bits: u32,
    /// `--res`: a node's error is at most the edge of its cell divided by this.
    pub resolution: u32,
    /// Number of nodes.
    pub nodes: u64,
    /// Number of nodes without children.
    pub leaves: u64,
    /// Number of levels; 1 for a single leaf.
    pub levels: u32,
    /// False where only geometry was preserved (`--appearance off`); then normals are there nevertheless.
    pub preserves_appearance: bool,
    /// True when every vertex and point has a colour.
    pub has_colors: bool,
    /// True when the mesh is closed and consistently oriented, so that what shows its back is hidden.
    pub closed: bool,
    /// Which way is up.
    pub up: UpAxis,
}

/// What is known of a node without its page.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeRecord {
    /// Its level: 0 is the root. Its cell's edge is the root's divided by 2 to this.
    pub level: u32,
    /// First of its children, which stand side by side; any number where it has none.
    pub first_child: u32,
    /// 0–8; 0 is a leaf.
    pub children: u32,
    /// Smallest coordinates of its vertices and points, in steps of its level from the root's origin. What its page holds is relative
    /// to it.
    pub min_steps: [i32; 3],
    /// Extent of its vertices and points, in steps; at most 65,535.
    pub extent_steps: [u16; 3],
    /// Bounds the two-sided distance between what is drawn for it and the original; model units.
    pub error_geo: f32,
    /// The same with the error of appearance: √(geo² + app²); model units. Never smaller than that of any child.
    pub error_total: f32,
    /// Cone of the normals of its triangles: axis, of unit length.
    pub cone_axis: [f32; 3],
    /// Sine of its half-angle; ≥ 1 for every direction there is.
    pub cone_sine: f32,
    /// Distance of points to their neighbours, in model units: how large they are drawn at least; 0 without points.
    pub spacing: f32,
    /// Vertices of its triangles.
    pub vertices: u32,
    /// Triangles.
    pub triangles: u32,
    /// Points.
    pub points: u32,
    /// Edges of just one triangle: lines are drawn over them.
    pub borders: u32,
    /// Length of its page on disk.
    pub bytes: u32,
    /// CRC-32C of that.
    pub checksum: u32,
}

/// Root, node records and model.
#[derive(Clone, Debug)]
pub struct Skeleton {
    root: Root,
    nodes: Vec<NodeRecord>,
    /// Where each page begins in the file.
    offsets: Vec<u64>,
    model: Model,
}

impl Skeleton {
    /// A skeleton of these parts, with pages that stand from `pages_offset` on.
    pub fn new(root: Root, nodes: Vec<NodeRecord>, pages_offset: u64) -> Self {
        let mut offset = pages_offset;
        let offsets = nodes
            .iter()
            .map(|node| {
                let own = offset;
                offset = offset.saturating_add(u64::from(node.bytes));
                own
            })
            .collect();
        Self { root, nodes, offsets, model: Model::default() }
    }

    /// The same with the model that coded the pages.
    pub fn with_model(self, model: Model) -> Self {
        Self { model, ..self }
    }

    /// What coded the pages.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// What holds for the whole hierarchy.
    pub fn root(&self) -> &Root {
        &self.root
    }

    /// All node records, coarse first.
    pub fn nodes(&self) -> &[NodeRecord] {
        &self.nodes
    }

    /// The record of a node.
    ///
    /// # Panics
    /// When there is no such node: ids come from this skeleton.
    pub fn record(&self, node: NodeId) -> &NodeRecord {
        &self.nodes[node.0 as usize]
    }

    /// Where a node's page begins in the file.
    pub fn page_offset(&self, node: NodeId) -> u64 {
        self.offsets[node.0 as usize]
    }

    /// Length of a step of a level, in model units.
    pub fn step(&self, level: u32) -> f64 {
        self.root.edge / f64::from(1u32 << self.root.cell_bits) / 2f64.powi(level as i32)
    }
}
