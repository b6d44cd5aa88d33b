//! Between the window's thread and the stage's: wishes and orders one way, pictures and figures the other.
//!
//! What always holds: nobody waits for the other side; of wishes only the latest counts; a wish stops the refinement of the last
//! one at once.

use gigalod_geom::{Camera, ImageSize};
use gigalod_render::window::Shown;
use gigalod_render::{Gpu, Look};
use gigalod_runtime::splats::Tint;
use gigalod_runtime::{CutReport, Interrupt, ModelFile, Similarity};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What a person wants to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wish {
    /// World space, with the window's size.
    pub(crate) camera: Camera,
    /// Kernel, light and background.
    pub(crate) look: Look,
    /// Colours of the model or of its levels.
    pub(crate) tint: Tint,
    /// Levels of hybrid models fade into each other.
    pub(crate) cross_fade: bool,
    /// Error at rest, in pixels.
    pub(crate) finest_px: f32,
    /// Milliseconds of a frame while the camera moves.
    pub(crate) target_ms: f64,
    /// Bytes for pages and lists.
    pub(crate) cpu_budget: u64,
    /// Bytes on the graphics device; `None` for all there is.
    pub(crate) gpu_budget: Option<u64>,
}

/// Names a model on the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ModelKey(pub(crate) u64);

/// Something to be done once.
pub(crate) enum Order {
    /// Puts a model into the scene.
    Add(ModelKey, ModelFile, Vec<Similarity>),
    /// Takes it out again.
    Remove(ModelKey),
    /// A picture of what is wished for, as fine as it gets.
    Picture(PathBuf, Wish),
    /// Go on with another device.
    MoveTo(Box<Gpu>),
}

/// What the stage has to say.
#[derive(Debug)]
pub(crate) enum News {
    /// A picture that was ordered: its name, size, 8-bit sRGB and alpha.
    Picture(PathBuf, ImageSize, Vec<u8>),
    /// The device is gone; the stage waits for [`Order::MoveTo`].
    DeviceLost(String),
    /// Something did not work; the stage goes on.
    Problem(String),
}

/// Figures of the last frame; times in milliseconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    /// Number of the wish that it shows.
    pub wish: u64,
    /// Of the cut.
    pub report: CutReport,
    /// Half of the splats drawn are no larger than this, in pixels: as a sample of them says.
    pub typical_px: f32,
    /// Pixels of the screen that a drawn one is wide: more than 1 only while the camera moves.
    pub pixel_edge_px: f64,
    /// From the beginning of the cut to the end of the drawing, on the clock.
    pub frame_ms: f64,
    /// Of these, the cut.
    pub select_ms: f64,
    /// Processor time of the stage's thread for the frame.
    pub cpu_ms: f64,
    /// Pages that the cut could have used and that were not there.
    pub misses: u64,
    /// Bytes of resident pages.
    pub resident_bytes: u64,
    /// Bytes that the scene keeps.
    pub cpu_bytes: u64,
    /// Bytes on the device.
    pub gpu_bytes: u64,
    /// Bytes read from files.
    pub bytes_read: u64,
    /// Nothing gets finer any more.
    pub settled: bool,
    /// Places at which each pixel was looked at.
    pub samples: u32,
    /// And edges get no smoother.
    pub finished: bool,
    /// Frames so far.
    pub frames: u64,
    /// What is wrong with files, as far as they were read.
    pub problems: Vec<String>,
}

#[derive(Default)]
struct Inbox {
    wish: Option<(u64, Wish)>,
    orders: VecDeque<Order>,
    closed: bool,
}

#[derive(Default)]
struct Outbox {
    shown: Option<Shown>,
    /// Number of the latest frame, while the window has not painted it.
    unseen: Option<u64>,
    figures: VecDeque<Figures>,
    news: Vec<News>,
}

/// Most figures that wait to be looked at.
const MOST_FIGURES: usize = 256;

pub(crate) struct Mailbox {
    inbox: Mutex<Inbox>,
    arrived: Condvar,
    outbox: Mutex<Outbox>,
    seen: Condvar,
    interrupt: Interrupt,
    /// Wakes the window's thread.
    wake: Box<dyn Fn() + Send + Sync>,
}

