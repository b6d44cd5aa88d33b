// splat_compute.wgsl: draws small splats into the keys of a band, and lists the large ones.
//
// Dispatch  the splats of one part, up to EACH an invocation.
// Reads     frame, part; balls; normals and colours where the kernel needs them.
// Writes    keys (and sums); list of large splats and how many there are (`DrawIndirectArgs`).
// Limits    none beyond the baseline of WebGPU with 32-bit keys; 64-bit ones need `SHADER_INT64_ATOMIC_MIN_MAX`.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame_params: PassParams;
@group(0) @binding(1) var<uniform> part_params: PartParams;
@group(0) @binding(6) var<storage, read_write> list: array<u32>;
@group(0) @binding(7) var<storage, read_write> draw: DrawIndirect;

struct DrawIndirect {
    vertex_count: u32,
    instance_count: atomic<u32>,
    first_vertex: u32,
    first_instance: u32,
}

// Copies, so that they are read once and not for each splat and pixel.
var<private> frame: PassParams;
var<private> part: PartParams;

#import splat_store.wgsl
#import dot.wgsl
#import splat_shape.wgsl
#import nearness.wgsl
#import splat_nearness.wgsl
#import splat_target.wgsl

// Invocations in a workgroup, splats that one invocation draws one after the other: starting an invocation costs as much as
// drawing a small splat.
const GROUP: u32 = 64u;
const EACH: u32 = 16u;

// 0: all splats. 1: every FEW-th. 2: the others.
override round: u32 = 0u;
const FEW: u32 = 4u;

// How many of its splats an invocation draws in this round, and which of its workgroup's are drawn, counted through.
fn turns() -> u32 {
    if round == 0u {
        return EACH;
    }
    return select(EACH - EACH / FEW, EACH / FEW, round == 1u);
}

fn drawn_in_round(index: u32) -> u32 {
    if round == 0u {
        return index;
    }
    return select(index + index / (FEW - 1u) + 1u, index * FEW, round == 1u);
}

@compute @workgroup_size(GROUP)
fn draw_small(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) member: u32) {
    frame = frame_params;
    part = part_params;
    // Neighbours in memory are drawn by neighbours in the workgroup.
    let first = group.x * (GROUP * EACH);
    // A bit for each large one. They are listed together, because a processor that runs invocations in lockstep takes its time
    // for each atomic operation, whether or not any of them gets there.
    var large = 0u;
    for (var turn = 0u; turn < turns(); turn++) {
        let place = first + drawn_in_round(turn * GROUP + member);
        if place < part.count && !draw_if_small(place) {
            large |= 1u << turn;
        }
    }
    while large != 0u {
        let place = first + drawn_in_round(countTrailingZeros(large) * GROUP + member);
        large &= large - 1u;
        // There is room for all.
        list[atomicAdd(&draw.instance_count, 1u)] = part.first_slot + place;
    }
}

// Draws a splat unless it is large: then false.
fn draw_if_small(place: u32) -> bool {
    let slot = part.first_slot + place;
    var normal_color = 0u;
    if is_elliptical() || blends() {
        normal_color = normal_color_at(slot);
    }
    let splat = splat_of(part, ball_at(slot), normal_color, part.first_number + place);
    let window = splat.shape.window;
    let extent = vec2u(window.zw - window.xy);
    if min(extent.x, extent.y) == 0u {
        return true;
    }
    if max(extent.x, extent.y) > frame.compute_extent_px {
        return false;
    }
    let width = i32(frame.size_px.x);
    // One loop, left at its end: a processor that runs invocations in lockstep goes through it as often as the largest splat
    // has pixels, and not once more.
    var pixel = window.xy;
    loop {
        let meeting = meet(splat.shape, pixel);
        if meeting.covered {
            deliver(u32((pixel.y - i32(frame.first_row)) * width + pixel.x), meeting, splat);
        }
        pixel.x++;
        if pixel.x == window.z {
            pixel = vec2i(window.x, pixel.y + 1);
        }
        continuing {
            break if pixel.y >= window.w;
        }
    }
    return true;
}
