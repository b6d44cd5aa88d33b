//! Four siblings at a time: what the traversal decides about a group, in four lanes.
//!
//! In: a group's words and its parent's decoded ball. Out: masks of lanes, one bit each, lowest first.
//! What always holds: each lane is computed by the operations of [`super::plain`] and `geom` in their order, so every bit is the same.

use super::plain::Cutting;
use crate::ModelView;
use gigalod_format::splats::{Node, Root};
use gigalod_geom::quantise::{cone, normal, sphere};
use glam::{BVec4A, Mat4, Vec3, Vec4, Vec4Swizzles};

/// What is the same for all nodes of a hierarchy in a view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// [`ModelView::eye_in_local`].
    eye: [Vec3; 2],
    forward: Vec3,
    planes: [Vec3; 5],
    /// Twice the focal length, in pixels.
    double_focal_px: f32,
    threshold_px: f32,
    overhang: f32,
    frustum_culling: bool,
    /// Lanes that may be larger than the threshold.
    can_open: u32,
    backface_culling: bool,
    /// What shows its back is hidden by what shows its front: of a closed surface, seen from outside.
    hides_backs: bool,
    spheres: &'static [sphere::Relative],
    normals: &'static [Vec3],
}

/// What is known of all nodes of a group; bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Known(u8);

impl Known {
    /// They lie wholly inside the frustum, or nobody asks.
    const INSIDE: u8 = 1;
    /// They wholly face the eye, or nobody asks.
    const TOWARD: u8 = 2;
    /// They wholly face away, and are visited nevertheless.
    const AWAY: u8 = 4;
}

/// Four nodes, decided. Lanes beyond the group's number of nodes are in no mask.
pub(super) struct Decided {
    /// Centres in local space, and radii: x, y, z, radius, each of four nodes.
    local: [Vec4; 4],
    /// The same with centres relative to the eye.
    in_eye: [Vec4; 4],
    /// [`gigalod_geom::projected::diameter_px`].
    pub(super) diameter_px: Vec4,
    /// Outside the picture.
    pub(super) outside: u32,
    /// Shows its back, with all that is below it.
    pub(super) back: u32,
    /// Neither outside nor back.
    pub(super) seen: u32,
    /// Seen, and larger than the threshold.
    pub(super) coarse: u32,
    /// Would show its back if it were drawn.
    pub(super) hidden: u32,
    inside: u32,
    toward: u32,
    away: u32,
}

impl Decided {
    /// The decoded ball of each node, in local space.
    pub(super) fn local_balls(&self) -> [Vec4; 4] {
        transposed(self.local)
    }

    /// The decoded ball of each node, relative to the eye.
    pub(super) fn balls_in_eye(&self) -> [Vec4; 4] {
        transposed(self.in_eye)
    }

    /// What is known of the children of the node in `lane`.
    pub(super) fn known_below(&self, lane: u32) -> Known {
        Known(
            (self.inside >> lane & 1) as u8
                | ((self.toward >> lane & 1) << 1) as u8
                | ((self.away >> lane & 1) << 2) as u8,
        )
    }
}

#[inline(always)]
fn transposed(rows: [Vec4; 4]) -> [Vec4; 4] {
    let columns = Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
    [columns.x_axis, columns.y_axis, columns.z_axis, columns.w_axis]
}

impl Look {
    pub(super) fn new(view: &ModelView, root: &Root, cutting: Cutting, threshold_px: f32) -> Self {
        Self {
            eye: view.eye_in_local(root.origin),
            forward: view.forward,
            planes: *view.frustum.planes(),
            double_focal_px: 2.0 * view.focal_px,
            threshold_px,
            overhang: root.overhang,
            frustum_culling: cutting.frustum_culling,
            can_open: can_open(threshold_px),
            backface_culling: cutting.backface_culling,
            hides_backs: root.closed && !root.bounds.contains(view.camera.eye),
            spheres: sphere::table(),
            normals: normal::table(),
        }
    }

    /// Replaces the threshold.
    pub(super) fn set_threshold_px(&mut self, threshold_px: f32) {
        self.threshold_px = threshold_px;
        self.can_open = can_open(threshold_px);
    }

    /// What is known before anything is decoded.
    pub(super) fn known(&self) -> Known {
        let inside = if self.frustum_culling { 0 } else { Known::INSIDE };
        let toward = if self.hides_backs { 0 } else { Known::TOWARD };
        Known(inside | toward)
    }

    /// Decides about the first `count` ≤ 4 of `words`, the children of `parent` (x, y, z, radius; local space).
    #[inline(always)]
    pub(super) fn decide(&self, parent: Vec4, known: Known, words: &[u32; 4], count: u8) -> Decided {
        // Four loops in one: what is known of a group decides which questions are asked at all.
        let inside = known.0 & Known::INSIDE != 0;
        let ask_facing = known.0 & (Known::TOWARD | Known::AWAY) == 0;
        match (inside, ask_facing) {
            (true, false) => self.decide_knowing::<true, false>(parent, known, words, count),
            (true, true) => self.decide_knowing::<true, true>(parent, known, words, count),
            (false, false) => self.decide_knowing::<false, false>(parent, known, words, count),
            (false, true) => self.decide_knowing::<false, true>(parent, known, words, count),
        }
    }

