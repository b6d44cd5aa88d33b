//! Splats: the cut through a bounding-sphere hierarchy.
//!
//! Source: the splats paper, section 2.1, `TraverseHierarchy`. [`plain`] is the traversal as the paper has it and judges the other one,
//! which [`SplatSelector`] uses: four siblings at a time, on several threads, in pieces of memory that go from frame to frame.
//! Each cut begins at the root; ARCHITECTURE.md says what refining the last one would gain (at rest a third) and cost (a fifth of
//! every other frame, and 28 bytes a splat).

mod area;
mod crew;
mod group;
mod lanes;
mod list;
pub mod plain;
mod sizes;
mod walk;

pub use list::{NormalColor, SplatBall, SplatList, SplatPiece};
pub use plain::Cutting;
pub use walk::CHECK_GROUPS;

use crate::residency::{PageKey, PageRequest};
use crate::selection::{DrawSource, Outcome, SelectInput, Selection, Selector, Target};
use crate::{CutReport, Limit};
use crew::Crew;
use gigalod_format::splats::{PageId, Root};
use gigalod_geom::color::rgb565_of_srgb8;
use gigalod_geom::projected;
use gigalod_geom::quantise::normal;
use lanes::Look;
pub(crate) use sizes::{ThresholdSearch, coarser, finer_by};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};
use std::sync::{Mutex, PoisonError};
use walk::{BENEFIT_UNITS, Cut, Item, MOST_BENEFIT_PX, sum_up};

/// Where a splat's colour comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tint {
    /// The model's colours; where it has none, one material.
    #[default]
    Model,
    /// A colour for each level of the hierarchy, from red (coarse) around the colour circle.
    Level,
}

/// The 8-bit sRGB colour of a model without colours: warm stone, one of those that 5-6-5 holds exactly.
pub const MATERIAL_SRGB: [u8; 3] = [197, 190, 173];

/// Nodes of a target's last cut from which on the next one is worth several threads: about a millisecond of one.
const WORTH_THREADS: u64 = 50_000;

/// Each cut forgets one part of so many of what those before it needed: half of it in 44 frames.
const FORGOTTEN: u64 = 64;

/// Chunks of work for each thread: the more, the shorter the wait for the last one.
const CHUNKS_PER_THREAD: usize = 8;

/// Groups among which chunks are cut.
const GROUPS_PER_CHUNK: usize = 8;

/// Cuts splat hierarchies on the host.
#[derive(Debug)]
pub struct SplatSelector {
    /// How to cut; the same picture comes out whatever is set here, slower or faster.
    pub cutting: Cutting,
    /// How to colour.
    pub tint: Tint,
    threads: usize,
    crew: Option<Crew>,
    /// Nodes that cuts of a target visited lately: what turns out of view may turn back.
    visited: BTreeMap<Target, u64>,
    // Kept so that a warm cut allocates nothing.
    items: Vec<Item>,
    scratch: Vec<Item>,
    free: Vec<SplatPiece>,
    filled: Vec<(u32, u32, SplatPiece)>,
    wanted: Vec<(PageId, u64)>,
}

impl Default for SplatSelector {
    /// With as many threads as the machine offers.
    fn default() -> Self {
        Self {
            cutting: Cutting::default(),
            tint: Tint::default(),
            threads: std::thread::available_parallelism().map_or(1, |cores| cores.get()),
            crew: None,
            visited: BTreeMap::new(),
            items: Vec::new(),
            scratch: Vec::new(),
            free: Vec::new(),
            filled: Vec::new(),
            wanted: Vec::new(),
        }
    }
}

impl SplatSelector {
    /// Cuts with at most so many threads, the caller's among them; lists do not depend on it.
    pub fn set_threads(&mut self, threads: usize) {
        if threads.max(1) != self.threads {
            self.threads = threads.max(1);
            self.crew = None;
        }
    }

    /// Bytes that it keeps: what its threads work with, and empty pieces of lists.
    pub fn bytes(&self) -> u64 {
        let workers = self.crew.as_ref().map_or(0, |crew| (0..crew.len()).map(|at| crew.worker(at).bytes()).sum());
        let free = self.free.iter().map(SplatPiece::bytes).sum::<u64>();
        let own = (self.items.capacity() + self.scratch.capacity()) * size_of::<Item>()
            + self.free.capacity() * size_of::<SplatPiece>()
            + self.filled.capacity() * size_of::<(u32, u32, SplatPiece)>()
            + self.wanted.capacity() * size_of::<(PageId, u64)>();
        workers + free + own as u64
    }

