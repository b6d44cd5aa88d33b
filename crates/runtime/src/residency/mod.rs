//! Which pages are in memory, within a hard budget.
//!
//! Requests go in, from whomever; pages come out later. Each frame's requests replace the last frame's as far as their
//! loading has not begun, so nobody waits for what the camera has left behind. The most useful byte is loaded first. To make
//! room, the page that was used longest ago goes; pages used in the current frame stay, and a page's ancestors are used
//! whenever it is. What a list holds stays too: its memory would not be free.
//!
//! Representations differ in what a page is, and in nothing else: [`ModelFile`] says how large one is and reads it.

mod file;
mod loader;
mod table;

pub use file::{DecodedPage, ModelFile, PageNumber};
#[cfg(not(target_arch = "wasm32"))]
pub use loader::ThreadedLoader;
pub use loader::{InlineLoader, Loaded, Loader};

pub(crate) use table::PageTable;

use gigalod_format::hybrid::NodeId;
use gigalod_format::splats::PageId;
use gigalod_format::{hybrid, splats};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use table::Table;

/// One open file of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FileId(pub u32);

/// One page of one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PageKey {
    /// Which file.
    pub file: FileId,
    /// Which of its pages.
    pub page: PageNumber,
}

/// Somebody would draw better with this page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PageRequest {
    /// What is wanted.
    pub key: PageKey,
    /// How much: the error in pixels that is drawn for want of it, summed over the nodes that want it.
    pub benefit: f32,
}

/// Shared with the threads of a cut.
type SharedSplats = Arc<PageTable<splats::Page>>;

/// The pages of one file.
struct FilePages {
    file: ModelFile,
    table: Table,
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
    pub fn add(&mut self, file: impl Into<ModelFile>) -> FileId {
        let file = file.into();
        let table = match &file {
            ModelFile::Splats(_) => Table::splats(file.pages()),
            ModelFile::Hybrid(_) => Table::hybrid(file.pages()),
        };
        self.files.push(FilePages { file, table });
        // As many as may be listed: what a budget leaves for pages must not shrink when they are.
        self.idle.clear();
        self.idle.reserve(self.files.iter().map(|pages| pages.table.len()).sum());
        FileId(self.files.len() as u32 - 1)
    }

    /// An open file.
    ///
    /// # Panics
    /// When `id` is of another residency.
    pub fn file(&self, id: FileId) -> &ModelFile {
        &self.files[id.0 as usize].file
    }

    /// The page of a splat file, if it is resident; marks it as used. Any page number is fine: there is none beyond the last.
    pub fn page(&self, file: FileId, page: PageId) -> Option<&splats::Page> {
        match &self.files[file.0 as usize].table {
            Table::Splats(table) => table.used(page, self.frame),
            Table::Hybrid(_) => None,
        }
    }

    /// The page of a node of a hybrid file, if it is resident; marks it as used. Any number is fine.
    pub fn node(&self, file: FileId, node: NodeId) -> Option<&Arc<hybrid::Page>> {
        match &self.files[file.0 as usize].table {
            Table::Hybrid(table) => table.used_shared(node, self.frame),
            Table::Splats(_) => None,
        }
    }

    /// A splat file, its pages, and what to mark them with that are used now.
    pub(crate) fn splats(&self, id: FileId) -> Option<(&Arc<splats::SplatFile>, &SharedSplats, u32)> {
        match self.files.get(id.0 as usize) {
            Some(FilePages { file: ModelFile::Splats(file), table: Table::Splats(table) }) => {
                Some((file, table, self.frame))
            }
            _ => None,
        }
    }

