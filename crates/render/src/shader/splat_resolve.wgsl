// splat_resolve.wgsl: keys to G-buffer, for the splats of one buffer.
//
// Draw      one triangle that covers the picture; the scissor cuts out the band.
// Reads     frame, parts; keys; balls, normals and colours.
// Writes    albedo (linear; alpha 1), normal (world; w = largest distance between two pixels of the splat), depth (the bits of
//           z, world units), depth test (near / z: 1 at the near plane, 0 at infinity).
// Limits    none beyond the baseline of WebGPU.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame: PassParams;
@group(0) @binding(1) var<storage, read> parts: array<PartParams>;
@group(0) @binding(2) var<storage, read> balls: array<vec4f>;
@group(0) @binding(3) var<storage, read> normal_colors: array<u32>;
// Inverted number, nearness.
@group(0) @binding(4) var<storage, read> keys: array<vec2u>;

#import splat_shape.wgsl
#import splat_nearness.wgsl
#import splat_parts.wgsl
#import splat_surface.wgsl

@fragment
fn resolve(@builtin(position) position: vec4f) -> Surface {
    let pixel = vec2u(position.xy);
    let key = keys[(pixel.y - frame.first_row) * u32(frame.size_px.x) + pixel.x];
    let number = ~key.x;
    let last = parts[frame.first_part + frame.part_count - 1u];
    let first_number = parts[frame.first_part].first_number;
    // Of this buffer's splats, in which numbers and places run alike? A smaller number wraps around.
    if key.y == 0u || number - first_number >= last.first_number - first_number + last.count {
        discard;
    }
    let slot = parts[frame.first_part].first_slot + (number - first_number);
    let part = parts[part_of_slot(slot)];
    let normal_color = normal_colors[slot];
    var footprint_px = 0.0;
    if frame.wants_footprint == 1u {
        footprint_px = footprint_of(shape_of(part, balls[slot], normal_color & 0x3fffu));
    }
    let z = depth_of(key.y);
    var out: Surface;
    out.albedo = vec4f(color_of(normal_color >> 16u), 1.0);
    out.normal_footprint = vec4f(normal_in_world(part, normal_color & 0x3fffu), footprint_px);
    out.depth_bits = bitcast<u32>(z);
    out.depth_test = frame.near / z;
    return out;
}
