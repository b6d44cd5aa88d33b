//! Paint: colours that belong to triangles rather than vertices, as materials and textures have them.
//!
//! ```text
//! stream ──▶ reading ──▶ Paint ──▶ texels ──▶ colour of a cell
//! corners,   spools,     pictures  tiles in
//! materials  pictures    as tiles  a cache
//! ```
//!
//! What always holds: however many pictures there are and however large, what is in memory of them is a cache of tiles, and one
//! picture while it is decoded. A picture that is missing or damaged is no error, since the surface is good: its material's colour
//! is shown, and a note says so. Nothing of that depends on memory: one that is too large to be decoded within the budget is an error.

mod pictures;
mod reading;
mod texels;

pub(super) use pictures::Picture;
pub(super) use reading::Reading;
pub(super) use texels::{Area, Tiles};

use super::join::Corners;
use super::plan::MemoryPlan;
use crate::spool::Spool;
use gigalod_import::{CornerBatch, Material, Wrap};
use serde::{Deserialize, Serialize};
use std::io;

/// What triangles show.
pub(crate) struct Paint {
    /// By the number that triangles have.
    pub(super) looks: Vec<Look>,
    pub(super) pictures: Vec<Picture>,
    /// Tiles of all pictures.
    pub(super) texels: Spool<Texel>,
    pub(super) tex_coords: Spool<[f32; 2]>,
    /// Numbers of texture coordinates, or [`CornerBatch::NONE`], of each triangle.
    pub(super) corners: Spool<[u32; 3]>,
    /// Number of each triangle's look, or [`CornerBatch::NONE`].
    pub(super) materials: Spool<u32>,
}

/// Stands for no texture coordinate, or no look.
pub(super) const NONE: u32 = CornerBatch::NONE;

/// 8-bit sRGB, and how opaque.
pub(super) type Texel = [u8; 4];

/// How a material looks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Look {
    /// A factor, 8-bit sRGB.
    pub(super) color: [u8; 3],
    /// Another.
    pub(super) picture: Option<u32>,
    pub(super) scale: [f32; 2],
    pub(super) offset: [f32; 2],
    pub(super) edges: [Edge; 2],
    /// What is less opaque is not there.
    pub(super) cutoff: Option<u8>,
}

/// What is outside a picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Edge {
    Repeat,
    Mirror,
    Clamp,
}

impl Edge {
    /// Place of a texel among so many.
    fn place(self, at: i64, count: u32) -> u32 {
        let count = i64::from(count);
        let place = match self {
            Self::Repeat => at.rem_euclid(count),
            Self::Mirror => {
                let place = at.rem_euclid(2 * count);
                if place < count { place } else { 2 * count - 1 - place }
            }
            Self::Clamp => at.clamp(0, count - 1),
        };
        place as u32
    }
}

impl Look {
    fn of(material: &Material, picture: Option<u32>) -> Self {
        Self {
            color: if material.is_in_vertices { [255; 3] } else { material.color },
            picture,
            scale: material.mapping.scale,
            offset: material.mapping.offset,
            edges: material.mapping.wrap.map(|wrap| match wrap {
                Wrap::Repeat => Edge::Repeat,
                Wrap::Mirror => Edge::Mirror,
                Wrap::Clamp => Edge::Clamp,
            }),
            cutoff: material.alpha_cutoff,
        }
    }

    /// Texels along both axes from a texture coordinate, in a picture of that size; y downwards from the top.
    pub(super) fn texel(&self, coord: [f64; 2], size: [u32; 2]) -> [f64; 2] {
        let [u, v] =
            std::array::from_fn(|axis| coord[axis] * f64::from(self.scale[axis]) + f64::from(self.offset[axis]));
        [u * f64::from(size[0]), (1.0 - v) * f64::from(size[1])]
    }
}

impl Paint {
    /// Texels that triangles show, each as often as it is shown.
    pub(super) fn count_texels(&self, plan: &MemoryPlan<'_>) -> io::Result<u64> {
        let (mut looks, mut coords, mut texels) = (Vec::new(), Vec::new(), 0u64);
        if self.tex_coords.len() == 0 {
            return Ok(0);
        }
        self.corners.for_each_piece(plan.diced_at_once(), |start, corners| {
            self.materials.read_vec(start, corners.len(), &mut looks)?;
            let known = corners.as_flattened().iter().map(|number| if *number == NONE { 0 } else { *number });
            Corners::of_vertices(known.collect()).fetch(&self.tex_coords, &mut coords)?;
            for ((coords, look), numbers) in coords.as_chunks::<3>().0.iter().zip(&looks).zip(corners) {
                let Some(look) = self.looks.get(*look as usize) else { continue };
                let Some(picture) = look.picture.filter(|_| !numbers.contains(&NONE)) else { continue };
                let size = self.pictures[picture as usize].levels[0].size;
                let [[ax, ay], [bx, by], [cx, cy]] = coords.map(|coord| look.texel(coord.map(f64::from), size));
                let area = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).abs() * 0.5;
                // In whole numbers, so that their order does not show; casting saturates.
                texels = texels.saturating_add(area as u64);
            }
            Ok(())
        })?;
        Ok(texels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_those_of_opengl() {
        let row = |edge: Edge| (-4..7).map(|at| edge.place(at, 3)).collect::<Vec<_>>();
        assert_eq!(row(Edge::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Edge::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(row(Edge::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }
}
