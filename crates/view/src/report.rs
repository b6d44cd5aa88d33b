//! What the viewer tells at exit.

use crate::mailbox::Figures;
use crate::recorder::Viewpoint;
use gigalod_geom::ImageSize;
use glam::DVec3;
use std::collections::VecDeque;
use std::time::Instant;

/// Figures that grow while the viewer runs. Times in milliseconds.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Processor time of the window's thread for each frame, without the driver's.
    pub window_cpu_ms: Vec<f32>,
    /// Processor time that the driver takes of the window's thread for each frame, to give images and to take them.
    pub driver_cpu_ms: Vec<f32>,
    /// Processor time of the stage's thread for each frame.
    pub stage_cpu_ms: Vec<f32>,
    /// From input to the frame that shows it.
    pub input_to_frame_ms: Vec<f32>,
    /// From the device being there to the first frame of a model.
    pub first_frame_ms: Option<f32>,
    /// From the last input to a picture that gets no finer.
    pub rest_to_settled_ms: Option<f32>,
    /// Files that were written.
    pub written: Vec<String>,
    /// Errors that were shown.
    pub problems: Vec<String>,
    /// The last frame.
    pub last: Option<Figures>,
    asked: VecDeque<(u64, Instant)>,
    last_input: Option<(u64, Instant)>,
    shown_wish: u64,
}

/// All that is known at exit.
#[derive(Clone, Debug)]
pub struct Report {
    /// What drew.
    pub adapter: String,
    /// Figures.
    pub tally: Tally,
    /// Where the camera was at the end.
    pub viewpoint: Viewpoint,
    /// Of the picture, beside the panel, in physical pixels.
    pub size: ImageSize,
    /// What was measured last, if it is still shown.
    pub measured: Option<Measured>,
}

/// A distance between two picked points.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// World space, two.
    pub points: Vec<DVec3>,
    /// World units.
    pub distance: f64,
    /// How far it may be off, world units; 0 where it is the original's.
    pub uncertain: f64,
}

impl Tally {
    /// Something else is to be seen from now on.
    pub(crate) fn wished(&mut self, number: u64) {
        let now = Instant::now();
        self.asked.push_back((number, now));
        self.last_input = Some((number, now));
    }

    /// The stage has finished a frame.
    pub(crate) fn drawn(&mut self, figures: &Figures) {
        self.stage_cpu_ms.push(figures.cpu_ms as f32);
        if let Some((_, begun)) = self.last_input.filter(|(number, _)| figures.settled && *number == figures.wish) {
            self.rest_to_settled_ms = Some(begun.elapsed().as_secs_f32() * 1e3);
            self.last_input = None;
        }
        self.last = Some(figures.clone());
    }

    /// The window shows the frame of a wish.
    pub(crate) fn shown(&mut self, wish: u64) {
        if wish == self.shown_wish {
            return;
        }
        self.shown_wish = wish;
        while let Some((_, begun)) = self.asked.pop_front_if(|(number, _)| *number <= wish) {
            self.input_to_frame_ms.push(begun.elapsed().as_secs_f32() * 1e3);
        }
    }
}

/// The value that so great a part of the values does not exceed (nearest rank).
pub fn percentile(values: &[f32], part: f64) -> Option<f32> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let rank = (sorted.len() as f64 * part).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}
