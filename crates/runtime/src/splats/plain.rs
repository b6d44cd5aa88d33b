//! The traversal as one would write it down: from the root to what is small enough on screen, one node after the other.
//!
//! The judge of the fast one: [`super::SplatSelector`] gives the same splats in the same order and the same report, which tests
//! hold against this. It also says of each node why it is left out, which nobody needs who only draws.
//!
//! Work goes by groups of siblings, because a group shares one pointer. A group on the stack knows its parent's decoded
//! sphere, from which its own are decoded on the way; the stack is explicit, so that the depth of a hostile tree costs no
//! call stack, and it is kept from frame to frame.
//!
//! What always holds, whatever the file says: each leaf lies below exactly one node that is drawn or culled; a traversal
//! visits no more nodes than the file claims to have; it never waits.

use crate::report::{CutReport, Limit};
use crate::residency::Residency;
use crate::selection::SelectInput;
use gigalod_format::splats::{Children, Node, PageId, WordIndex};
use gigalod_geom::cone::{Facing, NormalCone};
use gigalod_geom::frustum::Side;
use gigalod_geom::quantise::{cone, normal, sphere};
use gigalod_geom::{Sphere, projected};
use glam::Vec3;

/// How to cut. Culling changes the time it takes, never the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cutting {
    /// Leave out what lies outside the picture.
    pub frustum_culling: bool,
    /// Leave out whole subtrees that show their back (closed models, seen from outside their bounds).
    pub backface_culling: bool,
}

impl Default for Cutting {
    fn default() -> Self {
        Self { frustum_culling: true, backface_culling: true }
    }
}

/// A node the traversal has decided about.
#[derive(Clone, Copy, Debug)]
pub struct VisitedNode {
    /// As stored.
    pub node: Node,
    /// 5-6-5, where the file has colours.
    pub color: Option<u16>,
    /// Decoded centre, relative to the eye.
    pub center_in_eye: Vec3,
    /// Decoded radius.
    pub radius: f32,
    /// 0 for the root.
    pub level: u32,
    /// Where it is stored.
    pub place: (PageId, WordIndex),
}

/// Why a node is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culled {
    /// It lies outside the picture.
    Frustum,
    /// It shows its back.
    Backface,
}

/// Receives a cut.
pub trait CutSink {
    /// Draw this node.
    fn draw(&mut self, node: &VisitedNode);

    /// Leave this node out, with all below it.
    fn cull(&mut self, _node: &VisitedNode, _why: Culled) {}

    /// With this page a node that is drawn with an error of `error_px` could be drawn better.
    fn miss(&mut self, page: PageId, error_px: f32);
}

/// Groups to visit; kept by the caller so that a warm traversal allocates nothing.
#[derive(Debug, Default)]
pub struct Work {
    stack: Vec<Group>,
}

/// Siblings still to be visited.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// Decoded; local space.
    parent: Sphere,
    page: PageId,
    word: WordIndex,
    level: u16,
    count: u8,
    /// The parent lies wholly inside the frustum.
    inside: bool,
    /// The parent wholly faces the eye, or backfaces are not to be culled at all.
    toward: bool,
    /// The parent wholly faces away, and is visited nevertheless. A node's own cone may be wider than its parent's allows it to
    /// be, so what is known of the parent is remembered.
    away: bool,
}

/// Cuts one hierarchy for one view.
pub fn cut(input: &SelectInput<'_>, cutting: &Cutting, work: &mut Work, sink: &mut impl CutSink) -> CutReport {
    let residency = input.residency;
    let mut report = CutReport { threshold_px: input.threshold_px, ..CutReport::default() };
    let Some((file, ..)) = residency.splats(input.file) else { return report };
    let root = file.skeleton().root();
    if residency.page(input.file, PageId(0)).is_none() {
        // Nothing but the skeleton to draw from: the root ball.
        let [high, low] = input.view.eye_in_local(root.origin);
        let center = root.sphere.center - high - low;
        let px = projected::diameter_px(
            center.dot(input.view.forward),
            center.length_squared(),
            root.sphere.radius,
            input.view.focal_px,
        );
        sink.miss(PageId(0), px);
        // The skeleton has no normal for it: it faces whoever looks.
        let facing = normal::encode(-center);
        let visited = VisitedNode {
            node: Node::pack(sphere::SELF, facing, 3, Children::NONE),
            color: None,
            center_in_eye: center,
            radius: root.sphere.radius,
            level: 0,
            place: (PageId(0), WordIndex(0)),
        };
        report.drew(px, Some(Limit::Residency));
        sink.draw(&visited);
        return report;
    }
    // What shows its back is hidden by what shows its front: of a closed surface, seen from outside.
    let hides_backs = root.closed && !root.bounds.contains(input.view.camera.eye);
    let mut traversal = Traversal {
        residency,
        input,
        frustum_culling: cutting.frustum_culling,
        backface_culling: cutting.backface_culling,
        hides_backs,
        eye: input.view.eye_in_local(root.origin),
        overhang: root.overhang,
        max_nodes: root.nodes,
        report,
        spheres: sphere::table(),
    };
    work.stack.clear();
    work.stack.push(Group {
        parent: root.sphere,
        page: PageId(0),
        word: WordIndex(0),
        level: 0,
        count: 1,
        inside: !cutting.frustum_culling,
        toward: !hides_backs,
        away: false,
    });
    while let Some(group) = work.stack.pop() {
        let below = work.stack.len();
        if !traversal.visit(&group, &mut work.stack, sink) {
            traversal.report.inconsistent = true;
            break;
        }
        // So that the first is visited first.
        work.stack[below..].reverse();
    }
    traversal.report
}

