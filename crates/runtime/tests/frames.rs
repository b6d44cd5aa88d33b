//! The frame: two views of one file, a selector on the device, residency within its budget.

mod common;

use common::{camera, scene, statue};
use gigalod_format::splats::PageId;
use gigalod_runtime::residency::{InlineLoader, Loaded, Loader, ThreadedLoader};
use gigalod_runtime::{
    CutReport, DeviceDraw, DrawSource, FileId, Fineness, InstanceId, Interrupt, Limit, ModelFile, ModelView, Outcome,
    PageKey, PageNumber, PageRequest, RequestRing, Residency, SelectInput, Selection, Selector, Similarity,
    SplatSelector, Target, ViewId,
};
use std::collections::{BTreeMap, BTreeSet};

const CAMERA: ViewId = ViewId(0);
const LIGHT: ViewId = ViewId(1);

#[test]
fn two_views_of_one_file_share_pages_and_nothing_else() {
    let mut both = scene(statue(), 1 << 30);
    let near = camera(&both, 0.0, 8.0);
    let far = camera(&both, 180.0, 0.2);
    loop {
        both.select(CAMERA, &near, &Fineness::px(1.0));
        both.select(LIGHT, &far, &Fineness::px(4.0));
        both.serve();
        if !both.residency().is_loading() {
            break;
        }
        while both.residency().is_loading() {
            both.residency_mut().receive(true);
        }
    }
    let drawn = |scene: &gigalod_runtime::Scene, view| {
        let (_, selection) = scene.draws(view).next().expect("one instance");
        selection.draw.clone()
    };
    for (view, eye, threshold_px) in [(CAMERA, &near, 1.0), (LIGHT, &far, 4.0)] {
        let mut alone = scene(statue(), 1 << 30);
        alone.select_converged(view, eye, &Fineness::px(threshold_px));
        assert!(drawn(&alone, view) == drawn(&both, view), "{view:?} sees what it would see alone");
    }
    assert!(drawn(&both, CAMERA) != drawn(&both, LIGHT));
}

/// Pretends to run on the device: its list stays there, and its requests come back two frames late.
struct DeviceSelector {
    host: SplatSelector,
    ring: RequestRing,
    frame: u64,
    lists: BTreeMap<Target, Selection>,
}

impl Selector for DeviceSelector {
    fn select(&mut self, target: Target, input: &SelectInput<'_>, out: &mut Selection) -> Outcome {
        let on_device = self.lists.entry(target).or_default();
        self.host.select(target, input, on_device);
        for request in &on_device.requests {
            self.ring.push(self.frame, *request);
        }
        out.requests.clear();
        if let Some(finished) = self.frame.checked_sub(2) {
            self.ring.read_back(finished, &mut out.requests);
        }
        out.draw = DrawSource::OnDevice(DeviceDraw { handle: u64::from(target.instance.0) });
        out.report = CutReport::default();
        self.frame += 1;
        Outcome::Complete
    }

    fn forget(&mut self, target: Target) {
        self.lists.remove(&target);
        self.host.forget(target);
    }
}

#[test]
fn a_selector_on_the_device_is_served_like_one_on_the_host() {
    let with_host = {
        let mut scene = scene(statue(), 1 << 30);
        let camera = camera(&scene, 20.0, 2.0);
        scene.select_converged(CAMERA, &camera, &Fineness::px(2.0));
        let (_, selection) = scene.draws(CAMERA).next().unwrap();
        selection.draw.clone()
    };

    let host_scene = scene(statue(), 1 << 30);
    let camera = camera(&host_scene, 20.0, 2.0);
    let mut residency = Residency::new(1 << 30, Box::<InlineLoader>::default());
    let file = residency.add(statue());
    // A ring too small for all requests: what is dropped is asked for again.
    let ring = RequestRing::new(3);
    let mut selector = DeviceSelector { host: SplatSelector::default(), ring, frame: 0, lists: BTreeMap::new() };
    let target = Target { instance: InstanceId(0), view: CAMERA };
    let mut selection = Selection::default();
    for _ in 0..40 {
        let view = ModelView::new(&camera, &Similarity::IDENTITY);
        let interrupt = &Interrupt::default();
        let input = SelectInput::px(file, view, 2.0, interrupt, &residency);
        selector.select(target, &input, &mut selection);
        assert_eq!(selection.draw, DrawSource::OnDevice(DeviceDraw { handle: 0 }));
        residency.serve(&selection.requests);
        residency.receive(false);
    }
    assert!(selector.lists[&target].draw == with_host, "it converged to the host's list");
    selector.forget(target);
    assert!(selector.lists.is_empty());
}

