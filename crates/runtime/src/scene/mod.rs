//! Instances of models, and the frame that brings selectors and residency together.

mod budget;
pub mod description;

use crate::hybrid::CROSS_FADE;
use crate::residency::{FileId, PageRequest, Residency};
use crate::selection::{DrawSource, Selection, Selector, Target};
use crate::splats::{ThresholdSearch, Tint};
use crate::{CutReport, Fineness, HybridSelector, InstanceId, Interrupt, ModelView, Similarity, SplatSelector, ViewId};
use budget::LastCut;
use gigalod_geom::{Aabb, Camera};
use std::collections::BTreeMap;

/// One placement of one file.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Which model.
    pub file: FileId,
    /// Where it stands.
    pub placement: Similarity,
}

/// Models in their places.
#[derive(Debug)]
pub struct Scene {
    residency: Residency,
    instances: BTreeMap<InstanceId, Instance>,
    splats: SplatSelector,
    hybrid: HybridSelector,
    /// What cuts answered; kept so that buffers are reused.
    lists: BTreeMap<Target, Lists>,
    /// Of all targets since the last [`Scene::serve`].
    requests: Vec<PageRequest>,
    /// For pages, lists, and all else that the scene keeps.
    cpu_budget: u64,
    search: ThresholdSearch,
    /// Of each view.
    last: BTreeMap<ViewId, LastCut>,
    never: Interrupt,
}

/// Of one target.
#[derive(Debug, Default)]
struct Lists {
    /// The last complete cut.
    shown: Selection,
    /// The one being made, where the last must stay meanwhile.
    next: Selection,
}

impl Scene {
    /// An empty scene over `residency`.
    pub fn new(residency: Residency) -> Self {
        Self {
            residency,
            instances: BTreeMap::new(),
            splats: SplatSelector::default(),
            hybrid: HybridSelector::default(),
            lists: BTreeMap::new(),
            requests: Vec::new(),
            cpu_budget: u64::MAX,
            search: ThresholdSearch::new(),
            last: BTreeMap::new(),
            never: Interrupt::default(),
        }
    }

    /// Puts a model into the scene.
    pub fn add(&mut self, instance: Instance) -> InstanceId {
        let id = InstanceId(self.instances.last_key_value().map_or(0, |(last, _)| last.0 + 1));
        self.instances.insert(id, instance);
        id
    }

    /// Takes a model out of the scene; what is resident of it goes when room is wanted.
    pub fn remove(&mut self, instance: InstanceId) {
        self.instances.remove(&instance);
        let gone: Vec<Target> = self.lists.keys().copied().filter(|target| target.instance == instance).collect();
        for target in gone {
            if let Some(mut lists) = self.lists.remove(&target) {
                lists.shown.release(&mut self.splats);
                lists.next.release(&mut self.splats);
            }
            self.splats.forget(target);
            self.hybrid.forget(target);
        }
    }

    /// How the splat hierarchies are cut.
    pub fn splats_mut(&mut self) -> &mut SplatSelector {
        &mut self.splats
    }

    /// How the hybrid hierarchies are cut.
    pub fn hybrid_mut(&mut self) -> &mut HybridSelector {
        &mut self.hybrid
    }

    /// How everything is coloured.
    pub fn set_tint(&mut self, tint: Tint) {
        (self.splats.tint, self.hybrid.tint) = (tint, tint);
    }

    /// Whether levels of hybrid hierarchies fade into each other, pixel by pixel, where they are nearly too coarse.
    pub fn set_cross_fade(&mut self, fades: bool) {
        self.hybrid.cross_fade = if fades { CROSS_FADE } else { 0.0 };
    }

    /// What is resident.
    pub fn residency(&self) -> &Residency {
        &self.residency
    }

    /// What is resident.
    pub fn residency_mut(&mut self) -> &mut Residency {
        &mut self.residency
    }

    /// Around all instances; world space.
    pub fn bounds(&self) -> Aabb {
        let corners = self.instances.values().flat_map(|instance| {
            let placement = instance.placement;
            let bounds = self.residency.file(instance.file).bounds();
            bounds.corners().map(|corner| placement.position + placement.rotation * (corner * placement.scale))
        });
        Aabb::of(corners)
    }

    /// Bounds all that the scene keeps: lists take at most half of it, pages what lists leave.
    pub fn set_cpu_budget(&mut self, bytes: u64) {
        self.cpu_budget = bytes;
        for lists in self.lists.values_mut() {
            for list in [&mut lists.shown, &mut lists.next] {
                list.release(&mut self.splats);
                list.draw = DrawSource::default();
            }
        }
        self.splats.give_away(0, false);
        self.leave_the_rest_to_pages();
    }

    /// Bytes that the scene keeps: pages, lists, and what it works with.
    pub fn cpu_bytes(&self) -> u64 {
        self.residency.taken_bytes() + self.bytes_besides_pages()
    }

    /// Cuts all hierarchies for one view; the requests wait for [`Scene::serve`].
    pub fn select(&mut self, view: ViewId, camera: &Camera, fineness: &Fineness) -> CutReport {
        let never = self.never.clone();
        self.cut(view, camera, fineness, &never, false).expect("nobody has the interrupt")
    }

    /// The same, but may be broken off; then there is no report, and the last complete cut of the view stays what is drawn.
    pub fn select_interruptible(
        &mut self,
        view: ViewId,
        camera: &Camera,
        fineness: &Fineness,
        interrupt: &Interrupt,
    ) -> Option<CutReport> {
        let report = self.cut(view, camera, fineness, interrupt, true);
        if report.is_none() {
            // What is still shown still wants its pages; what was not finished does not.
            for (_, lists) in self.lists.iter_mut().filter(|(target, _)| target.view == view) {
                lists.next.release(&mut self.splats);
                self.requests.extend_from_slice(&lists.shown.requests);
            }
        }
        report
    }

    /// What the last cut of `view` draws.
    pub fn draws(&self, view: ViewId) -> impl Iterator<Item = (&Instance, &Selection)> {
        self.lists
            .iter()
            .filter(move |(target, _)| target.view == view)
            .filter_map(|(target, lists)| Some((self.instances.get(&target.instance)?, &lists.shown)))
    }

    /// Pixels of `camera`'s picture that the last cut of `view` covers, each splat and node by itself; an estimate. Lists that lie on the
    /// device are not counted.
    pub fn area_px(&self, view: ViewId, camera: &Camera) -> f64 {
        let area_px = |(instance, selection): (&Instance, &Selection)| match &selection.draw {
            DrawSource::Splats(list) => list.area_px(&ModelView::new(camera, &instance.placement)),
            DrawSource::Hybrid(list) => list.area_px(&ModelView::new(camera, &instance.placement)),
            DrawSource::OnDevice(_) => 0.0,
        };
        self.draws(view).map(area_px).sum()
    }

    /// Ends the frame: hands the union of all views' requests to residency.
    pub fn serve(&mut self) {
        self.residency.serve(&self.requests);
        self.requests.clear();
        self.leave_the_rest_to_pages();
    }

    /// Selects, serves and waits until the view is as fine as was asked for, or cannot get finer. For pictures, not frames:
    /// this one waits for loads.
    pub fn select_converged(&mut self, view: ViewId, camera: &Camera, fineness: &Fineness) -> CutReport {
        loop {
            let report = self.select(view, camera, fineness);
            self.serve();
            if !self.residency.is_loading() {
                return report;
            }
            while self.residency.is_loading() {
                self.residency.receive(true);
            }
        }
    }
}
