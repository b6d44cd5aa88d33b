//! Fitted points become leaves, as those of a mesh.
//!
//! What a point's ball was fitted to is local space rounded to `f32`; a leaf's ball encloses the same ball around the exact point.

use super::super::checkpoint::Facts;
use super::super::leaves::Leaf;
use super::super::plan::MemoryPlan;
use super::cells::Cells;
use super::fit::{AWAY_FROM_SKY, FIRST, Fits, FittedPoint, OWN_NORMAL};
use super::sides::{self, Sides};
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::quantise::normal;
use gigalod_geom::sphere::round_up;
use rayon::prelude::*;
use std::io;

/// All but so many hundredths of the points are not larger than the size that others are measured by;
const MANY: u64 = 1;
/// nothing is larger than so many times that: scattered noise, far from all and from itself, would be.
const MOST_TIMES: f32 = 3.0;

/// Leaves of all points, in the order of cells.
pub(in super::super) fn from_fits(
    facts: &Facts,
    cells: Cells,
    fits: Fits,
    up: UpAxis,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> io::Result<Spool<Leaf>> {
    let Cells { points, sites, cells, scale, has_normals } = cells;
    // What was read is not needed any more.
    drop((points, sites));
    let sides = if has_normals { Sides::Own } else { sides::sides(facts, &cells, &fits, up, plan, phases)? };
    phases.begin("leaves", fits.points.len());
    let most = most_radius(&fits.points)?;
    let mut out = Spool::named(&plan.place(), "leaves")?;
    out.expect(fits.points.len());
    let (mut start, mut points, mut aspects) = (0, Vec::new(), Vec::new());
    for (number, cell) in cells.iter().enumerate() {
        fits.points.read_vec(start, cell.points as usize, &mut points)?;
        if let Sides::Patches(_) = sides {
            fits.aspects.read_vec(u64::from(cell.first_site), cell.sites as usize, &mut aspects)?;
        }
        let mut site = 0;
        let turned: Vec<bool> = points
            .iter()
            .map(|point: &FittedPoint| {
                site += usize::from(point.flags & FIRST);
                match &sides {
                    Sides::Own => false,
                    Sides::Sky => point.flags & AWAY_FROM_SKY != 0,
                    Sides::Patches(turned) => {
                        turned[(fits.first_patches[number] + u32::from(aspects[site - 1].patch)) as usize]
                    }
                }
            })
            .collect();
        let leaf = |(point, turned): (&FittedPoint, &bool)| leaf(point, *turned, most, scale);
        let leaves: Vec<Leaf> = points.par_iter().with_min_len(1 << 12).zip(turned.par_iter()).map(leaf).collect();
        out.push(&leaves)?;
        start += u64::from(cell.points);
        phases.at(start);
    }
    Ok(out)
}

fn leaf(point: &FittedPoint, turned: bool, most: f32, scale: f32) -> Leaf {
    let FittedPoint { center, radius, color, flags, normal, spread } = *point;
    let turned = turned && flags & OWN_NORMAL == 0;
    // Each coordinate was rounded by no more than half a step.
    let moved = center.iter().map(|value| f64::from(value.abs())).sum::<f64>() * 2f64.powi(-24);
    let radius = f64::from(radius.min(most)) / f64::from(scale);
    Leaf {
        center,
        radius: round_up((radius + moved) * (1.0 + 1e-14)),
        color,
        unused: 0,
        normal: if turned { normal::encode(-normal::decode(normal)) } else { normal },
        spread,
    }
}

/// No ball is larger than this; in units of sites.
fn most_radius(points: &Spool<FittedPoint>) -> io::Result<f32> {
    // By the highest bits: 32 steps an octave.
    const SHIFT: u32 = 18;
    let mut counts = vec![0_u64; (f32::INFINITY.to_bits() >> SHIFT) as usize + 1];
    points.for_each_piece(MemoryPlan::PIECE, |_, piece| {
        for point in piece {
            counts[(point.radius.to_bits() >> SHIFT) as usize] += 1;
        }
        Ok(())
    })?;
    let mut left = points.len() * MANY / 100;
    for (step, count) in counts.iter().enumerate().rev() {
        if *count > left {
            return Ok(f32::from_bits((step as u32 + 1) << SHIFT) * MOST_TIMES);
        }
        left -= count;
    }
    Ok(f32::INFINITY)
}
