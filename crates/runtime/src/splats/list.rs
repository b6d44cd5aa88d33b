//! Lists of splats: what a cut writes and a renderer draws.
//!
//! What always holds: the order of a list is that of the tree, whoever filled its pieces; so a splat's place in the list is
//! a name for it that does not depend on threads or on what was drawn before.

/// Where a splat is and how large. WGSL twin: `shader/splats.wgsl` of the render crate.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SplatBall {
    /// Centre of the ball, relative to the eye; the model's axes and units.
    pub center_in_eye: [f32; 3],
    /// Radius of the ball; the model's units.
    pub radius: f32,
}

/// What a splat shows: normal (14 bits, lowest) and colour (5-6-5, highest 16 bits).
pub type NormalColor = u32;

/// Splats that one thread wrote: two columns of the same length, so that what decides where a splat is drawn lies close
/// together.
#[derive(Clone, Debug, Default)]
pub struct SplatPiece {
    /// Where each is.
    pub balls: Vec<SplatBall>,
    /// What each shows.
    pub normal_colors: Vec<NormalColor>,
}

/// Splats in the order of the tree, in pieces.
#[derive(Clone, Debug, Default)]
pub struct SplatList {
    /// One after the other; any may be empty.
    pub pieces: Vec<SplatPiece>,
}

impl SplatPiece {
    /// An empty piece with room for so many splats.
    pub fn with_capacity(splats: usize) -> Self {
        Self { balls: Vec::with_capacity(splats), normal_colors: Vec::with_capacity(splats) }
    }

    /// Splats that can be appended without asking for memory.
    pub fn room(&self) -> usize {
        self.balls.capacity().min(self.normal_colors.capacity()) - self.balls.len()
    }

    /// Bytes that it keeps.
    pub fn bytes(&self) -> u64 {
        (self.balls.capacity() * size_of::<SplatBall>() + self.normal_colors.capacity() * size_of::<NormalColor>())
            as u64
    }

    /// Appends a splat.
    pub fn push(&mut self, ball: SplatBall, normal_color: NormalColor) {
        self.balls.push(ball);
        self.normal_colors.push(normal_color);
    }

    /// Empties it and keeps its memory.
    pub fn clear(&mut self) {
        self.balls.clear();
        self.normal_colors.clear();
    }
}

impl SplatList {
    /// Bytes of a splat in both columns.
    pub const SPLAT_BYTES: u64 = (size_of::<SplatBall>() + size_of::<NormalColor>()) as u64;

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.pieces.iter().map(|piece| piece.balls.len()).sum()
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.pieces.iter().all(|piece| piece.balls.is_empty())
    }

    /// All splats, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&SplatBall, NormalColor)> {
        self.pieces.iter().flat_map(|piece| piece.balls.iter().zip(piece.normal_colors.iter().copied()))
    }

    /// Bytes that it keeps.
    pub fn bytes(&self) -> u64 {
        let own = self.pieces.capacity() * size_of::<SplatPiece>();
        own as u64 + self.pieces.iter().map(SplatPiece::bytes).sum::<u64>()
    }

    /// Empties all pieces and keeps their memory.
    pub fn clear(&mut self) {
        self.pieces.iter_mut().for_each(SplatPiece::clear);
    }
}

/// Equal are lists of the same splats, however they are cut into pieces.
impl PartialEq for SplatList {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().eq(other.iter())
    }
}
