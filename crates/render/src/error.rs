//! Why there is no picture.

/// Why a picture could not be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// No driver, most likely.
    #[error("no graphics adapter, not even a software one: {0}")]
    NoAdapter(String),
    /// The adapter would not open.
    #[error("the graphics adapter gave no device: {0}")]
    NoDevice(String),
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
    /// Something the renderer did was wrong, or the device is lost or out of memory.
    #[error("the graphics device reports: {0}")]
    Device(String),
    /// A draw source of a kind that this renderer did not make.
    #[error("a draw source lies on a device this renderer does not know")]
    ForeignDrawSource,
}
