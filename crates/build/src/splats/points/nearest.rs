//! The nearest of a set of sites: a k-d tree with buckets, and searches in it.
//!
//! Sites go in, with a number for each; for a place, the numbers of the nearest ones come out, by distance, and where that ties by
//! number. Squares of distances are `f32`s that are computed in one way, so a site is as far away in every tree it is in.

use super::cells::Site;

/// Sites of a bucket.
pub(super) const BUCKET: usize = 16;

/// A found site: the square of its distance as bits in the upper half, its number in the lower. Sorts by distance.
pub(super) type Key = u64;

pub(super) fn key(square: f32, number: u32) -> Key {
    u64::from(square.to_bits()) << 32 | u64::from(number)
}

/// Square of the distance.
pub(super) fn square_of(key: Key) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

pub(super) fn number_of(key: Key) -> u32 {
    key as u32
}

/// Of numbers; `f32::max` takes care of NaN as well, at three times the price.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Box3 {
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
}

impl Box3 {
    pub(super) const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    pub(super) fn including(self, at: Site) -> Self {
        self.union(&Self { min: at, max: at })
    }

    pub(super) fn union(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|axis| smaller(self.min[axis], other.min[axis])),
            max: std::array::from_fn(|axis| larger(self.max[axis], other.max[axis])),
        }
    }

    /// Square of the distance of a place, rounded as those of sites are: never above that of a site in the box.
    pub(super) fn square(&self, at: Site) -> f32 {
        let gap: [f32; 3] =
            std::array::from_fn(|axis| larger(larger(self.min[axis] - at[axis], at[axis] - self.max[axis]), 0.0));
        gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]
    }

    /// Square of the distance of another box, never above that of two places in them.
    pub(super) fn square_to(&self, other: &Self) -> f32 {
        let gap: [f32; 3] = std::array::from_fn(|axis| {
            larger(larger(self.min[axis] - other.max[axis], other.min[axis] - self.max[axis]), 0.0)
        });
        gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]
    }
}

/// Coordinates of a bucket, an array for each axis; beyond the last site NaN.
type Bucket = [[f32; BUCKET]; 3];

/// A k-d tree whose memory is used again.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Numbers of the sites, bucket by bucket.
    pub(super) order: Vec<u32>,
    buckets: Vec<Bucket>,
    /// A complete binary tree, root at 1; the last half are the buckets'.
    boxes: Vec<Box3>,
}

impl Tree {
    /// Builds the tree of sites, each known by its place in the list.
    pub(super) fn build(&mut self, sites: &[Site]) {
        self.order.clear();
        self.order.extend(0..sites.len() as u32);
        let width = sites.len().div_ceil(BUCKET).next_power_of_two();
        self.buckets.clear();
        self.boxes.clear();
        self.boxes.resize(2 * width, Box3::EMPTY);
        let mut starts = Vec::with_capacity(width);
        arrange(&mut self.order, sites, width, 0, &mut starts);
        // Buckets in the middle may be less than full: each begins where a multiple of its size is.
        let mut order = Vec::with_capacity(width * BUCKET);
        for (number, (start, count)) in starts.into_iter().enumerate() {
            let mut bucket = [[f32::NAN; BUCKET]; 3];
            for (slot, site) in self.order[start..start + count].iter().enumerate() {
                let at = sites[*site as usize];
                for axis in 0..3 {
                    bucket[axis][slot] = at[axis];
                }
                let bounds = &mut self.boxes[width + number];
                *bounds = bounds.including(at);
                order.push(*site);
            }
            order.resize((number + 1) * BUCKET, u32::MAX);
            self.buckets.push(bucket);
        }
        self.order = order;
        for node in (1..width).rev() {
            self.boxes[node] = self.boxes[2 * node].union(&self.boxes[2 * node + 1]);
        }
    }

    /// Numbers of the sites, near ones near each other.
    pub(super) fn sites(&self) -> impl Iterator<Item = u32> {
        self.order.iter().copied().filter(|site| *site != u32::MAX)
    }

