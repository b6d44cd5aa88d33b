// What a splat pass writes to the G-buffer, and a triangle that covers the picture.

struct Surface {
    @location(0) albedo: vec4f,
    @location(1) normal_footprint: vec4f,
    @location(2) depth_bits: u32,
    @builtin(frag_depth) depth_test: f32,
}

@vertex
fn cover_picture(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
