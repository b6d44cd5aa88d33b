//! Inputs of the hybrid passes. WGSL twins: `shader/hybrid_params.wgsl` and, for what lies in textures, `shader/hybrid_store.wgsl`.

use crate::splats::params::NEAR;
use gigalod_format::hybrid::{NodeRecord, Skeleton};
use gigalod_geom::Camera;
use gigalod_runtime::hybrid::RANKS;
use gigalod_runtime::{ModelView, Similarity};
use glam::{DVec2, DVec3};

/// Primitives in a run, as a power of two; `RUN_LOG2` of hybrid_store.wgsl.
pub(crate) const RUN_LOG2: u32 = 10;

/// One pass over one slice of runs, into one band of rows.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct HybridParams {
    pub(crate) size_px: [f32; 2],
    /// Where in the picture the view axis meets it: as pixels are sampled, half of the size for their middles.
    pub(crate) middle_px: [f32; 2],
    /// Pixels covered by one unit of length seen from one unit away, and the inverse.
    pub(crate) focal_px: f32,
    pub(crate) per_focal_px: f32,
    /// World units.
    pub(crate) near: f32,
    /// The band: rows from the top.
    pub(crate) first_row: u32,
    pub(crate) end_row: u32,
    /// 0: what is nearest. 1: what it is.
    pub(crate) phase: u32,
    /// What is wider or higher than this goes to the list.
    pub(crate) compute_extent_px: u32,
    /// First run of the slice.
    pub(crate) first_run: u32,
    /// Runs of triangles come first, then those of points, then those of lines.
    pub(crate) first_point_run: u32,
    pub(crate) first_line_run: u32,
    /// Added to the ranks of pixels, so that those of a pixel's samples differ.
    pub(crate) turn: u32,
    pub(crate) pad: u32,
}

impl HybridParams {
    /// The whole picture, phase 0, no run.
    pub(crate) fn new(camera: &Camera, middle_px: [f32; 2]) -> Self {
        let focal_px = camera.focal_px();
        Self {
            size_px: [camera.size.width as f32, camera.size.height as f32],
            middle_px,
            focal_px: focal_px as f32,
            per_focal_px: (1.0 / focal_px) as f32,
            near: NEAR,
            first_row: 0,
            end_row: camera.size.height,
            phase: 0,
            compute_extent_px: 0,
            first_run: 0,
            first_point_run: 0,
            first_line_run: 0,
            turn: 0,
            pad: 0,
        }
    }
}

/// A node as a frame draws it: eight texels of four words.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct NodeParams {
    /// Its smallest corner, in steps of its level, relative to a point of the grid near the eye.
    pub(crate) offset: [i32; 3],
    /// Where in the pages they begin.
    pub(crate) positions_at: u32,
    pub(crate) normals_at: u32,
    pub(crate) triangles_at: u32,
    pub(crate) borders_at: u32,
    /// World units: how large points are at least.
    pub(crate) spacing: f32,
    /// View axes in the model's axes, times the length of a step in world units.
    pub(crate) right: [f32; 3],
    /// World units: half the width of lines.
    pub(crate) half_width: f32,
    pub(crate) up: [f32; 3],
    /// Vertices of its page; points come after them.
    pub(crate) vertices: u32,
    pub(crate) forward: [f32; 3],
    /// Pixels that show it: of these ranks, from | end << 8.
    pub(crate) ranks: u32,
    /// What brings steps from that point of the grid to the eye.
    pub(crate) to_eye: [f32; 3],
    pub(crate) pad_c: u32,
    /// The model's first two axes, in world axes.
    pub(crate) model_x: [f32; 3],
    /// What a step of a normal's code is, of 2.
    pub(crate) normal_step: f32,
    pub(crate) model_y: [f32; 3],
    /// 8-bit sRGB, red lowest; the highest byte is 0 where this is the colour, and 255 where vertices have colours.
    pub(crate) color: u32,
}

/// Texels of a node; `NODE_TEXELS` of hybrid_store.wgsl.
pub(crate) const NODE_TEXELS: u64 = (size_of::<NodeParams>() / 16) as u64;

/// Farther away than this, in steps, the grid is not told apart.
const MOST_STEPS: f64 = (1 << 30) as f64;

/// A model as a camera sees it.
pub(crate) struct Seen<'a> {
    placement: &'a Similarity,
    view: ModelView,
    skeleton: &'a Skeleton,
}

impl<'a> Seen<'a> {
    pub(crate) fn new(camera: &Camera, placement: &'a Similarity, skeleton: &'a Skeleton) -> Self {
        Self { placement, view: ModelView::new(camera, placement), skeleton }
    }

