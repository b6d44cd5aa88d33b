// smooth.wgsl: what pictures sampled at several places of each pixel add up to.
//
// Draw      one triangle that covers the picture.
// Reads     the sum, in linear light, of pictures that each were given their share.
// Writes    the picture, in linear light; the target encodes it as sRGB.
// Limits    none beyond the baseline of WebGPU.

@group(0) @binding(0) var sum: texture_2d<f32>;

@vertex
fn cover_picture(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn smoothed(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(textureLoad(sum, vec2u(position.xy), 0).rgb, 1.0);
}
