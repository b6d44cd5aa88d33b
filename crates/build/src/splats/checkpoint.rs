//! Places to continue from: what each step leaves for the next one, kept in a work folder.
//!
//! In: a [`Stage`]. Out: the same stage, in another process. What grows with the model is in spools, which are named for it;
//! of the rest, lists become spools too, and single facts stand in the journal.

use super::chunk::Head;
use super::divide::{Chunks, Division};
use super::kept::KeptTree;
use super::leaves::Leaf;
use super::mesh::Mesh;
use super::paint::Paint;
use super::points::{Cells, Fits};
use super::tree::Extent;
use crate::spool::{Place, Spool};
use crate::work::Work;
use bytemuck::Pod;
use gigalod_format::{Dicing, InputCounts};
use gigalod_geom::Aabb;
use glam::{DVec3, Vec3A};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::io;

/// Within the longest step.
const DIVIDING: &str = "part of tree";

/// Of a point cloud: its cells; within and after the step that fits them.
const CELLS: &str = "cells";
const FITTING: &str = "part of radii";
const FITTED: &str = "radii";

/// What there is after each step.
pub(super) enum Stage {
    Start,
    Read(Mesh),
    /// Of a point cloud.
    Cells(Facts, Cells, Fits),
    Leaves(Facts, Spool<Leaf>),
    Dividing(Facts, Division),
    Tree(Facts, Chunks),
}

/// What is known of the model as a whole.
#[derive(Clone, Copy)]
pub(super) struct Facts {
    pub(super) counts: InputCounts,
    pub(super) origin: DVec3,
    pub(super) bounds: Aabb,
    pub(super) closed: bool,
    pub(super) has_colors: bool,
    pub(super) dicing: Option<Dicing>,
}

/// Keeps what `stage` has, instead of all that the one before it had.
pub(super) fn save(work: &Work, stage: &Stage) -> io::Result<()> {
    let place = Place::Work(work);
    match stage {
        Stage::Start => Ok(()),
        Stage::Read(Mesh { positions, normals, colors, triangles, paint }) => {
            let mut spools = vec![positions.secure()?, normals.secure()?, colors.secure()?, triangles.secure()?];
            let mut state = Value::Null;
            if let Some(Paint { looks, pictures, texels, tex_coords, corners, materials }) = paint {
                spools.extend([texels.secure()?, tex_coords.secure()?, corners.secure()?, materials.secure()?]);
                state = json!({ "looks": looks, "pictures": pictures });
            }
            work.finish("read", spools, state)
        }
        Stage::Cells(facts, cells, fits) => save_fits(work, facts, cells, fits),
        Stage::Leaves(facts, leaves) => work.finish("leaves", [leaves.secure()?], facts.to_json()),
        // Was saved when it was made.
        Stage::Dividing(..) => Ok(()),
        Stage::Tree(facts, Chunks { kept, colors, sizes, top, mean_radius }) => {
            let lists = [
                list(&place, "chunk_sizes", sizes)?,
                list(&place, "top", &top.nodes)?,
                list(&place, "top_colors", &top.colors)?,
                list(&place, "chunk_roots", &top.unit_nodes)?,
            ];
            let mut state = facts.to_json();
            state["mean_radius"] = json!(mean_radius);
            work.finish("tree", [kept.secure()?, colors.secure()?].into_iter().chain(lists), state)
        }
    }
}

/// Keeps how many cells of a point cloud are fitted.
pub(super) fn save_fits(work: &Work, facts: &Facts, cells: &Cells, fits: &Fits) -> io::Result<()> {
    let place = Place::Work(work);
    let done = fits.done();
    let of = |what: &str| format!("{what}{done}");
    let spools = [
        cells.points.secure()?,
        cells.sites.secure()?,
        list(&place, &of("cells"), &cells.cells)?,
        fits.points.secure()?,
        fits.aspects.secure()?,
        fits.crossing.secure()?,
        list(&place, &of("patches"), &fits.patches)?,
        list(&place, &of("first_patches"), &fits.first_patches)?,
    ];
    let mut state = facts.to_json();
    state["cells"] = json!({ "done": done, "scale": cells.scale, "has_normals": cells.has_normals });
    let phase = match done {
        0 => CELLS,
        _ if done < cells.cells.len() => FITTING,
        _ => FITTED,
    };
    work.finish(phase, spools, state)
}

/// Keeps how far a division has come. Names have numbers that grow from each time to the next: what the journal names stays
/// as it is until the next journal is there.
pub(super) fn save_division(work: &Work, facts: &Facts, division: &Division) -> io::Result<()> {
    let place = Place::Work(work);
    let of = |what: &str| format!("{what}{}-{}", division.sets, division.done);
    let Chunks { kept, colors, sizes, .. } = &division.chunks;
    let extents: Vec<_> = division.pending.iter().map(|(_, b)| [b.min.to_array(), b.max.to_array()]).collect();
    let shape: Vec<u8> = division.shape.iter().map(|is_chunk| u8::from(*is_chunk)).collect();
    let mut spools = vec![
        kept.secure()?,
        colors.secure()?,
        list(&place, &of("sizes"), sizes)?,
        list(&place, &of("shape"), &shape)?,
        list(&place, &of("roots"), &division.roots)?,
        list(&place, &of("extents"), &extents)?,
    ];
    let pending = division.pending.iter().map(|(leaves, _)| leaves.secure()).collect::<io::Result<Vec<_>>>()?;
    let mut state = facts.to_json();
    state["progress"] = json!([division.sets, division.done]);
    state["pending"] = pending.iter().map(|(name, _)| name.as_str()).collect();
    spools.extend(pending);
    work.finish(DIVIDING, spools, state)
}

