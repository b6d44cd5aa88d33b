// splat_compute.wgsl: draws small splats into the keys of a band, and lists the large ones.
//
// Dispatch  one invocation a splat of one part, in rows of ROW invocations.
// Reads     frame, part; balls; normals and colours where the kernel needs them.
// Writes    keys (and sums); list of large splats and how many there are (`DrawIndirectArgs`).
// Limits    none beyond the baseline of WebGPU with 32-bit keys; 64-bit ones need `SHADER_INT64_ATOMIC_MIN_MAX`.
//
// A splat that finds the list full is drawn here like a small one: it only takes longer.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame: PassParams;
@group(0) @binding(1) var<uniform> part: PartParams;
@group(0) @binding(2) var<storage, read> balls: array<vec4f>;
@group(0) @binding(3) var<storage, read> normal_colors: array<u32>;
@group(0) @binding(6) var<storage, read_write> list: array<u32>;
@group(0) @binding(7) var<storage, read_write> draw: DrawIndirect;

struct DrawIndirect {
    vertex_count: u32,
    instance_count: atomic<u32>,
    first_vertex: u32,
    first_instance: u32,
}

#import splat_shape.wgsl
#import splat_nearness.wgsl
#import splat_target.wgsl

const ROW: u32 = 2097152u;

@compute @workgroup_size(64)
fn draw_small(@builtin(global_invocation_id) id: vec3u) {
    let place = id.y * ROW + id.x;
    if place >= part.count {
        return;
    }
    let slot = part.first_slot + place;
    var normal_color = 0u;
    if is_elliptical() || blends() {
        normal_color = normal_colors[slot];
    }
    let splat = splat_of(part, balls[slot], normal_color, part.first_number + place);
    let window = splat.shape.window;
    let extent = window.zw - window.xy;
    if min(extent.x, extent.y) <= 0 {
        return;
    }
    if u32(max(extent.x, extent.y)) > frame.compute_extent_px {
        let entry = atomicAdd(&draw.instance_count, 1u);
        if entry < frame.list_capacity {
            list[entry] = slot;
            return;
        }
        // Whoever finds the list full takes back what it added: the count ends at the capacity.
        atomicSub(&draw.instance_count, 1u);
    }
    let width = i32(frame.size_px.x);
    for (var y = window.y; y < window.w; y++) {
        for (var x = window.x; x < window.z; x++) {
            let meeting = meet(splat.shape, vec2i(x, y));
            if meeting.covered {
                deliver(u32((y - i32(frame.first_row)) * width + x), meeting, splat);
            }
        }
    }
}