#[test]
fn decoded_pages_never_exceed_their_budget_and_the_report_says_what_is_missing() {
    let needed = {
        let mut free = scene(statue(), 1 << 30);
        let camera = camera(&free, 0.0, 1.0);
        free.select_converged(CAMERA, &camera, &Fineness::px(0.0));
        free.residency().resident_bytes()
    };
    let budget = needed / 3;
    let mut tight = scene(statue(), budget);
    for azimuth in [0.0, 90.0, 180.0, 0.0] {
        let camera = camera(&tight, azimuth, 3.0);
        for _ in 0..30 {
            tight.select(CAMERA, &camera, &Fineness::px(0.0));
            tight.serve();
            tight.residency_mut().receive(true);
            assert!(tight.residency().resident_bytes() <= budget);
        }
        let report = tight.select(CAMERA, &camera, &Fineness::px(0.0));
        assert_eq!(report.limited_by, Some(Limit::Residency));
        assert!(report.drawn > 100);
        tight.serve();
    }
    assert!(tight.residency().is_full());
}

/// Remembers what it was asked for, and loads nothing until told to.
#[derive(Default)]
struct LazyLoader {
    queued: Vec<PageKey>,
}

impl Loader for LazyLoader {
    fn queue(&mut self, key: PageKey, _file: ModelFile) {
        self.queued.push(key);
    }

    fn cancel_queued(&mut self) -> Vec<PageKey> {
        std::mem::take(&mut self.queued)
    }

    fn finished(&mut self, _wait: bool) -> Vec<Loaded> {
        Vec::new()
    }
}

#[test]
fn requests_of_an_older_frame_are_cancelled_and_the_most_useful_come_first() {
    let mut residency = Residency::new(1 << 30, Box::<LazyLoader>::default());
    let file = residency.add(statue());
    let request = |page, benefit| PageRequest { key: PageKey { file, page: PageNumber(page) }, benefit };
    residency.serve(&[request(0, 1.0), request(1, 5.0), request(0, 9.0)]);
    assert!(residency.is_loading());
    residency.serve(&[]);
    assert!(!residency.is_loading(), "nobody wants them any more");
    // Pages that do not exist, and files that do not, are nobody's business.
    residency.serve(&[
        request(u32::MAX, 1.0),
        PageRequest { key: PageKey { file: FileId(7), page: PageNumber(0) }, benefit: 1.0 },
    ]);
    assert!(!residency.is_loading());
}

#[test]
fn loading_on_threads_gives_the_same_cut() {
    let drawn = |loader: Box<dyn Loader>| {
        let mut residency = Residency::new(1 << 30, loader);
        let file = residency.add(statue());
        let mut scene = gigalod_runtime::Scene::new(residency);
        scene.add(gigalod_runtime::Instance { file, placement: Similarity::IDENTITY });
        let camera = camera(&scene, 10.0, 1.5);
        scene.select_converged(CAMERA, &camera, &Fineness::px(1.0));
        let pages: BTreeSet<u32> =
            (0..64).filter(|page| scene.residency().page(FileId(0), PageId(*page)).is_some()).collect();
        let (_, selection) = scene.draws(CAMERA).next().unwrap();
        (selection.draw.clone(), pages)
    };
    let threads = ThreadedLoader::new(3).unwrap();
    assert!(drawn(Box::new(threads)) == drawn(Box::<InlineLoader>::default()));
}