    /// Makes a cut, whose items are whole hierarchies, with the crew.
    fn work(&mut self, mut cut: Cut, together: bool) -> Cut {
        let crew = self.crew.get_or_insert_with(|| Crew::new(self.threads));
        let together = together && crew.len() > 1;
        cut.chunks = 1;
        if together {
            let chunks = crew.len() * CHUNKS_PER_THREAD;
            let mut items = std::mem::take(&mut cut.items);
            crew.worker(0).split(&cut, chunks * GROUPS_PER_CHUNK, &mut items, &mut self.scratch);
            cut.chunks = chunks.min(items.len()) as u32;
            cut.items = items;
        }
        let together = together && cut.items.len() > 1;
        crew.work(cut, together)
    }
}

impl Selector for SplatSelector {
    fn select(&mut self, target: Target, input: &SelectInput<'_>, out: &mut Selection) -> Outcome {
        let mut list = match std::mem::take(&mut out.draw) {
            DrawSource::Splats(list) => list,
            DrawSource::Hybrid(_) | DrawSource::OnDevice(_) => SplatList::default(),
        };
        out.requests.clear();
        let visited = self.visited.get(&target).copied().unwrap_or_default();
        let together = visited >= WORTH_THREADS;
        let mut outcome = self.cut_into(input, together, out, &mut list);
        if out.report.inconsistent && together {
            // Where it was cut short depends on who saw it first; alone, it is always the same place.
            outcome = self.cut_into(input, false, out, &mut list);
        }
        self.visited.insert(target, out.report.visited.max(visited - visited / FORGOTTEN));
        out.draw = DrawSource::Splats(list);
        outcome
    }

    fn forget(&mut self, target: Target) {
        self.visited.remove(&target);
    }
}

impl SplatSelector {
    /// Takes the memory of a list back, for the next ones.
    pub(crate) fn take_back(&mut self, list: &mut SplatList) {
        list.clear();
        self.free.extend(list.pieces.drain(..).filter(|piece| piece.room() > 0));
    }

    /// Gives memory away, bit by bit, that the next lists will not need, unless they grow by much: after lists of `used` pieces that
    /// were made of the same memory, or beside it.
    pub(crate) fn give_away(&mut self, used: usize, beside: bool) {
        let enough = used / 4 + 2 + if beside { used } else { 0 };
        let kept = self.free.len() - self.free.len().div_ceil(FORGOTTEN as usize);
        self.free.truncate(enough.max(kept));
    }

    /// Keeps a few empty pieces, so that a list that grows a little needs no memory.
    pub(crate) fn keep_spare(&mut self, used: usize, most_splats: u64, room_bytes: u64) {
        let piece_splats = piece_splats(most_splats);
        let missing = (used / 16 + 1).saturating_sub(self.free.len());
        let affordable = room_bytes / (piece_splats as u64 * SplatList::SPLAT_BYTES);
        self.free.extend((0..missing.min(affordable as usize)).map(|_| SplatPiece::with_capacity(piece_splats)));
    }

    /// Counts a hierarchy for a budget. False where it was broken off.
    pub(crate) fn count_into(&self, input: &SelectInput<'_>, search: &mut ThresholdSearch) -> bool {
        let Some((file, table, frame)) = input.residency.splats(input.file) else { return true };
        let root = file.skeleton().root();
        if table.used(PageId(0), frame).is_none() {
            search.count_root();
            return true;
        }
        let look = Look::new(&input.view, root, self.cutting, input.threshold_px);
        search.count(look, (table, frame), root, input.interrupt)
    }

