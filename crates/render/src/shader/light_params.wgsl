// Inputs of the lighting pass. Host twin: `LightParams` in light.rs; a test compares them.
struct LightParams {
    // View axes, in world axes.
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    // Unit vector towards the light, in world axes.
    towards_light: vec4f,
    // Linear light.
    light: vec4f,
    // Linear light; alpha 1.
    background: vec4f,
    size_px: vec2f,
    focal_px: f32,
    ambient: f32,
}
