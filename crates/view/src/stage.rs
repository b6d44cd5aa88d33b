//! The thread that selects, uploads and draws, so that the window's thread never does.
//!
//! Goes in: wishes and orders. Comes out: pictures on the device, and figures. While wishes change, each frame is as fine as its
//! time allows; once they rest it is refined step by step, and last its edges are smoothed ([`smooth`]), until a new wish comes: that
//! breaks everything off at once. Pictures for files are taken by [`pictures`].
//!
//! What always holds: a rested picture is that of `render` for the same camera, look and budgets, bit for bit; what goes wrong with
//! files or the device is told and survived.

mod pictures;
mod smooth;

use crate::clock::thread_cpu_ms;
use crate::mailbox::{Figures, Mail, Mailbox, ModelKey, News, Order, Wish};
use crate::settings::Settings;
use gigalod_render::{Frame, Look, RenderError, Renderer};
use gigalod_runtime::residency::ThreadedLoader;
use gigalod_runtime::{
    CutReport, DrawSource, Fineness, FrameRate, Instance, InstanceId, Limit, Magnified, Residency, Scene, ViewId,
};
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

const CAMERA: ViewId = ViewId(0);

/// Where there is no memory for so few, coarser will not help.
const FEWEST_SPLATS: u64 = 1000;

/// Splats that are looked at to tell a typical one, about.
const SAMPLE: usize = 500;

/// A window that takes longer to paint, or is hidden, is not waited for.
const LONGEST_PAINTING: Duration = Duration::from_millis(30);

/// Weight of the last frame in how long painting takes.
const PAINTING_GAIN: f64 = 0.2;

/// A model whose pages are on their way is not shown before its error is no larger than this, in pixels: a disc over the whole window
/// is no first picture of it.
const FIRST_ERROR_PX: f32 = 40.0;

/// But it is shown after this time in any case.
const LONGEST_FIRST_LOOK: Duration = Duration::from_millis(400);

/// How often pages that are being loaded are looked for, while there is nothing else to do.
const LOOK_FOR_PAGES: Duration = Duration::from_millis(4);

/// A finished frame.
struct Drawn {
    wish: Wish,
    threshold_px: f32,
    /// Pixels of the screen that a drawn one is wide.
    pixel_edge_px: f64,
}

pub(crate) struct Stage {
    mailbox: Arc<Mailbox>,
    renderer: Renderer,
    scene: Scene,
    instances: BTreeMap<ModelKey, Vec<InstanceId>>,
    control: FrameRate,
    /// How long the window paints while the camera moves, in the mean of the last frames.
    painting_ms: f64,
    wish: Option<(u64, Wish)>,
    /// What the last finished frame shows.
    drawn: Option<Drawn>,
    /// The next frame shows something else than the last one.
    changed: bool,
    /// Since when a model is there that has not been drawn yet.
    fresh: Option<Instant>,
    /// Edges are as smooth as they get.
    is_smooth: bool,
    /// Drawing is in vain until something changes.
    stuck: bool,
    /// The device is gone.
    lost: bool,
    /// What a device without enough memory has left.
    most_splats: u64,
    /// What the last cut is for, where that is as fine as it gets.
    cut: Option<Wish>,
    /// To be taken.
    pictures: VecDeque<(PathBuf, Wish)>,
    frames: u64,
    /// Of the last frame.
    figures: Figures,
}

impl Stage {
    pub(crate) fn new(mailbox: Arc<Mailbox>, mut renderer: Renderer, settings: Settings) -> std::io::Result<Self> {
        let threads = std::thread::available_parallelism().map_or(1, |cores| cores.get()).min(4);
        let residency = Residency::new(settings.cpu_budget, Box::new(ThreadedLoader::new(threads)?));
        let mut scene = Scene::new(residency);
        scene.set_cpu_budget(settings.cpu_budget);
        renderer.set_budget(settings.gpu_budget);
        Ok(Self {
            mailbox,
            renderer,
            scene,
            instances: BTreeMap::new(),
            // How fine, the first wish says.
            control: FrameRate::new(settings.target_ms, 1.0).with_larger_pixels(),
            painting_ms: 0.0,
            wish: None,
            drawn: None,
            changed: true,
            fresh: None,
            is_smooth: false,
            stuck: false,
            lost: false,
            most_splats: u64::MAX,
            cut: None,
            pictures: VecDeque::new(),
            frames: 0,
            figures: Figures::default(),
        })
    }