    /// A node; where its page lies and its colour are still to be filled in.
    pub(crate) fn node(&self, record: &NodeRecord) -> NodeParams {
        let step = self.skeleton.step(record.level);
        let camera = &self.view.camera;
        // The same for all nodes of a level, so that equal places are equal numbers.
        let eye = (camera.eye - self.skeleton.root().origin) / step;
        let near_eye = eye.round().clamp(DVec3::splat(-MOST_STEPS), DVec3::splat(MOST_STEPS));
        let offset = record.min_steps.map(f64::from);
        let offset = (DVec3::from_array(offset) - near_eye).clamp(DVec3::splat(-MOST_STEPS), DVec3::splat(MOST_STEPS));
        let axis = |axis: DVec3| (axis * (self.placement.scale * step)).as_vec3().to_array();
        let in_world = |axis: DVec3| (self.placement.rotation * axis).as_vec3().to_array();
        NodeParams {
            offset: offset.to_array().map(|x| x as i32),
            positions_at: 0,
            normals_at: 0,
            triangles_at: 0,
            borders_at: 0,
            spacing: (f64::from(record.spacing) * self.placement.scale) as f32,
            right: axis(camera.right),
            half_width: (line_half_width(record) * self.placement.scale) as f32,
            up: axis(camera.up),
            vertices: record.vertices,
            forward: axis(camera.forward),
            ranks: u32::from(RANKS) << 8,
            to_eye: (near_eye - eye).as_vec3().to_array(),
            pad_c: 0,
            model_x: in_world(DVec3::X),
            normal_step: (2.0 / f64::from((1u32 << self.skeleton.root().normal_bits.min(31)) - 1)) as f32,
            model_y: in_world(DVec3::Y),
            color: 0,
        }
    }

    /// Smallest corner and extent of a node, model space.
    fn bounds(&self, record: &NodeRecord) -> [DVec3; 2] {
        let step = self.skeleton.step(record.level);
        let low = self.skeleton.root().origin + DVec3::from_array(record.min_steps.map(f64::from)) * step;
        [low, DVec3::from_array(record.extent_steps.map(f64::from)) * step]
    }

    /// Where in the picture a node may show: smallest and largest place, in pixels; everywhere if it reaches the plane of the eye.
    pub(crate) fn window_px(&self, record: &NodeRecord) -> [DVec2; 2] {
        let [low, extent] = self.bounds(record);
        let camera = &self.view.camera;
        // Points and lines stick out.
        let margin = f64::from(record.spacing) + line_half_width(record);
        let mut window = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        for corner in 0..8u32 {
            let part = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
            let view = camera.view_point(low - margin + (extent + 2.0 * margin) * part);
            // Written so that what is no number is everywhere.
            let is_before_eye = view.z > margin * 1e-3;
            if !is_before_eye {
                return [DVec2::NEG_INFINITY, DVec2::INFINITY];
            }
            let px = camera.pixel_of_view_point(view);
            window = [window[0].min(px), window[1].max(px)];
        }
        // Places are rounded.
        [window[0] - 2.0, window[1] + 2.0]
    }
}

/// Half the width of a node's lines, model units. Each side of a gap covers what its own error opens; leaves of a finer level or of
/// the same, which draw no lines, are rounded to a smaller grid, and that is covered from here.
fn line_half_width(record: &NodeRecord) -> f64 {
    let beside = if record.children == 0 { 1.5 } else { 1.0625 };
    f64::from(record.error_geo) * beside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shader;
    use crate::splats::params::STRIDE;

    #[test]
    fn hybrid_params_have_one_layout() {
        shader::assert_same_layout!(
            HybridParams,
            crate::hybrid::SMALL,
            [
                size_px,
                middle_px,
                focal_px,
                per_focal_px,
                near,
                first_row,
                end_row,
                phase,
                compute_extent_px,
                first_run,
                first_point_run,
                first_line_run,
                turn,
                pad
            ]
        );
        assert!(size_of::<HybridParams>() as u64 <= STRIDE);
    }

    #[test]
    fn a_node_is_whole_texels_as_the_shaders_read_them() {
        let text = include_str!("../shader/hybrid_store.wgsl");
        assert!(text.contains(&format!("const NODE_TEXELS: u32 = {NODE_TEXELS}u;")));
        assert!(text.contains(&format!("const RUN_LOG2: u32 = {RUN_LOG2}u;")));
        let fade = include_str!("../shader/hybrid_fade.wgsl");
        assert!(fade.contains(&format!("const RANKS: u32 = {RANKS}u;")));
        let at = |offset: usize| (offset / 16, offset % 16 / 4);
        use std::mem::offset_of;
        assert_eq!(at(offset_of!(NodeParams, positions_at)), (0, 3));
        assert_eq!(at(offset_of!(NodeParams, normals_at)), (1, 0));
        assert_eq!(at(offset_of!(NodeParams, spacing)), (1, 3));
        assert_eq!(at(offset_of!(NodeParams, right)), (2, 0));
        assert_eq!(at(offset_of!(NodeParams, half_width)), (2, 3));
        assert_eq!(at(offset_of!(NodeParams, up)), (3, 0));
        assert_eq!(at(offset_of!(NodeParams, vertices)), (3, 3));
        assert_eq!(at(offset_of!(NodeParams, forward)), (4, 0));
        assert_eq!(at(offset_of!(NodeParams, ranks)), (4, 3));
        assert_eq!(at(offset_of!(NodeParams, to_eye)), (5, 0));
        assert_eq!(at(offset_of!(NodeParams, model_x)), (6, 0));
        assert_eq!(at(offset_of!(NodeParams, normal_step)), (6, 3));
        assert_eq!(at(offset_of!(NodeParams, model_y)), (7, 0));
        assert_eq!(at(offset_of!(NodeParams, color)), (7, 3));
    }
}
