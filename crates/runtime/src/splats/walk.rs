//! The fast traversal: what one thread does of a cut.
//!
//! In: a [`Cut`], which all threads share: the look, the pages, and *items*, groups from which subtrees hang, in the order of the
//! tree. Out: pieces of the list, wanted pages, counts. Items come in *chunks*; who is free takes the next one.
//! What always holds: a thread's pieces name their chunk, so the list is in the tree's order whoever made which; a warm worker
//! allocates nothing; it looks whether it shall stop every [`CHECK_GROUPS`] groups, that is after at most four times as many nodes.

use super::Tint;
use super::group::{Below, Group, Inconsistent, Stored, ones};
use super::lanes::{Known, Look, keep};
use super::list::{SplatBall, SplatList, SplatPiece};
use crate::fineness::Interrupt;
use crate::residency::PageTable;
use crate::{CutReport, Limit};
use gigalod_format::splats::{Node, Page, PageId, Root};
use glam::Vec4;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

/// How often a traversal looks whether it shall stop.
pub const CHECK_GROUPS: u32 = 256;

/// Splats that a worker collects before it appends them to a piece.
const BATCH: usize = 1024;

/// What a page may be worth at most to one node.
pub(super) const MOST_BENEFIT_PX: f32 = 1e6;

/// Parts of a pixel in which benefits are summed.
pub(super) const BENEFIT_UNITS: f32 = (1 << 20) as f32;

/// A part of the work, in the order of the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    group: Group,
    /// With all that is below; else the group alone, because what is below are the next items.
    whole: bool,
}

/// One cut, as all threads share it.
#[derive(Debug)]
pub(super) struct Cut {
    pub(super) look: Look,
    pub(super) table: Arc<PageTable<Page>>,
    /// What pages are marked with.
    pub(super) frame: u32,
    pub(super) max_nodes: u64,
    pub(super) tint: Tint,
    pub(super) most_splats: u64,
    /// Capacity of a new piece.
    pub(super) piece_splats: usize,
    pub(super) interrupt: Interrupt,
    pub(super) items: Vec<Item>,
    pub(super) chunks: u32,
    pub(super) next_chunk: AtomicU32,
    pub(super) drawn: AtomicU64,
    pub(super) stop: AtomicBool,
    /// Empty pieces, and bytes that may be allocated for more.
    pub(super) free: Mutex<(Vec<SplatPiece>, u64)>,
    pub(super) no_room: AtomicBool,
    /// Pages that were wanted last time.
    pub(super) wanted_before: usize,
}

impl Cut {
    /// True when nobody needs the rest.
    fn is_over(&self) -> bool {
        self.stop.load(Relaxed) || self.interrupt.is_set()
    }

    /// A used piece or a new one; none, and the cut is over, where that would be too much memory.
    fn empty_piece(&self) -> Option<SplatPiece> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let (pieces, room_bytes) = &mut *free;
        if let Some(piece) = pieces.pop() {
            return Some(piece);
        }
        match room_bytes.checked_sub(self.piece_splats as u64 * SplatList::SPLAT_BYTES) {
            Some(left) => *room_bytes = left,
            None => {
                self.no_room.store(true, Relaxed);
                self.stop.store(true, Relaxed);
                return None;
            }
        }
        drop(free);
        Some(SplatPiece::with_capacity(self.piece_splats))
    }
}

/// What one thread keeps from cut to cut.
#[derive(Debug)]
pub(super) struct Worker {
    stack: Vec<Group>,
    balls: Box<[SplatBall; BATCH]>,
    normal_colors: Box<[u32; BATCH]>,
    /// Splats in the two of them.
    filled: usize,
    /// Filled pieces, with chunk and number.
    pub(super) pieces: Vec<(u32, u32, SplatPiece)>,
    /// Pages that are missing, and the pixels that are drawn for want of them, in [`BENEFIT_UNITS`].
    pub(super) wanted: Vec<(PageId, u64)>,
    pub(super) report: CutReport,
    max_px: Vec4,
    groups: u32,
}

