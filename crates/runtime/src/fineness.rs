//! What is asked of a cut: how fine, at most how much, and whether it may be broken off.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// How fine a view shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Largest error on screen that is wanted, in pixels; 0 for everything there is.
    pub threshold_px: f32,
    /// Most splats, triangles and points of all instances together. Where the threshold would need more, it is raised, in steps of at
    /// most 1/16, until it does not; only the root of each instance is always drawn.
    pub most_splats: u64,
    /// What `threshold_px` would be if there were time and memory. Above it, a node of a hybrid model that the eye is amid of counts for
    /// where some of its vertices are seen, not for being everywhere; else a few such nodes would take all there may be.
    pub wanted_px: f32,
}

impl Fineness {
    /// This error, whatever it takes.
    pub fn px(threshold_px: f32) -> Self {
        Self { threshold_px, most_splats: u64::MAX, wanted_px: threshold_px }
    }
}

impl Default for Fineness {
    /// A pixel, whatever it takes.
    fn default() -> Self {
        Self::px(1.0)
    }
}

/// A way to tell a cut to stop; clones are the same one.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Stops the cut that is being made, and all others until [`Interrupt::clear`].
    pub fn set(&self) {
        self.0.store(true, Relaxed);
    }

    /// Cuts may be made again.
    pub fn clear(&self) {
        self.0.store(false, Relaxed);
    }

    /// True from [`Interrupt::set`] to [`Interrupt::clear`].
    pub fn is_set(&self) -> bool {
        self.0.load(Relaxed)
    }
}
