//! What a view has to say about a node: whether the picture shows where it is, how far off on the screen it may be drawn, whether all
//! of it shows its back.
//!
//! In: the camera in the model's space, a skeleton, a record. Out: a pixel error, or that the node is out of sight. No page is needed.
//! What always holds: the error is sound. Whoever sees a point of the node's surface, or of the original that it stands for, on the
//! screen, finds the other one no farther off than that; for records that make no sense it is infinite, never less than it should be.

use crate::ModelView;
use crate::splats::Cutting;
use gigalod_format::hybrid::{NodeId, NodeRecord, Skeleton};
use gigalod_geom::cone::NormalCone;
use gigalod_geom::projected;
use glam::DVec3;

/// A point is drawn as a disc that is `spacing` wide; so far it reaches, in spacings.
pub(super) const POINT_REACH: f64 = 0.5;

/// A hierarchy as one view sees it.
#[derive(Debug)]
pub(super) struct Look<'a> {
    skeleton: &'a Skeleton,
    frustum_culling: bool,
    /// What shows its back is hidden by what shows its front: of a closed surface, seen from outside.
    hides_backs: bool,
    /// The origin of local space, relative to the eye.
    origin_in_eye: DVec3,
    /// Of the root.
    step: f64,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Through the eye, pointing inwards.
    planes: [DVec3; 5],
    focal_px: f64,
    /// That of the picture's corners.
    largest_slope: f64,
}

/// A node that is in sight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sight {
    pub(super) node: u32,
    /// `error_total`, projected: how far off on the screen it may be drawn.
    pub(super) error_px: f32,
}

/// The box of a node's vertices and points; eye space, the model's axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeBox {
    pub(super) center: DVec3,
    pub(super) half: DVec3,
}

/// Positions of a node: where they count from, and how long a step is; eye space, the model's axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) min: DVec3,
    pub(super) step: f64,
}

impl<'a> Look<'a> {
    pub(super) fn new(view: &ModelView, skeleton: &'a Skeleton, cutting: Cutting) -> Self {
        let (camera, root) = (&view.camera, skeleton.root());
        let tan = camera.tan_half_fov();
        let (right, up, forward) = (camera.right, camera.up, camera.forward);
        Self {
            skeleton,
            frustum_culling: cutting.frustum_culling,
            hides_backs: root.closed && !root.bounds.contains(camera.eye),
            origin_in_eye: root.origin - camera.eye,
            step: root.edge * exp2(-i64::from(root.cell_bits)),
            right,
            up,
            forward,
            planes: [
                forward * tan.x + right,
                forward * tan.x - right,
                forward * tan.y + up,
                forward * tan.y - up,
                forward,
            ],
            focal_px: camera.focal_px(),
            largest_slope: tan.length(),
        }
    }

    /// The root, where it is in sight.
    pub(super) fn root(&self) -> Option<Sight> {
        self.see(0, self.skeleton.nodes().first()?)
    }

