//! Which pages are in memory, within a hard budget.
//!
//! Requests go in, from whomever; pages come out later. Each frame's requests replace the last frame's as far as their
//! loading has not begun, so nobody waits for what the camera has left behind. The most useful byte is loaded first. To make
//! room, the page that was used longest ago goes; pages used in the current frame stay, and a page's ancestors are used
//! whenever it is.

mod loader;

#[cfg(not(target_arch = "wasm32"))]
pub use loader::ThreadedLoader;
pub use loader::{InlineLoader, Loaded, Loader};

use gigalod_format::splats::{Page, PageId, SplatFile};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// One open file of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FileId(pub u32);

/// One page of one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PageKey {
    /// Which file.
    pub file: FileId,
    /// Which of its pages.
    pub page: PageId,
}

/// Somebody would draw better with this page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PageRequest {
    /// What is wanted.
    pub key: PageKey,
    /// How much: the error in pixels that is drawn for want of it, summed over the nodes that want it.
    pub benefit: f32,
}

/// The pages of one file.
struct FilePages {
    file: Arc<SplatFile>,
    /// Shared with the threads of a cut while it is made.
    table: Arc<PageTable>,
}

/// Which pages of a file are resident.
#[derive(Debug)]
pub(crate) struct PageTable {
    resident: Vec<Option<Arc<Page>>>,
    /// Frame in which each page was last used.
    last_used: Vec<AtomicU32>,
}

impl PageTable {
    fn new(pages: usize) -> Self {
        Self { resident: vec![None; pages], last_used: (0..pages).map(|_| AtomicU32::new(0)).collect() }
    }

    /// The page, if it is resident. Any number is fine.
    #[inline(always)]
    pub(crate) fn get(&self, page: PageId) -> Option<&Page> {
        self.resident.get(page.0 as usize)?.as_deref()
    }

    /// The same, and marks it as used in `frame`. Threads that use the same pages do not write in each other's way.
    #[inline(always)]
    pub(crate) fn used(&self, page: PageId, frame: u32) -> Option<&Page> {
        let resident = self.get(page)?;
        let last_used = self.last_used.get(page.0 as usize)?;
        if last_used.load(Ordering::Relaxed) != frame {
            last_used.store(frame, Ordering::Relaxed);
        }
        Some(resident)
    }
}

impl Clone for PageTable {
    fn clone(&self) -> Self {
        let last_used = self.last_used.iter().map(|frame| AtomicU32::new(frame.load(Ordering::Relaxed))).collect();
        Self { resident: self.resident.clone(), last_used }
    }
}

impl FilePages {
    /// To change. The table is shared only while a cut is made; it is copied where one never ended because it panicked.
    fn table_mut(&mut self) -> &mut PageTable {
        Arc::make_mut(&mut self.table)
    }
}

/// All resident pages of all files.
pub struct Residency {
    budget_bytes: u64,
    resident_bytes: u64,
    /// What the pages being loaded will take.
    incoming_bytes: u64,
    files: Vec<FilePages>,
    loader: Box<dyn Loader>,
    in_flight: BTreeSet<PageKey>,
    /// Pages that could not be loaded, and why; they are not asked for again.
    damaged: BTreeMap<PageKey, String>,
    /// Wanted pages for which there is no room.
    refused: u64,
    frame: u32,
    /// Kept so that a frame that loads nothing allocates nothing.
    wanted: Vec<PageRequest>,
    idle: Vec<(u32, PageKey, u64)>,
}

impl std::fmt::Debug for Residency {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Residency")
            .field("resident_bytes", &self.resident_bytes)
            .field("budget_bytes", &self.budget_bytes)
            .field("in_flight", &self.in_flight.len())
            .finish_non_exhaustive()
    }
}

impl Residency {
    /// Nothing resident yet. Decoded pages never take more than `budget_bytes` together.
    pub fn new(budget_bytes: u64, loader: Box<dyn Loader>) -> Self {
        Self {
            budget_bytes,
            resident_bytes: 0,
            incoming_bytes: 0,
            files: Vec::new(),
            loader,
            in_flight: BTreeSet::new(),
            damaged: BTreeMap::new(),
            refused: 0,
            frame: 1,
            wanted: Vec::new(),
            idle: Vec::new(),
        }
    }

