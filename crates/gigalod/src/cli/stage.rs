//! A model open for drawing: scene, loaders and graphics device, as `render`, `bench` and `demo` use them.

use super::args::{DrawArgs, KernelArg};
use super::error::CliError;
use super::files;
use super::progress::Console;
use gigalod_format::splats::SplatFile;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera};
use gigalod_render::{Frame, Gpu, Kernel, Lighting, Look, Picture, RenderError, Renderer};
use gigalod_runtime::residency::ThreadedLoader;
use gigalod_runtime::splats::Tint;
use gigalod_runtime::{CutReport, Instance, Residency, Scene, Similarity, ViewId};
use std::path::Path;
use std::sync::Arc;

/// The one view of a picture.
pub(crate) const CAMERA: ViewId = ViewId(0);

/// A model open for drawing.
pub(crate) struct Stage {
    pub(crate) scene: Scene,
    pub(crate) renderer: Renderer,
    up: UpAxis,
}

impl Stage {
    /// Opens a `.glod` file and the graphics device.
    pub(crate) fn open(file: &Path, cpu_budget: u64) -> Result<Self, CliError> {
        let splats: SplatFile = files::open_splats(file)?;
        let up = splats.skeleton().root().up;
        let threads = std::thread::available_parallelism().map_or(1, |cores| cores.get()).min(4);
        let loader = ThreadedLoader::new(threads)
            .map_err(|error| CliError::new(format!("could not start loading threads: {error}")))?;
        let mut residency = Residency::new(cpu_budget, Box::new(loader));
        let id = residency.add(Arc::new(splats));
        let mut scene = Scene::new(residency);
        scene.set_cpu_budget(cpu_budget);
        scene.add(Instance { file: id, placement: Similarity::IDENTITY });
        let renderer = Gpu::open().and_then(Renderer::new).map_err(graphics_error)?;
        Ok(Self { scene, renderer, up })
    }

    /// Around the model.
    pub(crate) fn bounds(&self) -> Aabb {
        self.scene.bounds()
    }

    /// Which way is up.
    pub(crate) fn up(&self) -> UpAxis {
        self.up
    }

    /// A picture of the last cut.
    pub(crate) fn picture(&mut self, camera: &Camera, look: Look) -> Result<Picture, CliError> {
        let draws =
            self.scene.draws(CAMERA).map(|(instance, selection)| (instance.placement, &selection.draw)).collect();
        self.renderer.picture(&Frame { camera: *camera, look, draws }).map_err(graphics_error)
    }

    /// Draws the last cut and waits until the device has done so.
    pub(crate) fn draw_frame(&mut self, camera: &Camera, look: Look) -> Result<(), CliError> {
        self.picture(camera, look).map(|_| ())
    }

    /// What is wrong with the file, as far as it was read; `name` is what messages call it.
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
        problems
    }
}

impl DrawArgs {
    /// Largest error on screen, in pixels; 0 for everything there is.
    pub(crate) fn threshold_px(&self) -> f64 {
        if self.full { 0.0 } else { self.error.unwrap_or(1.0) }
    }

    pub(crate) fn look(&self) -> Look {
        Look {
            kernel: match self.kernel {
                KernelArg::Square => Kernel::Square,
                KernelArg::Round => Kernel::Round,
            },
            lighting: Lighting { towards_light: self.light, background: self.background },
        }
    }

    pub(crate) fn tint(&self) -> Tint {
        if self.lod_colors { Tint::Level } else { Tint::Model }
    }
}

fn graphics_error(error: RenderError) -> CliError {
    let error_line = CliError::new(&error);
    match error {
        RenderError::NoAdapter(_) => {
            error_line.hint("install a Vulkan driver, as mesa-vulkan-drivers and libvulkan1 on Debian and Ubuntu")
        }
        _ => error_line,
    }
}
