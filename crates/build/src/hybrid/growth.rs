//! The octree of what does not fit into memory: sets of pieces on disk, raised one after the other, and the nodes above them.
//!
//! In: all pieces. Out: all nodes, in the order in which they were made, and a list of them. What is in memory at a time has the size that
//! the plan allows; how much that is changes nothing about the nodes. Between any two sets the state can be kept and continued from.

use super::Shape;
use super::cell::Cell;
use super::nodes::Nodes;
use super::octree::{self, Piece, Raised};
use super::patch::{Face, Patch, Spot, Vertex};
use super::pieces::Facts;
use crate::progress::Phases;
use crate::splats::plan::MemoryPlan;
use crate::spool::{Place, Spool};
use crate::work::Work;
use crate::{BuildError, Options};
use gigalod_import::ModelStream;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::io;

/// What is to be done.
pub(super) enum Task {
    /// Raise a cell.
    Set(Cell, Spool<Piece>),
    /// Make the node of a cell from the patches of so many children, which are done.
    Join(Cell, usize),
}

/// How far it has come.
pub(super) struct Growth {
    /// The next one last.
    tasks: Vec<Task>,
    /// Of cells whose parents are to come, in order.
    patches: Vec<Patch>,
    pub(super) nodes: Nodes,
    done: u64,
    /// Pieces that there were, when this process began.
    total: u64,
    sets: u64,
}

/// All of these pieces that are raised between two places to go on from: a quarter of the model.
const SAVE_EVERY: u64 = 4;
/// Bytes of work for each piece of a set in memory: the piece twice, its page, patches, and a share of what is being simplified.
const WORK_PER_PIECE: u64 = 260;
/// Bytes of the spools for each vertex: position, normal, colour, what it gathers.
const SPOOLED_PER_VERTEX: u64 = 24 + 12 + 3 + 16;
/// And for each triangle, where it is a piece already.
const SPOOLED_PER_TRIANGLE: u64 = 12 + 60;
/// Bytes of everything for each triangle, where the octree is made in memory: 150 to 170 on statues, most of it twice the pieces.
const ALL_PER_TRIANGLE: u64 = 200;
/// Within this step.
pub(super) const GROWING: &str = "part of octree";

/// Decides by what the stream declares; a stream that declares nothing is spooled to files.
pub(super) fn fits_into_memory(options: &Options, input: &dyn ModelStream) -> bool {
    let (Some(vertices), Some(faces)) = (input.declared_vertices(), input.declared_faces()) else { return false };
    let of_vertices = vertices.saturating_mul(SPOOLED_PER_VERTEX);
    let mesh = of_vertices.saturating_add(faces.saturating_mul(SPOOLED_PER_TRIANGLE));
    let octree = faces.saturating_mul(ALL_PER_TRIANGLE);
    mesh.max(octree) <= options.memory_bytes - options.memory_bytes / 8
}

impl Growth {
    pub(super) fn new(pieces: Spool<Piece>, plan: &MemoryPlan<'_>) -> io::Result<Self> {
        let nodes = Nodes::new(&plan.place())?;
        Ok(Self { tasks: vec![Task::Set(Cell::ROOT, pieces)], patches: vec![], nodes, done: 0, total: 0, sets: 0 })
    }

    /// Does all there is to do. `save` is told now and then how far that has come.
    pub(super) fn grow(
        mut self,
        shape: &Shape,
        plan: &MemoryPlan<'_>,
        phases: &Phases<'_>,
        mut save: impl FnMut(&Self) -> io::Result<()>,
    ) -> Result<Nodes, BuildError> {
        let waiting = |task: &Task| if let Task::Set(_, pieces) = task { pieces.len() } else { 0 };
        self.total = self.done + self.tasks.iter().map(waiting).sum::<u64>();
        let total = self.total;
        phases.begin("octree", total);
        let at_once = (plan.half() / WORK_PER_PIECE).max(shape.most_triangles as u64);
        let mut unsaved = 0;
        while let Some(task) = self.tasks.pop() {
            match task {
                Task::Set(cell, pieces) if pieces.len() <= at_once || matches!(pieces, Spool::Memory(_)) => {
                    unsaved += pieces.len();
                    self.raise(cell, pieces, shape, phases).map_err(BuildError::Scratch)?;
                }
                Task::Set(cell, pieces) if cell.level >= shape.deepest() => {
                    return Err(BuildError::Crowd { vertices: pieces.len(), most: at_once });
                }
                Task::Set(cell, pieces) => {
                    let vertices = pieces.len();
                    if !self.split(cell, pieces, shape, plan).map_err(BuildError::Scratch)? {
                        return Err(BuildError::Crowd { vertices, most: at_once });
                    }
                }
                Task::Join(cell, children) => {
                    let patches = self.patches.split_off(self.patches.len() - children);
                    let children = patches.into_iter().map(|patch| Raised { patch, nodes: vec![] }).collect();
                    self.put(octree::join(children, cell, shape)).map_err(BuildError::Scratch)?;
                }
            }
            if unsaved >= total / SAVE_EVERY && !self.tasks.is_empty() {
                save(&self).map_err(BuildError::Scratch)?;
                unsaved = 0;
            }
        }
        Ok(self.nodes)
    }

