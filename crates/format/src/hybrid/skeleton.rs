//! The skeleton of a hybrid file: what holds for all of it, and a record for each node, coarse ones first.

use super::codec::Model;
use crate::FormatError;
use crate::bytes::Fields;
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
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Root and node records.
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

const ROOT_BYTES: usize = 116;
const RECORD_BYTES: usize = 84;

impl Skeleton {
    /// Length on disk of the skeleton of so many nodes.
    pub fn encoded_bytes(nodes: u64) -> u64 {
        ROOT_BYTES as u64 + nodes * RECORD_BYTES as u64
    }

    /// Its bytes on disk.
    pub fn encode(root: &Root, nodes: &[NodeRecord]) -> Vec<u8> {
        let mut out = Vec::with_capacity(ROOT_BYTES + RECORD_BYTES * nodes.len());
        out.extend(root.origin.to_array().iter().flat_map(|x| x.to_le_bytes()));
        out.extend(root.edge.to_le_bytes());
        out.extend([root.bounds.min, root.bounds.max].iter().flat_map(DVec3::to_array).flat_map(f64::to_le_bytes));
        out.extend([root.nodes, root.leaves].iter().flat_map(|x| x.to_le_bytes()));
        out.extend(
            [root.levels, root.cell_bits, root.normal_bits, root.resolution].iter().flat_map(|x| x.to_le_bytes()),
        );
        let flags = [root.preserves_appearance, root.has_colors, root.closed, root.up == UpAxis::Z];
        out.extend(flags.map(u8::from));
        out.resize(ROOT_BYTES, 0);
        for node in nodes {
            out.extend([node.level, node.first_child, node.children].iter().flat_map(|x| x.to_le_bytes()));
            out.extend(node.min_steps.iter().flat_map(|x| x.to_le_bytes()));
            out.extend(node.extent_steps.iter().flat_map(|x| x.to_le_bytes()));
            out.extend([0; 2]);
            let [x, y, z] = node.cone_axis;
            let floats = [node.error_geo, node.error_total, x, y, z, node.cone_sine, node.spacing];
            out.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
            let counts = [node.vertices, node.triangles, node.points, node.borders, node.bytes, node.checksum];
            out.extend(counts.iter().flat_map(|x| x.to_le_bytes()));
        }
        out
    }

    /// Checks and decodes a skeleton.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] naming the record, and [`FormatError::Truncated`] where pages end beyond the file.
    pub fn parse(bytes: &[u8], pages_offset: u64, file_bytes: u64) -> Result<Self, FormatError> {
        let invalid = |problem: String| FormatError::invalid("the skeleton", problem);
        if bytes.len() < ROOT_BYTES || (bytes.len() - ROOT_BYTES) % RECORD_BYTES != 0 {
            return Err(invalid(format!("{} bytes, expected {ROOT_BYTES} and {RECORD_BYTES} a node", bytes.len())));
        }
        let mut fields = Fields(&bytes[..ROOT_BYTES]);
        let vector = |fields: &mut Fields<'_>| DVec3::new(fields.f64(), fields.f64(), fields.f64());
        let root = Root {
            origin: vector(&mut fields),
            edge: fields.f64(),
            bounds: Aabb { min: vector(&mut fields), max: vector(&mut fields) },
            nodes: fields.u64(),
            leaves: fields.u64(),
            levels: fields.u32(),
            cell_bits: fields.u32(),
            normal_bits: fields.u32(),
            resolution: fields.u32(),
            preserves_appearance: fields.u8() != 0,
            has_colors: fields.u8() != 0,
            closed: fields.u8() != 0,
            up: if fields.u8() != 0 { UpAxis::Z } else { UpAxis::Y },
        };
        let nodes: Vec<NodeRecord> = bytes[ROOT_BYTES..]
            .chunks_exact(RECORD_BYTES)
            .map(|record| {
                let mut fields = Fields(record);
                let (level, first_child, children) = (fields.u32(), fields.u32(), fields.u32());
                let min_steps = [(); 3].map(|()| fields.u32() as i32);
                let extent_steps = [(); 3].map(|()| fields.u16());
                fields.u16();
                NodeRecord {
                    level,
                    first_child,
                    children,
                    min_steps,
                    extent_steps,
                    error_geo: fields.f32(),
                    error_total: fields.f32(),
                    cone_axis: [(); 3].map(|()| fields.f32()),
                    cone_sine: fields.f32(),
                    spacing: fields.f32(),
                    vertices: fields.u32(),
                    triangles: fields.u32(),
                    points: fields.u32(),
                    borders: fields.u32(),
                    bytes: fields.u32(),
                    checksum: fields.u32(),
                }
            })
            .collect();
        let skeleton = Self::new(root, nodes, pages_offset);
        let end = skeleton.nodes.iter().fold(pages_offset, |sum, node| sum.saturating_add(u64::from(node.bytes)));
        if end > file_bytes {
            return Err(FormatError::Truncated { what: "the last page".into(), end, file_bytes });
        }
        Ok(skeleton)
    }
}
