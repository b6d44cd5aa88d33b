//! Splats: a hierarchy of bounding spheres, larger ones first, in pages.
//!
//! The words: a *node* is 32 bits (plus 16 of colour). The children of one node are a *group* of 2–4 nodes. The groups that
//! hang from one group, its up to 16 grandchildren-to-be, are a *family*; it lies in one piece, so one pointer per group finds
//! it, and none is needed where all nodes of the group are leaves. A family never straddles two pages. On disk a pointer is a
//! *link*: one of a few cursors of the page ([`links`]), and how many families it skips; [`Page`] puts pointers in when it decodes.
//!
//! Source: the splats paper, sections 3.1 and 3.2.

pub mod codec;
mod contents;
pub mod links;
pub mod node;
pub mod page;
pub mod skeleton;

pub use contents::PageContents;
pub use links::{FamilyPlace, Link, Linker};
pub use node::{Children, Node};
pub use page::{Page, WordIndex};
pub use skeleton::{PageId, PageRecord, Root, Skeleton};

use crate::container::{Section, read_checked};
use crate::{Container, FormatError, Kind};

/// An open splat file: the skeleton is in memory, pages are read one by one.
#[derive(Debug, Clone)]
pub struct SplatFile {
    container: Container,
    skeleton: Skeleton,
}

impl SplatFile {
    /// Reads and checks the skeleton.
    ///
    /// # Errors
    /// Damage is an error here: without its skeleton a file cannot be drawn at all.
    pub fn open(container: Container) -> Result<Self, FormatError> {
        container.expect_kind(Kind::Splats)?;
        let bytes = container.read_skeleton()?;
        let skeleton = Skeleton::parse(&bytes, container.pages_offset(), container.store().len())?;
        Ok(Self { container, skeleton })
    }

    /// The outer layer.
    pub fn container(&self) -> &Container {
        &self.container
    }

    /// Root, counts and page directory.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Reads, checks and decodes one page.
    ///
    /// # Errors
    /// [`FormatError::Checksum`] for a damaged page; [`FormatError::Invalid`] for one that contradicts itself.
    pub fn read_page(&self, page: PageId) -> Result<Page, FormatError> {
        let record = self.skeleton.record(page);
        let section = Section {
            offset: self.skeleton.page_offset(page),
            bytes: u64::from(record.bytes),
            checksum: record.checksum,
        };
        let bytes = read_checked(&**self.container.store(), &format!("page {page}"), section)?;
        Page::decode(&bytes, &self.skeleton, page)
    }
}
