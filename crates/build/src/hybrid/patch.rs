//! A piece of surface on its way up the hierarchy: what a node holds before it is rounded and coded.
//!
//! What always holds: between the surface that a patch stands for and the patch there is a correspondence that leaves out no
//! point of either; points that correspond are no farther apart than the `geo` of the face that they lie in. What the patch stands
//! for is the original, not the level below: errors are carried along with the faces.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// A corner that faces share.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Vertex {
    /// Local space: model space less the origin of the root's cell.
    pub(crate) at: DVec3,
    /// Of unit length.
    pub(crate) normal: Vec3,
    /// Red, green, blue, 0–255; zero where there are none.
    pub(crate) color: Vec3,
}

/// A triangle, and how far it may be off.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Face {
    /// Numbers of vertices, counter-clockwise seen from outside.
    pub(crate) corners: [u32; 3],
    /// Bounds the distance of its points to what they stand for; model units.
    pub(crate) geo: f32,
    /// The same for appearance: how far away what looks like the original lies; model units.
    pub(crate) app: f32,
}

/// A point that stands for small things.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Spot {
    pub(crate) vertex: Vertex,
    /// Bounds the distance to anything that it stands for; model units.
    pub(crate) geo: f32,
    pub(crate) app: f32,
    /// How far around it there was surface; model units.
    pub(crate) reach: f32,
    pub(crate) unused: u32,
}

/// Surface of one cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Patch {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) faces: Vec<Face>,
    pub(crate) spots: Vec<Spot>,
}

impl Face {
    /// Of both kinds.
    pub(crate) fn total(&self) -> f32 {
        total(self.geo, self.app)
    }
}

/// Geometric error and that of appearance are orthogonal (hybrid paper, section 3.1).
pub(crate) fn total(geo: f32, app: f32) -> f32 {
    if app == 0.0 { geo } else { (geo * geo + app * app).sqrt() }
}

impl Patch {
    /// Drops vertices of no face; the order of the others stays.
    pub(crate) fn compact(&mut self) {
        let mut renamed = vec![u32::MAX; self.vertices.len()];
        for face in &self.faces {
            for corner in face.corners {
                renamed[corner as usize] = 0;
            }
        }
        let mut kept = 0;
        for (old, new) in renamed.iter_mut().enumerate().filter(|(_, new)| **new == 0) {
            *new = kept;
            self.vertices[kept as usize] = self.vertices[old];
            kept += 1;
        }
        self.vertices.truncate(kept as usize);
        for face in &mut self.faces {
            face.corners = face.corners.map(|corner| renamed[corner as usize]);
        }
    }
}
