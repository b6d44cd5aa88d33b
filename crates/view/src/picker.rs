//! The thread that finds what is under the cursor.
//!
//! Goes in: where the cursor is, in which view, and what for. Comes out: a point of the surface, first as the leaves have it, then,
//! for a measurement of a model whose original lies at hand, exactly. What always holds: of pending questions with the same purpose
//! only the latest is answered, but for measurements.

use crate::host::{Host, Model, Work};
use crate::mailbox::ModelKey;
use crate::navigation::Anchor;
use crate::pick::{Hit, Pages, Ray};
use crate::pick_nodes::NodePages;
use gigalod_format::FormatError;
use gigalod_geom::Camera;
use gigalod_runtime::{ModelFile, Similarity};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Anchors of each model.
const ANCHORS: usize = 512;

/// What a point is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To come nearer to it.
    Zoom,
    /// To turn around it.
    Pivot,
    /// Not to fly through it.
    Ahead,
    /// To measure from or to it; numbered by who asks.
    Measure(u64),
}

/// What the thread is told.
pub(crate) enum Question {
    Add(ModelKey, Model),
    Remove(ModelKey),
    Point { purpose: Purpose, camera: Camera, at_px: DVec2 },
}

/// What the thread has to say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Answer {
    /// Balls that hold parts of the surface of all models; world space.
    Anchors(Vec<Anchor>),
    /// `None` where there is only background.
    Point { purpose: Purpose, at_px: DVec2, found: Option<Found> },
    /// Something is wrong with a file.
    Problem(String),
}

impl Found {
    /// What the camera may be held by: the point, with all that it may be off, and as much around it as there is detail.
    pub(crate) fn anchor(&self) -> Anchor {
        Anchor { at: self.point, radius: self.uncertain.max(self.detail) }
    }
}

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// World space.
    pub(crate) point: DVec3,
    /// How far the true surface may be, world units; 0 for the original's own.
    pub(crate) uncertain: f64,
    /// How far vertices are apart there, about, world units; 0 for the original's own.
    pub(crate) detail: f64,
    /// The exact point is being looked for.
    pub(crate) to_come: bool,
}

struct Open {
    model: Model,
    // Of these, one stays empty.
    splats: Pages,
    nodes: NodePages,
}

impl Open {
    fn new(model: Model) -> Self {
        Self { model, splats: Pages::default(), nodes: NodePages::default() }
    }

    fn first_hit(&mut self, ray: &Ray) -> Result<Option<Hit>, FormatError> {
        match &self.model.file {
            ModelFile::Splats(file) => self.splats.first_hit(file, ray),
            ModelFile::Hybrid(file) => self.nodes.first_hit(file, ray),
        }
    }

    fn anchors(&mut self, most: usize) -> Result<Vec<Anchor>, FormatError> {
        match &self.model.file {
            ModelFile::Splats(file) => self.splats.anchors(file, most),
            ModelFile::Hybrid(file) => self.nodes.anchors(file, most),
        }
    }
}

/// Starts the thread, which ends when its questions do.
pub(crate) fn start(
    host: Arc<dyn Host>,
    wake: impl Fn() + Send + Sync + 'static,
) -> std::io::Result<(Sender<Question>, Receiver<Answer>)> {
    let (ask, questions) = channel();
    let (tell, answers) = channel();
    std::thread::Builder::new().name("picker".into()).spawn(move || {
        let mut picker = Picker { host, tell, wake: Arc::new(wake), open: BTreeMap::new() };
        picker.run(&questions);
    })?;
    Ok((ask, answers))
}

struct Picker<W> {
    host: Arc<dyn Host>,
    tell: Sender<Answer>,
    wake: Arc<W>,
    open: BTreeMap<ModelKey, Open>,
}

