// splat_blend.wgsl: sums to G-buffer: the mean of what was blended.
//
// Draw      one triangle that covers the picture; the scissor cuts out the band.
// Reads     frame; keys, sums.
// Writes    as splat_resolve.wgsl; alpha is the sum of opacities, at most 1. Where that is below 1/2 there is no surface: the
//           depth is infinite, and what is drawn there later hides it.
// Limits    none beyond the baseline of WebGPU.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame: PassParams;
// Inverted number, nearness.
@group(0) @binding(4) var<storage, read> keys: array<vec2u>;
@group(0) @binding(5) var<storage, read> sums: array<u32>;

#import dot.wgsl
#import splat_shape.wgsl
#import nearness.wgsl
#import splat_nearness.wgsl
#import splat_surface.wgsl

fn sum_at(at: u32, carries: u32) -> f32 {
    return f32(sums[at]) + f32(carries) * 4294967296.0;
}

@fragment
fn resolve(@builtin(position) position: vec4f) -> Surface {
    let pixel = vec2u(position.xy);
    let at = (pixel.y - frame.first_row) * u32(frame.size_px.x) + pixel.x;
    let first = at * 10u;
    let carries = sums[first + 7u];
    let carries_normal = sums[first + 8u];
    let weight = sum_at(first, carries & 255u);
    if weight == 0.0 {
        discard;
    }
    let per_weight = 1.0 / (weight * 4095.0);
    let albedo = vec3f(
        sum_at(first + 1u, (carries >> 8u) & 255u),
        sum_at(first + 2u, (carries >> 16u) & 255u),
        sum_at(first + 3u, carries >> 24u),
    ) * per_weight;
    let normal = vec3f(
        sum_at(first + 4u, carries_normal & 1023u),
        sum_at(first + 5u, (carries_normal >> 10u) & 1023u),
        sum_at(first + 6u, carries_normal >> 20u),
    ) * per_weight * 2.0 - 1.0;
    let is_surface = weight >= 128.0;
    let z = depth_of(keys[at].y);
    var out: Surface;
    out.albedo = vec4f(albedo, min(weight / 256.0, 1.0));
    out.normal_footprint = vec4f(normal, select(0.0, bitcast<f32>(sums[first + 9u]), is_surface));
    out.depth_bits = select(0x7f800000u, bitcast<u32>(z), is_surface);
    out.depth_test = select(0.0, frame.near * (1.0 / z), is_surface);
    return out;
}
