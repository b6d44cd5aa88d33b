//! Hybrid: an out-of-core octree of simplified triangles and points with proven errors, from any mesh; the hybrid paper, section 3.
//!
//! The way of the data, a file for each step:
//!
//! ```text
//! mesh ──▶ pieces ──▶ growth: sets on disk ──▶ octree: leaves, then upwards ──▶ round ──▶ nodes ──▶ write
//! stream   triangles  that fit into memory     weld, zip, simplify             grid     spool     coded
//! ```
//!
//! `simplify` takes an operation only if `overlay` or `cover` proves its error; `looks` adds that of appearance.
//!
//! What always holds: each node's error bounds the two-sided distance between its triangles and points and the part of the original that
//! they stand for; it is at most the edge of the node's cell divided by the resolution. The bytes depend on the input and the options alone.
//!
//! Differs from the paper: triangles belong to the cell that their middle lies in, so that there are no slivers and leaves meet exactly;
//! only those much larger than a cell are cut at its faces; a node gathers its children's geometry, not its grandchildren's, with errors that faces carry.

mod cell;
mod cover;
mod cut;
mod edges;
mod growth;
mod looks;
mod nodes;
mod octree;
mod overlay;
mod patch;
mod pieces;
mod points;
#[cfg(test)]
mod proof_tests;
mod quadric;
mod round;
mod simplify;
mod surface;
mod weld;
mod write;
mod zip;

use crate::output::folder_of;
use crate::progress::{Phases, Progress, Report};
use crate::site::{GENERATOR, Site};
use crate::splats::mesh::{self, Mesh};
use crate::splats::plan::{self, MemoryPlan};
use crate::spool::Spool;
use crate::work::Work;
use crate::{BuildError, Options};
use gigalod_format::hybrid::{Root, Skeleton};
use gigalod_format::{Bounds, Kind, Metadata};
use gigalod_geom::Aabb;
use gigalod_import::ModelStream;
use glam::DVec3;
use growth::{GROWING, Growth};
use nodes::Nodes;
use octree::Piece;
use pieces::{Facts, PIECES};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// `--res` where nobody says otherwise.
pub const RESOLUTION: u32 = 64;
/// `--tmax` where nobody says otherwise.
pub const MOST_TRIANGLES: u32 = 4096;
/// Of the two coordinates of a normal.
const NORMAL_BITS: u32 = 9;
/// A step of the grid is at most the largest error divided by 2 to this.
const GRID_BITS: u32 = 4;

/// What all nodes have in common.
#[derive(Clone, Debug)]
struct Shape {
    /// Of the root's cell; model units.
    edge: f64,
    /// A node's error is at most the edge of its cell divided by this.
    resolution: u32,
    /// Most triangles of a leaf.
    most_triangles: usize,
    cell_bits: u32,
    normal_bits: u32,
    keeps_looks: bool,
    has_colors: bool,
}

impl Shape {
    /// Of the grid of a level; model units.
    fn step(&self, level: u32) -> f64 {
        self.edge / (1u64 << (level + self.cell_bits)) as f64
    }

    /// No position that was read is farther from what it became in local space, as `f32`.
    fn rounding(&self) -> f32 {
        simplify::up(3f64.sqrt() * self.edge / f64::from(1 << 24))
    }

    /// Deepest level: there a node's error is still four times what `f32` positions are off.
    fn deepest(&self) -> u32 {
        21u32.saturating_sub(self.resolution.next_power_of_two().ilog2()).min(cell::MOST_LEVEL)
    }

    /// Largest error of a patch before it is rounded to the grid.
    fn limit(&self, level: u32) -> f64 {
        // With what moves aside where rounding has flattened a face: a step along one axis.
        let most_moved = (1.5f64 * 1.5 + 0.5).sqrt() * 1.000_001 * self.step(level);
        self.edge / (1u64 << level) as f64 / f64::from(self.resolution) - most_moved
    }
}

/// What there is after each step.
enum Stage {
    Start,
    Read(Mesh),
    Pieces(Facts, Spool<Piece>),
    Growing(Facts, Growth),
}

