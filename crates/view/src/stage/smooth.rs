//! Smooth edges, once the picture is as fine as it gets.
//!
//! Goes in: the last cut. Comes out: the same picture, each pixel looked at in several places. What always holds: a new wish breaks it
//! off, and the picture stays as it was.

use super::{CAMERA, Stage};
use crate::mailbox::{Figures, News, Wish};
use gigalod_render::{Frame, RenderError};

impl Stage {
    pub(super) fn smooth(&mut self, number: u64, wish: &Wish) {
        let samples = wish.look.samples;
        // A picture for a file may have cut for something else.
        if samples == 1 || self.cut != Some(*wish) && !self.cut_for(wish) {
            self.is_smooth = samples == 1;
            return;
        }
        let draws =
            self.scene.draws(CAMERA).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
        let frame = Frame { camera: wish.camera, look: wish.look, draws };
        match self.renderer.draw_interruptible(&frame, self.mailbox.interrupt()) {
            Ok(false) => return,
            Ok(true) => {}
            Err(RenderError::DeviceLost(why)) => {
                self.lose(why);
                return;
            }
            Err(error) => {
                // The picture is what it was.
                self.is_smooth = true;
                self.mailbox.tell(News::Problem(error.to_string()));
                self.mailbox.show(self.renderer.shown(), Figures { finished: true, ..self.figures.clone() });
                return;
            }
        }
        self.is_smooth = true;
        self.frames += 1;
        let mut figures =
            Figures { wish: number, frames: self.frames, samples, finished: true, ..self.figures.clone() };
        // What a frame takes is what the last one took that was not drawn again and again.
        figures.gpu_bytes = self.renderer.gpu_bytes();
        self.mailbox.show(self.renderer.shown(), figures);
    }
}