/// What to do with a group.
const DRAW_AND_DESCEND: u8 = 0;
const DRAW: u8 = 1;
const DESCEND: u8 = 2;

impl Worker {
    pub(super) fn new() -> Self {
        let nothing = SplatBall { center_in_eye: [0.0; 3], radius: 0.0 };
        Self {
            stack: Vec::with_capacity(256),
            balls: Box::new([nothing; BATCH]),
            normal_colors: Box::new([0; BATCH]),
            filled: 0,
            pieces: Vec::new(),
            wanted: Vec::new(),
            report: CutReport::default(),
            max_px: Vec4::ZERO,
            groups: 0,
        }
    }

    /// Bytes that it keeps.
    pub(super) fn bytes(&self) -> u64 {
        let fixed = size_of::<Self>() + BATCH * (size_of::<SplatBall>() + size_of::<u32>());
        let grown = self.stack.capacity() * size_of::<Group>()
            + self.pieces.capacity() * size_of::<(u32, u32, SplatPiece)>()
            + self.wanted.capacity() * size_of::<(PageId, u64)>();
        (fixed + grown) as u64
    }

    /// Has room for a whole cut like the last one, whichever part of this one it will do.
    pub(super) fn reserve(&mut self, cut: &Cut) {
        let free = cut.free.lock().unwrap_or_else(PoisonError::into_inner).0.len();
        self.pieces.reserve(free);
        self.wanted.reserve(cut.wanted_before * 2);
    }

    /// Prepares for a new cut.
    pub(super) fn begin(&mut self) {
        self.stack.clear();
        self.filled = 0;
        self.wanted.clear();
        self.report = CutReport::default();
        self.max_px = Vec4::ZERO;
    }

    /// Splits the work: replaces groups by themselves and what is below them, level by level, until there are enough.
    pub(super) fn split(&mut self, cut: &Cut, enough: usize, items: &mut Vec<Item>, scratch: &mut Vec<Item>) {
        self.begin();
        // The last round may make four of each, and has itself beside them.
        items.reserve(enough * 6);
        scratch.reserve(enough * 6);
        let mut consistent = true;
        loop {
            let whole = items.iter().filter(|item| item.whole).count();
            if whole == 0 || whole >= enough || !consistent || cut.is_over() {
                break;
            }
            scratch.clear();
            for item in items.drain(..) {
                // What contradicts itself is found again when it is drawn.
                consistent &= !item.whole || self.visit::<DESCEND>(cut, &item.group).is_ok();
                if !item.whole || !consistent {
                    scratch.push(item);
                    continue;
                }
                scratch.push(Item { whole: false, ..item });
                scratch.extend(self.stack.drain(..).rev().map(|group| Item { group, whole: true }));
            }
            std::mem::swap(items, scratch);
        }
        self.begin();
    }

    /// Works until no chunk is left.
    pub(super) fn run(&mut self, cut: &Cut) {
        loop {
            let chunk = cut.next_chunk.fetch_add(1, Relaxed);
            if chunk >= cut.chunks || cut.is_over() {
                break;
            }
            let begin = |chunk: u32| (u64::from(chunk) * cut.items.len() as u64 / u64::from(cut.chunks)) as usize;
            for item in &cut.items[begin(chunk)..begin(chunk + 1)] {
                if self.item(cut, chunk, item).is_err() {
                    self.report.inconsistent = true;
                    cut.stop.store(true, Relaxed);
                }
                if cut.is_over() {
                    break;
                }
            }
            self.flush(cut, chunk);
        }
        self.report.max_error_px = self.report.max_error_px.max(self.max_px.max_element());
    }

