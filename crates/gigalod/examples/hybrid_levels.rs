//! How far the levels of a hybrid file are from the original, at how many triangles.
//!
//! `cargo run --release --example hybrid_levels -- FILE.glod MODEL.ply`
//!
//! A line of JSON for each level, of the cut that holds its nodes and the leaves above: triangles, points, and both ways' distances as
//! shares of the model's diagonal, measured by the judge; then a line with the mean (root of mean squares) at exactly 1/8 and 1/64 of the
//! original's triangles, log-log between levels.

use anyhow::{Context, Result, bail};
use gigalod::format::hybrid::{HybridFile, NodeId};
use gigalod::format::{Container, FileStore};
use gigalod::import::read_all;
use gigalod::verify;
use gigalod_reference::distance::{Sampling, two_sided};
use gigalod_reference::{Bvh, Mesh};
use glam::DVec3;
use serde_json::json;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, model] = &arguments[..] else { bail!("usage: hybrid_levels FILE.glod MODEL.ply") };
    let file = HybridFile::open(Container::open(Arc::new(FileStore::open(Path::new(file))?))?)?;
    let mut stream = gigalod::import::open(Box::new(File::open(model)?))?;
    let original = verify::mesh_of(read_all(&mut *stream, &mut |_, _| {})?)?;
    let diagonal = original.bounds().extent().length();
    let bvh = Bvh::build(&original);
    let count = original.triangles().len() as f64;

    let mut measured: Vec<(f64, f64)> = Vec::new();
    for level in 0..file.skeleton().root().levels {
        let (cut, points) = cut(&file, level)?;
        let triangles = cut.triangles().len();
        let both = two_sided(&bvh, &Bvh::build(&cut), Sampling::default()).context("a level without triangles")?;
        measured.push((triangles as f64 / count, both.rms() / diagonal));
        let (rms, max) = (both.rms() / diagonal, both.hausdorff() / diagonal);
        println!("{}", json!({ "level": level, "triangles": triangles, "points": points, "rms": rms, "max": max }));
    }
    let [eighth, sixty_fourth] = [8.0, 64.0].map(|part| at_share(&measured, 1.0 / part));
    println!("{}", json!({ "rms_at_1_8": eighth, "rms_at_1_64": sixty_fourth }));
    Ok(())
}

/// Between two levels, log-log; null where no level is coarser or none finer.
fn at_share(measured: &[(f64, f64)], share: f64) -> Option<f64> {
    let pair = measured.windows(2).find(|pair| pair[0].0 <= share && share <= pair[1].0)?;
    let [(coarse, high), (fine, low)] = [pair[0], pair[1]];
    let t = (share / coarse).ln() / (fine / coarse).ln();
    Some((high.ln() + t * (low / high).ln()).exp())
}

/// Triangles of all nodes of a level, and of leaves above it; and how many points there are.
fn cut(file: &HybridFile, level: u32) -> Result<(Mesh, usize)> {
    let skeleton = file.skeleton();
    let (mut positions, mut triangles, mut points) = (Vec::new(), Vec::new(), 0);
    for (number, record) in skeleton.nodes().iter().enumerate() {
        let is_in = record.level == level || (record.level < level && record.children == 0);
        if !is_in {
            continue;
        }
        let page = file.read_page(NodeId(number as u32))?;
        let (first, step) = (positions.len() as u32, skeleton.step(record.level));
        positions.extend(page.positions.iter().map(|at| {
            let steps = [0, 1, 2].map(|axis| f64::from(record.min_steps[axis]) + f64::from(at[axis]));
            skeleton.root().origin + DVec3::from_array(steps) * step
        }));
        triangles.extend(page.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
        points += record.points as usize;
    }
    Ok((Mesh::new(positions, None, None, triangles)?, points))
}
