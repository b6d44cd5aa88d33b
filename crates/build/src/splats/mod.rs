//! Splats: the bounding-sphere hierarchy of the splats paper, section 2.2, from a triangle mesh.
//!
//! The way of the data, a file for each step:
//!
//! ```text
//! mesh ──▶ leaves ──▶ divide ──▶ chunk: tree, contract ──▶ quantise ──▶ layout, pager ──▶ pages
//! stream   a sphere   chunks of  binary,   2–4 children    codes,       breadth-first
//!          a vertex   65,536     midpoint  a node          top-down     families
//! ```
//!
//! What grows with the model lies in spools, in memory or on disk as `plan.rs` decides; the rest is the size of a chunk.
//!
//! What always holds: each decoded sphere encloses the true sphere of its node, and with it all true leaves below; each
//! node's cone holds the cones of its children as decoded, and a leaf's cone the normals of all triangles at its vertex.
//! The tree depends on the set of vertices alone, not on their order, and
//! the bytes of the file on nothing else but the sums of normals, which are taken in the order of the triangles.

mod chunk;
mod contract;
mod divide;
mod join;
mod layout;
mod leaves;
mod mesh;
mod orientation;
mod pager;
mod plan;
mod quantise;
mod tree;

use crate::output::Output;
use crate::progress::{Phases, Progress, Report};
use crate::{BuildError, Options};
use gigalod_format::splats::{Root, Skeleton};
use gigalod_format::{Bounds, InputCounts, Kind, Metadata};
use gigalod_import::ModelStream;
use std::collections::BTreeMap;
use std::path::Path;

/// Builds `out` from a mesh.
///
/// # Errors
/// Whatever is wrong with the input, the budget or the output; `out` is then as it was before.
pub fn build(
    mut input: Box<dyn ModelStream>,
    options: &Options,
    progress: &dyn Progress,
    out: &Path,
) -> Result<Report, BuildError> {
    let output = Output::create(out).map_err(BuildError::Output)?;
    let phases = Phases::new(progress);
    let workers = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|error| BuildError::Threads(error.to_string()))?;

    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let plan = plan::MemoryPlan::new(options, &*input, folder);

    let mesh = mesh::read(&mut *input, &plan, &phases)?;
    let up = options.up.unwrap_or(input.up_axis());
    let counts = InputCounts { triangles: mesh.triangles.len(), vertices: mesh.positions.len(), points: 0 };
    drop(input);

    let leaves = workers.install(|| leaves::from_mesh(mesh, &plan, &phases))?;
    let leaves::Leaves { leaves, origin, bounds, closed, has_colors } = leaves;
    let (quantised, colors) = workers.install(|| {
        let mut chunks = divide::divide(leaves, has_colors, &plan, &phases)?;
        let top = std::mem::take(&mut chunks.top);
        let quantised = quantise::top_down(&chunks, top, &plan, &phases).map_err(BuildError::Scratch)?;
        Ok::<_, BuildError>((quantised, chunks.colors))
    })?;
    let layout::Written { writer, pages, model, nodes, leaves, levels, raw_bytes } =
        workers.install(|| layout::write(&quantised, &colors, output.file(), &phases)).map_err(BuildError::Output)?;
    let root = Root {
        origin,
        sphere: quantised.top[0].sphere,
        overhang: quantised.overhang,
        bounds,
        nodes,
        leaves,
        levels: levels.len() as u32,
        has_colors,
        closed,
        up,
    };
    let mut attributes = vec!["normals".to_string()];
    if has_colors {
        attributes.push("colors".into());
    }
    let skeleton = Skeleton::encode(&root, &pages, model.as_ref());
    let metadata = Metadata {
        generator: concat!("gigalod ", env!("CARGO_PKG_VERSION")).into(),
        input: counts,
        options: BTreeMap::from([
            ("as".into(), Kind::Splats.name().into()),
            ("up".into(), format!("{up:?}").to_lowercase()),
        ]),
        nodes: root.nodes,
        levels: root.levels,
        leaves: root.leaves,
        raw_bytes: raw_bytes + skeleton.len() as u64,
        closed,
        bounds: Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() },
        attributes,
        per_level: levels,
    };
    let (buffer, output_bytes) = writer.finish(&skeleton, &metadata).map_err(BuildError::Output)?;
    drop(buffer);
    output.publish().map_err(BuildError::Output)?;
    Ok(Report { metadata, output_bytes, phases: phases.times() })
}
