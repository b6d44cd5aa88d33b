//! Splats: the bounding-sphere hierarchy of the splats paper, section 2.2, from a triangle mesh or a point cloud.
//!
//! The way of the data, a file for each step:
//!
//! ```text
//! mesh ──▶ leaves ──▶ divide ──▶ chunk: tree, contract, kept ──▶ quantise: lower ──▶ layout ──▶ pages
//! stream   gather,    chunks of  binary,  2–4       measured     codes, top-down;    order of   coded
//!          join       65,536     midpoint children               by size            the file
//! ```
//!
//! A model without triangles is a point cloud: its leaves come from `points/`. Large triangles are cut into cells, each a leaf
//! (`dice/`), and so are those whose colours are not their vertices' (`paint/`).
//!
//! What grows with the model lies in spools, in memory or on disk as `plan.rs` decides; the rest is the size of a chunk. On
//! disk, `checkpoint.rs` makes of the end of each step a place to continue from.
//!
//! What always holds: each decoded sphere encloses all true leaves below its node; each node's cone holds the normals of all
//! triangles at the vertices below it. The bytes of the file depend on the sets of vertices and triangles and on nothing else: not
//! on their order in the input, not on memory, not on threads.

mod below;
mod checkpoint;
mod chunk;
mod contract;
pub(crate) mod dice;
mod divide;
mod facets;
mod family;
pub(crate) mod gather;
pub(crate) mod join;
mod kept;
mod layout;
mod leaves;
mod lone;
mod lower;
mod measure;
pub(crate) mod mesh;
mod orientation;
mod pages;
pub(crate) mod paint;
pub(crate) mod plan;
mod points;
mod quantise;
mod reorder;
mod tree;

use crate::output::folder_of;
use crate::progress::{Phases, Progress, Report};
use crate::site::{GENERATOR, Site};
use crate::{BuildError, Options};
use checkpoint::{Facts, Stage};
use divide::Division;
use gigalod_format::splats::{Root, Skeleton};
use gigalod_format::{Bounds, InputCounts, Kind, Metadata};
use gigalod_import::ModelStream;
use plan::MemoryPlan;
use std::path::Path;

/// Builds `out` from a mesh, or, where there are no triangles, from a point cloud.
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
    let own = options.spacing.map(|spacing| ("spacing".to_string(), spacing.to_string()));
    let in_memory = plan::fits_into_memory(options, &*input);
    let kind = (Kind::Splats, own.into_iter().collect());
    let site = Site::open(&*input, options, kind, (plan::threads(options), in_memory), progress, out)?;
    let plan = MemoryPlan::new(options, site.place(), folder_of(&site.out));
    let (workers, up, work) = (&site.workers, site.up, &site.work);

    let mut input = Some(input);
    let (mut stage, resumed_after) = checkpoint::load(work.as_ref()).map_err(BuildError::Scratch)?;
    let (facts, chunks) = loop {
        stage = match stage {
            Stage::Start => {
                let mut input = input.take().expect("a build starts once");
                Stage::Read(mesh::read(&mut *input, &plan, &phases)?)
            }
            Stage::Read(cloud) if cloud.triangles.len() == 0 => {
                let (facts, cells) = workers.install(|| points::divide(cloud, &plan, &phases))?;
                Stage::Cells(facts, cells, points::Fits::new(&plan).map_err(BuildError::Scratch)?)
            }
            Stage::Cells(facts, cells, fits) => {
                let save = |fits: &points::Fits| match work {
                    Some(work) => checkpoint::save_fits(work, &facts, &cells, fits),
                    None => Ok(()),
                };
                let fits = workers.install(|| points::fit(&cells, fits, up, &plan, &phases, save));
                let fits = fits.map_err(BuildError::Scratch)?;
                let leaves = workers.install(|| points::from_fits(&facts, cells, fits, up, &plan, &phases));
                Stage::Leaves(facts, leaves.map_err(BuildError::Scratch)?)
            }
            Stage::Read(mesh) => {
                let counts = InputCounts { triangles: mesh.triangles.len(), vertices: mesh.positions.len(), points: 0 };
                let leaves = workers.install(|| leaves::from_mesh(mesh, options.spacing, &plan, &phases))?;
                let leaves::Leaves { leaves, origin, bounds, closed, has_colors, dicing } = leaves;
                Stage::Leaves(Facts { counts, origin, bounds, closed, has_colors, dicing }, leaves)
            }
            Stage::Leaves(facts, leaves) => {
                Stage::Dividing(facts, Division::new(leaves, &plan).map_err(BuildError::Scratch)?)
            }
            Stage::Dividing(facts, division) => {
                let save = |division: &Division| match work {
                    Some(work) => checkpoint::save_division(work, &facts, division),
                    None => Ok(()),
                };
                let chunks = workers.install(|| divide::divide(division, facts.has_colors, &plan, &phases, save))?;
                Stage::Tree(facts, chunks)
            }
            Stage::Tree(facts, chunks) => break (facts, chunks),
        };
        if let Some(work) = work {
            checkpoint::save(work, &stage).map_err(BuildError::Scratch)?;
        }
    };
    drop(input);
    let Facts { counts, origin, bounds, closed, has_colors, dicing } = facts;
    let quantised = workers.install(|| quantise::top_down(chunks, &plan, &phases)).map_err(BuildError::Scratch)?;
    let pages::Written { writer, pages, model, nodes, levels, raw_bytes } =
        workers.install(|| pages::write(&quantised, site.output.file(), &phases)).map_err(BuildError::Output)?;
    let root = Root {
        origin,
        sphere: quantised.root,
        overhang: quantised.overhang,
        bounds,
        nodes,
        leaves: quantised.leaves,
        levels: levels.len() as u32,
        has_colors,
        closed,
        up,
    };
    let mut attributes = vec!["normals".to_string()];
    if has_colors {
        attributes.push("colors".into());
    }
    let mut influential = site.influential.clone();
    if let Some(dicing) = dicing {
        influential.insert("spacing".into(), dicing.spacing.to_string());
    }
    let skeleton = Skeleton::encode(&root, &pages, model.as_ref());
    let metadata = Metadata {
        generator: GENERATOR.into(),
        input: counts,
        options: influential,
        nodes: root.nodes,
        levels: root.levels,
        leaves: root.leaves,
        repeated: quantised.copies,
        raw_bytes: raw_bytes + skeleton.len() as u64,
        closed,
        bounds: Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() },
        reference_system: site.reference_system.clone(),
        attributes,
        dicing,
        per_level: levels,
    };
    let (buffer, output_bytes) = writer.finish(&skeleton, &metadata).map_err(BuildError::Output)?;
    drop((buffer, quantised));
    site.finish()?;
    Ok(Report { metadata, output_bytes, phases: phases.times(), resumed_after })
}