    /// The record of a node in sight.
    pub(super) fn record(&self, sight: Sight) -> &'a NodeRecord {
        self.skeleton.record(NodeId(sight.node))
    }

    /// A node, where it is in sight.
    pub(super) fn see(&self, node: u32, record: &NodeRecord) -> Option<Sight> {
        let NodeBox { center, half } = self.node_box(record);
        let [geo, total] = [record.error_geo, record.error_total].map(|error| f64::from(error).max(0.0));
        // What is below lies around the original, within an error that is not larger.
        let below = if record.children > 0 { total } else { 0.0 };
        let reach = half + geo + below + f64::from(record.spacing).max(0.0) * POINT_REACH;
        let is_outside = |inward: &DVec3| inward.dot(center) + inward.abs().dot(reach) < 0.0;
        if self.frustum_culling && self.planes.iter().any(is_outside) {
            return None;
        }
        // Whatever does not compare is as bad as can be.
        let shown = half + geo + f64::from(record.spacing).max(0.0) * POINT_REACH;
        let error_px = self.error_px(center, shown, f64::from(record.error_total)) as f32;
        Some(Sight { node, error_px: if error_px.is_nan() { f32::INFINITY } else { error_px } })
    }

    /// How far something of a box may shift on the screen that is off by `error`, where it is in the picture.
    fn error_px(&self, center: DVec3, half: DVec3, error: f64) -> f64 {
        let across = |axis: DVec3| axis.dot(center).abs() + axis.abs().dot(half);
        let depth = self.forward.dot(center) - self.forward.abs().dot(half);
        let own_slope = across(self.right).hypot(across(self.up)) / depth;
        let slope = if depth > 0.0 { own_slope.min(self.largest_slope) } else { self.largest_slope };
        // What is so far away and so near to the axis is as deep as that.
        let distance = (center.abs() - half).max(DVec3::ZERO).length();
        let depth = depth.max(distance / slope.hypot(1.0));
        projected::shift_px(slope, depth, error, self.focal_px)
    }

    /// True where nothing of the node's own triangles shows its front, and that hides it.
    pub(super) fn is_hidden(&self, record: &NodeRecord) -> bool {
        // Of points, cones say nothing.
        if !self.hides_backs || record.points > 0 {
            return false;
        }
        let NodeBox { center, half } = self.node_box(record);
        let cone = NormalCone { axis: record.cone_axis.into(), sin_half_angle: record.cone_sine };
        cone.faces_away(center.as_vec3(), (half.length() as f32).next_up())
    }

    /// The same of something in the picture that is no nearer to the eye than this.
    pub(super) fn error_px_beyond(&self, distance: f64, error: f64) -> f32 {
        let depth = distance / self.largest_slope.hypot(1.0);
        if depth == f64::INFINITY {
            0.0
        } else {
            projected::shift_px(self.largest_slope, depth, error, self.focal_px) as f32
        }
    }

    /// True where a point lies before the eye, not behind it.
    pub(super) fn is_before(&self, point: DVec3) -> bool {
        self.forward.dot(point) > 0.0
    }

    /// False where nothing that is no farther than this from what lies between some points is in the picture.
    pub(super) fn may_show(&self, points: &[DVec3], off: f64) -> bool {
        let is_outside = |inward: &DVec3| {
            let off = inward.length() * off;
            points.iter().all(|point| inward.dot(*point) + off < 0.0)
        };
        !self.planes.iter().any(is_outside)
    }

    /// Where a node's positions are.
    pub(super) fn grid(&self, record: &NodeRecord) -> Grid {
        let step = self.step * exp2(-i64::from(record.level));
        Grid { min: self.origin_in_eye + DVec3::from_array(record.min_steps.map(f64::from)) * step, step }
    }

    pub(super) fn node_box(&self, record: &NodeRecord) -> NodeBox {
        let Grid { min, step } = self.grid(record);
        let half = DVec3::from_array(record.extent_steps.map(f64::from)) * (step * 0.5);
        NodeBox { center: min + half, half }
    }

    /// Pixels of the picture that the rectangle around a node covers.
    pub(super) fn area_px(&self, record: &NodeRecord, width: f64, height: f64) -> f64 {
        let NodeBox { center, half } = self.node_box(record);
        let depth = self.forward.dot(center) - self.forward.abs().dot(half);
        if depth <= 0.0 {
            return width * height;
        }
        let side = |axis: DVec3, picture: f64| {
            let (middle, half) = (axis.dot(center), axis.abs().dot(half));
            // Of a box, as its middle plane has it.
            let scale = self.focal_px / self.forward.dot(center);
            let [from, to] = [middle - half, middle + half].map(|at| (at * scale).clamp(-picture * 0.5, picture * 0.5));
            to - from
        };
        side(self.right, width) * side(self.up, height)
    }
}

/// 2 to this, as exactly as there are numbers.
fn exp2(exponent: i64) -> f64 {
    2f64.powi(exponent.clamp(-2000, 2000) as i32)
}

#[cfg(test)]
#[path = "look_tests.rs"]
pub(super) mod tests;
