//! The window and its thread: events in, pictures out. Nothing here waits but for events and the display.

use crate::clock::thread_cpu_ms;
use crate::forced::{Forced, unless_forced};
use crate::host::Host;
use crate::mailbox::{Mailbox, Order};
use crate::panel::prepare;
use crate::picker;
use crate::report::{Measured, Report};
use crate::settings::Options;
use crate::stage::Stage;
use crate::viewer::Viewer;
use egui::ViewportId;
use gigalod_geom::ImageSize;
use gigalod_render::RenderError;
use gigalod_render::window::{Acquired, Shown, UiPaint, WindowPainter};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::{Window, WindowId};

/// Frames that change nothing come at most so often.
const LEAST_DELAY: Duration = Duration::from_millis(8);

/// A window that cannot be painted is tried again after so long.
const TRY_AGAIN: Duration = Duration::from_millis(500);

/// A device that is lost so often in a row stays lost.
const MOST_LOSSES: u32 = 3;

/// Why there is no window any more, or never was one.
#[derive(Debug)]
pub enum ViewError {
    /// The system gives no window.
    Window(String),
    /// The device cannot be used.
    Render(RenderError),
    /// The system gives no threads.
    Threads(std::io::Error),
    /// Another program has destroyed the window.
    Forced,
}

impl ViewError {
    /// As the system says it, without the place in a library's source where it was found.
    fn no_window(error: &dyn std::fmt::Display) -> Self {
        let text = error.to_string();
        let behind_place = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
        Self::Window(behind_place.map_or(text.clone(), |(_, why)| why.into()))
    }
}

impl std::fmt::Display for ViewError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Window(why) => write!(f, "could not open a window: {why}"),
            Self::Render(error) => error.fmt(f),
            Self::Threads(error) => write!(f, "could not start threads: {error}"),
            Self::Forced => f.write_str("the window was closed by force"),
        }
    }
}

impl std::error::Error for ViewError {}

/// Another thread has news.
struct Wake;

/// Opens a window and returns when the person has closed it. To be called on the program's first thread, once: it leaves a panic
/// hook that keeps quiet about a window that another program destroys.
///
/// # Errors
/// There is no window, no device, or it was lost for good. All else that goes wrong is told in the window.
pub fn run(options: Options, host: Arc<dyn Host>) -> Result<Report, ViewError> {
    let window_error = |error: &dyn std::fmt::Display| ViewError::no_window(error);
    let events = EventLoop::<Wake>::with_user_event().build().map_err(|error| window_error(&error))?;
    let proxy = events.create_proxy();
    let mut app = App { options, host, proxy, running: None, error: None };
    match unless_forced(|| events.run_app(&mut app)) {
        Ok(ended) => ended.map_err(|error| window_error(&error))?,
        Err(Forced) => app.error = Some(ViewError::Forced),
    }
    let report = app.running.map(Running::end);
    match (app.error, report) {
        (Some(error), _) => Err(error),
        (None, Some(report)) => Ok(report),
        (None, None) => Err(ViewError::Window("it was closed before it was open".into())),
    }
}

struct App {
    options: Options,
    host: Arc<dyn Host>,
    proxy: EventLoopProxy<Wake>,
    running: Option<Running>,
    error: Option<ViewError>,
}

