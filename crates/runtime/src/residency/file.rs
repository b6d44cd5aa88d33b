//! Files of any representation, as residency sees them: so many numbered pages, each with a size that is known before it is loaded.

use gigalod_format::hybrid::{self, HybridFile, NodeId};
use gigalod_format::splats::{self, PageId, SplatFile};
use gigalod_format::{Container, FormatError, Kind};
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use std::fmt;
use std::sync::Arc;

/// Number of a page in its file, whatever it holds: of splats that of its record, of a hybrid file that of its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PageNumber(pub u32);

impl From<PageId> for PageNumber {
    fn from(page: PageId) -> Self {
        Self(page.0)
    }
}

impl From<NodeId> for PageNumber {
    fn from(node: NodeId) -> Self {
        Self(node.0)
    }
}

impl fmt::Display for PageNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A file open for drawing.
#[derive(Clone, Debug)]
pub enum ModelFile {
    /// A hierarchy of spheres.
    Splats(Arc<SplatFile>),
    /// An octree of triangles and points.
    Hybrid(Arc<HybridFile>),
}

impl From<Arc<SplatFile>> for ModelFile {
    fn from(file: Arc<SplatFile>) -> Self {
        Self::Splats(file)
    }
}

impl From<Arc<HybridFile>> for ModelFile {
    fn from(file: Arc<HybridFile>) -> Self {
        Self::Hybrid(file)
    }
}

/// A page as it was decoded.
#[derive(Debug)]
pub enum DecodedPage {
    /// Of a splat file.
    Splats(splats::Page),
    /// Of a hybrid file.
    Hybrid(hybrid::Page),
}

impl ModelFile {
    /// Reads and checks the skeleton, of whichever kind it is.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn open(container: Container) -> Result<Self, FormatError> {
        match container.kind() {
            Kind::Hybrid => Ok(Self::Hybrid(Arc::new(HybridFile::open(container)?))),
            _ => Ok(Self::Splats(Arc::new(SplatFile::open(container)?))),
        }
    }

    /// The outer layer.
    pub fn container(&self) -> &Container {
        match self {
            Self::Splats(file) => file.container(),
            Self::Hybrid(file) => file.container(),
        }
    }

    /// Around everything; model space.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Splats(file) => file.skeleton().root().bounds,
            Self::Hybrid(file) => file.skeleton().root().bounds,
        }
    }

    /// Which way is up.
    pub fn up(&self) -> UpAxis {
        match self {
            Self::Splats(file) => file.skeleton().root().up,
            Self::Hybrid(file) => file.skeleton().root().up,
        }
    }

    /// Largest error on screen, in pixels, where nobody says: of triangles half a pixel; the diameter of a splat is a pixel.
    pub fn default_error_px(&self) -> f64 {
        match self {
            Self::Splats(_) => 1.0,
            Self::Hybrid(_) => 0.5,
        }
    }

    /// The file, if it holds splats.
    pub fn splats(&self) -> Option<&Arc<SplatFile>> {
        match self {
            Self::Splats(file) => Some(file),
            Self::Hybrid(_) => None,
        }
    }

    /// The file, if it is hybrid.
    pub fn hybrid(&self) -> Option<&Arc<HybridFile>> {
        match self {
            Self::Hybrid(file) => Some(file),
            Self::Splats(_) => None,
        }
    }

    /// Reads, checks and decodes a page.
    ///
    /// # Errors
    /// What is wrong with it.
    ///
    /// # Panics
    /// When there is no such page: residency asks only for those that there are.
    pub fn read_page(&self, page: PageNumber) -> Result<DecodedPage, FormatError> {
        match self {
            Self::Splats(file) => file.read_page(PageId(page.0)).map(DecodedPage::Splats),
            Self::Hybrid(file) => file.read_page(NodeId(page.0)).map(DecodedPage::Hybrid),
        }
    }

    /// Number of its pages.
    pub(super) fn pages(&self) -> usize {
        match self {
            Self::Splats(file) => file.skeleton().pages().len(),
            Self::Hybrid(file) => file.skeleton().nodes().len(),
        }
    }

    /// What a page will take once it is decoded.
    pub(super) fn bytes_to_come(&self, page: PageNumber) -> u64 {
        match self {
            Self::Splats(file) => {
                let word_bytes = if file.skeleton().root().has_colors { 6 } else { 4 };
                let words = file.skeleton().record(PageId(page.0)).words;
                size_of::<splats::Page>() as u64 + u64::from(words) * word_bytes
            }
            Self::Hybrid(file) => {
                let record = file.skeleton().record(NodeId(page.0));
                let color_bytes = if file.skeleton().root().has_colors { 4 } else { 0 };
                size_of::<hybrid::Page>() as u64
                    + (u64::from(record.vertices) + u64::from(record.points)) * (10 + color_bytes)
                    + u64::from(record.triangles) * 12
                    + u64::from(record.borders) * 8
            }
        }
    }
}
