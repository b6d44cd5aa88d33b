//! Models open for drawing: scene, loaders and graphics device, as `render`, `bench` and `demo` use them.

use super::args::DrawArgs;
use super::error::CliError;
use super::progress::Console;
use super::subject::Subject;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera};
use gigalod_render::{Frame, Gpu, Lighting, Look, RenderError, Renderer};
use gigalod_runtime::residency::ThreadedLoader;
use gigalod_runtime::scene::description::SceneDescription;
use gigalod_runtime::splats::Tint;
use gigalod_runtime::{CutReport, FileId, Fineness, FrameRate, Instance, Limit, Magnified, Residency, Scene, ViewId};
use std::path::Path;
use std::time::Instant;

/// The one view of a picture.
pub(crate) const CAMERA: ViewId = ViewId(0);

/// A device that is lost so often during one frame stays lost.
const MOST_LOSSES: u32 = 3;

/// Where there is no memory for so few, coarser will not help.
const FEWEST_SPLATS: u64 = 1000;

/// Models open for drawing.
pub(crate) struct Stage {
    pub(crate) scene: Scene,
    pub(crate) renderer: Renderer,
    /// Draws larger pixels where full ones would be late.
    pub(crate) control: Option<FrameRate>,
    up: UpAxis,
    /// Bytes for pages and lists.
    cpu_budget: u64,
    /// What a device without enough memory has left.
    most_splats: u64,
    happened: Vec<String>,
}

/// Most memory to use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budgets {
    /// Bytes for pages and lists.
    pub(crate) cpu: u64,
    /// Bytes on the graphics device; `None` for all there is.
    pub(crate) gpu: Option<u64>,
}

/// Whether a frame waits for pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wait {
    /// It draws what is there.
    Never,
    /// Until nothing that could be loaded is missing.
    Converged,
}

/// A frame that was drawn; times on the clock, from the beginning of its last cut.
pub(crate) struct Drawn<T> {
    /// What is on the screen.
    pub(crate) report: CutReport,
    /// Pixels of the screen that a drawn one is wide.
    pub(crate) pixel_edge_px: f64,
    pub(crate) select_ms: f64,
    pub(crate) frame_ms: f64,
    pub(crate) what: T,
}

impl Stage {
    /// Puts everything in its place, and opens the graphics device.
    pub(crate) fn open(subject: &Subject, budgets: Budgets) -> Result<Self, CliError> {
        let up = subject.up();
        let threads = std::thread::available_parallelism().map_or(1, |cores| cores.get()).min(4);
        let loader = ThreadedLoader::new(threads)
            .map_err(|error| CliError::new(format!("could not start loading threads: {error}")))?;
        let mut residency = Residency::new(budgets.cpu, Box::new(loader));
        let ids: Vec<FileId> = subject.models.iter().map(|(file, _)| residency.add(file.clone())).collect();
        let mut scene = Scene::new(residency);
        scene.set_cpu_budget(budgets.cpu);
        for (file, (_, places)) in ids.into_iter().zip(&subject.models) {
            for placement in places.iter().copied() {
                scene.add(Instance { file, placement });
            }
        }
        let mut renderer = Gpu::open().and_then(Renderer::new).map_err(graphics_error)?;
        renderer.set_budget(budgets.gpu);
        Ok(Self {
            scene,
            renderer,
            control: None,
            up,
            cpu_budget: budgets.cpu,
            most_splats: u64::MAX,
            happened: Vec::new(),
        })
    }

    /// Around all models.
    pub(crate) fn bounds(&self) -> Aabb {
        self.scene.bounds()
    }

    /// Which way is up.
    pub(crate) fn up(&self) -> UpAxis {
        self.up
    }

