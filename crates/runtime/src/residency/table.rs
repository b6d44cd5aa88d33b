//! Which pages of a file are resident, and when each was last used.
//!
//! What always holds: whoever makes a cut only reads, and marks; any page number is fine; a page that somebody else holds, as a list
//! does what it draws, is still counted as resident, because its memory is.

use super::file::{DecodedPage, PageNumber};
use gigalod_format::{hybrid, splats};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Which pages of a file are resident.
#[derive(Debug)]
pub(crate) struct PageTable<P> {
    resident: Vec<Option<Arc<P>>>,
    /// Frame in which each page was last used.
    last_used: Vec<AtomicU32>,
}

impl<P> PageTable<P> {
    fn new(pages: usize) -> Self {
        Self { resident: vec![None; pages], last_used: (0..pages).map(|_| AtomicU32::new(0)).collect() }
    }

    /// The page, if it is resident.
    #[inline(always)]
    pub(crate) fn get(&self, page: impl Into<PageNumber>) -> Option<&P> {
        self.resident.get(page.into().0 as usize)?.as_deref()
    }

    /// The same, and marks it as used in `frame`.
    #[inline(always)]
    pub(crate) fn used(&self, page: impl Into<PageNumber>, frame: u32) -> Option<&P> {
        self.used_shared(page, frame).map(|page| &**page)
    }

    /// The same, to be kept. Threads that use the same pages do not write in each other's way.
    #[inline(always)]
    pub(crate) fn used_shared(&self, page: impl Into<PageNumber>, frame: u32) -> Option<&Arc<P>> {
        let at = page.into().0 as usize;
        let resident = self.resident.get(at)?.as_ref()?;
        let last_used = self.last_used.get(at)?;
        if last_used.load(Ordering::Relaxed) != frame {
            last_used.store(frame, Ordering::Relaxed);
        }
        Some(resident)
    }
}

impl<P> Clone for PageTable<P> {
    fn clone(&self) -> Self {
        let last_used = self.last_used.iter().map(|frame| AtomicU32::new(frame.load(Ordering::Relaxed))).collect();
        Self { resident: self.resident.clone(), last_used }
    }
}

/// The table of a file of either kind, shared with the threads of a cut while it is made.
#[derive(Debug)]
pub(super) enum Table {
    Splats(Arc<PageTable<splats::Page>>),
    Hybrid(Arc<PageTable<hybrid::Page>>),
}

/// A resident page.
pub(super) struct Resident {
    pub(super) page: PageNumber,
    pub(super) bytes: u64,
    pub(super) last_used: u32,
    /// Somebody else holds it: evicting it would free nothing.
    pub(super) is_held: bool,
}

trait ResidentBytes {
    fn resident_bytes(&self) -> u64;
}

impl ResidentBytes for splats::Page {
    fn resident_bytes(&self) -> u64 {
        splats::Page::resident_bytes(self) as u64
    }
}

impl ResidentBytes for hybrid::Page {
    fn resident_bytes(&self) -> u64 {
        hybrid::Page::resident_bytes(self) as u64
    }
}

impl DecodedPage {
    /// Bytes that it keeps.
    pub(super) fn resident_bytes(&self) -> u64 {
        match self {
            Self::Splats(page) => ResidentBytes::resident_bytes(page),
            Self::Hybrid(page) => ResidentBytes::resident_bytes(page),
        }
    }
}

impl Table {
    pub(super) fn splats(pages: usize) -> Self {
        Self::Splats(Arc::new(PageTable::new(pages)))
    }

    pub(super) fn hybrid(pages: usize) -> Self {
        Self::Hybrid(Arc::new(PageTable::new(pages)))
    }

    /// Number of pages, resident or not.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Splats(table) => table.resident.len(),
            Self::Hybrid(table) => table.resident.len(),
        }
    }

    pub(super) fn is_resident(&self, page: PageNumber) -> bool {
        match self {
            Self::Splats(table) => table.get(page).is_some(),
            Self::Hybrid(table) => table.get(page).is_some(),
        }
    }

    /// All that are resident, in order.
    pub(super) fn for_each_resident(&self, visit: impl FnMut(Resident)) {
        fn each<P: ResidentBytes>(table: &PageTable<P>, mut visit: impl FnMut(Resident)) {
            for (at, page) in table.resident.iter().enumerate() {
                if let Some(page) = page {
                    visit(Resident {
                        page: PageNumber(at as u32),
                        bytes: page.resident_bytes(),
                        last_used: table.last_used[at].load(Ordering::Relaxed),
                        is_held: Arc::strong_count(page) > 1,
                    });
                }
            }
        }
        match self {
            Self::Splats(table) => each(table, visit),
            Self::Hybrid(table) => each(table, visit),
        }
    }

    /// Takes a page in. False, and it is dropped, where it is of the other kind or there is no such page.
    pub(super) fn insert(&mut self, page: PageNumber, decoded: DecodedPage, frame: u32) -> bool {
        fn put<P>(table: &mut Arc<PageTable<P>>, page: PageNumber, decoded: P, frame: u32) -> bool {
            // Shared only while a cut is made; it is copied where one never ended because it panicked.
            let table = Arc::make_mut(table);
            let Some(place) = table.resident.get_mut(page.0 as usize) else { return false };
            *place = Some(Arc::new(decoded));
            table.last_used[page.0 as usize].store(frame, Ordering::Relaxed);
            true
        }
        match (self, decoded) {
            (Self::Splats(table), DecodedPage::Splats(decoded)) => put(table, page, decoded, frame),
            (Self::Hybrid(table), DecodedPage::Hybrid(decoded)) => put(table, page, decoded, frame),
            _ => false,
        }
    }

    /// Lets a page go.
    pub(super) fn remove(&mut self, page: PageNumber) {
        fn take<P>(table: &mut Arc<PageTable<P>>, page: PageNumber) {
            if let Some(place) = Arc::make_mut(table).resident.get_mut(page.0 as usize) {
                *place = None;
            }
        }
        match self {
            Self::Splats(table) => take(table, page),
            Self::Hybrid(table) => take(table, page),
        }
    }
}
