//! Places to continue from: what each step leaves for the next one, kept in a work folder.
//!
//! In: a [`Stage`]. Out: the same stage, in another process. What grows with the model is in spools, which are named for it;
//! of the rest, lists become spools too, and single facts stand in the journal.

use super::contract::Plan;
use super::divide::{Chunks, Division};
use super::leaves::Leaf;
use super::mesh::Mesh;
use super::quantise::Quantised;
use super::tree::{Binary, Extent};
use crate::spool::{Place, Spool};
use crate::work::Work;
use bytemuck::{Pod, Zeroable};
use gigalod_format::InputCounts;
use gigalod_format::splats::Node;
use gigalod_geom::{Aabb, Sphere};
use glam::{DVec3, Vec3};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::io;

/// Within the longest step.
const DIVIDING: &str = "part of tree";

/// What there is after each step.
pub(super) enum Stage {
    Start,
    Read(Mesh),
    Leaves(Facts, Spool<Leaf>),
    Dividing(Facts, Division),
    Tree(Facts, Chunks),
    Quantised(Facts, Quantised, Spool<u16>),
}

/// What is known of the model as a whole.
#[derive(Clone, Copy)]
pub(super) struct Facts {
    pub(super) counts: InputCounts,
    pub(super) origin: DVec3,
    pub(super) bounds: Aabb,
    pub(super) closed: bool,
    pub(super) has_colors: bool,
}

/// A node of the tree on top, as a record.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TopNode {
    center: [f32; 3],
    radius: f32,
    mean_normal: [f32; 3],
    mean_color: [f32; 3],
    units: u32,
    weight: u32,
    normal: u16,
    code: u16,
    cone: u8,
    plan: [u8; 3],
}

/// Keeps what `stage` has, instead of all that the one before it had.
pub(super) fn save(work: &Work, stage: &Stage) -> io::Result<()> {
    let place = Place::Work(work);
    match stage {
        Stage::Start => Ok(()),
        Stage::Read(Mesh { positions, normals, colors, triangles }) => {
            let spools = [positions.secure()?, normals.secure()?, colors.secure()?, triangles.secure()?];
            work.finish("read", spools, Value::Null)
        }
        Stage::Leaves(facts, leaves) => work.finish("leaves", [leaves.secure()?], facts.to_json()),
        // Was saved when it was made.
        Stage::Dividing(..) => Ok(()),
        Stage::Tree(facts, Chunks { kept, colors, sizes, top }) => {
            let lists = [list(&place, "chunk_sizes", sizes)?, list(&place, "top", &records(top))?];
            work.finish("tree", [kept.secure()?, colors.secure()?].into_iter().chain(lists), facts.to_json())
        }
        Stage::Quantised(facts, Quantised { top, top_nodes, nodes, levels, overhang }, colors) => {
            let counts: Vec<u32> = levels.iter().map(|levels| levels.len() as u32).collect();
            let levels: Vec<[u32; 2]> = levels.iter().flatten().map(|(count, r)| [*count, r.to_bits()]).collect();
            let lists = [
                list(&place, "top_quantised", &records(top))?,
                list(&place, "top_nodes", &top_nodes.iter().map(|node| node.0).collect::<Vec<u32>>())?,
                list(&place, "level_counts", &counts)?,
                list(&place, "levels", &levels)?,
            ];
            let mut state = facts.to_json();
            state["overhang"] = overhang.to_bits().into();
            work.finish("quantise", [nodes.secure()?, colors.secure()?].into_iter().chain(lists), state)
        }
    }
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
        list(&place, &of("roots"), &records(&division.roots))?,
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
            positions: Spool::reopen(work, "positions")?,
            normals: Spool::reopen(work, "normals")?,
            colors: Spool::reopen(work, "colors")?,
            triangles: Spool::reopen(work, "triangles")?,
        }),
        "leaves" => Stage::Leaves(facts()?, Spool::reopen(work, "leaves")?),
        DIVIDING => {
            let numbers: [u64; 2] = of_json(&journal.state, "progress").ok_or_else(odd)?;
            let names: Vec<String> = of_json(&journal.state, "pending").ok_or_else(odd)?;
            let of = |what: &str| format!("{what}{}-{}", numbers[0], numbers[1]);
            let extents: Vec<[[f32; 3]; 2]> = unlist(work, &of("extents"))?;
            let pending = std::iter::zip(names, extents).map(|(name, [min, max])| {
                let extent = Extent { min: Vec3::from_array(min), max: Vec3::from_array(max) };
                Ok((Spool::reopen(work, &name)?, extent))
            });
            let division = Division {
                chunks: Chunks {
                    kept: Spool::reopen(work, "kept")?,
                    colors: Spool::reopen(work, "kept_colors")?,
                    sizes: unlist(work, &of("sizes"))?,
                    top: vec![],
                },
                shape: unlist::<u8>(work, &of("shape"))?.iter().map(|is_chunk| *is_chunk != 0).collect(),
                roots: nodes_of(unlist(work, &of("roots"))?),
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
                top: nodes_of(unlist(work, "top")?),
            };
            Stage::Tree(facts()?, chunks)
        }
        "quantise" => {
            let counts: Vec<u32> = unlist(work, "level_counts")?;
            let mut levels = unlist::<[u32; 2]>(work, "levels")?.into_iter().map(|[n, r]| (n, f32::from_bits(r)));
            let overhang = journal.state["overhang"].as_u64().ok_or_else(odd)?;
            let quantised = Quantised {
                top: nodes_of(unlist(work, "top_quantised")?),
                top_nodes: unlist(work, "top_nodes")?.into_iter().map(Node).collect(),
                nodes: Spool::reopen(work, "nodes")?,
                levels: counts.iter().map(|count| levels.by_ref().take(*count as usize).collect()).collect(),
                overhang: f32::from_bits(overhang as u32),
            };
            Stage::Quantised(facts()?, quantised, Spool::reopen(work, "kept_colors")?)
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

fn records(top: &[Binary]) -> Vec<TopNode> {
    let record = |node: &Binary| TopNode {
        center: node.sphere.center.to_array(),
        radius: node.sphere.radius,
        mean_normal: node.mean_normal.to_array(),
        mean_color: node.mean_color.to_array(),
        units: node.units,
        weight: node.weight,
        normal: node.normal,
        code: node.code,
        cone: node.cone,
        plan: node.plan.to_bytes(),
    };
    top.iter().map(record).collect()
}

fn nodes_of(records: Vec<TopNode>) -> Vec<Binary> {
    let node = |record: TopNode| Binary {
        sphere: Sphere { center: Vec3::from_array(record.center), radius: record.radius },
        mean_normal: Vec3::from_array(record.mean_normal),
        mean_color: Vec3::from_array(record.mean_color),
        units: record.units,
        weight: record.weight,
        normal: record.normal,
        code: record.code,
        cone: record.cone,
        plan: Plan::of_bytes(record.plan),
    };
    records.into_iter().map(node).collect()
}
