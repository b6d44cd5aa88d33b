//! The seam between what is resident and what is drawn.

use crate::hybrid::HybridList;
use crate::residency::{FileId, PageRequest, Residency};
use crate::splats::SplatList;
use crate::{CutReport, InstanceId, Interrupt, ModelView, SplatSelector, ViewId};
use std::collections::VecDeque;

/// What selector state is keyed by: one instance in one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Target {
    /// Which placement of a model.
    pub instance: InstanceId,
    /// Who looks at it.
    pub view: ViewId,
}

/// What a selector decides from.
#[derive(Clone, Copy)]
pub struct SelectInput<'a> {
    /// The hierarchy.
    pub file: FileId,
    /// The camera in the model's space.
    pub view: ModelView,
    /// Largest error on screen that is wanted, in pixels; 0 for everything there is.
    pub threshold_px: f32,
    /// Up to this threshold, the error on screen decides; above it, where the node is seen, too: see [`crate::Fineness::wanted_px`].
    pub wanted_px: f32,
    /// With more splats, or triangles and points, than these the cut is broken off.
    pub most_splats: u64,
    /// Bytes that may be allocated for the list; where they are not enough, the cut is broken off.
    pub room_bytes: u64,
    /// Breaks the cut off.
    pub interrupt: &'a Interrupt,
    /// What can be drawn now.
    pub residency: &'a Residency,
}

impl<'a> SelectInput<'a> {
    /// This error, whatever it takes.
    pub fn px(
        file: FileId,
        view: ModelView,
        threshold_px: f32,
        interrupt: &'a Interrupt,
        residency: &'a Residency,
    ) -> Self {
        let (most_splats, room_bytes) = (u64::MAX, u64::MAX);
        Self { file, view, threshold_px, wanted_px: threshold_px, most_splats, room_bytes, interrupt, residency }
    }
}

/// A list that a device-side selector made; only the renderer that runs the selector knows what it names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceDraw {
    /// Chosen by the selector.
    pub handle: u64,
}

/// What is to be drawn for one instance in one view.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DrawSource {
    /// A list of splats on the host.
    Splats(SplatList),
    /// Nodes of a hybrid hierarchy, with their pages on the host.
    Hybrid(HybridList),
    /// A list that already lies on the device.
    OnDevice(DeviceDraw),
}

impl Default for DrawSource {
    fn default() -> Self {
        Self::Splats(SplatList::default())
    }
}

/// What a selector answers. Reused from frame to frame, so that a warm frame allocates nothing.
#[derive(Debug, Default)]
pub struct Selection {
    /// To draw now.
    pub draw: DrawSource,
    /// To load for later, in no order.
    pub requests: Vec<PageRequest>,
    /// Figures.
    pub report: CutReport,
}

impl Selection {
    /// Bytes that it keeps on the host.
    pub fn bytes(&self) -> u64 {
        let list = match &self.draw {
            DrawSource::Splats(list) => list.bytes(),
            DrawSource::Hybrid(list) => list.bytes(),
            DrawSource::OnDevice(_) => 0,
        };
        list + (self.requests.capacity() * size_of::<PageRequest>()) as u64
    }

    /// Empties the list; its memory is for the next ones, its pages may go.
    pub(crate) fn release(&mut self, splats: &mut SplatSelector) {
        match &mut self.draw {
            DrawSource::Splats(list) => splats.take_back(list),
            DrawSource::Hybrid(list) => list.clear(),
            DrawSource::OnDevice(_) => {}
        }
    }

    /// Pieces of a list of splats.
    pub(crate) fn pieces(&self) -> usize {
        match &self.draw {
            DrawSource::Splats(list) => list.pieces.len(),
            DrawSource::Hybrid(_) | DrawSource::OnDevice(_) => 0,
        }
    }
}

/// How a cut ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It is there.
    Complete,
    /// It was broken off; what it left is of no use.
    Interrupted,
    /// It has more splats, or triangles and points, than were allowed; what it left is of no use.
    TooMany,
    /// Its list needs more memory than was allowed; what it left is of no use.
    NoRoom,
}

/// Turns (hierarchy, instance, view, residency) into a draw source and page requests.
pub trait Selector {
    /// Overwrites `out`. State from earlier calls for the same `target` may be used, never that of another target.
    fn select(&mut self, target: Target, input: &SelectInput<'_>, out: &mut Selection) -> Outcome;

    /// Drops the state of a target that is gone.
    fn forget(&mut self, target: Target);
}

/// The way back from the device: a ring of fixed size that a device-side selector writes requests into, and that the host
/// reads when the device has finished that frame. What does not fit is dropped: the next frame asks again.
#[derive(Clone, Debug)]
pub struct RequestRing {
    capacity: usize,
    written: VecDeque<(u64, PageRequest)>,
    dropped: u64,
}

impl RequestRing {
    /// A ring of so many requests.
    pub fn new(capacity: usize) -> Self {
        Self { capacity, written: VecDeque::with_capacity(capacity), dropped: 0 }
    }

    /// Writes a request in frame `frame`.
    pub fn push(&mut self, frame: u64, request: PageRequest) {
        if self.written.len() == self.capacity {
            self.dropped += 1;
        } else {
            self.written.push_back((frame, request));
        }
    }

    /// Moves what was written up to and including `finished_frame` to `out`.
    pub fn read_back(&mut self, finished_frame: u64, out: &mut Vec<PageRequest>) {
        while self.written.front().is_some_and(|(frame, _)| *frame <= finished_frame) {
            out.extend(self.written.pop_front().map(|(_, request)| request));
        }
    }

    /// Requests that found the ring full, since it was made.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