/// The stage that an earlier process has come to, and its name.
pub(super) fn load(work: Option<&Work>) -> io::Result<(Stage, Option<String>)> {
    let Some((work, journal)) = work.and_then(|work| Some((work, work.found()?))) else {
        return Ok((Stage::Start, None));
    };
    let odd = || io::Error::new(io::ErrorKind::InvalidData, "the journal says what no builder writes");
    let facts = || Facts::of_json(&journal.state).ok_or_else(odd);
    let stage = match journal.phase.as_str() {
        "read" => Stage::Read(Mesh {
            paint: match &journal.state {
                Value::Null => None,
                state => Some(Paint {
                    looks: of_json(state, "looks").ok_or_else(odd)?,
                    pictures: of_json(state, "pictures").ok_or_else(odd)?,
                    texels: Spool::reopen(work, "texels")?,
                    tex_coords: Spool::reopen(work, "tex_coords")?,
                    corners: Spool::reopen(work, "tex_corners")?,
                    materials: Spool::reopen(work, "materials")?,
                }),
            },
            ..Mesh::reopen(work)?
        }),
        CELLS | FITTING | FITTED => {
            let state = &journal.state["cells"];
            let done: usize = of_json(state, "done").ok_or_else(odd)?;
            let of = |what: &str| format!("{what}{done}");
            let cells = Cells {
                points: Spool::reopen(work, "points")?,
                sites: Spool::reopen(work, "sites")?,
                cells: unlist(work, &of("cells"))?,
                scale: of_json(state, "scale").ok_or_else(odd)?,
                has_normals: of_json(state, "has_normals").ok_or_else(odd)?,
            };
            let fits = Fits {
                points: Spool::reopen(work, "fitted")?,
                aspects: Spool::reopen(work, "aspects")?,
                crossing: Spool::reopen(work, "crossing")?,
                patches: unlist(work, &of("patches"))?,
                first_patches: unlist(work, &of("first_patches"))?,
            };
            Stage::Cells(facts()?, cells, fits)
        }
        "leaves" => Stage::Leaves(facts()?, Spool::reopen(work, "leaves")?),
        DIVIDING => {
            let numbers: [u64; 2] = of_json(&journal.state, "progress").ok_or_else(odd)?;
            let names: Vec<String> = of_json(&journal.state, "pending").ok_or_else(odd)?;
            let of = |what: &str| format!("{what}{}-{}", numbers[0], numbers[1]);
            let extents: Vec<[[f32; 3]; 2]> = unlist(work, &of("extents"))?;
            let pending = std::iter::zip(names, extents).map(|(name, [min, max])| {
                let extent = Extent { min: Vec3A::from_array(min), max: Vec3A::from_array(max) };
                Ok((Spool::reopen(work, &name)?, extent))
            });
            let division = Division {
                chunks: Chunks {
                    kept: Spool::reopen(work, "kept")?,
                    colors: Spool::reopen(work, "kept_colors")?,
                    sizes: unlist(work, &of("sizes"))?,
                    top: KeptTree::default(),
                    mean_radius: 0.0,
                },
                shape: unlist::<u8>(work, &of("shape"))?.iter().map(|is_chunk| *is_chunk != 0).collect(),
                roots: unlist::<Head>(work, &of("roots"))?,
                pending: pending.collect::<io::Result<_>>()?,
                sets: numbers[0],
                done: numbers[1],
            };
            Stage::Dividing(facts()?, division)
        }
        "tree" => {
            let chunks = Chunks {
                kept: Spool::reopen(work, "kept")?,
                colors: Spool::reopen(work, "kept_colors")?,
                sizes: unlist(work, "chunk_sizes")?,
                top: KeptTree {
                    nodes: unlist(work, "top")?,
                    colors: unlist(work, "top_colors")?,
                    unit_nodes: unlist(work, "chunk_roots")?,
                },
                mean_radius: of_json(&journal.state, "mean_radius").ok_or_else(odd)?,
            };
            Stage::Tree(facts()?, chunks)
        }
        _ => return Err(odd()),
    };
    Ok((stage, Some(journal.phase.clone())))
}

impl Facts {
    fn to_json(self) -> Value {
        json!({
            "counts": self.counts,
            "origin": self.origin.to_array(),
            "min": self.bounds.min.to_array(),
            "max": self.bounds.max.to_array(),
            "closed": self.closed,
            "has_colors": self.has_colors,
            "dicing": self.dicing,
        })
    }

    fn of_json(state: &Value) -> Option<Self> {
        let vector = |key: &str| Some(DVec3::from_array(of_json(state, key)?));
        Some(Self {
            counts: of_json(state, "counts")?,
            origin: vector("origin")?,
            bounds: Aabb { min: vector("min")?, max: vector("max")? },
            closed: state["closed"].as_bool()?,
            has_colors: state["has_colors"].as_bool()?,
            dicing: of_json(state, "dicing")?,
        })
    }
}

fn of_json<T: DeserializeOwned>(state: &Value, key: &str) -> Option<T> {
    serde_json::from_value(state[key].clone()).ok()
}

fn list<T: Pod>(place: &Place<'_>, name: &str, all: &[T]) -> io::Result<(String, crate::journal::Extent)> {
    let mut spool = Spool::named(place, name)?;
    spool.push(all)?;
    spool.secure()
}

fn unlist<T: Pod>(work: &Work, name: &str) -> io::Result<Vec<T>> {
    let spool = Spool::reopen(work, name)?;
    let mut all = Vec::new();
    spool.read_vec(0, spool.len() as usize, &mut all)?;
    Ok(all)
}