    fn cut_into(
        &mut self,
        input: &SelectInput<'_>,
        together: bool,
        out: &mut Selection,
        list: &mut SplatList,
    ) -> Outcome {
        self.take_back(list);
        out.report = CutReport { threshold_px: input.threshold_px, ..CutReport::default() };
        let Some((file, table, frame)) = input.residency.splats(input.file) else { return Outcome::Complete };
        let root = file.skeleton().root();
        if table.used(PageId(0), frame).is_none() {
            list.pieces.extend(self.free.pop());
            return draw_root(input, root, self.tint, out, list);
        }

        let look = Look::new(&input.view, root, self.cutting, input.threshold_px);
        let mut items = std::mem::take(&mut self.items);
        items.clear();
        items.push(Item::root(root, look.known()));
        let cut = Cut {
            look,
            table: table.clone(),
            frame,
            max_nodes: root.nodes,
            tint: self.tint,
            most_splats: input.most_splats,
            piece_splats: piece_splats(input.most_splats),
            interrupt: input.interrupt.clone(),
            items,
            chunks: 1,
            next_chunk: AtomicU32::new(0),
            drawn: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            free: Mutex::new((std::mem::take(&mut self.free), input.room_bytes)),
            no_room: AtomicBool::new(false),
            wanted_before: self.wanted.len(),
        };
        let cut = self.work(cut, together);
        self.items = cut.items;
        (self.free, _) = cut.free.into_inner().unwrap_or_else(PoisonError::into_inner);

        self.wanted.clear();
        if let Some(crew) = &self.crew {
            for number in 0..crew.len() {
                let mut worker = crew.worker(number);
                out.report = out.report.merge(worker.report);
                self.filled.append(&mut worker.pieces);
                self.wanted.append(&mut worker.wanted);
            }
        }
        out.report.inconsistent |= out.report.visited > root.nodes;
        self.filled.sort_unstable_by_key(|(chunk, number, _)| (*chunk, *number));
        list.pieces.extend(self.filled.drain(..).map(|(_, _, piece)| piece));
        sum_up(&mut self.wanted);
        out.requests.extend(self.wanted.iter().map(|(page, benefit)| PageRequest {
            key: PageKey { file: input.file, page: (*page).into() },
            benefit: *benefit as f32 / BENEFIT_UNITS,
        }));
        if input.interrupt.is_set() {
            Outcome::Interrupted
        } else if cut.drawn.into_inner() > input.most_splats {
            Outcome::TooMany
        } else if cut.no_room.into_inner() {
            Outcome::NoRoom
        } else {
            Outcome::Complete
        }
    }
}

/// Capacity of a new piece: large ones are handed on with less ado, small ones leave less unused where memory is tight.
fn piece_splats(most_splats: u64) -> usize {
    (most_splats / 128).clamp(1024, 16_384) as usize
}

/// Nothing but the skeleton to draw from: the root ball.
fn draw_root(input: &SelectInput<'_>, root: &Root, tint: Tint, out: &mut Selection, list: &mut SplatList) -> Outcome {
    let [high, low] = input.view.eye_in_local(root.origin);
    let center = root.sphere.center - high - low;
    let radius = root.sphere.radius;
    let depth = center.dot(input.view.forward);
    let px = projected::diameter_px(depth, center.length_squared(), radius, input.view.focal_px);
    let key = PageKey { file: input.file, page: PageId(0).into() };
    out.requests.push(PageRequest { key, benefit: px.min(MOST_BENEFIT_PX) });
    out.report.drew(px, Some(Limit::Residency));
    if list.pieces.is_empty() {
        list.pieces.push(SplatPiece::with_capacity(1));
    }
    // The skeleton has no normal for it: it faces whoever looks.
    let facing = u32::from(normal::encode(-center));
    let color = if tint == Tint::Level { level_color(0) } else { packed_material() };
    list.pieces[0].push(SplatBall { center_in_eye: center.to_array(), radius }, facing | u32::from(color) << 16);
    match input.interrupt.is_set() {
        true => Outcome::Interrupted,
        false if input.most_splats == 0 => Outcome::TooMany,
        false => Outcome::Complete,
    }
}

/// [`MATERIAL_SRGB`] in 5-6-5.
pub(crate) const fn packed_material() -> u16 {
    let [r, g, b] = MATERIAL_SRGB;
    ((r as u16 * 31 + 127) / 255) << 11 | ((g as u16 * 63 + 127) / 255) << 5 | ((b as u16 * 31 + 127) / 255)
}

/// Colours that differ from one level to the next and still tell coarse from fine.
pub fn level_color(level: u32) -> u16 {
    const CIRCLE: [[u8; 3]; 12] = [
        [230, 60, 50],
        [235, 130, 40],
        [240, 200, 50],
        [170, 210, 60],
        [80, 190, 80],
        [50, 190, 150],
        [60, 190, 220],
        [70, 140, 230],
        [100, 90, 225],
        [160, 90, 220],
        [220, 90, 200],
        [235, 100, 140],
    ];
    rgb565_of_srgb8(CIRCLE[level as usize % CIRCLE.len()])
}
