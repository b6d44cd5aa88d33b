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
    // Where in the picture the view axis meets it.
    middle_px: vec2f,
    focal_px: f32,
    ambient: f32,
    // What this picture is of a sum of several.
    share: f32,
    pad_a: f32,
    pad_b: f32,
    pad_c: f32,
}
