//! The coarse statue, sampled once: radius and materials on a fixed grid of rays over the six sides of the box.
//!
//! Takes the proportions and a resolution; answers, for any point of any side, the radius (cubic) and the materials
//! (linear) there. Its size depends on no triangle count above about two million: this is what makes hundreds of
//! millions of vertices cheap. Grids carry margins beyond their side, so cubics need no neighbours.

use super::bust::{FAR_M, hit};
use super::filter::{Radii, fill_undercuts, margin};
use super::marks::Marks;
use super::ray::{Ray, SidePoint};
use super::relief::Relief;
use super::shape::Shape;
use super::texel::{Coarse, Texel};
use rayon::prelude::*;

/// Most samples along a side. 512: 2 mm on the face; six sides take 35 MB.
pub(super) const MAX_CELLS: usize = 512;

/// The six grids.
#[derive(Debug)]
pub(super) struct Table {
    cells: usize,
    /// Samples beyond each border of a side.
    margin: usize,
    sides: Vec<Vec<Texel>>,
}

impl Table {
    /// Samples the statue with `cells` samples along each side.
    pub(super) fn new(shape: &Shape, cells: usize) -> Self {
        let relief = Relief::new(shape);
        let margin = margin(cells);
        let stride = cells + 1 + 2 * margin;
        let sides = (0..6)
            .map(|side| {
                let direction = |row: usize, column: usize| {
                    let coordinate = |index: usize| 2.0 * (index as f32 - margin as f32) / cells as f32 - 1.0;
                    SidePoint { side, u: coordinate(column), v: coordinate(row) }.direction()
                };
                let ray = |row: usize, column: usize| Ray::of(direction(row, column));
                let outside = Outside::new(shape, stride, &ray);
                let mut grid = vec![Texel::default(); stride * stride];
                grid.par_chunks_mut(stride).enumerate().for_each(|(row, texels)| {
                    for (column, texel) in texels.iter_mut().enumerate() {
                        let with_marks = row % 2 == 0 && column % 2 == 0;
                        *texel = sample(&ray(row, column), shape, &relief, outside.at(row, column), with_marks);
                    }
                });
                spread_marks(&mut grid, stride);
                let mut radii: Vec<f32> = grid.iter().map(|texel| texel.radius).collect();
                fill_undercuts(&mut radii, stride, cells);
                let radii = Radii { radii: &radii, stride, cells };
                grid.par_chunks_mut(stride).enumerate().for_each(|(row, texels)| {
                    for (column, texel) in texels.iter_mut().enumerate() {
                        texel.radius = radii.radii[row * stride + column];
                        texel.set_cavity(radii.cavity(row, column, direction));
                    }
                });
                grid
            })
            .collect();
        Self { cells, margin, sides }
    }

    /// The coarse statue at a point of a side.
    pub(super) fn at(&self, point: SidePoint) -> Coarse {
        let stride = self.cells + 1 + 2 * self.margin;
        let locate = |t: f32| {
            let at = (t + 1.0) * 0.5 * self.cells as f32;
            let cell = (at as usize).min(self.cells - 1);
            (cell + self.margin, at - cell as f32)
        };
        let ((column, fu), (row, fv)) = (locate(point.u), locate(point.v));
        let (wu, wv) = (cubic_weights(fu), cubic_weights(fv));
        let grid = &self.sides[point.side];
        let mut radius = 0.0;
        for (dv, weight) in wv.into_iter().enumerate() {
            let start = (row + dv - 1) * stride + column - 1;
            let four = &grid[start..start + 4];
            radius += weight
                * (four[0].radius * wu[0] + four[1].radius * wu[1] + four[2].radius * wu[2] + four[3].radius * wu[3]);
        }
        let (low, high) = (&grid[row * stride + column..][..2], &grid[(row + 1) * stride + column..][..2]);
        let weights = [(1.0 - fu) * (1.0 - fv), fu * (1.0 - fv), (1.0 - fu) * fv, fu * fv];
        Texel::mean(radius, [&low[0], &low[1], &high[0], &high[1]], weights)
    }
}

/// Every fourth ray of every fourth row, followed from far outside: tells the others where to begin.
struct Outside {
    radii: Vec<f32>,
    stride: usize,
}

impl Outside {
    const STEP: usize = 4;

    fn new(shape: &Shape, fine_stride: usize, ray: &(impl Fn(usize, usize) -> Ray + Sync)) -> Self {
        // One more than fits, so that every fine ray has coarse ones on both sides.
        let stride = fine_stride.div_ceil(Self::STEP) + 1;
        let radii = (0..stride * stride)
            .into_par_iter()
            .map(|at| hit(&ray(at / stride * Self::STEP, at % stride * Self::STEP), shape, FAR_M).radius)
            .collect();
        Self { radii, stride }
    }

    /// A distance outside the surface, as far as the four rays around can tell.
    fn at(&self, row: usize, column: usize) -> f32 {
        let low = row / Self::STEP * self.stride + column / Self::STEP;
        let high = low + self.stride;
        let most = self.radii[low].max(self.radii[low + 1]).max(self.radii[high]).max(self.radii[high + 1]);
        most + 0.05
    }
}

/// The statue along one ray.
fn sample(ray: &Ray, shape: &Shape, relief: &Relief, outside: f32, with_marks: bool) -> Texel {
    let found = hit(ray, shape, outside);
    let (p, near) = (ray.at(found.radius), found.bust);
    Texel::new(&Coarse {
        radius: found.radius + relief.height(p, &near),
        hair: near.hair + near.beard,
        cloth: near.cloth,
        base: near.base,
        cavity: 0.0,
        marks: if with_marks { Marks::at(shape.seed, p, &near) } else { Marks::default() },
    })
}

/// Marks vary slowly and are computed at every other texel of every other row; gives the rest their neighbours' mean.
/// `stride` is odd, so borders have theirs.
fn spread_marks(grid: &mut [Texel], stride: usize) {
    for row in (0..stride).step_by(2) {
        for at in (row * stride + 1..(row + 1) * stride - 1).step_by(2) {
            grid[at] = grid[at].with_marks_between(&grid[at - 1], &grid[at + 1]);
        }
    }
    for row in (1..stride - 1).step_by(2) {
        for at in row * stride..(row + 1) * stride {
            grid[at] = grid[at].with_marks_between(&grid[at - stride], &grid[at + stride]);
        }
    }
}

/// Weights of a Catmull-Rom cubic at `t` in [0, 1]; they sum to 1.
fn cubic_weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [-0.5 * t + t2 - 0.5 * t3, 1.0 - 2.5 * t2 + 1.5 * t3, 0.5 * t + 2.0 * t2 - 1.5 * t3, -0.5 * t2 + 0.5 * t3]
}