    /// Until the mailbox is closed.
    pub(crate) fn run(mut self) {
        loop {
            let is_refined = !self.changed && self.control.is_settled();
            let rests = self.wish.is_none() || self.lost || self.stuck || is_refined && self.is_smooth;
            let wait = if rests {
                self.take_pictures();
                None
            } else if self.fresh.is_some() || !self.changed && self.waits_for_pages() {
                Some(LOOK_FOR_PAGES)
            } else {
                Some(Duration::ZERO)
            };
            let Mail { wish, orders, closed } = self.mailbox.receive(wait);
            if closed {
                orders.into_iter().for_each(|order| self.obey(order));
                // Nobody is left to break it off.
                self.take_pictures();
                return;
            }
            if let Some((number, wish)) = wish {
                self.take_wish(number, wish);
            }
            for order in orders {
                self.obey(order);
            }
            let Some((number, wish)) = self.wish else { continue };
            if self.lost || self.stuck {
                continue;
            }
            if !self.changed && self.control.is_settled() {
                if !self.is_smooth {
                    self.smooth(number, &wish);
                }
                continue;
            }
            if !self.changed && self.waits_for_pages() && self.scene.residency_mut().receive(false) == 0 {
                continue;
            }
            self.frame(number, &wish);
        }
    }

    /// True where the last frame was as fine as resident pages allow, and others are on their way.
    fn waits_for_pages(&self) -> bool {
        let finest = self
            .drawn
            .as_ref()
            .is_some_and(|drawn| drawn.threshold_px <= drawn.wish.finest_px && drawn.pixel_edge_px == 1.0);
        finest && self.scene.residency().is_loading()
    }

    fn take_wish(&mut self, number: u64, wish: Wish) {
        let before = self.wish.replace((number, wish)).map(|(_, before)| before);
        if before == Some(wish) {
            return;
        }
        if before.is_none_or(|before| before.target_ms != wish.target_ms || before.finest_px != wish.finest_px) {
            self.control = FrameRate::new(wish.target_ms, wish.finest_px).with_larger_pixels();
        }
        if before.is_none_or(|before| before.cpu_budget != wish.cpu_budget) {
            self.allow_bytes(wish.cpu_budget);
        }
        if before.is_none_or(|before| before.gpu_budget != wish.gpu_budget) {
            self.renderer.set_budget(wish.gpu_budget);
            self.most_splats = u64::MAX;
        }
        self.scene.set_tint(wish.tint);
        self.scene.set_cross_fade(wish.cross_fade);
        (self.changed, self.stuck) = (true, false);
    }

