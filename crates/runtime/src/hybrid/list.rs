//! Lists of nodes: what a hybrid cut writes and a renderer draws.
//!
//! What always holds: nodes stand in ascending order of their numbers; a page is that of its node; the page of a node that is drawn
//! stays alive with the list, whatever residency does.

use super::fade::Ranks;
use crate::FileId;
use crate::splats::Tint;
use gigalod_format::hybrid::{HybridFile, NodeId, Page};
use std::sync::Arc;

/// Nodes to be drawn of one instance. Reused from frame to frame.
#[derive(Clone, Debug)]
pub struct HybridList {
    /// Which model, in its residency: with a node's number a name for what is drawn.
    pub file: FileId,
    /// Its skeleton says where nodes are and how large a step is; `None` only of a list that was never filled.
    pub hybrid: Option<Arc<HybridFile>>,
    /// What to draw.
    pub nodes: Vec<HybridNode>,
    /// Where colours come from.
    pub tint: Tint,
}

/// One of them.
#[derive(Clone, Debug)]
pub struct HybridNode {
    /// Which.
    pub node: NodeId,
    /// What it holds.
    pub page: Arc<Page>,
    /// True where neighbours may have been simplified otherwise, so that gaps along its border must be closed by lines.
    pub draws_lines: bool,
    /// Which pixels show it.
    pub ranks: Ranks,
}

impl Default for HybridList {
    fn default() -> Self {
        Self { file: FileId(u32::MAX), hybrid: None, nodes: Vec::new(), tint: Tint::default() }
    }
}

impl HybridList {
    /// Bytes that it keeps; pages are residency's.
    pub fn bytes(&self) -> u64 {
        (self.nodes.capacity() * size_of::<HybridNode>()) as u64
    }

    /// Empties it and keeps its memory.
    pub fn clear(&mut self) {
        self.hybrid = None;
        self.nodes.clear();
    }
}

/// Equal are lists of the same nodes of the same model, drawn alike.
impl PartialEq for HybridList {
    fn eq(&self, other: &Self) -> bool {
        let is_same =
            |(a, b): (&HybridNode, &HybridNode)| (a.node, a.draws_lines, a.ranks) == (b.node, b.draws_lines, b.ranks);
        self.file == other.file
            && self.tint == other.tint
            && self.nodes.len() == other.nodes.len()
            && self.nodes.iter().zip(&other.nodes).all(is_same)
    }
}