struct Traversal<'a> {
    residency: &'a Residency,
    input: &'a SelectInput<'a>,
    frustum_culling: bool,
    backface_culling: bool,
    hides_backs: bool,
    eye: [Vec3; 2],
    overhang: f32,
    max_nodes: u64,
    report: CutReport,
    spheres: &'static [sphere::Relative],
}

impl Traversal<'_> {
    /// Decides about the nodes of a group. False where the file is inconsistent and the traversal must end.
    fn visit(&mut self, group: &Group, stack: &mut Vec<Group>, sink: &mut impl CutSink) -> bool {
        let Some(page) = self.residency.page(self.input.file, group.page) else {
            return true;
        };
        let start = usize::from(group.word.0);
        let end = start + usize::from(group.count);
        let Some(words) = page.words().get(start..end) else {
            return false;
        };
        self.report.visited += u64::from(group.count);
        if self.report.visited > self.max_nodes {
            return false;
        }
        // The group's pointer follows it, if any of its nodes has children.
        let family = page.words().get(end).map(|word| page.family(*word));
        // Words of the family that lie before the group below the node at hand.
        let mut before = 0;
        for (at, word) in words.iter().enumerate() {
            let node = Node(*word);
            let children = node.children();
            let ball = sphere::decode_with(self.spheres, &group.parent, node.sphere());
            let center_in_eye = ball.center - self.eye[0] - self.eye[1];
            let visited = VisitedNode {
                node,
                color: page.colors().get(start + at).copied(),
                center_in_eye,
                radius: ball.radius,
                level: u32::from(group.level),
                place: (group.page, WordIndex((start + at) as u16)),
            };
            let skipped = before;
            before += children.words() as u16;

            let (mut inside, mut toward, mut away) = (group.inside, group.toward, group.away);
            let padded = ball.radius * self.overhang;
            if !inside {
                match self.input.view.frustum.side(center_in_eye, padded) {
                    Side::Outside => {
                        self.report.culled_frustum += 1;
                        sink.cull(&visited, Culled::Frustum);
                        continue;
                    }
                    Side::Inside => inside = self.frustum_culling,
                    Side::Crossing => {}
                }
            }
            if !toward && !away {
                match self.cone(node).facing(center_in_eye, padded) {
                    Facing::Away if self.backface_culling => {
                        self.report.culled_backface += 1;
                        sink.cull(&visited, Culled::Backface);
                        continue;
                    }
                    Facing::Away => away = true,
                    Facing::Toward => toward = true,
                    Facing::Unsure => {}
                }
            }

            let depth = center_in_eye.dot(self.input.view.forward);
            let distance_squared = center_in_eye.length_squared();
            let focal_px = self.input.view.focal_px;
            let threshold_px = self.input.threshold_px;
            let coarse = projected::exceeds_px(depth, distance_squared, ball.radius, focal_px, threshold_px);
            let error_px = || projected::diameter_px(depth, distance_squared, ball.radius, focal_px);
            let limit = if !coarse {
                None
            } else if children.count == 0 {
                Some(Limit::Data)
            } else {
                let Some(below) = family else {
                    return false;
                };
                if let Some(page_below) = self.residency.page(self.input.file, below.page) {
                    let Some(first) = page_below.family_word(below.family) else {
                        return false;
                    };
                    stack.push(Group {
                        parent: ball,
                        page: below.page,
                        word: WordIndex(first.0.saturating_add(skipped)),
                        level: group.level.saturating_add(1),
                        count: children.count,
                        inside,
                        toward,
                        away,
                    });
                    continue;
                }
                sink.miss(below.page, error_px());
                Some(Limit::Residency)
            };
            // Also with culling off, so that the picture is the same: hidden splats are not part of it.
            let hidden = away || !toward && self.cone(node).faces_away(center_in_eye, ball.radius);
            if self.hides_backs && hidden {
                self.report.culled_backface += 1;
                sink.cull(&visited, Culled::Backface);
                continue;
            }
            self.report.drew(error_px(), limit);
            sink.draw(&visited);
        }
        true
    }

    fn cone(&self, node: Node) -> NormalCone {
        NormalCone { axis: normal::decode(node.normal()), sin_half_angle: cone::SINES[usize::from(node.cone())] }
    }
}
