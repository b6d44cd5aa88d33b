//! The whole mesh, read from a stream once, in memory or spooled to disk.

use super::paint::{Paint, Reading};
use super::plan::MemoryPlan;
use crate::BuildError;
use crate::journal::Extent;
use crate::progress::Phases;
use crate::spool::{Place, Spool};
use crate::work::Work;
use bytemuck::Pod;
use gigalod_import::{Batch, ModelStream};
use glam::{DVec3, Vec3};
use std::io;

/// The position of a vertex, in either precision.
pub(crate) trait Corner: Copy + Pod + Send + Sync {
    /// The vector from another one to this one.
    fn minus(&self, other: &Self) -> [f32; 3];

    fn exact(&self) -> DVec3;
}

impl Corner for [f32; 3] {
    fn minus(&self, other: &Self) -> [f32; 3] {
        std::array::from_fn(|axis| self[axis] - other[axis])
    }

    fn exact(&self) -> DVec3 {
        Vec3::from_array(*self).as_dvec3()
    }
}

impl Corner for [f64; 3] {
    fn minus(&self, other: &Self) -> [f32; 3] {
        std::array::from_fn(|axis| (self[axis] - other[axis]) as f32)
    }

    fn exact(&self) -> DVec3 {
        DVec3::from_array(*self)
    }
}

/// Model space. As narrow as the model is: half the bytes that have to be fetched again and again.
#[derive(Debug)]
pub(crate) enum Positions {
    /// All coordinates are `f32`s.
    Narrow(Spool<[f32; 3]>),
    Wide(Spool<[f64; 3]>),
}

/// Names of the spools of positions in a work folder.
const NARROW: &str = "positions";
const WIDE: &str = "wide_positions";

impl Positions {
    /// Puts all on disk; returns the name, too.
    pub(crate) fn secure(&self) -> io::Result<(String, Extent)> {
        match self {
            Self::Narrow(spool) => spool.secure(),
            Self::Wide(spool) => spool.secure(),
        }
    }

    /// As an earlier process left them.
    pub(crate) fn reopen(work: &Work) -> io::Result<Self> {
        if work.has(WIDE) {
            Ok(Self::Wide(Spool::reopen(work, WIDE)?))
        } else {
            Ok(Self::Narrow(Spool::reopen(work, NARROW)?))
        }
    }

    pub(crate) fn len(&self) -> u64 {
        match self {
            Self::Narrow(spool) => spool.len(),
            Self::Wide(spool) => spool.len(),
        }
    }

    fn expect(&mut self, vertices: u64) {
        match self {
            Self::Narrow(spool) => spool.expect(vertices),
            Self::Wide(spool) => spool.expect(vertices),
        }
    }

    fn push(&mut self, positions: &[DVec3], place: &Place<'_>) -> io::Result<()> {
        if let Self::Narrow(spool) = self {
            if positions.iter().all(|position| position.as_vec3().as_dvec3() == *position) {
                let narrow: Vec<[f32; 3]> = positions.iter().map(|position| position.as_vec3().to_array()).collect();
                return spool.push(&narrow);
            }
            // The first that is not: those before it are widened.
            let mut wide = Spool::named(place, WIDE)?;
            spool.for_each_piece(MemoryPlan::PIECE, |_, piece| {
                wide.push(&piece.iter().map(|position| position.exact().to_array()).collect::<Vec<_>>())
            })?;
            *self = Self::Wide(wide);
        }
        if let Self::Wide(spool) = self {
            spool.push(&positions.iter().map(DVec3::to_array).collect::<Vec<_>>())?;
        }
        Ok(())
    }

    /// Positions of the vertices from `start` on.
    pub(crate) fn read_vec(&self, start: u64, count: usize, out: &mut Vec<DVec3>) -> io::Result<()> {
        fn read<C: Corner>(spool: &Spool<C>, start: u64, count: usize, out: &mut Vec<DVec3>) -> io::Result<()> {
            let mut corners = Vec::new();
            spool.read_vec(start, count, &mut corners)?;
            out.clear();
            out.extend(corners.iter().map(C::exact));
            Ok(())
        }
        match self {
            Self::Narrow(spool) => read(spool, start, count, out),
            Self::Wide(spool) => read(spool, start, count, out),
        }
    }
}

/// An indexed mesh as it was read; without triangles it is a point cloud.
pub(crate) struct Mesh {
    pub(crate) positions: Positions,
    /// One for each vertex, or empty.
    pub(crate) normals: Spool<[f32; 3]>,
    /// 8-bit sRGB, one for each vertex, or empty.
    pub(crate) colors: Spool<[u8; 3]>,
    pub(crate) triangles: Spool<[u32; 3]>,
    /// Where materials or textures have colours.
    pub(crate) paint: Option<Paint>,
}

impl Mesh {
    /// As an earlier process left it, but for what materials need.
    pub(crate) fn reopen(work: &Work) -> io::Result<Self> {
        Ok(Self {
            positions: Positions::reopen(work)?,
            normals: Spool::reopen(work, "normals")?,
            colors: Spool::reopen(work, "colors")?,
            triangles: Spool::reopen(work, "triangles")?,
            paint: None,
        })
    }

    /// Bytes of the spools, but for pictures.
    pub(crate) fn spooled_bytes(&self) -> u64 {
        let per_vertex = 24 * self.positions.len() + 12 * self.normals.len() + 3 * self.colors.len();
        let of_paint = |paint: &Paint| 8 * paint.tex_coords.len() + 16 * paint.corners.len();
        per_vertex + 12 * self.triangles.len() + self.paint.as_ref().map_or(0, of_paint)
    }
}

pub(crate) fn read(input: &mut dyn ModelStream, plan: &MemoryPlan, phases: &Phases<'_>) -> Result<Mesh, BuildError> {
    phases.begin("read", input.bytes_consumed().1);
    let place = plan.place();
    let mut mesh = Mesh {
        positions: Positions::Narrow(Spool::named(&place, NARROW).map_err(BuildError::Scratch)?),
        normals: Spool::named(&place, "normals").map_err(BuildError::Scratch)?,
        colors: Spool::named(&place, "colors").map_err(BuildError::Scratch)?,
        triangles: Spool::named(&place, "triangles").map_err(BuildError::Scratch)?,
        paint: None,
    };
    let mut paint = Reading::new(place);
    if let (Some(vertices), Some(faces)) = (input.declared_vertices(), input.declared_faces()) {
        // A header's word, believed only as far as the plan found room for it.
        mesh.positions.expect(vertices.min(plan.most_vertices()));
        mesh.triangles.expect(faces.min(plan.most_triangles()));
    }
    let mut batch = Batch::default();
    let mut normals: Vec<[f32; 3]> = Vec::new();
    while input.next(&mut batch)? {
        normals.clear();
        normals.extend(batch.vertices.normals.iter().map(Vec3::to_array));
        let mut push = || {
            mesh.positions.push(&batch.vertices.positions, &place)?;
            mesh.normals.push(&normals)?;
            mesh.colors.push(&batch.vertices.colors)?;
            mesh.triangles.push(&batch.triangles)?;
            paint.push(&batch)
        };
        push().map_err(BuildError::Scratch)?;
        phases.at(input.bytes_consumed().0);
    }
    if mesh.positions.len() == 0 {
        return Err(BuildError::Nothing);
    }
    if mesh.positions.len() >= 1 << 31 {
        return Err(BuildError::TooManyVertices { found: mesh.positions.len() });
    }
    if mesh.triangles.len() > 0 {
        mesh.paint = paint.finish(input, plan, phases)?;
    }
    Ok(mesh)
}
