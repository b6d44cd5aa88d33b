//! The skeleton of a splat file: its root sphere, its counts, a record for each page, coarse pages first, and the model that
//! entropy-coded pages need.

use super::codec::Model;
use super::page;
use crate::FormatError;
use crate::bytes::Fields;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Sphere};
use glam::{DVec3, Vec3};
use std::fmt;

/// Number of a page, from 0; page 0 holds the root.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PageId(pub u32);

impl fmt::Display for PageId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What holds for the whole hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// Origin of local space, in model space: the middle of the bounds.
    pub origin: DVec3,
    /// The root's sphere, decoded; local space.
    pub sphere: Sphere,
    /// No decoded descendant of any node reaches farther from the node's centre than this times the node's radius; ≥ 1.
    pub overhang: f32,
    /// Around all referenced vertices; model space.
    pub bounds: Aabb,
    /// Number of nodes.
    pub nodes: u64,
    /// Number of leaves.
    pub leaves: u64,
    /// Number of levels; 1 for a single leaf.
    pub levels: u32,
    /// True when every node has a colour.
    pub has_colors: bool,
    /// True when the mesh is closed and consistently oriented, so that what shows its back is hidden.
    pub closed: bool,
    /// Which way is up.
    pub up: UpAxis,
}

/// Where a page is and what it holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageRecord {
    /// Length on disk.
    pub bytes: u32,
    /// CRC-32C of the bytes on disk.
    pub checksum: u32,
    /// Nodes in it, 1–8192.
    pub nodes: u16,
    /// Nodes and pointers in it.
    pub words: u16,
    /// Families in it, 1–4096.
    pub families: u16,
    /// How its bytes are coded: see [`page`].
    pub codec: u8,
}

/// Root and page directory.
#[derive(Clone, Debug)]
pub struct Skeleton {
    root: Root,
    pages: Vec<PageRecord>,
    /// Where each page begins in the file.
    offsets: Vec<u64>,
    model: Option<Model>,
}

const ROOT_BYTES: usize = 128;
const RECORD_BYTES: usize = 16;
const HAS_COLORS: u32 = 1;
const CLOSED: u32 = 2;
const Z_UP: u32 = 4;

impl Skeleton {
    /// Length on disk of the skeleton of so many pages.
    pub fn encoded_bytes(page_count: u64, model: Option<&Model>) -> u64 {
        let model_bytes = model.map_or(0, |model| model.to_bytes().len() as u64);
        ROOT_BYTES as u64 + RECORD_BYTES as u64 * page_count + model_bytes
    }

    /// The bytes of a skeleton. `model` is what coded the pages, if any are coded.
    pub fn encode(root: &Root, pages: &[PageRecord], model: Option<&Model>) -> Vec<u8> {
        let model = model.map(Model::to_bytes).unwrap_or_default();
        let mut out = Vec::with_capacity(ROOT_BYTES + RECORD_BYTES * pages.len() + model.len());
        out.extend(root.origin.to_array().iter().flat_map(|x| x.to_le_bytes()));
        out.extend(root.sphere.center.to_array().iter().flat_map(|x| x.to_le_bytes()));
        out.extend(root.sphere.radius.to_le_bytes());
        out.extend(root.overhang.to_le_bytes());
        out.extend([root.bounds.min, root.bounds.max].iter().flat_map(DVec3::to_array).flat_map(f64::to_le_bytes));
        out.extend([root.nodes, root.leaves, pages.len() as u64].iter().flat_map(|x| x.to_le_bytes()));
        out.extend(root.levels.to_le_bytes());
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let flags = flag(root.has_colors, HAS_COLORS) | flag(root.closed, CLOSED) | flag(root.up == UpAxis::Z, Z_UP);
        out.extend(flags.to_le_bytes());
        out.extend((model.len() as u32).to_le_bytes());
        debug_assert_eq!(out.len(), ROOT_BYTES);
        for page in pages {
            out.extend([page.bytes, page.checksum].iter().flat_map(|x| x.to_le_bytes()));
            out.extend([page.nodes, page.words, page.families].iter().flat_map(|x| x.to_le_bytes()));
            out.extend([page.codec, 0]);
        }
        out.extend(model);
        out
    }