    /// Makes a file's pages known; none is loaded before it is asked for.
    pub fn add(&mut self, file: Arc<SplatFile>) -> FileId {
        let pages = file.skeleton().pages().len();
        self.files.push(FilePages { file, table: Arc::new(PageTable::new(pages)) });
        FileId(self.files.len() as u32 - 1)
    }

    /// An open file.
    ///
    /// # Panics
    /// When `id` is of another residency.
    pub fn file(&self, id: FileId) -> &Arc<SplatFile> {
        &self.files[id.0 as usize].file
    }

    /// The page, if it is resident; marks it as used. Any page number is fine: there is none beyond the last.
    pub fn page(&self, file: FileId, page: PageId) -> Option<&Page> {
        self.files[file.0 as usize].table.used(page, self.frame)
    }

    /// The pages of a file, and what to mark them with that are used now.
    pub(crate) fn table(&self, file: FileId) -> (Arc<PageTable>, u32) {
        (self.files[file.0 as usize].table.clone(), self.frame)
    }

    /// Ends the frame: loads what was asked for in it, as far as the budget allows, instead of what was asked for before.
    ///
    /// Allocates nothing where nothing new is to be loaded.
    pub fn serve(&mut self, requests: &[PageRequest]) {
        for key in self.loader.cancel_queued() {
            self.in_flight.remove(&key);
            self.incoming_bytes -= self.bytes_to_come(key);
        }
        let mut wanted = std::mem::take(&mut self.wanted);
        wanted.clear();
        wanted.extend(requests.iter().copied().filter(|request| self.is_to_come(request.key)));
        // By benefit too: the same sums, whatever the order of the requests.
        wanted.sort_unstable_by(|a, b| a.key.cmp(&b.key).then(a.benefit.total_cmp(&b.benefit)));
        wanted.dedup_by(|next, first| {
            let same = next.key == first.key;
            if same {
                first.benefit += next.benefit;
            }
            same
        });
        let per_byte = |wish: &PageRequest| wish.benefit / self.bytes_to_come(wish.key) as f32;
        wanted.sort_unstable_by(|a, b| per_byte(b).total_cmp(&per_byte(a)).then(a.key.cmp(&b.key)));
        self.refused = 0;
        for PageRequest { key, .. } in wanted.iter().copied() {
            let bytes = self.bytes_to_come(key);
            if !self.make_room(bytes) {
                self.refused += 1;
                continue;
            }
            self.in_flight.insert(key);
            self.incoming_bytes += bytes;
            self.loader.queue(key, self.files[key.file.0 as usize].file.clone());
        }
        self.wanted = wanted;
        self.frame += 1;
    }

    /// True of a page that there is, that is neither resident nor being loaded, and that is not known to be damaged.
    fn is_to_come(&self, key: PageKey) -> bool {
        let file = self.files.get(key.file.0 as usize);
        let there = file.and_then(|pages| pages.table.resident.get(key.page.0 as usize));
        matches!(there, Some(None)) && !self.damaged.contains_key(&key) && !self.in_flight.contains(&key)
    }

    /// Takes in what has been loaded; with `wait`, blocks until there is something, if anything is under way.
    /// Returns the number of pages that became resident or turned out to be damaged.
    pub fn receive(&mut self, wait: bool) -> usize {
        let loaded = self.loader.finished(wait && !self.in_flight.is_empty());
        let count = loaded.len();
        for Loaded { key, page } in loaded {
            self.in_flight.remove(&key);
            self.incoming_bytes -= self.bytes_to_come(key);
            match page {
                // Asked for when there was more room.
                Ok(page)
                    if self.resident_bytes + self.incoming_bytes + page.resident_bytes() as u64 > self.budget_bytes =>
                {
                    self.refused += 1;
                }
                Ok(page) => {
                    self.resident_bytes += page.resident_bytes() as u64;
                    let frame = self.frame;
                    let table = self.files[key.file.0 as usize].table_mut();
                    table.resident[key.page.0 as usize] = Some(Arc::new(page));
                    table.last_used[key.page.0 as usize].store(frame, Ordering::Relaxed);
                }
                Err(error) => {
                    self.damaged.insert(key, error.to_string());
                }
            }
        }
        count
    }

