//! A small triangle mesh in memory, and the filters that keep it tidy.

use glam::Vec3;

/// One copy while it is made.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    pub(super) positions: Vec<Vec3>,
    /// Indices into `positions`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// One per position, or none at all.
    pub(super) colors: Vec<[u8; 3]>,
}

impl Mesh {
    /// Corners of a triangle.
    pub(super) fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|corner| self.positions[corner as usize])
    }

    /// Middle of a triangle.
    pub(super) fn centroid(&self, triangle: [u32; 3]) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        (a + b + c) / 3.0
    }

    /// Keeps the triangles whose centroid `keep` approves, unless that were none; leaves vertices alone.
    pub(super) fn keep_triangles(&mut self, keep: impl Fn(Vec3) -> bool) {
        let kept: Vec<_> = self.triangles.iter().copied().filter(|&triangle| keep(self.centroid(triangle))).collect();
        if !kept.is_empty() {
            self.triangles = kept;
        }
    }

    /// Drops vertices that no triangle names; the others keep their order.
    pub(super) fn without_unused(self) -> Self {
        let mut new_index = vec![u32::MAX; self.positions.len()];
        for triangle in &self.triangles {
            for &corner in triangle {
                new_index[corner as usize] = 0;
            }
        }
        for (index, used) in new_index.iter_mut().filter(|index| **index == 0).zip(0..) {
            *index = used;
        }
        let is_used = |index: &usize| new_index[*index] != u32::MAX;
        let at = |items: &[[u8; 3]]| (0..items.len()).filter(is_used).map(|index| items[index]).collect();
        Self {
            positions: (0..self.positions.len()).filter(is_used).map(|index| self.positions[index]).collect(),
            colors: at(&self.colors),
            triangles: self
                .triangles
                .iter()
                .map(|triangle| triangle.map(|corner| new_index[corner as usize]))
                .collect(),
        }
    }
}
