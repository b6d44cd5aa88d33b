//! Nodes that are made: their pages, not yet coded, in a spool, and a list of where these are.

use super::cell::Cell;
use super::round::Made;
use crate::journal::Extent;
use crate::spool::{Place, Spool};
use crate::work::Work;
use bytemuck::{Pod, Zeroable};
use gigalod_format::hybrid::{NodeRecord, Page};
use std::io;

/// A node in the list.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Entry {
    code: u64,
    /// Of its page in the spool.
    offset: u64,
    level: u32,
    min_steps: [i32; 3],
    extent_steps: [u16; 3],
    unused: u16,
    pub(super) error_geo: f32,
    pub(super) error_total: f32,
    cone_axis: [f32; 3],
    cone_sine: f32,
    spacing: f32,
    pub(super) vertices: u32,
    pub(super) triangles: u32,
    pub(super) points: u32,
}

impl Entry {
    pub(super) fn cell(&self) -> Cell {
        Cell { level: self.level, code: self.code }
    }

    /// Its record; children, borders and bytes are still to come.
    pub(super) fn record(&self) -> NodeRecord {
        NodeRecord {
            level: self.level,
            first_child: 0,
            children: 0,
            min_steps: self.min_steps,
            extent_steps: self.extent_steps,
            error_geo: self.error_geo,
            error_total: self.error_total,
            cone_axis: self.cone_axis,
            cone_sine: self.cone_sine,
            spacing: self.spacing,
            vertices: self.vertices,
            triangles: self.triangles,
            points: self.points,
            borders: 0,
            bytes: 0,
            checksum: 0,
        }
    }
}

/// All nodes that are made.
#[derive(Debug)]
pub(super) struct Nodes {
    pages: Spool<u8>,
    pub(super) list: Vec<Entry>,
}

/// Name of the spool of pages.
const PAGES: &str = "raw_pages";

impl Nodes {
    pub(super) fn new(place: &Place<'_>) -> io::Result<Self> {
        Ok(Self { pages: Spool::named(place, PAGES)?, list: Vec::new() })
    }

    pub(super) fn push(&mut self, made: &Made) -> io::Result<()> {
        let Made { cell, record, page } = made;
        self.list.push(Entry {
            code: cell.code,
            offset: self.pages.len(),
            level: cell.level,
            min_steps: record.min_steps,
            extent_steps: record.extent_steps,
            unused: 0,
            error_geo: record.error_geo,
            error_total: record.error_total,
            cone_axis: record.cone_axis,
            cone_sine: record.cone_sine,
            spacing: record.spacing,
            vertices: record.vertices,
            triangles: record.triangles,
            points: record.points,
        });
        self.pages.push(bytemuck::cast_slice(&page.positions))?;
        self.pages.push(bytemuck::cast_slice(&page.normals))?;
        self.pages.push(page.colors.as_flattened())?;
        self.pages.push(bytemuck::cast_slice(&page.triangles))
    }

    /// The page of a node, without its borders.
    pub(super) fn page(&self, entry: &Entry, has_colors: bool) -> io::Result<Page> {
        let count = (entry.vertices + entry.points) as usize;
        let mut page = Page {
            positions: vec![[0; 3]; count],
            normals: vec![0; count],
            colors: vec![[0; 4]; if has_colors { count } else { 0 }],
            triangles: vec![[0; 3]; entry.triangles as usize],
            borders: Vec::new(),
        };
        let mut at = entry.offset;
        let parts: [&mut [u8]; 4] = [
            bytemuck::cast_slice_mut(&mut page.positions),
            bytemuck::cast_slice_mut(&mut page.normals),
            page.colors.as_flattened_mut(),
            bytemuck::cast_slice_mut(&mut page.triangles),
        ];
        for part in parts {
            self.pages.read(at, part)?;
            at += part.len() as u64;
        }
        Ok(page)
    }

    /// Puts all on disk; the list under this name.
    pub(super) fn secure(&self, place: &Place<'_>, list: &str) -> io::Result<Vec<(String, Extent)>> {
        let mut spool = Spool::named(place, list)?;
        spool.push(&self.list)?;
        Ok(vec![self.pages.secure()?, spool.secure()?])
    }

    /// As an earlier process left them.
    pub(super) fn reopen(work: &Work, list: &str) -> io::Result<Self> {
        let spool = Spool::reopen(work, list)?;
        let mut all = Vec::new();
        spool.read_vec(0, spool.len() as usize, &mut all)?;
        Ok(Self { pages: Spool::reopen(work, PAGES)?, list: all })
    }
}
