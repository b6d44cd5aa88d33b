//! The streams of a page, in the order in which they are coded, and the tables that code them.

/// Streams that are there whatever the page: steps of the front, details of rare ones, places of points.
pub(super) const TOKENS: usize = 0;
pub(super) const RARE: usize = 1;
pub(super) const KEYS: usize = 2;
/// Number of these, each with a table of its own.
pub(super) const FIXED: usize = 3;

/// Differences of one coordinate, which have several tables by how large they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Position,
    Normal,
    Color,
    PointNormal,
    PointColor,
}

impl Kind {
    /// Symbols that can occur.
    pub(super) fn symbols(self) -> u32 {
        match self {
            Self::Position => 42,
            Self::Normal | Self::PointNormal => 26,
            Self::Color | Self::PointColor => 18,
        }
    }
}

/// Three of positions, two of normals and three of colours of vertices; two of normals and three of colours of points.
pub(super) const STREAMS: [Kind; 13] = [
    Kind::Position,
    Kind::Position,
    Kind::Position,
    Kind::Normal,
    Kind::Normal,
    Kind::Color,
    Kind::Color,
    Kind::Color,
    Kind::PointNormal,
    Kind::PointNormal,
    Kind::PointColor,
    Kind::PointColor,
    Kind::PointColor,
];
/// Tables of each kind.
pub(super) const SIZES: usize = 16;
/// Where these begin.
pub(super) const OF_POINTS: usize = 8;
/// All tables: of the fixed streams, then by kind and size.
pub(super) const TABLES: usize = FIXED + 5 * SIZES;

/// The table of a kind and size.
pub(super) fn table_of(kind: Kind, size: usize) -> usize {
    FIXED + kind as usize * SIZES + size
}

/// How many numbers each of [`STREAMS`] has.
pub(super) fn counts(vertices: usize, points: usize, has_colors: bool) -> [usize; STREAMS.len()] {
    std::array::from_fn(|stream| {
        let is_color = matches!(STREAMS[stream], Kind::Color | Kind::PointColor);
        match stream < OF_POINTS {
            _ if is_color && !has_colors => 0,
            true => vertices,
            false => points,
        }
    })
}
