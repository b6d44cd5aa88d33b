//! Which neighbours' normals are on the same side: patches of a cell whose points agree.
//!
//! Unoriented normals and the neighbours of each point go in. Neighbours are joined in the order in which their normals
//! are parallel, the most parallel first, so that what decides about a point's side is a spanning tree of the smallest turns (Hoppe
//! et al. 1992, section 3.3; Kruskal's algorithm instead of Prim's). Normals come out turned so that all of a patch are on
//! one side, with the number of each one's patch; and whether each is to be turned once more to be on the side of the sky, where
//! the sky is one more neighbour of every point.

use glam::Vec3;

/// Neighbours that a point may get its side from.
pub(super) const SIDES_OF: usize = 8;

/// A forest whose members know on which side of their root they are.
#[derive(Debug, Default)]
pub(super) struct Forest {
    parents: Vec<u32>,
    /// On the other side than the parent.
    turned: Vec<bool>,
    sizes: Vec<u32>,
}

impl Forest {
    /// Of members that have nothing in common.
    pub(super) fn reset(&mut self, members: usize) {
        self.parents.clear();
        self.parents.extend(0..members as u32);
        self.turned.clear();
        self.turned.resize(members, false);
        self.sizes.clear();
        self.sizes.resize(members, 1);
    }

    /// The root of a member's tree, and whether the member is on its other side.
    pub(super) fn root(&mut self, member: u32) -> (u32, bool) {
        let (mut at, mut turned) = (member, false);
        loop {
            let parent = self.parents[at as usize];
            if parent == at {
                return (at, turned);
            }
            // A root is on its own side.
            self.turned[at as usize] ^= self.turned[parent as usize];
            self.parents[at as usize] = self.parents[parent as usize];
            turned ^= self.turned[at as usize];
            at = self.parents[at as usize];
        }
    }

    /// Joins two trees, if they are two, by members that are on the same side or are not.
    pub(super) fn join(&mut self, one: u32, other: u32, turned: bool) {
        let ((mut a, a_turned), (mut b, b_turned)) = (self.root(one), self.root(other));
        if a == b {
            return;
        }
        if self.sizes[a as usize] < self.sizes[b as usize] {
            std::mem::swap(&mut a, &mut b);
        }
        self.sizes[a as usize] += self.sizes[b as usize];
        self.parents[b as usize] = a;
        self.turned[b as usize] = turned ^ a_turned ^ b_turned;
    }
}

/// What is less steep than 60° is on the side of the sky, whatever its neighbours say.
const SEEN_BY_SKY: f32 = 0.5;

/// Turns are in sixteenths of an octave; smaller ones than this are noise.
const LEAST_TURN: f32 = 1e-4;

/// How far from parallel two directions are, in steps from 0.
fn turn(cosine: f32) -> usize {
    let steps = |turn: f32| turn.to_bits() >> 19;
    (steps((1.0 - cosine.abs()).max(LEAST_TURN)) - steps(LEAST_TURN)) as usize
}

#[derive(Debug, Default)]
pub(super) struct Patches {
    /// For each point.
    pub(super) patch_of: Vec<u16>,
    /// For each point: its normal is to be turned once more to be on the side of the sky.
    pub(super) away_from_sky: Vec<bool>,
    pub(super) count: usize,
    edges: Vec<[u32; 2]>,
    turns: Vec<u16>,
    sorted: Vec<u32>,
    plain: Forest,
    under_sky: Forest,
}

