//! Instances of models, and the frame that brings selectors and residency together.

use crate::residency::{FileId, PageRequest, Residency};
use crate::selection::{SelectInput, Selection, Selector, Target};
use crate::{CutReport, InstanceId, ModelView, Similarity, SplatSelector, ViewId};
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

/// How fine a view is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Largest error on screen, in pixels; 0 for everything there is.
    pub threshold_px: f32,
    /// Most splats, over all instances; a cut that would have more is made coarser.
    pub most_splats: u64,
}

/// Models in their places.
#[derive(Debug)]
pub struct Scene {
    residency: Residency,
    instances: BTreeMap<InstanceId, Instance>,
    splats: SplatSelector,
    /// What the last [`Scene::select`] of each target answered; kept so that buffers are reused.
    selections: BTreeMap<Target, Selection>,
    /// Of all targets since the last [`Scene::serve`].
    requests: Vec<PageRequest>,
}

impl Scene {
    /// An empty scene over `residency`.
    pub fn new(residency: Residency) -> Self {
        Self {
            residency,
            instances: BTreeMap::new(),
            splats: SplatSelector::default(),
            selections: BTreeMap::new(),
            requests: Vec::new(),
        }
    }

    /// Puts a model into the scene.
    pub fn add(&mut self, instance: Instance) -> InstanceId {
        let id = InstanceId(self.instances.last_key_value().map_or(0, |(last, _)| last.0 + 1));
        self.instances.insert(id, instance);
        id
    }

    /// How the splat hierarchies are cut.
    pub fn splats_mut(&mut self) -> &mut SplatSelector {
        &mut self.splats
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
            let bounds = self.residency.file(instance.file).skeleton().root().bounds;
            bounds.corners().map(|corner| placement.position + placement.rotation * (corner * placement.scale))
        });
        Aabb::of(corners)
    }

    /// Cuts all hierarchies for one view; the requests wait for [`Scene::serve`].
    pub fn select(&mut self, view: ViewId, camera: &Camera, threshold_px: f32) -> CutReport {
        let mut report = CutReport::default();
        for (instance, Instance { file, placement }) in &self.instances {
            let target = Target { instance: *instance, view };
            let input = SelectInput {
                file: *file,
                view: ModelView::new(camera, placement),
                threshold_px,
                residency: &self.residency,
            };
            let selection = self.selections.entry(target).or_default();
            self.splats.select(target, &input, selection);
            self.requests.extend_from_slice(&selection.requests);
            report = report.merge(selection.report);
        }
        report
    }

    /// What the last cut of `view` draws.
    pub fn draws(&self, view: ViewId) -> impl Iterator<Item = (&Instance, &Selection)> {
        self.selections
            .iter()
            .filter(move |(target, _)| target.view == view)
            .filter_map(|(target, selection)| Some((self.instances.get(&target.instance)?, selection)))
    }

    /// Ends the frame: hands the union of all views' requests to residency.
    pub fn serve(&mut self) {
        self.residency.serve(&self.requests);
        self.requests.clear();
    }

    /// Selects, serves and waits until the view is as fine as was asked for, or cannot get finer. For pictures, not frames:
    /// this one waits for loads.
    pub fn select_converged(&mut self, view: ViewId, camera: &Camera, threshold_px: f32) -> CutReport {
        loop {
            let report = self.select(view, camera, threshold_px);
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
