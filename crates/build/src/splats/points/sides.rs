//! On which side each patch of normals belongs.
//!
//! Patches of all cells go in, with the neighbours that lie in two cells; for each patch comes out whether to turn it. Neighbours
//! vote whether their patches are on the same side, and patches are joined in the order of how clear the votes are. What is
//! joined is turned outwards as a whole: its normals point away from its middle, as the flux through it says; for a closed
//! surface that is the sign of its volume, exactly.
//!
//! A cloud that is much wider than high, and whose surface mostly faces up or down, was seen from above: there every point
//! has the sky for a neighbour, and what that says is taken.

use super::super::checkpoint::Facts;
use super::super::join::Corners;
use super::super::plan::MemoryPlan;
use super::cells::Cell;
use super::fit::{Aspect, Fits, PatchSums, axis};
use super::patches::Forest;
use crate::progress::Phases;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::quantise::normal;
use glam::DVec3;
use std::collections::HashMap;
use std::io;

/// What is to be done about normals.
#[derive(Debug, PartialEq)]
pub(super) enum Sides {
    /// Nothing: they are the file's.
    Own,
    /// Those away from the sky are turned.
    Sky,
    /// Those of some patches are turned.
    Patches(Vec<bool>),
}

/// Height of a cloud seen from above, at most, of its width.
const MOST_HEIGHT: f64 = 0.35;

/// How far normals of a cloud seen from above are along the axis of the sky, in the mean and at least: as on a slope of 45°.
const LEAST_ALONG_UP: f64 = 0.707;

pub(super) fn sides(
    facts: &Facts,
    cells: &[Cell],
    fits: &Fits,
    up: UpAxis,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Sides> {
    if is_seen_from_above(facts, fits, up) {
        return Ok(Sides::Sky);
    }
    let votes = votes(cells, fits, plan, phases)?;
    Ok(Sides::Patches(turned(&fits.patches, votes)))
}

fn is_seen_from_above(facts: &Facts, fits: &Fits, up: UpAxis) -> bool {
    let extent = facts.bounds.extent();
    let up = axis(up).as_dvec3();
    let height = extent.dot(up);
    let width = (extent - up * height).max_element();
    let sum = |of: fn(&PatchSums) -> f64| fits.patches.iter().map(of).sum::<f64>();
    height <= width * MOST_HEIGHT && sum(|patch| patch.along_up) >= sum(|patch| patch.area) * LEAST_ALONG_UP
}

/// What a vote for parallel normals weighs.
const FULL_VOTE: f32 = 1024.0;

/// For each two patches that are neighbours, by how much they are on the same side, in order.
fn votes(cells: &[Cell], fits: &Fits, plan: &MemoryPlan<'_>, phases: &Phases<'_>) -> io::Result<Vec<([u32; 2], i64)>> {
    phases.begin("sides", fits.crossing.len());
    let mut votes: HashMap<[u32; 2], i64> = HashMap::new();
    let mut aspects = Vec::new();
    let at_once = plan.triangles_at_once().clamp(1, MemoryPlan::PIECE);
    fits.crossing.for_each_piece(at_once, |start, pairs| {
        Corners::of_vertices(pairs.as_flattened().to_vec()).fetch(&fits.aspects, &mut aspects)?;
        for (pair, aspects) in pairs.iter().zip(aspects.as_chunks::<2>().0) {
            let patch = |at: usize| {
                let cell = cells.partition_point(|cell| cell.first_site <= pair[at]) - 1;
                fits.first_patches[cell] + u32::from(aspects[at].patch)
            };
            let [one, other] = aspects.map(|Aspect { normal, .. }| normal::decode(normal));
            let cosine = one.dot(other);
            let mut patches = [patch(0), patch(1)];
            patches.sort_unstable();
            // Integers, so that their order does not matter.
            *votes.entry(patches).or_default() += (cosine * cosine.abs() * FULL_VOTE) as i64;
        }
        phases.at(start + pairs.len() as u64);
        Ok(())
    })?;
    let mut votes: Vec<_> = votes.into_iter().collect();
    votes.sort_unstable_by_key(|(patches, vote)| (std::cmp::Reverse(vote.abs()), *patches));
    Ok(votes)
}

/// Which patches are to be turned; the clearest votes first.
fn turned(patches: &[PatchSums], votes: Vec<([u32; 2], i64)>) -> Vec<bool> {
    let mut forest = Forest::default();
    forest.reset(patches.len());
    for ([one, other], vote) in votes {
        forest.join(one, other, vote < 0);
    }
    let mut sums = vec![PatchSums::default(); patches.len()];
    for (number, patch) in patches.iter().enumerate() {
        let (root, turned) = forest.root(number as u32);
        sums[root as usize].add(patch, turned);
    }
    (0..patches.len() as u32)
        .map(|number| {
            let (root, turned) = forest.root(number);
            turned ^ sums[root as usize].is_inside_out()
        })
        .collect()
}

impl PatchSums {
    fn add(&mut self, other: &Self, turned: bool) {
        let sign = if turned { -1.0 } else { 1.0 };
        self.flux += other.flux * sign;
        self.normal = (DVec3::from_array(self.normal) + DVec3::from_array(other.normal) * sign).to_array();
        self.place = (DVec3::from_array(self.place) + DVec3::from_array(other.place)).to_array();
        self.area += other.area;
        self.along_up += other.along_up;
    }

    /// Its normals point to its middle, more than away from it.
    fn is_inside_out(&self) -> bool {
        let middle = DVec3::from_array(self.place) / self.area.max(f64::MIN_POSITIVE);
        self.flux < middle.dot(DVec3::from_array(self.normal))
    }
}
