//! Leaves that are far from everything else.
//!
//! A code is no smaller than a thirteenth of the parent's radius: a point far away from all others would become a disc that is
//! seen from everywhere. The format knows no single children either. So a leaf whose decoded ball would be more than
//! [`TOO_LARGE`] times its own, and as much larger than a usual leaf, becomes an inner node with two children, both of which are
//! that leaf: drawn at the same place, they are one, and up to a thirteenth as large. If that is not enough, both are taken apart
//! in turn.
//!
//! A leaf's true ball, what it is decoded to, and its decoded parent go in; a better place for it comes out, if there is one.

use gigalod_geom::Sphere;
use gigalod_geom::quantise::sphere;

/// A leaf is as large as the format has it unless that is more than so many times its own radius, and a usual one's.
const TOO_LARGE: f32 = 2.0;

/// Room that is tried around a leaf, in radii of the ball that is too large for it.
const ROOMS: [f32; 5] = [0.5, 0.25, 0.1, 0.03, 0.0];

/// What does not become so much smaller is left as it is.
const MUCH: f32 = 0.7;

/// Nothing smaller than this, of the model's root, is told apart by `f32`.
const LEAST: f32 = 1.0 / (1 << 20) as f32;

/// One leaf more for so many nodes of a tree, at most, and a few besides: room that a thread has.
const NODES_PER_COPY: usize = 8;
const COPIES: usize = 64;

/// Leaves that may be put into a tree of so many nodes.
pub(super) fn copies_of(nodes: usize) -> usize {
    nodes / NODES_PER_COPY + COPIES
}

/// What is usual in a model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Usual {
    /// No ball up to this radius is too large.
    allowed: f32,
}

impl Usual {
    /// `mean` is that of all leaves.
    pub(super) fn of(mean: f32, model_radius: f32) -> Self {
        Self { allowed: mean.max(model_radius * LEAST) * TOO_LARGE }
    }

    /// True of a decoded ball that is much larger than the leaf that it stands for.
    #[inline]
    pub(super) fn is_too_large(&self, leaf: &Sphere, decoded: &Sphere) -> bool {
        decoded.radius > (leaf.radius * TOO_LARGE).max(self.allowed)
    }
}

/// A code for a leaf's place, and its ball, under which the leaf itself can be smaller than `now`. What touches the border of its
/// parent's ball can not, so there must be some room around it; how much depends on where the lattice is.
pub(super) fn with_room(leaf: &Sphere, now: &Sphere, parent: &Sphere) -> Option<(u16, Sphere)> {
    let candidates = ROOMS.map(|room| {
        let roomy = Sphere { center: leaf.center, radius: leaf.radius + now.radius * room };
        let (code, ball) = sphere::encode(parent, &roomy);
        (code, ball, sphere::encode(&ball, leaf).1.radius)
    });
    let is_sound = |ball: &Sphere, radius: f32| ball.encloses(leaf) && radius <= now.radius * MUCH;
    let sound = candidates.into_iter().filter(|(_, ball, radius)| is_sound(ball, *radius));
    sound.min_by(|a, b| a.2.total_cmp(&b.2)).map(|(code, ball, _)| (code, ball))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    proptest! {
        /// Wherever a leaf lies within its parent, unless at its very border, and however small it is.
        #[test]
        fn a_lone_leaf_becomes_as_small_as_it_is_in_a_few_steps(
            direction in prop::array::uniform3(-1f32..1.0), away in 0f32..0.9, times in 20f32..1e5,
        ) {
            let mut parent = Sphere { center: Vec3::new(3.0, -7.0, 11.0), radius: 10.0 };
            let center = parent.center + Vec3::from_array(direction).normalize_or(Vec3::X) * away * parent.radius;
            let leaf = Sphere { center, radius: parent.radius / times };
            let usual = Usual::of(0.0, 0.0);
            let (_, mut now) = sphere::encode(&parent, &leaf);
            let mut steps = 0;
            while usual.is_too_large(&leaf, &now) {
                let Some((_, ball)) = with_room(&leaf, &now, &parent) else { break };
                prop_assert!(ball.encloses(&leaf));
                parent = ball;
                now = sphere::encode(&parent, &leaf).1;
                steps += 1;
            }
            prop_assert!(now.encloses(&leaf) && now.radius <= leaf.radius * 3.0, "{} times", now.radius / leaf.radius);
            prop_assert!(steps <= 8, "{steps}");
        }
    }
}