    fn raise(&mut self, cell: Cell, pieces: Spool<Piece>, shape: &Shape, phases: &Phases<'_>) -> io::Result<()> {
        let count = pieces.len();
        let all = match pieces {
            Spool::Memory(all) => all,
            file => {
                let mut all = Vec::new();
                file.read_vec(0, count as usize, &mut all)?;
                all
            }
        };
        // Cutting has made more of them.
        let told = |done: u64| phases.at((self.done + done).min(self.total));
        let raised = octree::raise(all, cell, shape, &octree::Told::new(&told));
        self.done += count;
        phases.at(self.done.min(self.total));
        self.put(raised)
    }

    fn put(&mut self, raised: Raised) -> io::Result<()> {
        raised.nodes.iter().try_for_each(|made| self.nodes.push(made))?;
        self.patches.push(raised.patch);
        Ok(())
    }

    /// Sorts a set into eight; false where too much of it is too large for that.
    fn split(&mut self, cell: Cell, pieces: Spool<Piece>, shape: &Shape, plan: &MemoryPlan<'_>) -> io::Result<bool> {
        let mut sets = Vec::new();
        for _ in 0..8 {
            self.sets += 1;
            sets.push(Spool::named(&plan.place_in_files(), &format!("set{}", self.sets))?);
        }
        let (all, mut large) = (pieces.len() as usize, 0);
        pieces.for_each_piece(MemoryPlan::PIECE, |_, piece| {
            large += piece.iter().filter(|piece| octree::is_large(piece, cell, shape)).count();
            let parts = octree::split(piece, cell, shape);
            sets.iter_mut().zip(&parts).try_for_each(|(set, part)| set.push(part))
        })?;
        drop(pieces);
        let sets = sets.into_iter().enumerate().filter(|(_, set)| set.len() > 0);
        let tasks: Vec<Task> = sets.map(|(octant, set)| Task::Set(cell.child(octant as u8), set)).collect();
        self.tasks.push(Task::Join(cell, tasks.len()));
        self.tasks.extend(tasks.into_iter().rev());
        Ok(octree::may_cut(large, all))
    }

    /// Keeps the state in a work folder.
    pub(super) fn save(&self, work: &Work, facts: &Facts) -> io::Result<()> {
        let place = Place::Work(work);
        let of = |what: &str| format!("{what}{}-{}", self.sets, self.done);
        let mut spools = self.nodes.secure(&place, &of("list"))?;
        let (mut vertices, mut faces) = (Spool::named(&place, &of("vertices"))?, Spool::named(&place, &of("faces"))?);
        let mut spots = Spool::named(&place, &of("spots"))?;
        let mut sizes = Vec::new();
        for patch in &self.patches {
            vertices.push(&patch.vertices)?;
            faces.push(&patch.faces)?;
            spots.push(&patch.spots)?;
            sizes.push([patch.vertices.len(), patch.faces.len(), patch.spots.len()]);
        }
        spools.extend([vertices.secure()?, faces.secure()?, spots.secure()?]);
        let mut tasks = Vec::new();
        for task in &self.tasks {
            tasks.push(match task {
                Task::Join(cell, children) => {
                    Kept { level: cell.level, code: cell.code, set: None, children: *children }
                }
                Task::Set(cell, pieces) => {
                    let (name, extent) = pieces.secure()?;
                    spools.push((name.clone(), extent));
                    Kept { level: cell.level, code: cell.code, set: Some(name), children: 0 }
                }
            });
        }
        let numbers = [self.sets, self.done];
        let state = json!({ "facts": facts, "tasks": tasks, "sizes": sizes, "numbers": numbers });
        work.finish(GROWING, spools, state)
    }

    /// As [`Growth::save`] left it.
    pub(super) fn load(work: &Work, state: &serde_json::Value) -> io::Result<Self> {
        let odd = || io::Error::new(io::ErrorKind::InvalidData, "the journal says what no builder writes");
        let tasks: Vec<Kept> = serde_json::from_value(state["tasks"].clone()).map_err(|_| odd())?;
        let sizes: Vec<[usize; 3]> = serde_json::from_value(state["sizes"].clone()).map_err(|_| odd())?;
        let [sets, done]: [u64; 2] = serde_json::from_value(state["numbers"].clone()).map_err(|_| odd())?;
        let of = |what: &str| format!("{what}{sets}-{done}");
        let vertices: Spool<Vertex> = Spool::reopen(work, &of("vertices"))?;
        let faces: Spool<Face> = Spool::reopen(work, &of("faces"))?;
        let spots: Spool<Spot> = Spool::reopen(work, &of("spots"))?;
        let mut patches = Vec::new();
        let mut from = [0; 3];
        for [vertex_count, face_count, spot_count] in sizes {
            let mut patch = Patch::default();
            vertices.read_vec(from[0], vertex_count, &mut patch.vertices)?;
            faces.read_vec(from[1], face_count, &mut patch.faces)?;
            spots.read_vec(from[2], spot_count, &mut patch.spots)?;
            from = [from[0] + vertex_count as u64, from[1] + face_count as u64, from[2] + spot_count as u64];
            patches.push(patch);
        }
        let task = |Kept { level, code, set, children }: Kept| {
            let cell = Cell { level, code };
            Ok(match set {
                None => Task::Join(cell, children),
                Some(name) => Task::Set(cell, Spool::reopen(work, &name)?),
            })
        };
        let tasks = tasks.into_iter().map(task).collect::<io::Result<_>>()?;
        Ok(Self { tasks, patches, nodes: Nodes::reopen(work, &of("list"))?, done, total: 0, sets })
    }
}

/// A task in a journal.
#[derive(Serialize, Deserialize)]
struct Kept {
    level: u32,
    code: u64,
    set: Option<String>,
    children: usize,
}
