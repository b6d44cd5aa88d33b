//! The surface under the cursor, from the leaves of a hierarchy of splats: at full precision, although the display is coarse.
//!
//! Goes in: an open file, a ray in model space. Comes out: where the ray meets the surface that the leaves stand for. Nodes are opened
//! in the order in which the ray enters their balls, so only pages along the ray are read, and no more than lead to the nearest
//! hit. This waits for reads: it is for a thread of its own.
//!
//! What always holds: the true surface lies within [`Hit::radius`] of the ray near the hit; hostile files end the search.

use crate::navigation::Anchor;
use gigalod_format::FormatError;
use gigalod_format::splats::{Children, FamilyPlace, Node, Page, PageId, SplatFile, WordIndex};
use gigalod_geom::Sphere;
use gigalod_geom::quantise::{normal, sphere};
use glam::{DVec3, Vec3};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

/// Pages that are kept decoded from one pick to the next, about 40 KiB each.
const MOST_PAGES: usize = 512;

/// Balls whose surface patch the ray just misses count where nothing else does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter: the point is origin + t · direction.
    pub t: f64,
    /// How far the point may be from the true surface, in model units; of splats the radius of the leaf's ball.
    pub radius: f64,
    /// How far the original's vertices are apart there, about, in model units: nothing is gained by coming much nearer.
    pub detail: f64,
}

impl Hit {
    /// A leaf's ball holds all triangles at its vertex.
    pub fn on_ball(t: f64, radius: f64) -> Self {
        Self { t, radius, detail: radius }
    }
}

/// A half-line in model space; the direction's length is the unit of [`Hit::t`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins.
    pub origin: DVec3,
    /// Where it goes; not zero.
    pub direction: DVec3,
}

/// A file with the pages that were read of it.
#[derive(Debug, Default)]
pub struct Pages {
    decoded: BTreeMap<PageId, Page>,
}

/// Siblings, or a leaf, in the order in which the ray reaches them.
#[derive(Debug)]
struct Entry {
    t: f64,
    what: What,
}

#[derive(Debug)]
enum What {
    /// `skipped` words after the family's first.
    Group {
        parent: Sphere,
        family: FamilyPlace,
        skipped: u16,
        count: u8,
    },
    Leaf {
        center: DVec3,
        normal: Vec3,
        radius: f64,
    },
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Entry {}
impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Entry {
    /// The nearest is the greatest: a heap gives it first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.t.total_cmp(&self.t)
    }
}

/// One node of a group.
struct Sibling {
    node: Node,
    children: Children,
    /// Words of the family below the group that its siblings before it take.
    skipped: u16,
    ball: Sphere,
}

/// A group of `count` nodes that begins at a word of a page, below a ball, and the family of their children; `None` where it does
/// not lie in the page.
fn siblings<'a>(
    page: &'a Page,
    start: usize,
    count: u8,
    parent: &'a Sphere,
) -> Option<(Option<FamilyPlace>, impl Iterator<Item = Sibling> + 'a)> {
    let end = start + usize::from(count);
    let words = page.words().get(start..end)?;
    let family = page.words().get(end).map(|word| page.family(*word));
    let nodes = words.iter().scan(0, move |before, word| {
        let node = Node(*word);
        let children = node.children();
        let skipped = *before;
        *before += children.words() as u16;
        Some(Sibling { node, children, skipped, ball: sphere::decode_with(sphere::table(), parent, node.sphere()) })
    });
    Some((family, nodes))
}

impl Pages {
    fn page(&mut self, file: &SplatFile, page: PageId) -> Result<&Page, FormatError> {
        if self.decoded.len() >= MOST_PAGES && !self.decoded.contains_key(&page) {
            // The first pages are on every way.
            self.decoded.retain(|kept, _| kept.0 < 16);
        }
        match self.decoded.entry(page) {
            std::collections::btree_map::Entry::Occupied(there) => Ok(there.into_mut()),
            std::collections::btree_map::Entry::Vacant(place) => Ok(place.insert(file.read_page(page)?)),
        }
    }