    /// Replaces the budget; where pages take more, the oldest go at once, whatever is drawn with them.
    pub fn set_budget(&mut self, budget_bytes: u64) {
        self.budget_bytes = budget_bytes;
        if self.resident_bytes + self.incoming_bytes > budget_bytes {
            for key in self.loader.cancel_queued() {
                self.in_flight.remove(&key);
                self.incoming_bytes -= self.bytes_to_come(key);
            }
        }
        let excess = (self.resident_bytes + self.incoming_bytes).saturating_sub(budget_bytes).min(self.resident_bytes);
        if excess > 0 {
            self.evict(excess, |_| true);
        }
    }

    /// True while pages are being loaded.
    pub fn is_loading(&self) -> bool {
        !self.in_flight.is_empty()
    }

    /// True when the last [`Residency::serve`] left a wish unfulfilled for want of room.
    pub fn is_full(&self) -> bool {
        self.refused > 0
    }

    /// Bytes of all pages that are resident or being loaded.
    pub fn taken_bytes(&self) -> u64 {
        self.resident_bytes + self.incoming_bytes
    }

    /// Bytes of what is kept about pages, resident or not.
    pub fn directory_bytes(&self) -> u64 {
        let entry = size_of::<Option<Arc<Page>>>() + size_of::<AtomicU32>();
        let pages = self.files.iter().map(|pages| pages.table.resident.len() * entry).sum::<usize>();
        let lists =
            self.wanted.capacity() * size_of::<PageRequest>() + self.idle.capacity() * size_of::<(u32, PageKey, u64)>();
        (pages + lists) as u64
    }

    /// Bytes of all resident pages.
    pub fn resident_bytes(&self) -> u64 {
        self.resident_bytes
    }

    /// Pages that could not be loaded, and why.
    pub fn damaged(&self) -> impl Iterator<Item = (PageKey, &str)> {
        self.damaged.iter().map(|(key, why)| (*key, why.as_str()))
    }

    /// Bytes read from all stores.
    pub fn bytes_read(&self) -> u64 {
        self.files.iter().map(|pages| pages.file.container().store().bytes_read()).sum()
    }

    /// What a page will take once it is decoded.
    fn bytes_to_come(&self, key: PageKey) -> u64 {
        let skeleton = self.files[key.file.0 as usize].file.skeleton();
        let word_bytes = if skeleton.root().has_colors { 6 } else { 4 };
        size_of::<Page>() as u64 + u64::from(skeleton.record(key.page).words) * word_bytes
    }

    /// Evicts until `bytes` more fit; false, with nothing evicted in vain, where they cannot.
    fn make_room(&mut self, bytes: u64) -> bool {
        let taken = self.resident_bytes + self.incoming_bytes + bytes;
        let Some(excess) = taken.checked_sub(self.budget_bytes).filter(|excess| *excess > 0) else {
            return true;
        };
        let frame = self.frame;
        self.evict(excess, |last_used| last_used < frame)
    }

    /// Evicts at least so many bytes of pages that may go by the frame in which they were last used, oldest first; false, with
    /// nothing evicted in vain, where there are not so many.
    fn evict(&mut self, excess: u64, may_go: impl Fn(u32) -> bool) -> bool {
        let mut idle = std::mem::take(&mut self.idle);
        idle.clear();
        for (file, pages) in self.files.iter().enumerate() {
            for (page, resident) in pages.table.resident.iter().enumerate() {
                let last_used = pages.table.last_used[page].load(Ordering::Relaxed);
                if let Some(resident) = resident
                    && may_go(last_used)
                {
                    let key = PageKey { file: FileId(file as u32), page: PageId(page as u32) };
                    idle.push((last_used, key, resident.resident_bytes() as u64));
                }
            }
        }
        let enough = idle.iter().map(|(_, _, bytes)| bytes).sum::<u64>() >= excess;
        if enough {
            // Of equally old pages the finer one, which comes later in the file, goes first.
            idle.sort_unstable_by_key(|(last_used, key, _)| (*last_used, std::cmp::Reverse(*key)));
            let mut freed = 0;
            for (_, key, bytes) in &idle {
                if freed >= excess {
                    break;
                }
                self.files[key.file.0 as usize].table_mut().resident[key.page.0 as usize] = None;
                freed += bytes;
            }
            self.resident_bytes -= freed;
        }
        self.idle = idle;
        enough
    }
}
