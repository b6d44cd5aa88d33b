//! What `info` tells about a file: a JSON object at its end, not needed for drawing.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Counts of what was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputCounts {
    /// Triangles, polygons and strips taken apart.
    pub triangles: u64,
    /// Vertices, unreferenced ones included.
    pub vertices: u64,
    /// Points that came without a mesh.
    pub points: u64,
}

/// An axis-aligned box; model space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: [f64; 3],
    /// Largest coordinates.
    pub max: [f64; 3],
}

/// What one level of a hierarchy holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelSummary {
    /// 0 is the root.
    pub level: u32,
    /// Nodes on this level.
    pub nodes: u64,
    /// Triangles of their payloads.
    pub triangles: u64,
    /// Points of their payloads.
    pub points: u64,
    /// Bytes of pages; a page that holds several levels is shared out by their nodes.
    pub bytes: u64,
    /// Largest `error_geo` of these nodes, in model units.
    pub max_error: f64,
}

/// How large triangles were cut into samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dicing {
    /// No sample stands for more than a square of this size; model units.
    pub spacing: f64,
    /// Triangles that were cut, or became a sample each.
    pub triangles: u64,
    /// Leaves that they became; all others are vertices.
    pub samples: u64,
}

/// What the model's coordinates mean on the Earth, as far as its file said; nothing of it is needed to draw.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReferenceSystem {
    /// What the file called it.
    pub name: Option<String>,
    /// Number in the register of EPSG.
    pub epsg: Option<u32>,
    /// Description in well-known text.
    pub wkt: Option<String>,
}

/// Facts about a file and how it was built. Never a time, a path or a machine: same input and options, same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Program and version that built it.
    pub generator: String,
    /// What was read.
    pub input: InputCounts,
    /// Build options by their command-line names, as they took effect. `units` is there where somebody said what a length of 1
    /// is: `m`, `mm`, `cm`, `km`, `ft`, `us-ft` or `in`.
    pub options: BTreeMap<String, String>,
    /// All nodes.
    pub nodes: u64,
    /// Number of levels.
    pub levels: u32,
    /// Nodes without children.
    pub leaves: u64,
    /// How many of them repeat another leaf: of points far away from others, so that these are not drawn too large.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub repeated: u64,
    /// Size before entropy coding: the skeleton, nodes, colours, group sizes, and a 16-bit page-relative pointer for each
    /// group that needs one.
    pub raw_bytes: u64,
    /// True when the mesh was proved closed and consistently oriented.
    pub closed: bool,
    /// Around all referenced vertices.
    pub bounds: Bounds,
    /// Where the input said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_system: Option<ReferenceSystem>,
    /// Of `"normals"`, `"colors"`, …: what the nodes carry.
    pub attributes: Vec<String>,
    /// How large triangles were cut, if any were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dicing: Option<Dicing>,
    /// Coarse to fine.
    pub per_level: Vec<LevelSummary>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_zero(value: &u64) -> bool {
    *value == 0
}