    /// The same of a hybrid file.
    pub(crate) fn hybrid(&self, id: FileId) -> Option<(&Arc<hybrid::HybridFile>, &PageTable<hybrid::Page>, u32)> {
        match self.files.get(id.0 as usize) {
            Some(FilePages { file: ModelFile::Hybrid(file), table: Table::Hybrid(table) }) => {
                Some((file, table, self.frame))
            }
            _ => None,
        }
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
        let is_missing =
            |pages: &FilePages| (key.page.0 as usize) < pages.table.len() && !pages.table.is_resident(key.page);
        file.is_some_and(is_missing) && !self.damaged.contains_key(&key) && !self.in_flight.contains(&key)
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
                Ok(page) if self.resident_bytes + self.incoming_bytes + page.resident_bytes() > self.budget_bytes => {
                    self.refused += 1;
                }
                Ok(page) => {
                    let bytes = page.resident_bytes();
                    if self.files[key.file.0 as usize].table.insert(key.page, page, self.frame) {
                        self.resident_bytes += bytes;
                    }
                }
                Err(error) => {
                    self.damaged.insert(key, error.to_string());
                }
            }
        }
        count
    }

    /// Replaces the budget; where pages take more, the oldest go at once, used or not, but for those that a list holds.
    pub fn set_budget(&mut self, budget_bytes: u64) {
        self.budget_bytes = budget_bytes;
        if self.resident_bytes + self.incoming_bytes > budget_bytes {
            for key in self.loader.cancel_queued() {
                self.in_flight.remove(&key);
                self.incoming_bytes -= self.bytes_to_come(key);
            }
        }
        let excess = (self.resident_bytes + self.incoming_bytes).saturating_sub(budget_bytes);
        if excess > 0 {
            self.list_idle(|_| true);
            self.evict_idle(excess);
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
        let entry = size_of::<Option<Arc<splats::Page>>>() + size_of::<AtomicU32>();
        let pages = self.files.iter().map(|pages| pages.table.len() * entry).sum::<usize>();
        let lists =
            self.wanted.capacity() * size_of::<PageRequest>() + self.idle.capacity() * size_of::<(u32, PageKey, u64)>();
        (pages + lists) as u64
    }

    /// Bytes that the first pages of all models take.
    pub fn first_pages_bytes(&self) -> u64 {
        self.files.iter().map(|pages| pages.file.bytes_to_come(PageNumber(0))).sum()
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
        self.files[key.file.0 as usize].file.bytes_to_come(key.page)
    }

    /// Evicts until `bytes` more fit; false, with nothing evicted in vain, where they cannot.
    fn make_room(&mut self, bytes: u64) -> bool {
        let taken = self.resident_bytes + self.incoming_bytes + bytes;
        let Some(excess) = taken.checked_sub(self.budget_bytes).filter(|excess| *excess > 0) else {
            return true;
        };
        let frame = self.frame;
        let enough = self.list_idle(|last_used| last_used < frame) >= excess;
        if enough {
            self.evict_idle(excess);
        }
        enough
    }

    /// Lists pages that nobody holds and that may go by the frame in which they were last used; returns their bytes.
    fn list_idle(&mut self, may_go: impl Fn(u32) -> bool) -> u64 {
        let mut idle = std::mem::take(&mut self.idle);
        idle.clear();
        for (file, pages) in self.files.iter().enumerate() {
            pages.table.for_each_resident(|resident| {
                if may_go(resident.last_used) && !resident.is_held {
                    let key = PageKey { file: FileId(file as u32), page: resident.page };
                    idle.push((resident.last_used, key, resident.bytes));
                }
            });
        }
        self.idle = idle;
        self.idle.iter().map(|(_, _, bytes)| bytes).sum()
    }

    /// Evicts at least so many bytes of what was listed, oldest first, or all of it.
    fn evict_idle(&mut self, excess: u64) {
        // Of equally old pages the finer one, which comes later in the file, goes first.
        self.idle.sort_unstable_by_key(|(last_used, key, _)| (*last_used, std::cmp::Reverse(*key)));
        let mut freed = 0;
        for (_, key, bytes) in &self.idle {
            if freed >= excess {
                break;
            }
            self.files[key.file.0 as usize].table.remove(key.page);
            freed += bytes;
        }
        self.resident_bytes -= freed;
    }
}
