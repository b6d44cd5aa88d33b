//! Pictures for files.
//!
//! Goes in: names, each with the wish that it shows. Comes out: for each of them a picture as `render` draws it, or why there is none.
//!
//! What always holds: a picture is as fine as what it was asked with allows, whatever a person does meanwhile: as they come first, it
//! is drawn when they rest, at the latest when the viewer ends.

use super::{CAMERA, LOOK_FOR_PAGES, Stage};
use crate::mailbox::{News, Wish};
use gigalod_render::{Frame, RenderError};
use gigalod_runtime::Fineness;
use std::path::Path;

impl Stage {
    /// Draws what was ordered, unless something else is wished for meanwhile.
    pub(super) fn take_pictures(&mut self) {
        if self.lost || self.pictures.is_empty() {
            return;
        }
        while let Some((name, wish)) = self.pictures.pop_front() {
            if !self.take(&name, &wish) {
                self.pictures.push_front((name, wish));
                break;
            }
        }
        if let Some((_, wish)) = self.wish {
            self.scene.set_tint(wish.tint);
            self.scene.set_cross_fade(wish.cross_fade);
        }
    }

    /// False where the picture is still to be taken.
    fn take(&mut self, name: &Path, wish: &Wish) -> bool {
        if (self.changed || self.cut != Some(*wish)) && !self.cut_for(wish) {
            return false;
        }
        let draws =
            self.scene.draws(CAMERA).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
        let news = match self.renderer.picture(&Frame { camera: wish.camera, look: wish.look, draws }) {
            Ok(picture) => News::Picture(name.to_path_buf(), picture.size, picture.rgba),
            Err(RenderError::DeviceLost(why)) => {
                // The next device draws it.
                self.lose(why);
                return false;
            }
            Err(error) => News::Problem(format!("{}: {error}", name.display())),
        };
        self.mailbox.tell(news);
        true
    }

    /// Cuts as fine as was asked for and waits for its pages; false where that was broken off.
    pub(super) fn cut_for(&mut self, wish: &Wish) -> bool {
        let interrupt = self.mailbox.interrupt().clone();
        let room = self.renderer.most_splats(wish.camera.size, &wish.look);
        let fineness = Fineness { most_splats: self.most_splats.min(room), ..Fineness::px(wish.finest_px) };
        self.scene.set_tint(wish.tint);
        self.scene.set_cross_fade(wish.cross_fade);
        self.cut = None;
        loop {
            let report = self.scene.select_interruptible(CAMERA, &wish.camera, &fineness, &interrupt);
            self.scene.serve();
            if report.is_none() {
                return false;
            }
            if !self.scene.residency().is_loading() {
                self.cut = Some(*wish);
                return true;
            }
            while self.scene.residency().is_loading() && self.scene.residency_mut().receive(false) == 0 {
                if interrupt.is_set() {
                    return false;
                }
                std::thread::sleep(LOOK_FOR_PAGES);
            }
        }
    }
}
