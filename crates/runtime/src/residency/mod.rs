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
    resident: Vec<Option<Arc<Page>>>,
    /// Frame in which each page was last used.
    last_used: Vec<AtomicU32>,
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
        }
    }

    /// Makes a file's pages known; none is loaded before it is asked for.
    pub fn add(&mut self, file: Arc<SplatFile>) -> FileId {
        let pages = file.skeleton().pages().len();
        self.files.push(FilePages {
            file,
            resident: vec![None; pages],
            last_used: (0..pages).map(|_| AtomicU32::new(0)).collect(),
        });
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
        let pages = &self.files[file.0 as usize];
        let resident = pages.resident.get(page.0 as usize)?.as_deref()?;
        pages.last_used[page.0 as usize].store(self.frame, Ordering::Relaxed);
        Some(resident)
    }

    /// Ends the frame: loads what was asked for in it, as far as the budget allows, instead of what was asked for before.
    pub fn serve(&mut self, requests: &[PageRequest]) {
        let mut benefit: BTreeMap<PageKey, f32> = BTreeMap::new();
        for request in requests {
            let there =
                self.files.get(request.key.file.0 as usize).and_then(|f| f.resident.get(request.key.page.0 as usize));
            if matches!(there, Some(None)) && !self.damaged.contains_key(&request.key) {
                *benefit.entry(request.key).or_default() += request.benefit;
            }
        }
        for key in self.loader.cancel_queued() {
            self.in_flight.remove(&key);
            self.incoming_bytes -= self.bytes_to_come(key);
        }
        let mut wanted: Vec<(PageKey, f32)> =
            benefit.into_iter().filter(|(key, _)| !self.in_flight.contains(key)).collect();
        let per_byte = |(key, benefit): &(PageKey, f32)| benefit / self.bytes_to_come(*key) as f32;
        wanted.sort_by(|a, b| per_byte(b).total_cmp(&per_byte(a)).then(a.0.cmp(&b.0)));
        self.refused = 0;
        for (key, _) in wanted {
            let bytes = self.bytes_to_come(key);
            if !self.make_room(bytes) {
                self.refused += 1;
                continue;
            }
            self.in_flight.insert(key);
            self.incoming_bytes += bytes;
            self.loader.queue(key, self.files[key.file.0 as usize].file.clone());
        }
        self.frame += 1;
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
                Ok(page) => {
                    self.resident_bytes += page.resident_bytes() as u64;
                    let pages = &mut self.files[key.file.0 as usize];
                    pages.resident[key.page.0 as usize] = Some(Arc::new(page));
                    pages.last_used[key.page.0 as usize].store(self.frame, Ordering::Relaxed);
                }
                Err(error) => {
                    self.damaged.insert(key, error.to_string());
                }
            }
        }
        count
    }

    /// True while pages are being loaded.
    pub fn is_loading(&self) -> bool {
        !self.in_flight.is_empty()
    }

    /// True when the last [`Residency::serve`] left a wish unfulfilled for want of room.
    pub fn is_full(&self) -> bool {
        self.refused > 0
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
        let mut idle: Vec<(u32, PageKey, u64)> = Vec::new();
        for (file, pages) in self.files.iter().enumerate() {
            for (page, resident) in pages.resident.iter().enumerate() {
                let last_used = pages.last_used[page].load(Ordering::Relaxed);
                if let Some(resident) = resident
                    && last_used < self.frame
                {
                    let key = PageKey { file: FileId(file as u32), page: PageId(page as u32) };
                    idle.push((last_used, key, resident.resident_bytes() as u64));
                }
            }
        }
        if idle.iter().map(|(_, _, bytes)| bytes).sum::<u64>() < excess {
            return false;
        }
        // Of equally old pages the finer one, which comes later in the file, goes first.
        idle.sort_by_key(|(last_used, key, _)| (*last_used, std::cmp::Reverse(*key)));
        let mut freed = 0;
        for (_, key, bytes) in idle {
            if freed >= excess {
                break;
            }
            self.files[key.file.0 as usize].resident[key.page.0 as usize] = None;
            freed += bytes;
        }
        self.resident_bytes -= freed;
        true
    }
}
