//! A patch that is being changed: faces, and for each vertex a list of its corners.
//!
//! Any faces whatever: non-manifold, degenerate, none of it matters here. What always holds: each face that is there is in the list
//! of each of its vertices; lists may hold faces that are gone.

use super::patch::{Face, Patch, Spot, Vertex};

/// End of a list.
const END: u32 = u32::MAX;

/// A patch with neighbours.
#[derive(Debug)]
pub(super) struct Surface {
    pub(super) vertices: Vec<Vertex>,
    pub(super) faces: Vec<Face>,
    is_gone: Vec<bool>,
    first: Vec<u32>,
    next: Vec<u32>,
    /// Faces that are there.
    pub(super) left: usize,
    spots: Vec<Spot>,
}

impl Surface {
    pub(super) fn new(patch: Patch) -> Self {
        let Patch { vertices, faces, spots } = patch;
        let mut surface = Self {
            first: vec![END; vertices.len()],
            next: vec![END; faces.len() * 3],
            is_gone: vec![false; faces.len()],
            left: faces.len(),
            spots,
            vertices,
            faces,
        };
        // Backwards, so that lists are in order.
        for face in (0..surface.faces.len()).rev() {
            let corners = surface.faces[face].corners;
            if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
                surface.is_gone[face] = true;
                surface.left -= 1;
                continue;
            }
            for side in (0..3).rev() {
                surface.link(face * 3 + side, corners[side]);
            }
        }
        surface
    }

    /// What is left.
    pub(super) fn into_patch(self) -> Patch {
        let Self { vertices, faces, is_gone, spots, .. } = self;
        let mut gone = is_gone.into_iter();
        let mut faces = faces;
        faces.retain(|_| gone.next() == Some(false));
        let mut patch = Patch { vertices, faces, spots };
        patch.compact();
        patch
    }

    fn link(&mut self, corner: usize, vertex: u32) {
        self.next[corner] = self.first[vertex as usize];
        self.first[vertex as usize] = corner as u32;
    }

    /// Faces around a vertex, in no order; forgets those that are gone.
    pub(super) fn around(&mut self, vertex: u32, out: &mut Vec<u32>) {
        let mut corner = self.first[vertex as usize];
        let mut last = END;
        while corner != END {
            let (face, next) = (corner / 3, self.next[corner as usize]);
            if self.is_gone[face as usize] {
                match last {
                    END => self.first[vertex as usize] = next,
                    last => self.next[last as usize] = next,
                }
            } else {
                out.push(face);
                last = corner;
            }
            corner = next;
        }
    }

    pub(super) fn is_there(&self, face: u32) -> bool {
        !self.is_gone[face as usize]
    }

    /// Numbers and corners of those that are.
    pub(super) fn there(&self) -> impl Iterator<Item = (u32, [u32; 3])> + Clone {
        let all = self.faces.iter().zip(&self.is_gone).enumerate();
        all.filter(|(_, (_, is_gone))| !**is_gone).map(|(number, (face, _))| (number as u32, face.corners))
    }

    /// Takes a face away.
    pub(super) fn remove(&mut self, face: u32) {
        self.left -= usize::from(!self.is_gone[face as usize]);
        self.is_gone[face as usize] = true;
    }

    /// Gives one corner of a face to another vertex.
    pub(super) fn reassign(&mut self, face: u32, from: u32, to: u32) {
        let corners = &mut self.faces[face as usize].corners;
        let side = corners.iter().position(|corner| *corner == from).expect("the face has that corner");
        corners[side] = to;
        // The old list still holds this corner. It is skipped there only if the face is gone; so the old vertex must be done with.
        self.link_again(face as usize * 3 + side, from, to);
    }

    fn link_again(&mut self, corner: usize, from: u32, to: u32) {
        let mut at = self.first[from as usize];
        let next = self.next[corner];
        if at as usize == corner {
            self.first[from as usize] = next;
        } else {
            while self.next[at as usize] as usize != corner {
                at = self.next[at as usize];
            }
            self.next[at as usize] = next;
        }
        self.link(corner, to);
    }
}
