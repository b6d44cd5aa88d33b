//! Why there is no picture.

/// Why a picture could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// No driver, most likely.
    #[error("no graphics adapter, not even a software one: {0}")]
    NoAdapter(String),
    /// The adapter would not open.
    #[error("the graphics adapter gave no device: {0}")]
    NoDevice(String),
    /// [`crate::GpuLevel::from_env`] found another word.
    #[error("GIGALOD_GPU_LEVEL is {0:?}, expected webgl, webgpu or native")]
    Level(String),
    /// Larger than the adapter's textures.
    #[error("a picture of {width}x{height} pixels, expected 1 to {limit} each way")]
    Size {
        /// Asked for.
        width: u32,
        /// Asked for.
        height: u32,
        /// The adapter's.
        limit: u32,
    },
    /// This frame needs more than [`crate::Renderer::set_budget`] allows. Nothing was drawn; draw coarser.
    #[error("the frame needs {needed} bytes on the graphics device, expected at most {budget}")]
    Budget {
        /// Bytes that this frame would take at least.
        needed: u64,
        /// Bytes allowed.
        budget: u64,
    },
    /// More splats or primitives than 32-bit numbers can name, or more vertices in a page than 21-bit numbers.
    #[error("{0} splats, primitives or vertices of a page: more than can be numbered")]
    TooMany(u64),
    /// Triangles are drawn through storage buffers, and this device cannot write any.
    #[error("the graphics device cannot draw hybrid models: it has no storage buffers to write to")]
    NeedsStorage,
    /// The kernel cannot be drawn by the depth test alone, and this device can do no more.
    #[error("the graphics device cannot blend splats: it has no storage buffers to write to")]
    CannotBlend,
    /// Asked for too many places in a pixel, or none.
    #[error("{0} samples of a pixel, expected 1 to {most}", most = crate::MOST_SAMPLES)]
    Samples(u32),
    /// Pictures are added up in half floats, and this device cannot add to them.
    #[error("the graphics device cannot smooth edges: it cannot add half floats up")]
    CannotSmooth,
    /// The device had not the memory. The renderer has freed what it kept and can be used: draw coarser.
    #[error("the graphics device is out of memory: {0}")]
    OutOfMemory(String),
    /// The device is gone, with all that was on it: a driver was reset or removed. [`crate::Renderer::recover`] opens it anew.
    #[error("the graphics device was lost: {0}")]
    DeviceLost(String),
    /// Something the renderer did was wrong.
    #[error("the graphics device reports: {0}")]
    Device(String),
    /// A draw source of a kind that this renderer did not make.
    #[error("a draw source lies on a device this renderer does not know")]
    ForeignDrawSource,
}