    /// As many as are wished for, but no fewer than it takes to show each model at all.
    fn allow_bytes(&mut self, cpu_budget: u64) {
        self.scene.set_cpu_budget(cpu_budget.max(self.scene.least_bytes()));
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Add(key, file, placements) => {
                let file = self.scene.residency_mut().add(file);
                let ids = placements.into_iter().map(|placement| self.scene.add(Instance { file, placement }));
                self.instances.insert(key, ids.collect());
                if let Some((_, wish)) = self.wish {
                    self.allow_bytes(wish.cpu_budget);
                }
                self.fresh = Some(Instant::now());
            }
            Order::Remove(key) => {
                for id in self.instances.remove(&key).unwrap_or_default() {
                    self.scene.remove(id);
                }
            }
            Order::Picture(name, wish) => {
                self.pictures.push_back((name, wish));
                return;
            }
            Order::MoveTo(gpu) => match self.renderer.move_to(*gpu) {
                Ok(()) => self.lost = false,
                Err(error) => self.mailbox.tell(News::Problem(error.to_string())),
            },
        }
        (self.changed, self.stuck) = (true, false);
    }

    fn frame(&mut self, number: u64, wish: &Wish) {
        let (begun, cpu_begun) = (Instant::now(), thread_cpu_ms());
        let moved = self.changed;
        (self.cut, self.is_smooth) = (None, false);
        self.control.share(self.painting_ms);
        let wanted = self.control.next(moved);
        let room = self.renderer.most_splats(wish.camera.size, &wish.look);
        let fineness = Fineness { most_splats: wanted.most_splats.min(self.most_splats).min(room), ..wanted };
        self.scene.residency_mut().receive(false);
        let report = if moved {
            // A moving frame is short, and breaking it off would show nothing at all.
            self.scene.select(CAMERA, &wish.camera, &fineness)
        } else {
            let interrupt = self.mailbox.interrupt().clone();
            match self.scene.select_interruptible(CAMERA, &wish.camera, &fineness, &interrupt) {
                Some(report) => report,
                None => {
                    self.scene.serve();
                    return;
                }
            }
        };
        let select_ms = begun.elapsed().as_secs_f64() * 1e3;
        let is_coming = report.limited_by == Some(Limit::Residency) && report.max_error_px > FIRST_ERROR_PX;
        if is_coming && self.fresh.is_some_and(|since| since.elapsed() < LONGEST_FIRST_LOOK) {
            self.scene.serve();
            return;
        }
        self.fresh = None;
        let misses = self.scene.draws(CAMERA).map(|(_, selection)| selection.requests.len() as u64).sum();
        let draws =
            self.scene.draws(CAMERA).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
        let pixel_edge_px = self.control.pixel_edge_px(&report, select_ms, self.scene.area_px(CAMERA, &wish.camera));
        let magnified = Magnified::new(&wish.camera, pixel_edge_px);
        let look = Look { samples: 1, ..wish.look };
        let frame = Frame { camera: *magnified.camera(), look, draws };
        let typical_px = typical_px(&frame, wish.camera.focal_px());
        let waited = Instant::now();
        self.mailbox.wait_until_painted(LONGEST_PAINTING);
        let waited = waited.elapsed();
        if moved {
            self.painting_ms += PAINTING_GAIN * (waited.as_secs_f64() * 1e3 - self.painting_ms);
        }
        if !moved && self.mailbox.interrupt().is_set() {
            // Something else is wished for; what would be drawn in detail is not what a person waits for.
            self.scene.serve();
            return;
        }
        let drawn = if moved {
            self.renderer.draw(&frame).map(|()| true)
        } else {
            self.renderer.draw_interruptible(&frame, self.mailbox.interrupt())
        };
        self.scene.serve();
        match drawn {
            Ok(true) => {}
            Ok(false) => return,
            Err(error) => {
                self.survive(error, &report);
                return;
            }
        }
        let frame_ms = (begun.elapsed() - waited).as_secs_f64() * 1e3;
        self.control.drew(frame_ms, &report, self.scene.residency().is_loading());
        self.changed = false;
        let settled = self.control.is_settled();
        self.drawn = Some(Drawn { wish: *wish, threshold_px: report.threshold_px, pixel_edge_px });
        self.cut = settled.then_some(*wish);
        // As it is on the screen.
        let report = magnified.report(&report);
        self.frames += 1;
        let figures = Figures {
            wish: number,
            report,
            typical_px,
            pixel_edge_px,
            frame_ms,
            select_ms,
            cpu_ms: thread_cpu_ms() - cpu_begun,
            misses,
            resident_bytes: self.scene.residency().resident_bytes(),
            cpu_bytes: self.scene.cpu_bytes(),
            gpu_bytes: self.renderer.gpu_bytes(),
            bytes_read: self.scene.residency().bytes_read(),
            settled,
            samples: 1,
            finished: settled && wish.look.samples == 1,
            frames: self.frames,
            problems: self.problems(&report),
        };
        self.figures = figures.clone();
        self.mailbox.show(self.renderer.shown(), figures);
    }

    fn survive(&mut self, error: RenderError, report: &CutReport) {
        match error {
            RenderError::DeviceLost(why) => self.lose(why),
            RenderError::OutOfMemory(why) if report.primitives() > FEWEST_SPLATS => {
                self.most_splats = report.primitives() / 2;
                let text = format!("the graphics device is out of memory, drawn coarser: {why}");
                self.mailbox.tell(News::Problem(text));
            }
            error => {
                self.stuck = true;
                let text = match error {
                    RenderError::Budget { needed, .. } => format!(
                        "this picture needs {} MiB on the graphics device: allow more (Budgets, Device memory), or make the window smaller",
                        needed.div_ceil(1 << 20)
                    ),
                    error => error.to_string(),
                };
                self.mailbox.tell(News::Problem(text));
            }
        }
    }

    fn lose(&mut self, why: String) {
        self.lost = true;
        self.mailbox.forget_shown();
        self.mailbox.tell(News::DeviceLost(why));
    }

    fn problems(&self, report: &CutReport) -> Vec<String> {
        let damaged = self.scene.residency().damaged();
        let mut problems: Vec<String> = damaged.map(|(_, why)| format!("drawn coarser: {why}")).collect();
        if report.inconsistent {
            problems.push("the tree of a file contradicts itself, parts may be missing".to_string());
        }
        problems
    }
}

/// Median diameter of what is drawn, in pixels of the screen across the view axis, of a sample; 0 where nothing is.
fn typical_px(frame: &Frame<'_>, focal_px: f64) -> f32 {
    // Sizes and distances are in the same units, those of the model.
    let pieces = || {
        let lists = frame.draws.iter().filter_map(|(_, source)| match source {
            DrawSource::Splats(list) => Some(&list.pieces),
            _ => None,
        });
        lists.flatten().map(|piece| &piece.balls[..])
    };
    let step = (pieces().map(<[_]>::len).sum::<usize>() / SAMPLE).max(1);
    let mut diameters: Vec<f32> = pieces()
        .flat_map(|balls| balls.iter().step_by(step))
        .map(|ball| 2.0 * focal_px as f32 * ball.radius / glam::Vec3::from_array(ball.center_in_eye).length())
        .collect();
    let middle = diameters.len() / 2;
    if diameters.is_empty() { 0.0 } else { *diameters.select_nth_unstable_by(middle, f32::total_cmp).1 }
}