    /// Replaces `found` by the nearest `count` sites, or all there are, that are no farther than `within`, a square.
    pub(super) fn nearest(&self, at: Site, count: usize, within: f32, found: &mut Vec<Key>) {
        let width = self.buckets.len();
        let (mut len, mut within) = (0, within);
        let mut stack = [0_u32; 32];
        let mut depth = 1;
        stack[0] = 1;
        if found.len() < 4 * count + BUCKET {
            found.resize(4 * count + BUCKET, 0);
        }
        while depth > 0 {
            depth -= 1;
            let node = stack[depth] as usize;
            if node < width {
                let squares = [self.boxes[2 * node].square(at), self.boxes[2 * node + 1].square(at)];
                // The nearer one on top.
                let near = usize::from(squares[1] < squares[0]);
                for child in [1 - near, near] {
                    stack[depth] = (2 * node + child) as u32;
                    depth += usize::from(squares[child] <= within);
                }
                continue;
            }
            if width == 1 && self.boxes[1].square(at) > within {
                continue;
            }
            let bucket = &self.buckets[node - width];
            let numbers = &self.order[(node - width) * BUCKET..][..BUCKET];
            let squares = squares(bucket, at);
            for slot in 0..BUCKET {
                // NaN compares false.
                found[len] = key(squares[slot], numbers[slot]);
                len += usize::from(squares[slot] <= within);
            }
            if len + BUCKET > found.len() {
                found[..len].select_nth_unstable(count - 1);
                len = count;
                within = square_of(found[count - 1]);
            }
        }
        if len > 2 * count {
            found[..len].select_nth_unstable(count - 1);
            len = count;
        }
        found.truncate(len);
        found.sort_unstable();
        found.truncate(count);
    }
}

fn squares([x, y, z]: &Bucket, at: Site) -> [f32; BUCKET] {
    std::array::from_fn(|slot| {
        let (x, y, z) = (x[slot] - at[0], y[slot] - at[1], z[slot] - at[2]);
        x * x + y * y + z * z
    })
}

/// Puts sites into the order of buckets, of which there may be `width`; lists where each begins, and how many it has.
fn arrange(order: &mut [u32], sites: &[Site], width: usize, start: usize, out: &mut Vec<(usize, usize)>) {
    if width == 1 {
        out.push((start, order.len()));
        return;
    }
    let bounds = order.iter().fold(Box3::EMPTY, |bounds, site| bounds.including(sites[*site as usize]));
    let extent: [f32; 3] = std::array::from_fn(|axis| bounds.max[axis] - bounds.min[axis]);
    let axis = (0..3).fold(0, |widest, axis| if extent[axis] > extent[widest] { axis } else { widest });
    let left = (order.len() / 2).next_multiple_of(BUCKET).min(order.len());
    if left > 0 && left < order.len() {
        // Equal ones by number, so that the tree is the same whatever the library does.
        order.select_nth_unstable_by(left, |a, b| {
            let of = |site: &u32| sites[*site as usize][axis];
            of(a).total_cmp(&of(b)).then(a.cmp(b))
        });
    }
    let (left_half, right_half) = order.split_at_mut(left);
    arrange(left_half, sites, width / 2, start, out);
    arrange(right_half, sites, width / 2, start + left, out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_are_those_that_a_look_at_all_finds(
            sites in prop::collection::vec(prop::array::uniform3((-8i32..8).prop_map(|x| x as f32 * 0.25)), 1..400),
            at in prop::array::uniform3(-3f32..3.0), count in 1usize..70, within in 0f32..30.0,
        ) {
            let mut tree = Tree::default();
            tree.build(&sites);
            let mut sorted: Vec<u32> = tree.sites().collect();
            sorted.sort_unstable();
            prop_assert!(sorted.into_iter().eq(0..sites.len() as u32));
            let mut all: Vec<Key> = sites.iter().enumerate().map(|(number, site)| {
                let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| site[axis] - at[axis]);
                key(x * x + y * y + z * z, number as u32)
            }).collect();
            all.retain(|key| square_of(*key) <= within);
            all.sort_unstable();
            all.truncate(count);
            let mut found = Vec::new();
            tree.nearest(at, count, within, &mut found);
            prop_assert_eq!(found, all);
        }
    }
}