impl<W: Fn() + Send + Sync + 'static> Picker<W> {
    fn run(&mut self, questions: &Receiver<Question>) {
        let mut waiting: Vec<Question> = Vec::new();
        loop {
            if waiting.is_empty() {
                match questions.recv() {
                    Ok(question) => waiting.push(question),
                    Err(_) => return,
                }
            }
            waiting.extend(questions.try_iter());
            let question = waiting.remove(0);
            if let Question::Point { purpose: Purpose::Zoom | Purpose::Pivot | Purpose::Ahead, .. } = question {
                let is_newer = |other: &Question| match (other, &question) {
                    (Question::Point { purpose: other, .. }, Question::Point { purpose, .. }) => other == purpose,
                    _ => false,
                };
                if waiting.iter().any(is_newer) {
                    continue;
                }
            }
            match question {
                Question::Add(key, model) => {
                    self.open.insert(key, Open::new(model));
                    self.tell_anchors();
                }
                Question::Remove(key) => {
                    self.open.remove(&key);
                    self.tell_anchors();
                }
                Question::Point { purpose, camera, at_px } => self.find(purpose, &camera, at_px),
            }
        }
    }

    fn answer(&self, answer: Answer) {
        // Who no longer listens needs no answer.
        let _ = self.tell.send(answer);
        (self.wake)();
    }

    fn tell_anchors(&mut self) {
        let (mut anchors, mut problems) = (Vec::new(), Vec::new());
        for open in self.open.values_mut() {
            let balls = open.anchors(ANCHORS / open.model.placements.len().clamp(1, ANCHORS));
            let model = &open.model;
            match balls {
                Ok(balls) => {
                    let all = model.placements.iter().flat_map(|place| balls.iter().map(move |ball| (place, ball)));
                    anchors.extend(all.map(|(place, Anchor { at, radius })| Anchor {
                        at: world(place, *at),
                        radius: radius * place.scale,
                    }));
                }
                Err(error) => problems.push(format!("{}: {error}", model.source.display())),
            }
        }
        self.answer(Answer::Anchors(anchors));
        problems.into_iter().for_each(|problem| self.answer(Answer::Problem(problem)));
    }

    fn find(&mut self, purpose: Purpose, camera: &Camera, at_px: DVec2) {
        let direction = camera.ray_through(at_px);
        let mut nearest: Option<(Hit, Ray, Similarity, ModelKey)> = None;
        let mut problems = Vec::new();
        for (key, open) in &mut self.open {
            for at in 0..open.model.placements.len() {
                let place = open.model.placements[at];
                let ray = Ray {
                    origin: place.model_point(camera.eye),
                    direction: place.model_direction(direction) / place.scale,
                };
                match open.first_hit(&ray) {
                    Ok(Some(hit)) if nearest.is_none_or(|(before, ..)| hit.t < before.t) => {
                        nearest = Some((hit, ray, place, *key));
                    }
                    Ok(_) => {}
                    Err(error) => problems.push(format!("{}: {error}", open.model.source.display())),
                }
            }
        }
        let found = nearest.map(|(hit, ray, place, key)| {
            let original = self.open.get(&key).and_then(|open| open.model.original.clone());
            let exact = original.filter(|_| matches!(purpose, Purpose::Measure(_)));
            let found = Found {
                point: world(&place, ray.origin + ray.direction * hit.t),
                uncertain: hit.radius * 2.0 * place.scale,
                detail: hit.detail * 2.0 * place.scale,
                to_come: exact.is_some(),
            };
            (found, exact.map(|original| (original, hit, ray, place)))
        });
        let exact = found.as_ref().and_then(|(_, exact)| exact.clone());
        let found = found.map(|(found, _)| found);
        problems.into_iter().for_each(|problem| self.answer(Answer::Problem(problem)));
        self.answer(Answer::Point { purpose, at_px, found });
        let (Some(found), Some((original, hit, ray, place))) = (found, exact) else { return };
        // The whole original is read for that: on a thread of its own.
        let (host, tell, wake) = (self.host.clone(), self.tell.clone(), self.wake.clone());
        let search = move || {
            let exact = host.exact_point(&original, &ray, &hit, &Work::default());
            let better = match &exact {
                Ok(Some(point)) => Found { point: world(&place, *point), uncertain: 0.0, detail: 0.0, to_come: false },
                Ok(None) | Err(_) => Found { to_come: false, ..found },
            };
            let _ = tell.send(Answer::Point { purpose, at_px, found: Some(better) });
            if let Err(problem) = exact {
                let _ = tell.send(Answer::Problem(problem));
            }
            wake();
        };
        if let Err(error) = std::thread::Builder::new().name("exact point".into()).spawn(search) {
            self.answer(Answer::Problem(format!("could not start a thread: {error}")));
        }
    }
}

fn world(place: &Similarity, point: DVec3) -> DVec3 {
    place.position + place.rotation * (point * place.scale)
}