/// What came in.
#[derive(Default)]
pub(crate) struct Mail {
    pub(crate) wish: Option<(u64, Wish)>,
    pub(crate) orders: Vec<Order>,
    pub(crate) closed: bool,
}

/// What came out.
#[derive(Default)]
pub(crate) struct Delivery {
    pub(crate) figures: Vec<Figures>,
    pub(crate) news: Vec<News>,
}

impl Mailbox {
    pub(crate) fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self {
            inbox: Mutex::default(),
            arrived: Condvar::new(),
            outbox: Mutex::default(),
            seen: Condvar::new(),
            interrupt: Interrupt::default(),
            wake: Box::new(wake),
        }
    }

    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn outbox(&self) -> MutexGuard<'_, Outbox> {
        self.outbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn wish(&self, number: u64, wish: Wish) {
        let mut inbox = self.inbox();
        inbox.wish = Some((number, wish));
        self.interrupt.set();
        self.arrived.notify_one();
    }

    pub(crate) fn order(&self, order: Order) {
        let mut inbox = self.inbox();
        // A picture for a file is taken when nothing moves: it need not wait longer for having been asked for.
        if !matches!(order, Order::Picture(..)) {
            self.interrupt.set();
        }
        inbox.orders.push_back(order);
        self.arrived.notify_one();
    }

    pub(crate) fn close(&self) {
        self.inbox().closed = true;
        self.interrupt.set();
        self.arrived.notify_one();
    }

    pub(crate) fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// What has come in; waits for something for so long, or as long as it takes.
    pub(crate) fn receive(&self, wait: Option<Duration>) -> Mail {
        let nothing = |inbox: &mut Inbox| inbox.wish.is_none() && inbox.orders.is_empty() && !inbox.closed;
        let mut inbox = match wait {
            None => self.arrived.wait_while(self.inbox(), nothing).unwrap_or_else(PoisonError::into_inner),
            Some(wait) if wait.is_zero() => self.inbox(),
            Some(wait) => {
                self.arrived.wait_timeout_while(self.inbox(), wait, nothing).unwrap_or_else(PoisonError::into_inner).0
            }
        };
        self.interrupt.clear();
        Mail { wish: inbox.wish.take(), orders: inbox.orders.drain(..).collect(), closed: inbox.closed }
    }

    /// A frame is finished.
    pub(crate) fn show(&self, shown: Option<Shown>, figures: Figures) {
        let mut outbox = self.outbox();
        outbox.shown = shown;
        outbox.unseen = Some(figures.frames);
        if outbox.figures.len() == MOST_FIGURES {
            outbox.figures.pop_front();
        }
        outbox.figures.push_back(figures);
        drop(outbox);
        (self.wake)();
    }

    /// The window has done with this frame what it does. One queue orders the device's work: the window would wait for a next frame that was
    /// handed in earlier.
    pub(crate) fn painted(&self, frame: u64) {
        let mut outbox = self.outbox();
        outbox.unseen = outbox.unseen.filter(|latest| *latest > frame);
        self.seen.notify_one();
    }

    /// Waits until the window has painted the latest picture, but not for long.
    pub(crate) fn wait_until_painted(&self, at_most: Duration) {
        let is_unseen = |outbox: &mut Outbox| outbox.unseen.is_some();
        drop(self.seen.wait_timeout_while(self.outbox(), at_most, is_unseen));
    }

    pub(crate) fn tell(&self, news: News) {
        self.outbox().news.push(news);
        (self.wake)();
    }

    pub(crate) fn collect(&self) -> Delivery {
        let mut outbox = self.outbox();
        Delivery { figures: outbox.figures.drain(..).collect(), news: std::mem::take(&mut outbox.news) }
    }

    /// The latest picture.
    pub(crate) fn shown(&self) -> Option<Shown> {
        self.outbox().shown.clone()
    }

    /// Pictures of a lost device cannot be shown.
    pub(crate) fn forget_shown(&self) {
        self.outbox().shown = None;
    }
}