    #[inline(always)]
    fn decide_knowing<const INSIDE: bool, const ASK_FACING: bool>(
        &self,
        parent: Vec4,
        known: Known,
        words: &[u32; 4],
        count: u8,
    ) -> Decided {
        let valid = (1u32 << count) - 1;
        let relative = transposed(words.map(|word| {
            let relative = &self.spheres[usize::from(Node(word).sphere()).min(sphere::CODES - 1)];
            relative.offset.extend(relative.scale)
        }));
        let parent_radius = parent.wwww();
        let local = [
            parent.xxxx() + relative[0] * parent_radius,
            parent.yyyy() + relative[1] * parent_radius,
            parent.zzzz() + relative[2] * parent_radius,
            parent_radius * relative[3],
        ];
        let radius = local[3];
        let [high, low] = self.eye;
        let x = local[0] - Vec4::splat(high.x) - Vec4::splat(low.x);
        let y = local[1] - Vec4::splat(high.y) - Vec4::splat(low.y);
        let z = local[2] - Vec4::splat(high.z) - Vec4::splat(low.z);
        let dot = |v: Vec3| Vec4::splat(v.x) * x + Vec4::splat(v.y) * y + Vec4::splat(v.z) * z;
        let distance_squared = x * x + y * y + z * z;
        let depth = dot(self.forward);
        let padded = radius * self.overhang;

        let (mut outside, mut now_inside) = (0, if INSIDE { 0xF } else { 0 });
        if !INSIDE {
            let nearest = self.planes.iter().map(|plane| dot(*plane)).reduce(Vec4::min).unwrap_or(Vec4::ZERO);
            outside = nearest.cmplt(-padded).bitmask();
            now_inside = !nearest.cmplt(padded).bitmask();
        }

        let (mut toward, mut away) = (0, 0);
        let mut hidden = 0;
        if ASK_FACING {
            let mut axes = [Vec4::ZERO; 4];
            for (axis, word) in axes.iter_mut().zip(words) {
                *axis = self.normals[usize::from(Node(*word).normal()).min(normal::CODES - 1)].extend(0.0);
            }
            let axes = transposed(axes);
            let along = axes[0] * x + axes[1] * y + axes[2] * z;
            let sin_alpha = Vec4::from_array(words.map(|word| cone::SINES[usize::from(Node(word).cone())]));
            let narrow = sin_alpha.cmplt(Vec4::ONE);
            // As `NormalCone::facing` of the padded ball.
            let clear = along.abs() - padded;
            let spread = sin_alpha + 2e-5;
            let sure = narrow & clear.cmpgt(Vec4::ZERO) & (clear * clear).cmpgt(distance_squared * spread * spread);
            let behind = along.cmpgt(Vec4::ZERO);
            away = (sure & behind).bitmask();
            toward = sure.bitmask() & !away;
            // As `NormalCone::faces_away` of the ball itself.
            let cos_alpha = (Vec4::ONE - sin_alpha * sin_alpha).sqrt();
            let distance = distance_squared.sqrt();
            let sin_beta = radius / distance;
            let cos_beta = (Vec4::ONE - sin_beta * sin_beta).max(Vec4::ZERO).sqrt();
            let sin_sum = sin_alpha * cos_beta + cos_alpha * sin_beta;
            let faces_away = narrow
                & distance_squared.cmpgt(radius * radius)
                & (cos_alpha * cos_beta).cmpgt(sin_alpha * sin_beta)
                & along.cmpgt(distance * (sin_sum + 1e-5));
            hidden = away | faces_away.bitmask() & !toward;
        } else if known.0 & Known::TOWARD != 0 {
            toward = 0xF;
        } else {
            (away, hidden) = (0xF, 0xF);
        }
        let outside = outside & valid;
        // What was known to face away before is visited nevertheless.
        let back = if ASK_FACING && self.backface_culling { away & valid & !outside } else { 0 };
        let seen = valid & !outside & !back;

        // As `projected::exceeds_px` and `projected::diameter_px`.
        let has_size = radius.cmpgt(Vec4::ZERO);
        let before_eye = depth.cmpgt(radius);
        let gap = (depth - radius) * (depth + radius);
        let reach = radius * self.double_focal_px;
        let tangent_squared = distance_squared - radius * radius;
        let limit = gap * self.threshold_px;
        let larger = (reach * reach * tangent_squared).cmpgt(limit * limit);
        let coarse = (has_size & (larger | !before_eye)).bitmask() & seen & self.can_open;
        let diameter_px = reach * tangent_squared.max(Vec4::ZERO).sqrt() / gap;
        let diameter_px = Vec4::select(before_eye, diameter_px, Vec4::INFINITY);
        let diameter_px = Vec4::select(has_size, diameter_px, Vec4::ZERO);
        Decided {
            local,
            in_eye: [x, y, z, radius],
            diameter_px,
            outside,
            back,
            seen,
            coarse,
            hidden: if self.hides_backs { hidden & seen } else { 0 },
            inside: now_inside,
            toward,
            away,
        }
    }
}

/// Nothing is larger than an infinite threshold, not even what reaches the eye.
fn can_open(threshold_px: f32) -> u32 {
    if threshold_px < f32::INFINITY { 0xF } else { 0 }
}

/// The lanes of `mask` of `values`, zero elsewhere.
#[inline(always)]
pub(super) fn keep(mask: u32, values: Vec4) -> Vec4 {
    let lane = |lane: u32| mask >> lane & 1 != 0;
    Vec4::select(BVec4A::new(lane(0), lane(1), lane(2), lane(3)), values, Vec4::ZERO)
}
