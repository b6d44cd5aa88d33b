//! How far any faces are from any others, as a proof: for what [`overlay`](super::overlay) cannot lay flat.
//!
//! In: faces that go, those that come, and those beside them that stay; a limit. Out: bounds for those that come and stay, so that
//! each point of the old ones has a point of the new ones that close, and each of the new ones one of the old; or nothing, where there is no
//! such proof within the limit.
//!
//! The proof: the distance to a convex set is a convex function, and a triangle is convex. So no point of a triangle is farther from
//! another one than its corners are. Where no single triangle is near enough to all three corners, the triangle is cut into four, some
//! times over.

use glam::DVec3;

/// How often a triangle is cut.
const MOST_CUTS: u32 = 2;
/// More than all roundings of this file, as a share.
const ROUNDING: f64 = 1e-6;

/// Faces of both sides. Reused.
#[derive(Debug, Default)]
pub(super) struct Cover {
    /// Those that go, and their errors.
    pub(super) old: Vec<([DVec3; 3], f64)>,
    /// Those that come; their errors are the result.
    pub(super) new: Vec<([DVec3; 3], f64)>,
    /// Those that stay, and their errors, which may grow.
    pub(super) beside: Vec<([DVec3; 3], f64)>,
}

impl Cover {
    pub(super) fn clear(&mut self) {
        self.old.clear();
        self.new.clear();
        self.beside.clear();
    }

    /// Bounds all that come and stay; false where that is not possible within `limit`.
    pub(super) fn bound(&mut self, limit: f64) -> bool {
        let Self { old, new, beside } = self;
        let stayed: Vec<f64> = beside.iter().map(|(_, geo)| *geo).collect();
        // Each new point has an old one.
        for (corners, geo) in new.iter_mut() {
            let targets = || old.iter().chain(beside.iter()).map(|(corners, geo)| (corners, *geo));
            let mut most = 0.0f64;
            let is_covered = covered(corners, MOST_CUTS, &mut |corners| {
                let best = nearest(corners, targets());
                let fits = best.1 <= limit;
                if fits {
                    most = most.max(best.1);
                }
                fits
            });
            if !is_covered {
                return false;
            }
            *geo = most;
        }
        // Each old point has a new one, which then stands for it too.
        for (corners, geo) in old.iter() {
            let is_covered = covered(corners, MOST_CUTS, &mut |corners| {
                let targets = new.iter().chain(beside.iter()).map(|(corners, _)| (corners, *geo));
                let (target, bound) = nearest(corners, targets);
                if bound > limit {
                    return false;
                }
                let raised = match target.checked_sub(new.len()) {
                    None => &mut new[target].1,
                    Some(target) => &mut beside[target].1,
                };
                *raised = raised.max(bound);
                true
            });
            if !is_covered {
                return false;
            }
        }
        for (_, geo) in new.iter_mut() {
            *geo *= 1.0 + ROUNDING;
        }
        for ((_, geo), stayed) in beside.iter_mut().zip(stayed) {
            if *geo > stayed {
                *geo *= 1.0 + ROUNDING;
            }
        }
        new.iter().chain(beside.iter()).all(|(_, geo)| *geo <= limit * (1.0 + ROUNDING))
    }

    /// The new face nearest to a point, and the shares of its corners there.
    pub(super) fn locate(&self, at: DVec3) -> (usize, [f64; 3]) {
        let places = self.new.iter().enumerate().map(|(number, (corners, _))| (number, shares_at(at, corners)));
        let distance = |(number, shares): &(usize, [f64; 3])| {
            let [a, b, c] = self.new[*number].0;
            (a * shares[0] + b * shares[1] + c * shares[2] - at).length_squared()
        };
        places.min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("something comes")
    }
}

/// Asks for a triangle, and where that is denied for its four parts.
fn covered(corners: &[DVec3; 3], cuts: u32, is_near: &mut dyn FnMut(&[DVec3; 3]) -> bool) -> bool {
    if is_near(corners) {
        return true;
    }
    if cuts == 0 {
        return false;
    }
    let [a, b, c] = *corners;
    let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
    [[ab, bc, ca], [a, ab, ca], [ab, b, bc], [ca, bc, c]].iter().all(|part| covered(part, cuts - 1, is_near))
}

/// The triangle for which the error, carried and added, is least, and that error.
fn nearest<'a>(corners: &[DVec3; 3], targets: impl Iterator<Item = (&'a [DVec3; 3], f64)>) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (number, (target, carried)) in targets.enumerate() {
        let mut most = 0.0f64;
        let room = best.1 - carried;
        for corner in corners {
            most = most.max(distance_squared(*corner, target));
            if room <= 0.0 || most >= room * room {
                break;
            }
        }
        let bound = most.sqrt() + carried;
        if bound < best.1 {
            best = (number, bound);
        }
    }
    best
}

fn distance_squared(at: DVec3, corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = shares_at(at, corners);
    (corners[0] * a + corners[1] * b + corners[2] * c - at).length_squared()
}

/// Shares of the corners at the point of a triangle that is nearest. Of a degenerate one, at a point of it.
///
/// Source: Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5.
fn shares_at(at: DVec3, corners: &[DVec3; 3]) -> [f64; 3] {
    let [a, b, c] = *corners;
    let (ab, ac, ap) = (b - a, c - a, at - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = at - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = d1 / (d1 - d3).max(f64::MIN_POSITIVE);
        return [1.0 - share, share, 0.0];
    }
    let cp = at - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = d2 / (d2 - d6).max(f64::MIN_POSITIVE);
        return [1.0 - share, 0.0, share];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6)).max(f64::MIN_POSITIVE);
        return [0.0, 1.0 - share, share];
    }
    let sum = (va + vb + vc).max(f64::MIN_POSITIVE);
    [va / sum, vb / sum, vc / sum]
}
