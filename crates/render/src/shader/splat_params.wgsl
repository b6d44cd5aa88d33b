// Inputs of the splat pass. Host twin: `SplatParams` in splats.rs; a test compares them.
struct SplatParams {
    // View axes, in the model's axes.
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    // The model's axes, in world axes.
    model_x: vec4f,
    model_y: vec4f,
    model_z: vec4f,
    size_px: vec2f,
    // Pixels covered by one unit of length seen from one unit away.
    focal_px: f32,
    // World units.
    near: f32,
    // World units in a model unit.
    world_from_model: f32,
    kernel: u32,
    pad: vec2u,
}

const KERNEL_SQUARE: u32 = 0u;
const KERNEL_ROUND: u32 = 1u;