/// Builds `out` from a mesh.
///
/// # Errors
/// Whatever is wrong with the input, the budget or the output; `out` is then as it was before.
pub fn build(
    input: Box<dyn ModelStream>,
    options: &Options,
    progress: &dyn Progress,
    out: &Path,
) -> Result<Report, BuildError> {
    let phases = Phases::new(progress);
    let resolution = options.resolution.unwrap_or(RESOLUTION);
    let most_triangles = options.most_triangles.unwrap_or(MOST_TRIANGLES);
    let own = BTreeMap::from([
        ("res".to_string(), resolution.to_string()),
        ("tmax".to_string(), most_triangles.to_string()),
        ("appearance".to_string(), if options.keeps_looks { "on" } else { "off" }.to_string()),
    ]);
    let in_memory = growth::fits_into_memory(options, &*input);
    let site = Site::open(&*input, options, (Kind::Hybrid, own), (plan::threads(options), in_memory), progress, out)?;
    let plan = MemoryPlan::new(options, site.place(), folder_of(&site.out));

    let mut input = Some(input);
    let (mut stage, resumed_after) = load(site.work.as_ref()).map_err(BuildError::Scratch)?;
    let (facts, shape, mut nodes) = loop {
        stage = match stage {
            Stage::Start => {
                let mut input = input.take().expect("a build starts once");
                let mesh = mesh::read(&mut *input, &plan, &phases)?;
                if mesh.triangles.len() == 0 {
                    return Err(BuildError::NoTriangles);
                }
                if options.only_suited && mesh.paint.is_some() {
                    return Err(BuildError::Painted);
                }
                Stage::Read(mesh)
            }
            Stage::Read(mesh) => {
                if mesh.paint.is_some() {
                    progress.note("textures are left out; --as splats keeps them");
                }
                let (facts, pieces) = site.workers.install(|| pieces::of_mesh(mesh, &plan, &phases))?;
                Stage::Pieces(facts, pieces)
            }
            Stage::Pieces(facts, pieces) => {
                Stage::Growing(facts, Growth::new(pieces, &plan).map_err(BuildError::Scratch)?)
            }
            Stage::Growing(facts, growth) => {
                let shape = Shape::of(&facts, resolution, most_triangles, options.keeps_looks);
                let save = |growth: &Growth| match &site.work {
                    Some(work) => growth.save(work, &facts),
                    None => Ok(()),
                };
                let nodes = site.workers.install(|| growth.grow(&shape, &plan, &phases, save))?;
                break (facts, shape, nodes);
            }
        };
        if let Some(work) = &site.work {
            save(work, &stage).map_err(BuildError::Scratch)?;
        }
    };
    drop(input);
    finish(site, &facts, &shape, &mut nodes, &phases).map(|(metadata, output_bytes)| Report {
        metadata,
        output_bytes,
        phases: phases.times(),
        resumed_after,
    })
}

impl Shape {
    fn of(facts: &Facts, resolution: u32, most_triangles: u32, keeps_looks: bool) -> Self {
        Self {
            edge: facts.edge,
            resolution,
            most_triangles: most_triangles as usize,
            cell_bits: (resolution.next_power_of_two().ilog2() + GRID_BITS).min(14),
            normal_bits: NORMAL_BITS,
            keeps_looks,
            has_colors: facts.has_colors,
        }
    }
}

/// Writes the file and gives it its name; returns what it says of itself, and its length.
fn finish(
    site: Site,
    facts: &Facts,
    shape: &Shape,
    nodes: &mut Nodes,
    phases: &Phases<'_>,
) -> Result<(Metadata, u64), BuildError> {
    let written = site.workers.install(|| write::write(nodes, shape, site.output.file(), phases));
    let write::Written { writer, records, model, levels, leaves, raw_bytes } = written.map_err(BuildError::Output)?;
    let [min, max] = [facts.min, facts.max].map(DVec3::from_array);
    let root = Root {
        origin: DVec3::from_array(facts.origin),
        edge: shape.edge,
        bounds: Aabb { min, max },
        cell_bits: shape.cell_bits,
        normal_bits: shape.normal_bits,
        resolution: shape.resolution,
        nodes: records.len() as u64,
        leaves,
        levels: levels.len() as u32,
        preserves_appearance: shape.keeps_looks,
        has_colors: shape.has_colors,
        closed: facts.closed,
        up: site.up,
    };
    let mut attributes = vec!["normals".to_string()];
    if shape.has_colors {
        attributes.push("colors".into());
    }
    let metadata = Metadata {
        generator: GENERATOR.into(),
        input: facts.counts,
        options: site.influential.clone(),
        nodes: root.nodes,
        levels: root.levels,
        leaves,
        repeated: 0,
        raw_bytes,
        closed: facts.closed,
        bounds: Bounds { min: facts.min, max: facts.max },
        reference_system: site.reference_system.clone(),
        attributes,
        dicing: None,
        per_level: levels,
    };
    let skeleton = Skeleton::encode(&root, &records, &model);
    let (buffer, output_bytes) = writer.finish(&skeleton, &metadata).map_err(BuildError::Output)?;
    drop(buffer);
    site.finish()?;
    Ok((metadata, output_bytes))
}

/// Keeps what `stage` has, instead of all that the one before it had.
fn save(work: &Work, stage: &Stage) -> io::Result<()> {
    match stage {
        Stage::Start => Ok(()),
        Stage::Read(Mesh { positions, normals, colors, triangles, .. }) => {
            let spools = [positions.secure()?, normals.secure()?, colors.secure()?, triangles.secure()?];
            work.finish("read", spools, serde_json::Value::Null)
        }
        Stage::Pieces(facts, pieces) => work.finish(PIECES, [pieces.secure()?], serde_json::json!({ "facts": facts })),
        // Nothing was raised yet.
        Stage::Growing(..) => Ok(()),
    }
}

/// The stage that an earlier process has come to, and its name.
fn load(work: Option<&Work>) -> io::Result<(Stage, Option<String>)> {
    let Some((work, journal)) = work.and_then(|work| Some((work, work.found()?))) else {
        return Ok((Stage::Start, None));
    };
    let odd = || io::Error::new(io::ErrorKind::InvalidData, "the journal says what no builder writes");
    let facts = || serde_json::from_value(journal.state["facts"].clone()).map_err(|_| odd());
    let stage = match journal.phase.as_str() {
        "read" => Stage::Read(Mesh::reopen(work)?),
        PIECES => Stage::Pieces(facts()?, Spool::reopen(work, PIECES)?),
        GROWING => Stage::Growing(facts()?, Growth::load(work, &journal.state)?),
        _ => return Err(odd()),
    };
    Ok((stage, Some(journal.phase.clone())))
}
