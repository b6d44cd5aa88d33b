//! Inputs of the splat passes. WGSL twins: `shader/splat_params.wgsl`.

use gigalod_geom::Camera;
use gigalod_runtime::{ModelView, Similarity};
use glam::DVec3;

/// How close to the eye something may come before it counts as being there, in world units. The depth buffer has the same
/// precision whatever this is, and as it is a power of two, near / z rounds the same way; in the middle of what a float holds,
/// so that worlds may be 2⁶⁰ times as large as this or as one.
pub(crate) const NEAR: f32 = 1.0 / (1u64 << 60) as f32;

/// Bytes from one [`PassParams`] or [`PartParams`] to the next: dynamic offsets are aligned to this on every device.
pub(crate) const STRIDE: u64 = 256;

/// One pass over one buffer of splats, into one band of rows.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct PassParams {
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
    /// 0: what is nearest. 1: what it is, or what is close to it.
    pub(crate) phase: u32,
    /// Splats whose window is wider or higher than this are drawn through the pipeline.
    pub(crate) compute_extent_px: u32,
    /// Which of the parts lie in this buffer of splats.
    pub(crate) first_part: u32,
    pub(crate) part_count: u32,
    /// 1: extents of splats are wanted too.
    pub(crate) wants_footprint: u32,
    /// Splats in this buffer.
    pub(crate) chunk_count: u32,
    pub(crate) pad: u32,
}

/// Consecutive splats of one instance in one buffer.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct PartParams {
    /// View axes, in the model's axes, times the length of a model unit in world units.
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) forward: [f32; 4],
    /// The model's axes, in world axes.
    pub(crate) model_x: [f32; 4],
    pub(crate) model_y: [f32; 4],
    pub(crate) model_z: [f32; 4],
    /// Number in the frame of its first splat, and where in the buffer that lies.
    pub(crate) first_number: u32,
    pub(crate) first_slot: u32,
    pub(crate) count: u32,
    /// World units in a model unit.
    pub(crate) world_from_model: f32,
    pub(crate) pad: [u32; 36],
}

impl PassParams {
    /// The whole picture, phase 0, no part.
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
            first_part: 0,
            part_count: 0,
            wants_footprint: 0,
            chunk_count: 0,
            pad: 0,
        }
    }
}

impl PartParams {
    /// An instance as a camera sees it; where its splats lie is still to be filled in.
    pub(crate) fn new(camera: &Camera, placement: &Similarity) -> Self {
        let view = ModelView::new(camera, placement).camera;
        let in_view = |axis: DVec3| four(axis * placement.scale);
        let in_world = |axis: DVec3| four(placement.rotation * axis);
        Self {
            right: in_view(view.right),
            up: in_view(view.up),
            forward: in_view(view.forward),
            model_x: in_world(DVec3::X),
            model_y: in_world(DVec3::Y),
            model_z: in_world(DVec3::Z),
            first_number: 0,
            first_slot: 0,
            count: 0,
            world_from_model: placement.scale as f32,
            pad: [0; 36],
        }
    }
}

/// A vector as a uniform holds it.
pub(crate) fn four(vector: DVec3) -> [f32; 4] {
    vector.as_vec3().extend(0.0).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shader;

    #[test]
    fn pass_params_have_one_layout() {
        shader::assert_same_layout!(
            PassParams,
            crate::splats::COMPUTE,
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
                first_part,
                part_count,
                wants_footprint,
                chunk_count,
                pad
            ]
        );
        assert!(size_of::<PassParams>() as u64 <= STRIDE);
    }

    #[test]
    fn part_params_have_one_layout_and_fill_a_stride() {
        shader::assert_same_layout!(
            PartParams,
            crate::splats::COMPUTE,
            [right, up, forward, model_x, model_y, model_z, first_number, first_slot, count, world_from_model]
        );
        assert_eq!(size_of::<PartParams>() as u64, STRIDE);
    }
}
