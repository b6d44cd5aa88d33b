//! Hybrid: an octree of simplified triangles and points, a page for each node.
//!
//! The words: the root's *cell* is a cube; the cells of a node's children are the eighths of its own. A node holds a
//! simplified version of all surface whose triangles lie in its cell by their middles; so its *bounds* may stick out of the cell a
//! little. Positions are whole *steps* of a grid that all nodes of a level share: the root's edge divided by a power of two. A node's
//! page has the number of the node; nodes stand level by level, the children of one node side by side, so a prefix of the file is the
//! whole model at low resolution.
//!
//! Source: the hybrid paper, section 3.

mod codec;
mod contents;
pub mod skeleton;
mod stored;

pub use codec::{Model, PartBits, Prepared, Statistics};
pub use contents::Page;
pub use skeleton::{NodeId, NodeRecord, Root, Skeleton};
pub use stored::{MAX_BORDERS, MAX_LEVELS, MAX_POINTS, MAX_TRIANGLES, MAX_VERTICES};

use crate::container::{Section, read_checked};
use crate::{Container, FormatError, Kind};

/// An open hybrid file: the skeleton is in memory, pages are read one by one.
#[derive(Debug, Clone)]
pub struct HybridFile {
    container: Container,
    skeleton: Skeleton,
}

impl HybridFile {
    /// Reads and checks the skeleton.
    ///
    /// # Errors
    /// Damage is an error here: without its skeleton a file cannot be drawn at all.
    pub fn open(container: Container) -> Result<Self, FormatError> {
        container.expect_kind(Kind::Hybrid)?;
        let bytes = container.read_skeleton()?;
        let skeleton = Skeleton::parse(&bytes, container.pages_offset(), container.store().len())?;
        Ok(Self { container, skeleton })
    }

    /// The outer layer.
    pub fn container(&self) -> &Container {
        &self.container
    }

    /// Root and all node records.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Reads, checks and decodes the page of one node.
    ///
    /// # Errors
    /// [`FormatError::Checksum`] for a damaged page; [`FormatError::Invalid`] for one that contradicts itself.
    pub fn read_page(&self, node: NodeId) -> Result<Page, FormatError> {
        let record = self.skeleton.record(node);
        let section = Section {
            offset: self.skeleton.page_offset(node),
            bytes: u64::from(record.bytes),
            checksum: record.checksum,
        };
        let bytes = read_checked(&**self.container.store(), &format!("page {node}"), section)?;
        Page::decode(&bytes, &self.skeleton, node)
    }
}
