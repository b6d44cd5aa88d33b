//! Models on the stage: one more, one less, those of a scene instead, and a look at all of them.
//!
//! Goes in: opened models and scenes. Comes out: orders for the stage and the picker, and where the camera begins. What always holds: stage,
//! picker and list have the same models.

use super::{Names, Staged, Viewer};
use crate::host::{Model, OpenedScene, up_of};
use crate::jobs::JobNumber;
use crate::mailbox::{ModelKey, Order};
use crate::measure::Measuring;
use crate::navigation::Navigation;
use crate::picker::Question;
use crate::settings::FirstLook;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera};
use gigalod_runtime::Similarity;

/// Of a picture of everything, what has no more of it than this is hardly found.
const SPECK: f64 = 0.01;

/// Around a model, wherever it stands; world space.
fn bounds_of(model: &Model) -> Aabb {
    let corners = model.file.bounds().corners();
    let place = |at: &Similarity| corners.map(|corner| at.position + at.rotation * (corner * at.scale));
    Aabb::of(model.placements.iter().flat_map(place))
}

/// As its file says; none where it is shown larger or smaller.
fn unit_of(model: &Model) -> Option<&str> {
    model.unit.as_deref().filter(|_| model.placements.iter().all(|place| place.scale == 1.0))
}

impl Viewer {
    /// Puts a model on the stage, in its place in the list, whichever was read first.
    pub(super) fn add(&mut self, model: Model, asked: JobNumber, preview: Option<(JobNumber, u64)>) {
        let key = ModelKey(self.next_key);
        self.next_key += 1;
        self.mailbox.order(Order::Add(key, model.file.clone(), model.placements.clone()));
        let _ = self.ask.send(Question::Add(key, model.clone()));
        let place = self.models.partition_point(|staged| staged.asked <= asked);
        self.models.insert(place, Staged { key, model, asked, preview });
        self.call_files_after_models(place);
        // What figures say is of what was there before.
        self.figures.settled = false;
    }

    /// Files to write are called as the only model, or as a scene once there are more, unless a person has called them otherwise.
    fn call_files_after_models(&mut self, added: usize) {
        let Staged { key, model, asked, .. } = &self.models[added];
        if self.models.len() == 1 {
            self.names = Names::of(&model.source);
            return;
        }
        let is_other = |staged: &&Staged| staged.key != *key && !(staged.preview.is_some() && staged.asked == *asked);
        if self.models.iter().filter(is_other).any(|other| Names::of(&other.model.source) == self.names) {
            self.names = Names::default();
        }
    }

    pub(crate) fn remove(&mut self, key: ModelKey) {
        self.models.retain(|staged| staged.key != key);
        self.mailbox.order(Order::Remove(key));
        self.figures.settled = false;
        let _ = self.ask.send(Question::Remove(key));
        self.measuring = Measuring::default();
    }

    pub(super) fn show_scene(&mut self, scene: OpenedScene, asked: JobNumber) {
        let OpenedScene { description, models } = scene;
        let gone: Vec<ModelKey> = self.models.iter().map(|staged| staged.key).collect();
        gone.into_iter().for_each(|key| self.remove(key));
        self.scene_up = description.up;
        self.settings.background = description.background.unwrap_or(self.settings.background);
        self.settings.towards_light = description.towards_light();
        description.not_drawn().iter().for_each(|missing| self.notice_error(missing));
        models.into_iter().for_each(|model| self.add(model, asked, None));
        let camera = description.camera.unwrap_or_default();
        self.fov_deg = camera.fov_deg.unwrap_or(self.fov_deg);
        self.show_whole();
        if camera.eye.is_some() || camera.target.is_some() {
            let (eye, target) = (self.navigation.eye(), self.navigation.pivot());
            self.navigation.set_home(camera.eye.unwrap_or(eye), camera.target.unwrap_or(target), self.size);
        }
    }

    /// Around all models; world space.
    pub(crate) fn bounds(&self) -> Aabb {
        self.models.iter().map(|staged| bounds_of(&staged.model)).fold(Aabb::EMPTY, Aabb::union)
    }

    /// Looks at one model, from the side that the camera is on.
    pub(crate) fn look_at(&mut self, key: ModelKey, now: f64) {
        self.leave_path(now);
        if let Some(staged) = self.models.iter().find(|staged| staged.key == key) {
            self.navigation.look_at(bounds_of(&staged.model), self.size);
            (self.under_cursor, self.zoom_to_come, self.ahead) = (None, None, None);
        }
    }

    /// Of models that lie far apart, a view of everything shows nothing but specks.
    pub(super) fn tell_of_specks(&mut self, now: f64) {
        let whole = self.bounds().diagonal();
        let is_speck = |staged: &&Staged| bounds_of(&staged.model).diagonal() < whole * SPECK;
        let Some(speck) = self.models.iter().find(is_speck) else { return };
        let name = speck.model.source.file_name().unwrap_or_default().to_string_lossy();
        let text = format!("{name} is a speck beside all there is: a click on its name in the panel looks at it");
        self.notice(&text, now);
    }

    /// What a length of 1 is, where all models agree: a symbol such as `m`.
    pub(crate) fn unit(&self) -> Option<&str> {
        let (first, rest) = self.models.split_first()?;
        let unit = unit_of(&first.model)?;
        rest.iter().all(|staged| unit_of(&staged.model) == Some(unit)).then_some(unit)
    }

    /// Error at rest, in pixels: as a person says, or as suits the models.
    pub(crate) fn finest_px(&self) -> f32 {
        let of_models = self.models.iter().map(|staged| staged.model.file.default_error_px() as f32).reduce(f32::max);
        self.settings.finest_px.or(of_models).unwrap_or(1.0)
    }

    /// Which way is up.
    pub(crate) fn up(&self) -> UpAxis {
        let first = self.models.first().map(|staged| std::slice::from_ref(&staged.model));
        self.scene_up.unwrap_or(up_of(first.unwrap_or_default()))
    }

    /// Takes this way for up, whatever models say, and looks at everything.
    pub(crate) fn stand_up(&mut self, up: UpAxis, now: f64) {
        self.leave_path(now);
        self.scene_up = Some(up);
        self.navigation.stand_up(up, self.size);
        (self.under_cursor, self.zoom_to_come, self.ahead) = (None, None, None);
    }

    /// Looks at everything, from where the options say.
    pub(super) fn show_whole(&mut self) {
        let (bounds, up, fov) = (self.bounds(), self.up(), self.fov_deg.to_radians());
        self.navigation = Navigation::new(bounds, up, fov, self.size);
        match self.first_look {
            FirstLook::Whole => {}
            FirstLook::From { eye, target } => self.navigation.set_home(eye, target, self.size),
            FirstLook::Orbit([azimuth, elevation, zoom]) => {
                let camera = Camera::orbit(&bounds, up, [azimuth, elevation], zoom, fov, self.size);
                self.navigation.set_home(camera.eye, bounds.center(), self.size);
            }
        }
        (self.under_cursor, self.zoom_to_come, self.ahead) = (None, None, None);
    }
}