    /// Cuts and draws with `draw`. A device that is lost is opened anew; one whose memory does not suffice gets a coarser cut,
    /// also from then on. Both are told, and are among the [`Stage::problems`].
    pub(crate) fn draw_until<T>(
        &mut self,
        camera: &Camera,
        look: Look,
        wanted: &Fineness,
        wait: Wait,
        draw: fn(&mut Renderer, &Frame<'_>) -> Result<T, RenderError>,
        console: &Console,
    ) -> Result<Drawn<T>, CliError> {
        let mut losses = 0;
        loop {
            let room = self.renderer.most_splats(camera.size, &look);
            let most_splats = wanted.most_splats.min(self.most_splats).min(room);
            let fineness = Fineness { most_splats, ..*wanted };
            if wait == Wait::Converged {
                // Then once more with everything there: the time that a warm cut takes.
                self.scene.select_converged(CAMERA, camera, &fineness);
                self.expect_all_models()?;
            }
            let begun = Instant::now();
            self.scene.residency_mut().receive(false);
            let report = self.scene.select(CAMERA, camera, &fineness);
            let select_ms = begun.elapsed().as_secs_f64() * 1e3;
            let pixel_edge_px = match &mut self.control {
                Some(control) => control.pixel_edge_px(&report, select_ms, self.scene.area_px(CAMERA, camera)),
                None => 1.0,
            };
            let shown = Magnified::new(camera, pixel_edge_px);
            let draws =
                self.scene.draws(CAMERA).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
            match draw(&mut self.renderer, &Frame { camera: *shown.camera(), look, draws }) {
                Ok(what) => {
                    let frame_ms = begun.elapsed().as_secs_f64() * 1e3;
                    return Ok(Drawn { report: shown.report(&report), pixel_edge_px, select_ms, frame_ms, what });
                }
                Err(RenderError::DeviceLost(why)) if losses < MOST_LOSSES => {
                    losses += 1;
                    self.happened(format!("the graphics device was lost and is opened anew: {why}"), console);
                    self.renderer.recover().map_err(graphics_error)?;
                }
                Err(RenderError::OutOfMemory(why)) if report.primitives() > FEWEST_SPLATS => {
                    self.most_splats = report.primitives() / 2;
                    self.happened(format!("the graphics device is out of memory, drawn coarser: {why}"), console);
                }
                Err(error) => return Err(graphics_error(error)),
            }
        }
    }

    /// After a cut that has waited for its pages: a model that is not drawn at all, for want of memory, is an error.
    fn expect_all_models(&self) -> Result<(), CliError> {
        let is_missing = |report: &CutReport| report.drawn == 0 && report.limited_by == Some(Limit::Residency);
        let is_damaged = self.scene.residency().damaged().next().is_some();
        if is_damaged || !self.scene.draws(CAMERA).any(|(_, drawn)| is_missing(&drawn.report)) {
            return Ok(());
        }
        let least = self.scene.least_bytes();
        let text = format!("the coarsest picture needs {least} bytes of memory, expected at most {}", self.cpu_budget);
        Err(CliError::new(text).hint("give a larger --cpu-budget"))
    }

    /// Something went wrong and was put right.
    fn happened(&mut self, what: String, console: &Console) {
        console.warn(&CliError::new(&what));
        self.happened.push(what);
    }

    /// What is wrong with the file, as far as it was read, and what went wrong with the device; `name` is what messages call it.
    pub(crate) fn problems(&self, name: &Path, report: &CutReport, console: &Console) -> Vec<String> {
        let damaged = self.scene.residency().damaged();
        let mut problems: Vec<String> =
            damaged.map(|(_, why)| CliError::in_file(name, why).to_string().replacen("error: ", "", 1)).collect();
        if report.inconsistent {
            problems.push(format!("{}: the tree contradicts itself, parts may be missing", name.display()));
        }
        for problem in &problems {
            console.warn(&CliError::new(problem));
        }
        problems.extend_from_slice(&self.happened);
        problems
    }
}

impl DrawArgs {
    /// Largest error on screen, in pixels, where somebody says; 0 for everything there is.
    pub(crate) fn asked_px(&self) -> Option<f64> {
        if self.full { Some(0.0) } else { self.error }
    }

    /// The same, and `default_px` where nobody says.
    pub(crate) fn threshold_px(&self, default_px: f64) -> f64 {
        self.asked_px().unwrap_or(default_px)
    }

    /// As asked for; what is not asked for, as the scene has it.
    pub(crate) fn look(&self, scene: &SceneDescription) -> Look {
        let lighting = Lighting {
            towards_light: self.light.or(scene.towards_light()),
            background: self.background.or(scene.background).unwrap_or(Lighting::default().background),
        };
        Look { kernel: self.kernel.into(), lighting, samples: self.samples.unwrap_or(1) }
    }

    pub(crate) fn budgets(&self) -> Budgets {
        Budgets { cpu: self.cpu_budget, gpu: self.gpu_budget }
    }

    pub(crate) fn tint(&self) -> Tint {
        if self.lod_colors { Tint::Level } else { Tint::Model }
    }
}

/// What was drawn, in words.
pub(crate) fn primitives(triangles: f64, points: f64) -> String {
    match triangles {
        0.0 if points == 0.0 => "nothing".into(),
        0.0 => format!("{points:.0} splats"),
        _ => format!("{triangles:.0} triangles, {points:.0} points"),
    }
}

pub(crate) fn graphics_error(error: RenderError) -> CliError {
    let error_line = CliError::new(&error);
    match error {
        RenderError::NoAdapter(_) => {
            error_line.hint("install a Vulkan driver, as mesa-vulkan-drivers and libvulkan1 on Debian and Ubuntu")
        }
        RenderError::Budget { .. } => error_line.hint("give a larger --gpu-budget, or a smaller --size"),
        RenderError::OutOfMemory(_) => error_line.hint("a smaller --size takes less"),
        _ => error_line,
    }
}