    fn item(&mut self, cut: &Cut, chunk: u32, item: &Item) -> Result<(), Inconsistent> {
        if !item.whole {
            self.visit::<DRAW>(cut, &item.group)?;
            self.flush_if_full(cut, chunk);
            return Ok(());
        }
        self.stack.clear();
        self.stack.push(item.group);
        while let Some(group) = self.stack.pop() {
            self.visit::<DRAW_AND_DESCEND>(cut, &group)?;
            self.flush_if_full(cut, chunk);
            self.groups = self.groups.wrapping_add(1);
            if self.groups.is_multiple_of(CHECK_GROUPS) && cut.is_over() {
                break;
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn visit<const WHAT: u8>(&mut self, cut: &Cut, group: &Group) -> Result<(), Inconsistent> {
        let stored = Stored::read(&cut.table, group)?;
        self.report.visited += u64::from(group.count);
        if self.report.visited > cut.max_nodes {
            return Err(Inconsistent);
        }
        let decided = cut.look.decide(group.parent, group.known, &stored.words, group.count);
        let inner = stored.inner();
        let (mut open, mut missing) = (decided.coarse & inner, 0);
        if open != 0 {
            match stored.below(&cut.table, cut.frame)? {
                Below::At(page, first) if WHAT != DRAW => {
                    stored.push_open((page, first), group, &decided, open, &mut self.stack);
                }
                Below::At(..) => {}
                Below::Missing(page) => {
                    (missing, open) = (open, 0);
                    if WHAT != DESCEND {
                        self.want(page, keep(missing, decided.diameter_px));
                    }
                }
            }
        }
        if WHAT == DESCEND {
            return Ok(());
        }
        let unopened = decided.seen & !open;
        let hidden = decided.hidden & unopened;
        let drawn = unopened & !hidden;
        self.report.culled_frustum += ones(decided.outside);
        self.report.culled_backface += ones(decided.back | hidden);
        if drawn & decided.coarse != 0 {
            let limit = if drawn & missing != 0 { Limit::Residency } else { Limit::Data };
            self.report.limited_by = self.report.limited_by.max(Some(limit));
        }
        self.max_px = self.max_px.max(keep(drawn, decided.diameter_px));

        let balls = decided.balls_in_eye();
        let colors = stored.colors(group, cut.tint);
        let mut at = self.filled;
        for lane in 0..4 {
            // Overwritten by the next one where the lane is not drawn.
            self.balls[at % BATCH] = bytemuck::cast(balls[lane].to_array());
            self.normal_colors[at % BATCH] =
                u32::from(Node(stored.words[lane]).normal()) | u32::from(colors[lane]) << 16;
            at += (drawn >> lane & 1) as usize;
        }
        self.filled = at;
        Ok(())
    }

    #[inline(always)]
    fn flush_if_full(&mut self, cut: &Cut, chunk: u32) {
        if self.filled > BATCH - 4 {
            self.flush(cut, chunk);
        }
    }

    /// Appends what was collected to the list.
    #[cold]
    fn flush(&mut self, cut: &Cut, chunk: u32) {
        let filled = std::mem::take(&mut self.filled);
        self.report.drawn += filled as u64;
        self.report.points += filled as u64;
        if cut.drawn.fetch_add(filled as u64, Relaxed) + filled as u64 > cut.most_splats {
            cut.stop.store(true, Relaxed);
            return;
        }
        let mut begin = 0;
        while begin < filled {
            let room = match self.pieces.last() {
                Some((of, _, piece)) if *of == chunk => piece.room(),
                _ => 0,
            };
            if room == 0 {
                let Some(piece) = cut.empty_piece() else {
                    return;
                };
                self.pieces.push((chunk, self.pieces.len() as u32, piece));
                continue;
            }
            let end = filled.min(begin + room);
            if let Some((_, _, piece)) = self.pieces.last_mut() {
                piece.balls.extend_from_slice(&self.balls[begin..end]);
                piece.normal_colors.extend_from_slice(&self.normal_colors[begin..end]);
            }
            begin = end;
        }
    }

    /// Notes what could be drawn better with a page.
    #[cold]
    fn want(&mut self, page: PageId, diameters_px: Vec4) {
        // Twice the threshold wanted is worth twice as much, but a node at the eye is not worth everything. Integers: their sum
        // does not depend on its order.
        let benefit = diameters_px
            .to_array()
            .iter()
            .map(|px| (px.min(MOST_BENEFIT_PX) * BENEFIT_UNITS + 0.5) as u64)
            .sum::<u64>();
        match self.wanted.last_mut() {
            Some((last, sum)) if *last == page => *sum = sum.saturating_add(benefit),
            _ => {
                if self.wanted.len() == self.wanted.capacity() {
                    sum_up(&mut self.wanted);
                }
                self.wanted.push((page, benefit));
            }
        }
    }
}

/// Sorts by page and keeps one entry for each.
pub(super) fn sum_up(wanted: &mut Vec<(PageId, u64)>) {
    wanted.sort_unstable();
    wanted.dedup_by(|next, first| {
        let same = next.0 == first.0;
        if same {
            first.1 = first.1.saturating_add(next.1);
        }
        same
    });
}

impl Item {
    /// A whole hierarchy.
    pub(super) fn root(root: &Root, known: Known) -> Self {
        Self { group: Group::root(root, known), whole: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residency::{InlineLoader, Residency};
    use crate::splats::Cutting;
    use crate::{ModelView, Similarity};
    use gigalod_build::{NoProgress, Options, splats};
    use gigalod_format::splats::SplatFile;
    use gigalod_format::{Container, FileStore};
    use gigalod_geom::camera::UpAxis;
    use gigalod_geom::{Camera, ImageSize};
    use gigalod_synth::{Order, StatueOptions, write_statue};

    #[test]
    fn what_is_interrupted_visits_few_more_nodes() {
        let mut ply = Vec::new();
        let options = StatueOptions { triangles: 20_000, seed: 3, colors: false, order: Order::Coherent };
        write_statue(options, &mut ply, &mut |_, _| {}).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("statue.glod");
        let stream = gigalod_import::open(Box::new(std::io::Cursor::new(ply))).unwrap();
        splats::build(stream, &Options::default(), &NoProgress, &out).unwrap();
        let store = Arc::new(FileStore::open(&out).unwrap());
        let file = Arc::new(SplatFile::open(Container::open(store).unwrap()).unwrap());
        let root = *file.skeleton().root();
        let mut residency = Residency::new(1 << 30, Box::<InlineLoader>::default());
        let id = residency.add(file.clone());
        let key = |page| crate::PageKey { file: id, page: crate::PageNumber(page) };
        let all: Vec<_> = (0..file.skeleton().pages().len() as u32)
            .map(|page| crate::PageRequest { key: key(page), benefit: 1.0 })
            .collect();
        residency.serve(&all);
        while residency.is_loading() {
            residency.receive(true);
        }
        let size = ImageSize { width: 300, height: 300 };
        let camera = Camera::orbit(&root.bounds, UpAxis::Y, [0.0, 0.0], 1.0, 0.7, size);
        let view = ModelView::new(&camera, &Similarity::IDENTITY);
        let cutting = Cutting { frustum_culling: false, backface_culling: false };
        let look = Look::new(&view, &root, cutting, 0.0);
        let interrupt = Interrupt::default();
        let (_, table, frame) = residency.splats(id).unwrap();
        let table = table.clone();
        let cut = Cut {
            look,
            table,
            frame,
            max_nodes: root.nodes,
            tint: Tint::Model,
            most_splats: u64::MAX,
            piece_splats: 1024,
            interrupt: interrupt.clone(),
            items: vec![Item::root(&root, look.known())],
            chunks: 1,
            next_chunk: AtomicU32::new(0),
            drawn: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            free: Mutex::new((Vec::new(), u64::MAX)),
            no_room: AtomicBool::new(false),
            wanted_before: 0,
        };
        let mut worker = Worker::new();
        worker.item(&cut, 0, &cut.items[0]).unwrap();
        assert_eq!(worker.report.visited, root.nodes, "everything");
        // As if it were set after any number of groups.
        interrupt.set();
        for groups in [0, 1, 100, CHECK_GROUPS - 1, 12_345] {
            worker.begin();
            worker.groups = groups;
            worker.item(&cut, 0, &cut.items[0]).unwrap();
            let most = u64::from(CHECK_GROUPS) * 4;
            assert!((1..=most).contains(&worker.report.visited), "{} nodes", worker.report.visited);
        }
    }
}