/// An open window.
struct Running {
    window: Arc<Window>,
    painter: WindowPainter,
    context: egui::Context,
    input: egui_winit::State,
    viewer: Viewer,
    mailbox: Arc<Mailbox>,
    stage: Option<JoinHandle<()>>,
    size: ImageSize,
    losses: u32,
    opened: Instant,
    /// Number and size of the picture that the window shows, and what lies over it.
    painted: Option<(u64, ImageSize)>,
    painted_shapes: Vec<egui::epaint::ClippedShape>,
    /// A frame was asked for here, and not by the system, which has lost what the window showed.
    asked: bool,
    must_paint: bool,
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.running.is_some() {
            return;
        }
        match Running::open(events, &self.options, &self.host, &self.proxy) {
            Ok(running) => self.running = Some(running),
            Err(error) => {
                self.error = Some(error);
                events.exit();
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: Wake) {
        if let Some(running) = &mut self.running {
            running.ask();
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(running) = &mut self.running else { return };
        // A frame that is being made is no reason for another, although egui says so.
        if running.input.on_window_event(&running.window, &event).repaint && event != WindowEvent::RedrawRequested {
            running.ask();
        }
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Destroyed => {
                self.error = Some(ViewError::Forced);
                events.exit();
            }
            WindowEvent::Resized(size) => {
                running.size = ImageSize { width: size.width, height: size.height };
                running.painter.resize(running.size);
                running.must_paint = true;
                running.ask();
            }
            WindowEvent::ScaleFactorChanged { .. } | WindowEvent::Occluded(false) => {
                running.must_paint = true;
                running.ask();
            }
            WindowEvent::RedrawRequested => match running.frame() {
                Ok(Next::Redraw) => running.ask(),
                Ok(Next::At(instant)) => events.set_control_flow(ControlFlow::WaitUntil(instant)),
                Ok(Next::Wait) => events.set_control_flow(ControlFlow::Wait),
                Ok(Next::End) => events.exit(),
                Err(error) => {
                    self.error = Some(error);
                    events.exit();
                }
            },
            _ => {}
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: winit::event::StartCause) {
        if let (winit::event::StartCause::ResumeTimeReached { .. }, Some(running)) = (cause, &mut self.running) {
            running.ask();
        }
    }
}

/// How soon egui wants its next frame.
fn repaint_delay(output: &egui::FullOutput) -> Duration {
    output.viewport_output.get(&ViewportId::ROOT).map_or(Duration::MAX, |root| root.repaint_delay)
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Painted {
    Done,
    Hidden,
    Again,
}

/// When the next frame is wanted.
enum Next {
    Redraw,
    At(Instant),
    Wait,
    End,
}

impl Running {
    fn open(
        events: &ActiveEventLoop,
        options: &Options,
        host: &Arc<dyn Host>,
        proxy: &EventLoopProxy<Wake>,
    ) -> Result<Self, ViewError> {
        let ImageSize { width, height } = options.size;
        let attributes =
            Window::default_attributes().with_title("Gigalod").with_inner_size(PhysicalSize::new(width, height));
        let window = events.create_window(attributes).map_err(|error| ViewError::no_window(&error))?;
        let window = Arc::new(window);
        let inner = window.inner_size();
        let size = ImageSize { width: inner.width, height: inner.height };
        let (painter, renderer) = WindowPainter::open(window.clone(), size).map_err(ViewError::Render)?;
        let opened = Instant::now();

        // A closed event loop needs no waking.
        let wake = {
            let proxy = proxy.clone();
            move || drop(proxy.send_event(Wake))
        };
        let mailbox = Arc::new(Mailbox::new(wake.clone()));
        let stage = Stage::new(mailbox.clone(), renderer, options.settings).map_err(ViewError::Threads)?;
        let stage =
            std::thread::Builder::new().name("stage".into()).spawn(|| stage.run()).map_err(ViewError::Threads)?;
        let picker = picker::start(host.clone(), wake.clone()).map_err(ViewError::Threads)?;
        let mut viewer = Viewer::new(options, host.clone(), mailbox.clone(), picker, wake);
        viewer.adapter = painter.gpu().adapter();

        let context = egui::Context::default();
        prepare(&context);
        let most = Some(painter.gpu().max_picture_edge() as usize);
        let scale = Some(window.scale_factor() as f32);
        let input = egui_winit::State::new(context.clone(), ViewportId::ROOT, &*window, scale, None, most);
        let stage = Some(stage);
        window.request_redraw();
        Ok(Self {
            window,
            painter,
            context,
            input,
            viewer,
            mailbox,
            stage,
            size,
            losses: 0,
            opened,
            painted: None,
            painted_shapes: Vec::new(),
            asked: true,
            must_paint: false,
        })
    }

    /// Asks for a frame.
    fn ask(&mut self) {
        self.asked = true;
        self.window.request_redraw();
    }

    /// One frame of the window; it is painted where it differs from the last one.
    fn frame(&mut self) -> Result<Next, ViewError> {
        let begun = thread_cpu_ms();
        self.must_paint |= !std::mem::take(&mut self.asked);
        if std::mem::take(&mut self.viewer.wants_new_device) {
            self.painter.gpu().close();
            // At rest nobody else would notice.
            self.must_paint = true;
        }
        if let Some(why) = self.viewer.wants_recovery.take() {
            self.recover(&why)?;
        }
        let raw = self.input.take_egui_input(&self.window);
        let (viewer, size) = (&mut self.viewer, self.size);
        let mut output = self.context.run_ui(raw, |ui| viewer.ui(ui, size));
        let delay = repaint_delay(&output);
        self.input.handle_platform_output(&self.window, output.platform_output);
        let picture = (self.viewer.figures.frames, size);
        let is_same = !std::mem::take(&mut self.must_paint)
            && output.textures_delta.is_empty()
            && self.painted == Some(picture)
            && self.painted_shapes == output.shapes;
        if is_same {
            self.mailbox.painted(self.viewer.figures.frames);
            // A person drags, and the stage has not caught up: painting the same again would only take its time.
            let next = Instant::now().checked_add(delay.max(LEAST_DELAY)).map_or(Next::Wait, Next::At);
            return Ok(if self.viewer.wants_to_quit { Next::End } else { next });
        }
        self.painted = None;
        self.painted_shapes.clone_from(&output.shapes);
        let primitives = self.context.tessellate(output.shapes, output.pixels_per_point);
        let shown = self.mailbox.shown();
        let ui = UiPaint { primitives: &primitives, pixels_per_point: output.pixels_per_point };
        self.painter.take_textures(&output.textures_delta);
        let painted = self.paint(shown.as_ref(), &ui);
        self.mailbox.painted(self.viewer.figures.frames);
        self.painter.free_textures(&output.textures_delta);
        output.textures_delta.clear();
        let (painted, driver_ms) = match painted {
            Err(RenderError::DeviceLost(why)) => {
                self.recover(&why)?;
                return Ok(Next::Redraw);
            }
            Err(error) => {
                self.viewer.notice_error(&error.to_string());
                return Ok(Instant::now().checked_add(TRY_AGAIN).map_or(Next::Wait, Next::At));
            }
            Ok(painted) => painted,
        };
        let tally = &mut self.viewer.tally;
        if painted == Painted::Done {
            self.painted = Some(picture);
            tally.window_cpu_ms.push((thread_cpu_ms() - begun - driver_ms) as f32);
            tally.driver_cpu_ms.push(driver_ms as f32);
            if shown.is_some() {
                self.losses = 0;
                tally.first_frame_ms.get_or_insert(self.opened.elapsed().as_secs_f32() * 1e3);
                tally.shown(self.viewer.figures.wish);
            }
        }
        if self.viewer.wants_to_quit {
            return Ok(Next::End);
        }
        Ok(match (painted, delay) {
            (Painted::Hidden, _) => Next::Wait,
            (Painted::Again, _) => Next::Redraw,
            (Painted::Done, delay) if delay.is_zero() => Next::Redraw,
            (Painted::Done, delay) => Instant::now().checked_add(delay).map_or(Next::Wait, Next::At),
        })
    }

    /// Paints the window; how that went, and how much processor time the driver took for it.
    fn paint(&mut self, shown: Option<&Shown>, ui: &UiPaint<'_>) -> Result<(Painted, f64), RenderError> {
        let begun = thread_cpu_ms();
        let acquired = self.painter.acquire()?;
        let acquired_at = thread_cpu_ms();
        let image = match acquired {
            Acquired::Image(image) => image,
            Acquired::Hidden => return Ok((Painted::Hidden, 0.0)),
            Acquired::Again => return Ok((Painted::Again, 0.0)),
        };
        let painted = self.painter.paint(image, shown, self.viewer.size, ui);
        let painted_at = thread_cpu_ms();
        self.painter.show(painted)?;
        Ok((Painted::Done, acquired_at - begun + thread_cpu_ms() - painted_at))
    }

    /// Opens the device anew, where it is lost.
    fn recover(&mut self, why: &str) -> Result<(), ViewError> {
        self.must_paint = true;
        if !self.painter.gpu().is_lost() {
            self.mailbox.order(Order::MoveTo(Box::new(self.painter.gpu().clone())));
            return Ok(());
        }
        self.losses += 1;
        self.mailbox.forget_shown();
        match self.painter.recover() {
            Ok(gpu) => {
                let now = self.context.input(|input| input.time);
                self.viewer.adapter = gpu.adapter();
                self.viewer.notice_mended(&format!("the graphics device was lost and opened anew: {why}"), now);
                self.mailbox.order(Order::MoveTo(Box::new(gpu)));
                Ok(())
            }
            Err(error) if self.losses > MOST_LOSSES => Err(ViewError::Render(error)),
            Err(error) => {
                self.viewer.notice_error(&error.to_string());
                Ok(())
            }
        }
    }

    /// Ends all threads, after what is being written is on disk.
    fn end(mut self) -> Report {
        self.mailbox.close();
        if let Some(stage) = self.stage.take() {
            // One that panicked has said so.
            let _ = stage.join();
        }
        self.viewer.finish();
        let viewpoint = self.viewer.own_viewpoint();
        let adapter = self.viewer.adapter.clone();
        let measured = self.viewer.measuring.distance().map(|(distance, uncertain, _)| Measured {
            points: self.viewer.measuring.points().map(|found| found.point).collect(),
            distance,
            uncertain,
        });
        let tally = std::mem::take(&mut self.viewer.tally);
        Report { adapter, tally, viewpoint, size: self.viewer.size, measured }
    }
}