    /// Checks and decodes a skeleton; `pages_offset` and `file_bytes` bound what its records may claim.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] naming the record, and [`FormatError::Truncated`] where pages end beyond the file.
    pub fn parse(bytes: &[u8], pages_offset: u64, file_bytes: u64) -> Result<Self, FormatError> {
        let invalid = |problem: String| FormatError::invalid("the skeleton", problem);
        if bytes.len() < ROOT_BYTES {
            return Err(invalid(format!("{} bytes, expected at least {ROOT_BYTES}", bytes.len())));
        }
        let mut fields = Fields(bytes);
        let vector = |fields: &mut Fields<'_>| DVec3::new(fields.f64(), fields.f64(), fields.f64());
        let origin = vector(&mut fields);
        let center = Vec3::new(fields.f32(), fields.f32(), fields.f32());
        let (radius, overhang) = (fields.f32(), fields.f32());
        let bounds = Aabb { min: vector(&mut fields), max: vector(&mut fields) };
        let (nodes, leaves, page_count) = (fields.u64(), fields.u64(), fields.u64());
        let (levels, flags, model_bytes) = (fields.u32(), fields.u32(), fields.u32());
        if !origin.is_finite() || !bounds.min.is_finite() || !bounds.max.is_finite() || bounds.is_empty() {
            return Err(invalid(format!(
                "an origin at {} and bounds from {} to {}, expected finite numbers, the smaller first",
                shown(origin),
                shown(bounds.min),
                shown(bounds.max)
            )));
        }
        if !center.is_finite() || !(0.0..=f32::MAX).contains(&radius) || !(1.0..=64.0).contains(&overhang) {
            return Err(invalid(format!(
                "a root sphere at {center} with radius {radius} and overhang {overhang}, expected finite numbers, a radius ≥ 0, an overhang of 1–64"
            )));
        }
        let Some(record_bytes) = (bytes.len() - ROOT_BYTES).checked_sub(model_bytes as usize) else {
            return Err(invalid(format!("a model of {model_bytes} bytes in {} bytes of skeleton", bytes.len())));
        };
        let whole = record_bytes.is_multiple_of(RECORD_BYTES) && (record_bytes / RECORD_BYTES) as u64 == page_count;
        if !whole || !(1..=u64::from(u32::MAX)).contains(&page_count) {
            return Err(invalid(format!("{page_count} pages in {} bytes of skeleton", bytes.len())));
        }
        if flags & !(HAS_COLORS | CLOSED | Z_UP) != 0 {
            return Err(invalid(format!("flags {flags:#x}, expected none beyond {:#x}", HAS_COLORS | CLOSED | Z_UP)));
        }
        let root = Root {
            origin,
            sphere: Sphere { center, radius },
            overhang,
            bounds,
            nodes,
            leaves,
            levels,
            has_colors: flags & HAS_COLORS != 0,
            closed: flags & CLOSED != 0,
            up: if flags & Z_UP != 0 { UpAxis::Z } else { UpAxis::Y },
        };
        let mut pages = Vec::with_capacity(page_count as usize);
        let mut offsets = Vec::with_capacity(page_count as usize);
        let (mut offset, mut counted) = (pages_offset, 0u64);
        for number in 0..page_count {
            let record = PageRecord {
                bytes: fields.u32(),
                checksum: fields.u32(),
                nodes: fields.u16(),
                words: fields.u16(),
                families: fields.u16(),
                codec: {
                    let codec = fields.u8();
                    fields.u8();
                    codec
                },
            };
            page::check_record(&record, number)?;
            offsets.push(offset);
            offset = offset.saturating_add(u64::from(record.bytes));
            counted += u64::from(record.nodes);
            pages.push(record);
        }
        if offset > file_bytes {
            return Err(FormatError::Truncated { what: "the last page".into(), end: offset, file_bytes });
        }
        if counted != nodes {
            return Err(invalid(format!("pages of {counted} nodes in all, expected {nodes}")));
        }
        if !(1..=nodes).contains(&leaves) || !(1..=nodes).contains(&u64::from(levels)) {
            return Err(invalid(format!("{leaves} leaves on {levels} levels, expected 1–{nodes} of each")));
        }
        let model = if model_bytes > 0 { Some(Model::parse(&bytes[ROOT_BYTES + record_bytes..])?) } else { None };
        Ok(Self { root, pages, offsets, model })
    }

    /// What holds for the whole hierarchy.
    pub fn root(&self) -> &Root {
        &self.root
    }

    /// What entropy-coded pages are decoded with; none where all pages are raw.
    pub fn model(&self) -> Option<&Model> {
        self.model.as_ref()
    }

    /// All page records, coarse first.
    pub fn pages(&self) -> &[PageRecord] {
        &self.pages
    }

    /// The record of a page.
    ///
    /// # Panics
    /// When there is no such page: ids come from this skeleton.
    pub fn record(&self, page: PageId) -> &PageRecord {
        &self.pages[page.0 as usize]
    }

    /// Where a page begins in the file.
    pub fn page_offset(&self, page: PageId) -> u64 {
        self.offsets[page.0 as usize]
    }
}

/// In a line of bounded length, whatever the numbers.
fn shown(place: DVec3) -> String {
    let is_long = |value: f64| value != 0.0 && !(1e-9..1e16).contains(&value.abs());
    let number = |value: f64| if is_long(value) { format!("{value:e}") } else { value.to_string() };
    format!("[{}, {}, {}]", number(place.x), number(place.y), number(place.z))
}
