//! Triangles meet their vertices, wherever the vertices are.
//!
//! In memory that is indexing. In a file, the corners of a batch of triangles are sorted by vertex, so that the file is swept
//! once, in order, and only where it is needed. Folding goes in order of (vertex, corner) either way, so sums of floats are the
//! same to the last bit.

use super::plan::MemoryPlan;
use crate::spool::Spool;
use bytemuck::Pod;
use rayon::prelude::*;
use std::io;

/// The corners of a batch of triangles, in order of their vertices.
#[derive(Default)]
pub(crate) struct Corners {
    /// Vertex in the upper half, number of the corner (3 · triangle + 0, 1, 2) in the lower. Sorted; empty while not needed.
    by_vertex: Vec<u64>,
    vertices: Vec<u32>,
}

impl Corners {
    pub(crate) fn of(triangles: &[[u32; 3]]) -> Self {
        Self::of_vertices(triangles.as_flattened().to_vec())
    }

    /// Of anything that has vertices.
    pub(crate) fn of_vertices(vertices: Vec<u32>) -> Self {
        Self { by_vertex: Vec::new(), vertices }
    }

    fn sort(&mut self) {
        if self.by_vertex.is_empty() {
            let key = |(corner, vertex): (usize, &u32)| u64::from(*vertex) << 32 | corner as u64;
            self.by_vertex = self.vertices.iter().enumerate().map(key).collect();
            self.by_vertex.sort_unstable();
        }
    }

    /// The record of each corner's vertex.
    pub(crate) fn fetch<R: Pod + Send + Sync>(&mut self, records: &Spool<R>, out: &mut Vec<R>) -> io::Result<()> {
        out.clear();
        if let Spool::Memory(all) = records {
            self.vertices.par_iter().with_min_len(1 << 14).map(|vertex| all[*vertex as usize]).collect_into_vec(out);
            return Ok(());
        }
        self.sort();
        out.resize(self.vertices.len(), R::zeroed());
        let mut piece = Vec::new();
        for group in pieces(&self.by_vertex) {
            let (start, count) = extent(group);
            records.read_vec(start, count, &mut piece)?;
            for key in group {
                out[*key as u32 as usize] = piece[((key >> 32) - start) as usize];
            }
        }
        Ok(())
    }

    /// Folds a contribution of each corner into the record of its vertex; `fold` is told the number of the corner.
    pub(crate) fn fold<R: Pod>(
        &mut self,
        records: &mut Spool<R>,
        mut fold: impl FnMut(&mut R, usize),
    ) -> io::Result<()> {
        if let Spool::Memory(all) = records {
            for (corner, vertex) in self.vertices.iter().enumerate() {
                fold(&mut all[*vertex as usize], corner);
            }
            return Ok(());
        }
        self.sort();
        let mut piece = Vec::new();
        for group in pieces(&self.by_vertex) {
            let (start, count) = extent(group);
            records.read_vec(start, count, &mut piece)?;
            for key in group {
                fold(&mut piece[((key >> 32) - start) as usize], *key as u32 as usize);
            }
            records.write(start, &piece)?;
        }
        Ok(())
    }
}

/// Runs of keys whose vertices lie in the same piece of a file.
fn pieces(by_vertex: &[u64]) -> impl Iterator<Item = &[u64]> {
    by_vertex.chunk_by(|a, b| (a >> 32) / MemoryPlan::PIECE as u64 == (b >> 32) / MemoryPlan::PIECE as u64)
}

/// First vertex of a run, and number of vertices up to its last.
fn extent(group: &[u64]) -> (u64, usize) {
    let (first, last) = (group[0] >> 32, group[group.len() - 1] >> 32);
    (first, (last - first + 1) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spool::Place;

    #[test]
    fn joining_in_a_file_is_joining_in_memory() {
        let folder = tempfile::tempdir().unwrap();
        let count = 3 * MemoryPlan::PIECE as u32;
        let records: Vec<u32> = (0..count).map(|i| i.wrapping_mul(2_654_435_761)).collect();
        let triangles: Vec<[u32; 3]> =
            (0..5000u32).map(|i| [i * 39 % count, i.wrapping_mul(40_503) % count, i % 7]).collect();
        let results = [Place::Memory, Place::Folder(folder.path())].map(|place| {
            let mut spool = Spool::new(&place).unwrap();
            spool.push(&records).unwrap();
            let mut corners = Corners::of(&triangles);
            let mut fetched = Vec::new();
            corners.fetch(&spool, &mut fetched).unwrap();
            // Not commutative: the order shows.
            corners
                .fold(&mut spool, |record, corner| *record = record.wrapping_mul(31).wrapping_add(corner as u32))
                .unwrap();
            let mut all = Vec::new();
            spool.read_vec(0, count as usize, &mut all).unwrap();
            (fetched, all)
        });
        assert!(results[0] == results[1]);
        let expected: Vec<u32> = triangles.as_flattened().iter().map(|vertex| records[*vertex as usize]).collect();
        assert!(results[0].0 == expected);
    }
}
