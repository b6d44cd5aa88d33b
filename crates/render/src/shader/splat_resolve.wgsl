// splat_resolve.wgsl: keys to G-buffer, for the splats of one buffer.
//
// Draw      one triangle that covers the picture; the scissor cuts out the band.
// Reads     frame, parts; found keys; balls, normals and colours.
// Writes    albedo (linear; alpha 1), normal (world; w = largest distance between two pixels of the splat), depth (the bits of
//           z, world units), depth test (near / z: 1 at the near plane, 0 at infinity).
// Limits    none beyond the baseline of WebGPU.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame: PassParams;
// The first part of the buffer; and all.
@group(0) @binding(1) var<uniform> part: PartParams;
@group(0) @binding(8) var<storage, read> parts: array<PartParams>;
// Inverted number, nearness; in rows as long as those of the store.
@group(0) @binding(9) var found: texture_2d<u32>;

// True where splats of several instances are to be told apart: rare, and slow on some devices.
override is_shared: bool = true;
// True where extents of splats are wanted too.
override wants_footprint: bool = true;

#import splat_store.wgsl
#import dot.wgsl
#import splat_shape.wgsl
#import nearness.wgsl
#import splat_nearness.wgsl
#import splat_parts.wgsl
#import splat_surface.wgsl

@fragment
fn resolve(@builtin(position) position: vec4f) -> Surface {
    let pixel = vec2u(position.xy);
    let at = (pixel.y - frame.first_row) * u32(frame.size_px.x) + pixel.x;
    let key = textureLoad(found, texel_of(at), 0).xy;
    let number = ~key.x;
    // Of this buffer's splats, in which numbers and places run alike? A smaller number wraps around.
    let slot = number - part.first_number;
    if key.y == 0u || slot >= frame.chunk_count {
        discard;
    }
    let normal_color = normal_color_at(slot);
    let normal_code = normal_color & 0x3fffu;
    var normal: vec3f;
    var footprint_px = 0.0;
    if is_shared {
        let found = part_of_slot(slot);
        normal = normal_in_world(parts[found], normal_code);
        if wants_footprint {
            footprint_px = footprint_of(shape_of(parts[found], ball_at(slot), normal_code));
        }
    } else {
        normal = normal_in_world(part, normal_code);
        if wants_footprint {
            footprint_px = footprint_of(shape_of(part, ball_at(slot), normal_code));
        }
    }
    let z = depth_of(key.y);
    var out: Surface;
    out.albedo = vec4f(color_of(normal_color >> 16u), 1.0);
    out.normal_footprint = vec4f(normal, footprint_px);
    out.depth_bits = bitcast<u32>(z);
    out.depth_test = frame.near * (1.0 / z);
    return out;
}