    /// Where the ray first meets the surface. Damaged pages are as if there was nothing below them, but for their parents' balls.
    ///
    /// # Errors
    /// The root's page cannot be read.
    pub fn first_hit(&mut self, file: &SplatFile, ray: &Ray) -> Result<Option<Hit>, FormatError> {
        let root = file.skeleton().root();
        let Some(axis) = ray.direction.try_normalize() else { return Ok(None) };
        self.page(file, PageId(0))?;
        let mut queue = BinaryHeap::new();
        queue.push(Entry {
            t: 0.0,
            what: What::Group {
                parent: root.sphere,
                family: FamilyPlace { page: PageId(0), family: 0 },
                skipped: 0,
                count: 1,
            },
        });
        let overhang = f64::from(root.overhang);
        // Leaves whose patch the ray meets, and the first whose ball it does.
        let (mut met, mut grazed): (Vec<Patch>, Option<Hit>) = (Vec::new(), None);
        let mut visited = 0;
        while let Some(Entry { t: entry, what }) = queue.pop() {
            // What comes later cannot take part in the nearest surface.
            if met.iter().map(Patch::back).fold(f64::INFINITY, f64::min) < entry {
                break;
            }
            let (parent, place, group_skipped, count) = match what {
                What::Group { parent, family, skipped, count } => (parent, family, skipped, count),
                What::Leaf { center, normal, radius } => {
                    match Patch::of(axis, ray.origin, center, normal, radius) {
                        Some(patch) => met.push(patch),
                        None if grazed.is_none() => {
                            grazed = Some(Hit::on_ball((center - ray.origin).dot(axis), radius));
                        }
                        None => {}
                    }
                    continue;
                }
            };
            visited += u64::from(count);
            if visited > root.nodes {
                break;
            }
            let Ok(page) = self.page(file, place.page) else {
                // What is known is the parent's ball.
                let center = root.origin + parent.center.as_dvec3();
                let t = (center - ray.origin).dot(axis);
                grazed = grazed.or(Some(Hit::on_ball(t, f64::from(parent.radius))));
                continue;
            };
            let Some(word) = page.family_word(place.family) else { break };
            let start = usize::from(word.0) + usize::from(group_skipped);
            let Some((family, siblings)) = siblings(page, start, count, &parent) else { break };
            for Sibling { node, children, skipped, ball } in siblings {
                let center = root.origin + ball.center.as_dvec3();
                let radius = f64::from(ball.radius);
                let is_leaf = children.count == 0;
                let reach = if is_leaf { radius } else { radius * overhang };
                let Some(t) = entry_of(axis, ray.origin, center, reach) else { continue };
                if is_leaf {
                    let normal = normal::decode(node.normal());
                    queue.push(Entry { t, what: What::Leaf { center, normal, radius } });
                } else if let Some(below) = family {
                    let what = What::Group { parent: ball, family: below, skipped, count: children.count };
                    queue.push(Entry { t, what });
                }
            }
        }
        let unit = 1.0 / ray.direction.length();
        let hit = blend(&met).or(grazed).filter(|hit| hit.t > 0.0);
        Ok(hit.map(|hit| Hit { t: hit.t * unit, ..hit }))
    }

    /// Balls that hold parts of the surface, all over the model, in model space: the smallest of the root's page.
    ///
    /// # Errors
    /// The root's page cannot be read.
    pub fn anchors(&mut self, file: &SplatFile, most: usize) -> Result<Vec<Anchor>, FormatError> {
        let root = file.skeleton().root();
        let page = self.page(file, PageId(0))?;
        let mut found = Vec::new();
        let mut stack = vec![(root.sphere, WordIndex(0), 1u8)];
        let mut visited = 0;
        while let Some((parent, word, count)) = stack.pop() {
            let Some((family, siblings)) = siblings(page, usize::from(word.0), count, &parent) else { break };
            visited += usize::from(count);
            if visited > page.node_count() {
                break;
            }
            for Sibling { children, skipped, ball, .. } in siblings {
                let below = family.filter(|below| children.count > 0 && below.page == PageId(0));
                match below.and_then(|below| page.family_word(below.family)) {
                    Some(first) => stack.push((ball, WordIndex(first.0.saturating_add(skipped)), children.count)),
                    None => {
                        let at = root.origin + ball.center.as_dvec3();
                        found.push(Anchor { at, radius: f64::from(ball.radius) });
                    }
                }
            }
        }
        let step = found.len().div_ceil(most.max(1)).max(1);
        Ok(found.into_iter().step_by(step).collect())
    }
}

/// Where a ray enters a ball, 0 from inside; `None` where it does not. `axis` is a unit vector.
fn entry_of(axis: DVec3, origin: DVec3, center: DVec3, radius: f64) -> Option<f64> {
    let to_center = center - origin;
    let along = to_center.dot(axis);
    let half_chord_squared = radius * radius - (to_center - axis * along).length_squared();
    (half_chord_squared >= 0.0 && along + half_chord_squared.sqrt() >= 0.0)
        .then(|| (along - half_chord_squared.sqrt()).max(0.0))
}

/// A leaf's tangent disc, met by the ray.
#[derive(Clone, Copy, Debug)]
struct Patch {
    t: f64,
    radius: f64,
    /// 1 where the ray goes through the middle, 0 at the rim.
    weight: f64,
}

impl Patch {
    fn of(axis: DVec3, origin: DVec3, center: DVec3, normal: Vec3, radius: f64) -> Option<Self> {
        let normal = normal.as_dvec3();
        let slope = normal.dot(axis);
        if slope.abs() < 1e-3 {
            return None;
        }
        let t = (center - origin).dot(normal) / slope;
        let share = (origin + axis * t - center).length_squared() / (radius * radius);
        (share < 1.0 && t > 0.0).then_some(Self { t, radius, weight: (1.0 - share).powi(2) })
    }

    /// Behind this there is another surface.
    fn back(&self) -> f64 {
        self.t + 2.0 * self.radius
    }
}

/// The nearest surface of several patches that overlap: their mean, those in whose middle the ray is count most.
fn blend(met: &[Patch]) -> Option<Hit> {
    let back = met.iter().map(Patch::back).fold(f64::INFINITY, f64::min);
    let nearest = met.iter().filter(|patch| patch.t <= back);
    let (weight, t, radius) = nearest.fold((0.0, 0.0, 0.0_f64), |(weight, t, radius), patch| {
        (weight + patch.weight, t + patch.weight * patch.t, radius.max(patch.radius))
    });
    (weight > 0.0).then(|| Hit::on_ball(t / weight, radius))
}
