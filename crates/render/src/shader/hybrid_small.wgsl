// hybrid_small.wgsl: draws small triangles, points or lines into the keys of a band, and lists the large ones.
//
// Dispatch  a workgroup for each run of the slice.
// Reads     frame; runs, nodes, pages; for lines, what was drawn before.
// Writes    keys; list of what is large, by number, and how much that is.
// Limits    none beyond the baseline of WebGPU with 32-bit keys; 64-bit ones need `SHADER_INT64_ATOMIC_MIN_MAX`.

#import hybrid_params.wgsl

@group(0) @binding(0) var<uniform> frame_params: HybridParams;
@group(0) @binding(6) var<storage, read_write> list: array<u32>;
@group(0) @binding(7) var<storage, read_write> dispatch: DispatchIndirect;

struct DispatchIndirect {
    groups: atomic<u32>,
    shares: u32,
    one: u32,
    count: atomic<u32>,
}

// A copy, so that it is read once and not for each pixel.
var<private> frame: HybridParams;

#import hybrid_kinds.wgsl
#import dot.wgsl
#import hybrid_store.wgsl
#import hybrid_place.wgsl
#import hybrid_triangle.wgsl
#import hybrid_spots.wgsl
#import hybrid_gaps.wgsl
#import hybrid_fade.wgsl
#import nearness.wgsl
#import hybrid_target.wgsl
#import splat_target.wgsl

const GROUP: u32 = 64u;
// Workgroups that can be dispatched in a direction.
const MOST_GROUPS: u32 = 65535u;

@compute @workgroup_size(GROUP)
fn draw_small(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) member: u32) {
    frame = frame_params;
    let run_index = frame.first_run + group.x;
    let run = run_at(run_index);
    let node = node_at(run.node);
    // A bit for each large one; they are listed together, as in splat_compute.wgsl.
    var large = 0u;
    let turns = (run.count + GROUP - 1u) / GROUP;
    for (var turn = 0u; turn < turns; turn++) {
        let place = turn * GROUP + member;
        if place < run.count {
            let number = (run_index << RUN_LOG2) | place;
            var is_done: bool;
            if kind == TRIANGLES {
                is_done = draw_triangle(node, run.first + place, number);
            } else {
                is_done = draw_spot(node, run.first + place, number);
            }
            large |= select(1u << turn, 0u, is_done);
        }
    }
    while large != 0u {
        let place = countTrailingZeros(large) * GROUP + member;
        large &= large - 1u;
        // There is room for all.
        let slot = atomicAdd(&dispatch.count, 1u);
        list[slot] = (run_index << RUN_LOG2) | place;
        atomicMax(&dispatch.groups, min(slot + 1u, MOST_GROUPS));
    }
}

fn key_of(pixel: vec2i) -> u32 {
    return u32((pixel.y - i32(frame.first_row)) * i32(frame.size_px.x) + pixel.x);
}

// True where all lie beyond the same edge of the picture, or behind the eye.
fn is_beside(a: vec3f, b: vec3f, c: vec3f) -> bool {
    // A pixel more than the picture.
    let most = (frame.size_px * 0.5 + 1.0) * frame.per_focal_px;
    let x = vec3f(a.x, b.x, c.x);
    let y = vec3f(a.y, b.y, c.y);
    let z = vec3f(a.z, b.z, c.z);
    return all(z <= vec3f(frame.near)) || all(x > z * most.x) || all(-x > z * most.x) || all(y > z * most.y) || all(-y > z * most.y);
}

// Draws a triangle unless it is large: then false.
fn draw_triangle(node: Node, index: u32, number: u32) -> bool {
    let corners = corners_of(page_word(node.triangles_at + index));
    let a = vertex_of(node, corners.x);
    let b = vertex_of(node, corners.y);
    let c = vertex_of(node, corners.z);
    if !(a.tame && b.tame && c.tame) {
        return is_beside(a.in_view, b.in_view, c.in_view);
    }
    let low = min(min(a.at, b.at), c.at);
    let high = max(max(a.at, b.at), c.at);
    let window = window_of(low, high);
    if window.x >= window.z || window.y >= window.w {
        return true;
    }
    let extent = (high - low) >> vec2u(SUB_LOG2);
    if max(extent.x, extent.y) >= i32(frame.compute_extent_px) {
        return false;
    }
    let area = (b.at.x - a.at.x) * (c.at.y - a.at.y) - (b.at.y - a.at.y) * (c.at.x - a.at.x);
    if area == 0i {
        return true;
    }
    let flat = flat_of(a, b, c, area < 0i);
    let whole = f32(abs(area));
    let ab = flat.b - flat.a;
    let bc = flat.c - flat.b;
    let ca = flat.a - flat.c;
    // What lies on an edge that is another's: one step outside.
    let off = vec3i(select(-1i, 0i, owns(ab)), select(-1i, 0i, owns(bc)), select(-1i, 0i, owns(ca)));
    let first = center_of(window.xy);
    var row = vec3i(
        ab.x * (first.y - flat.a.y) - ab.y * (first.x - flat.a.x),
        bc.x * (first.y - flat.b.y) - bc.y * (first.x - flat.b.x),
        ca.x * (first.y - flat.c.y) - ca.y * (first.x - flat.c.x),
    ) + off;
    let step_x = vec3i(-ab.y, -bc.y, -ca.y) << vec3u(SUB_LOG2);
    let step_y = vec3i(ab.x, bc.x, ca.x) << vec3u(SUB_LOG2);
    var at = row;
    var pixel = window.xy;
    loop {
        if (at.x | at.y | at.z) >= 0i && shows_in(node, pixel) {
            let z = depth_in(flat, vec3f((at - off).yzx), whole);
            deliver(key_of(pixel), Meeting(z), Splat(number));
        }
        pixel.x++;
        at += step_x;
        if pixel.x == window.z {
            pixel = vec2i(window.x, pixel.y + 1);
            row += step_y;
            at = row;
        }
        continuing {
            break if pixel.y >= window.w;
        }
    }
    return true;
}

// Draws a point or a line unless it is large: then false.
fn draw_spot(node: Node, index: u32, number: u32) -> bool {
    var spot: Spot;
    if kind == POINTS {
        spot = point_of(node, index);
    } else {
        spot = line_of(node, corners_of(page_word(node.borders_at + index)).xy);
    }
    let window = spot.window;
    let extent = vec2u(window.zw - window.xy);
    if min(extent.x, extent.y) == 0u {
        return true;
    }
    if max(extent.x, extent.y) > frame.compute_extent_px {
        return false;
    }
    var pixel = window.xy;
    loop {
        let z = depth_of_spot(spot, pixel);
        if z > 0.0 && shows_in(node, pixel) && (kind == POINTS || is_gap(spot, pixel, z)) {
            deliver(key_of(pixel), Meeting(z), Splat(number));
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