impl Patches {
    /// Finds the patches of points with these `normals`; `neighbours` says which of these points are neighbours of one, so many
    /// that count: it may name more that do not.
    pub(super) fn find<'a>(&mut self, normals: &mut [Vec3], neighbours: impl Fn(usize) -> &'a [u32], up: Vec3) {
        let count = normals.len();
        self.edges.clear();
        self.turns.clear();
        let sky = count as u32;
        for (one, normal) in normals.iter().enumerate() {
            for other in neighbours(one) {
                // Once, where each is the other's neighbour.
                if one < *other as usize || !neighbours(*other as usize).contains(&(one as u32)) {
                    self.edges.push([one as u32, *other]);
                    self.turns.push(turn(normal.dot(normals[*other as usize])) as u16);
                }
            }
            self.edges.push([one as u32, sky]);
            let along = normal.dot(up).abs();
            self.turns.push(if along >= SEEN_BY_SKY { 0 } else { turn(along) as u16 });
        }
        self.sort();
        self.plain.reset(count);
        self.under_sky.reset(count + 1);
        for edge in &self.sorted {
            let [one, other] = self.edges[*edge as usize];
            let direction = if other == sky { up } else { normals[other as usize] };
            let turned = normals[one as usize].dot(direction) < 0.0;
            self.under_sky.join(one, other, turned);
            if other != sky {
                self.plain.join(one, other, turned);
            }
        }
        self.patch_of.clear();
        self.away_from_sky.clear();
        let mut patches = vec![u16::MAX; count];
        self.count = 0;
        let (_, sky_turned) = self.under_sky.root(sky);
        for (one, normal) in normals.iter_mut().enumerate() {
            let (root, turned) = self.plain.root(one as u32);
            let patch = &mut patches[root as usize];
            if *patch == u16::MAX {
                *patch = self.count as u16;
                self.count += 1;
            }
            self.patch_of.push(*patch);
            let (_, turned_to_sky) = self.under_sky.root(one as u32);
            self.away_from_sky.push(turned_to_sky ^ sky_turned ^ turned);
            if turned {
                *normal = -*normal;
            }
        }
    }

    /// Edges by their turns; those of one turn in their order.
    fn sort(&mut self) {
        let mut starts = [0_u32; 512];
        for turn in &self.turns {
            starts[usize::from(*turn) + 1] += 1;
        }
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        self.sorted.clear();
        self.sorted.resize(self.turns.len(), 0);
        for (edge, turn) in self.turns.iter().enumerate() {
            let start = &mut starts[usize::from(*turn)];
            self.sorted[*start as usize] = edge as u32;
            *start += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_grow_and_fit() {
        let turns: Vec<usize> = (0..=1000).map(|cosine| turn(1.0 - cosine as f32 / 1000.0)).collect();
        assert!(turns.is_sorted() && turns[0] == 0 && turns[1000] > 150 && turns[1000] < 511);
        assert_eq!(turn(-0.3), turn(0.3));
        assert!(turn(1.001) == 0);
    }

    /// A circle, cut in two places: each arc is one patch, whose normals go all the way round.
    #[test]
    fn sides_are_passed_on_around_corners_and_not_across_gaps() {
        let count = 60;
        let outward = |at: usize| {
            let (sin, cos) = (at as f64 / count as f64 * std::f64::consts::TAU).sin_cos();
            Vec3::new(cos as f32, sin as f32, 0.0)
        };
        let neighbours: Vec<Vec<u32>> = (0..count)
            .map(|at| {
                let around = [count - 1, 1].map(|step| (at + step) % count);
                let arc = |at: usize| usize::from((20..50).contains(&at));
                around.into_iter().filter(|other| arc(*other) == arc(at)).map(|other| other as u32).collect()
            })
            .collect();
        let mut normals: Vec<Vec3> =
            (0..count).map(|at| if at * 7 % 5 < 2 { outward(at) } else { -outward(at) }).collect();
        let mut patches = Patches::default();
        patches.find(&mut normals, |at| &neighbours[at][..], Vec3::Y);
        assert_eq!(patches.count, 2);
        for patch in 0..2 {
            let sides: Vec<f32> = (0..count)
                .filter(|at| usize::from(patches.patch_of[*at]) == patch)
                .map(|at| normals[at].dot(outward(at)))
                .collect();
            assert!(sides.len() >= 30 && sides.iter().all(|side| side.signum() == sides[0].signum()), "{sides:?}");
        }
        for (normal, away_from_sky) in normals.iter().zip(&patches.away_from_sky) {
            let to_sky = if *away_from_sky { -*normal } else { *normal };
            assert!(to_sky.y > -0.51, "{to_sky}");
        }
    }
}
