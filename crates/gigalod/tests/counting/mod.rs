//! An allocator for tests that counts: what is live, the most that was since it was asked to forget, and how often it was asked.
//!
//! A test file that has `mod counting;` has it for its whole program, so it counts what all tests of the file do: they take
//! turns with [`peak_of`].
#![allow(dead_code, reason = "each test file uses its own part")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

struct Counting;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

fn grow(bytes: usize) {
    ALLOCATIONS.fetch_add(1, Relaxed);
    PEAK.fetch_max(LIVE.fetch_add(bytes, Relaxed) + bytes, Relaxed);
}

// SAFETY: passes everything on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // Old and new lie side by side for a moment, at worst.
        grow(new_size);
        LIVE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above; `pointer` came from the system's allocator with this layout.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often memory was asked for, or asked to grow, by all threads since the program began.
pub(crate) fn allocations() -> usize {
    ALLOCATIONS.load(Relaxed)
}

/// What `act` allocates at most at any time, beyond what there was before. One at a time.
pub(crate) fn peak_of<T>(act: impl FnOnce() -> T) -> (T, usize) {
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let before = settled();
    PEAK.store(before, Relaxed);
    let result = act();
    (result, PEAK.load(Relaxed) - before)
}

/// What is live when it no longer changes: threads of pools that were dropped end, and free what is theirs, in their own time.
fn settled() -> usize {
    let (mut live, mut same) = (LIVE.load(Relaxed), 0);
    while same < 10 {
        std::thread::sleep(std::time::Duration::from_millis(10));
        let now = LIVE.load(Relaxed);
        same = if now == live { same + 1 } else { 0 };
        live = now;
    }
    live
}
