//! How the builder keeps within its memory.
//!
//! Everything that grows with the model is a [`Spool`](crate::spool::Spool): in memory if all of it fits into half the budget, else
//! in files. The other half is for the pieces that are worked on. Which it is changes the time a build takes, never its bytes.

use super::chunk::MAX_LEAVES;
use crate::Options;
use crate::spool::Place;
use gigalod_import::ModelStream;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the spools take for each vertex and triangle, at the stage where they take most: position, normal, colour and gathered
/// attributes; then leaf, kept nodes and packed nodes.
const SPOOLED_PER_VERTEX: u64 = 24 + 12 + 3 + 16 + 4;
const SPOOLED_PER_TRIANGLE: u64 = 12 + 6;

/// What they take besides where materials have textures: texture coordinates, their numbers and a material's.
const PAINT_PER_VERTEX: u64 = 8 + 8;
const PAINT_PER_TRIANGLE: u64 = 12 + 4;

/// What they take for each point of a cloud without faces. What is spooled first is less than of a mesh, which has two triangles
/// a vertex; from the leaves on it is the same.
const SPOOLED_PER_POINT: u64 = SPOOLED_PER_VERTEX + 2 * SPOOLED_PER_TRIANGLE + 5;

/// Bytes of work for each triangle that is joined with its vertices at a time: the triangle, its corners, their order, positions,
/// and what it gives to its vertices; all but the positions twice, as the batch before is gathered meanwhile.
const WORK_PER_TRIANGLE: u64 = 12 + 3 * 24 + 2 * (12 + 3 * 8 + 32 + 6);

/// Bytes of work for each triangle that is diced: what its corners carry, twice while it is fetched, and its grid.
const WORK_PER_DICED: u64 = 3 * 2 * (24 + 12 + 3 + 8 + 12) + 24 + 300;

/// Bytes of work for each leaf of a block: the leaf, its kept nodes, and a share of the trees in work.
const WORK_PER_LEAF: u64 = 160;

/// Bytes of work of each thread: the tree of a chunk (`chunk::TREE`), what becomes of it, and a chunk that is quantised.
const WORK_PER_THREAD: u64 = 13 << 20;

#[derive(Debug)]
pub(crate) struct MemoryPlan<'a> {
    budget: u64,
    threads: usize,
    place: Place<'a>,
    /// For what does not fit where the rest does.
    folder: &'a Path,
    /// What comes from now on does not fit.
    is_spilled: AtomicBool,
}

/// Threads to work with: as many as are asked for, or one a core, but no more than memory has room for.
pub(crate) fn threads(options: &Options) -> usize {
    let asked = match options.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    asked.clamp(1, (options.memory_bytes / 2 / WORK_PER_THREAD).max(1) as usize)
}

/// Decides by what the stream declares; a stream that declares nothing is spooled to files.
pub(crate) fn fits_into_memory(options: &Options, input: &dyn ModelStream) -> bool {
    let spooled = match (input.declared_vertices(), input.declared_faces()) {
        (Some(vertices), Some(faces)) => {
            let is_painted = input.materials().iter().any(|material| material.texture.is_some());
            let paint = if is_painted { [PAINT_PER_VERTEX, PAINT_PER_TRIANGLE] } else { [0; 2] };
            let of_vertices = vertices.saturating_mul(SPOOLED_PER_VERTEX + paint[0]);
            let mesh = of_vertices.saturating_add(faces.saturating_mul(SPOOLED_PER_TRIANGLE + paint[1]));
            mesh.max(vertices.saturating_mul(SPOOLED_PER_POINT))
        }
        _ => u64::MAX,
    };
    spooled <= options.memory_bytes / 2
}

impl<'a> MemoryPlan<'a> {
    pub(crate) fn new(options: &Options, place: Place<'a>, folder: &'a Path) -> Self {
        let (budget, threads) = (options.memory_bytes, threads(options));
        Self { budget, threads, place, folder, is_spilled: AtomicBool::new(false) }
    }

    pub(crate) fn place(&self) -> Place<'a> {
        if self.is_spilled.load(Ordering::Relaxed) { self.place_in_files() } else { self.place }
    }

    /// For what lies in files whatever room there is.
    pub(crate) fn place_in_files(&self) -> Place<'a> {
        match self.place {
            Place::Memory => Place::Folder(self.folder),
            other => other,
        }
    }

    /// True where all spools are in memory.
    pub(crate) fn is_in_memory(&self) -> bool {
        matches!(self.place(), Place::Memory)
    }

    /// So many leaves are to come, of which the input said nothing: from now on spools are in files, if there are too many.
    /// `spooled` is what is in memory beside them.
    pub(crate) fn expect_leaves(&self, leaves: u64, spooled: u64) {
        if leaves.saturating_mul(SPOOLED_PER_VERTEX).saturating_add(spooled) > self.budget / 2 {
            self.is_spilled.store(true, Ordering::Relaxed);
        }
    }

    /// Bytes for what is worked on.
    pub(crate) fn half(&self) -> u64 {
        self.budget / 2
    }

    /// Most bytes to decode a picture in.
    pub(crate) fn picture_bytes(&self) -> u64 {
        self.budget / 2
    }

    /// Bytes for tiles of pictures.
    pub(crate) fn tile_bytes(&self) -> u64 {
        self.budget / 16
    }

    /// Triangles to be diced at a time.
    pub(crate) fn diced_at_once(&self) -> usize {
        ((self.budget / 8 / WORK_PER_DICED) as usize).clamp(256, 1 << 16)
    }

    /// Cells of them to be made into leaves at a time.
    pub(crate) fn cells_at_once(&self) -> usize {
        self.threads << 14
    }

    /// Vertices that memory has room for.
    pub(crate) fn most_vertices(&self) -> u64 {
        self.budget / 2 / SPOOLED_PER_VERTEX
    }

    /// Triangles that memory has room for.
    pub(crate) fn most_triangles(&self) -> u64 {
        self.budget / 2 / SPOOLED_PER_TRIANGLE
    }

    /// Triangles to be joined with their vertices at a time.
    pub(crate) fn triangles_at_once(&self) -> usize {
        (self.budget / 2 / WORK_PER_TRIANGLE) as usize
    }

    /// Leaves to be made into trees at a time; never less than a chunk, which the smallest budget has room for.
    pub(crate) fn leaves_at_once(&self) -> usize {
        ((self.budget / 2 / WORK_PER_LEAF) as usize).max(MAX_LEAVES)
    }

    /// Records of a piece that is read from a spool.
    pub(crate) const PIECE: usize = 1 << 16;
}
