//! Why a model could not be made.

/// Why a model could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// PLY counts vertices in 31 bits, and an empty model has no shape.
    #[error("cannot make {asked} triangles: the number must lie between {least} and {most}")]
    TriangleCount {
        /// What was asked for.
        asked: u64,
        /// The fewest that can be made.
        least: u64,
        /// The most that can be made.
        most: u64,
    },
    /// The scan to copy has no triangle with an area.
    #[error("the scan to copy has no triangle with an area ({vertices} vertices, {triangles} triangles)")]
    EmptyScan {
        /// Vertices found.
        vertices: usize,
        /// Triangles found.
        triangles: usize,
    },
    /// A triangle of the scan names a vertex that is not there.
    #[error("triangle {triangle} of the scan names vertex {found}, but there are {vertices} vertices")]
    BadIndex {
        /// Position in [`crate::Scan::triangles`].
        triangle: usize,
        /// The index found there.
        found: u32,
        /// Vertices in the scan.
        vertices: usize,
    },
    /// A coordinate is not a number, or so large that distances overflow.
    #[error("vertex {vertex} of the scan has a coordinate that is not finite or beyond 1e30")]
    NotFinite {
        /// Position in [`crate::Scan::positions`].
        vertex: usize,
    },
    /// Colours, where there are any, come one per vertex.
    #[error("the scan has {found} colours for {expected} vertices")]
    ColorCount {
        /// Vertices in the scan.
        expected: usize,
        /// Colours in the scan.
        found: usize,
    },
    /// A scan without shared vertices can need more vertices than PLY can number.
    #[error("the model would have {found} vertices; PLY can number {most}")]
    VertexCount {
        /// Vertices needed.
        found: u64,
        /// The most that can be numbered.
        most: u64,
    },
    /// The output refused bytes.
    #[error("could not write the model")]
    Io {
        /// What the output said.
        #[from]
        source: std::io::Error,
    },
}
