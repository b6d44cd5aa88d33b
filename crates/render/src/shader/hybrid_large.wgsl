// hybrid_large.wgsl: draws the large triangles, points or lines that hybrid_small.wgsl has listed, as that would draw them.
//
// Dispatch  indirect: for each listed primitive some workgroups, which share its rows of tiles; 8×8 pixels a tile, one an invocation.
// Reads     frame; list; runs, nodes, pages; for lines, what was drawn before.
// Writes    keys.
// Limits    as for hybrid_small.wgsl.
//
// Edges between two tame vertices are whole numbers here too, of more than 32 bits. An edge of which an end is behind the eye or far
// outside is a plane through the eye: that of its ends in a fixed order, so that both of its triangles find the same numbers.
// So nothing is clipped, and which triangle a pixel belongs to is decided edge by edge, as neighbours decide it.

#import hybrid_params.wgsl

@group(0) @binding(0) var<uniform> frame_params: HybridParams;
@group(0) @binding(6) var<storage, read> list: array<u32>;
// As hybrid_small.wgsl has left it; the last is how much is listed.
@group(0) @binding(7) var<storage, read> dispatch: vec4u;

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

const TILE_LOG2: u32 = 3u;

@compute @workgroup_size(64)
fn draw_large(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) member: u32,
) {
    frame = frame_params;
    let in_tile = vec2i(vec2u(member & 7u, member >> TILE_LOG2));
    let count = dispatch.w;
    for (var at = group.x; at < count; at += groups.x) {
        let number = list[at];
        let run = run_at(number >> RUN_LOG2);
        let node = node_at(run.node);
        let index = run.first + (number & ((1u << RUN_LOG2) - 1u));
        if kind == TRIANGLES {
            draw_triangle(node, index, number, group.y, groups.y, in_tile);
        } else {
            draw_spot(node, index, number, group.y, groups.y, in_tile);
        }
    }
}

fn key_of(pixel: vec2i) -> u32 {
    return u32((pixel.y - i32(frame.first_row)) * i32(frame.size_px.x) + pixel.x);
}

// high · 2²⁴ + low; 0 ≤ low < 2²⁴.
struct Wide {
    high: i32,
    low: i32,
}

// a.x b.y - a.y b.x, of numbers of up to 25 bits.
fn cross_wide(a: vec2i, b: vec2i) -> Wide {
    let ah = a >> vec2u(12u);
    let bh = b >> vec2u(12u);
    let al = a & vec2i(4095i);
    let bl = b & vec2i(4095i);
    let low = al.x * bl.y - al.y * bl.x;
    let middle = ah.x * bl.y + al.x * bh.y - ah.y * bl.x - al.y * bh.x + (low >> 12u);
    let high = ah.x * bh.y - ah.y * bh.x + (middle >> 12u);
    return Wide(high, ((middle & 4095i) << 12u) | (low & 4095i));
}

// The nearest float, as one of 32 bits gives it where it has no more.
fn float_of(wide: Wide) -> f32 {
    let is_short = wide.high >= -128i && wide.high < 128i;
    let short = f32((wide.high << 24u) | wide.low);
    return select(f32(wide.high) * 16777216.0 + f32(wide.low), short, is_short);
}

// One edge of a triangle whose area is positive.
struct Edge {
    is_whole: bool,
    owns: bool,
    // Whole numbers: where it begins, and whither it leads.
    begin: vec2i,
    along: vec2i,
    // A plane through the eye.
    plane: vec3f,
}

// A vertex as its edges see it: where it was rounded to, if it was.
fn seen(vertex: Vertex) -> vec3f {
    let from_middle = (vec2f(vertex.at) * (1.0 / f32(1u << SUB_LOG2)) - frame.middle_px) * (frame.per_focal_px * vertex.in_view.z);
    return select(vertex.in_view, vec3f(from_middle.x, -from_middle.y, vertex.in_view.z), vertex.tame);
}

fn comes_first(a: vec3f, b: vec3f) -> bool {
    return a.x < b.x || (a.x == b.x && (a.y < b.y || (a.y == b.y && a.z < b.z)));
}

fn edge_of(a: Vertex, b: Vertex) -> Edge {
    var out: Edge;
    out.is_whole = a.tame && b.tame;
    out.begin = a.at;
    out.along = b.at - a.at;
    if out.is_whole {
        out.owns = owns(out.along);
        return out;
    }
    let start = seen(a);
    let end = seen(b);
    out.owns = comes_first(start, end);
    let p = select(end, start, out.owns);
    let q = select(start, end, out.owns);
    let plane = vec3f(q.y * p.z - q.z * p.y, q.z * p.x - q.x * p.z, q.x * p.y - q.y * p.x);
    out.plane = select(-plane, plane, out.owns);
    return out;
}

struct Side {
    is_inside: bool,
    // Twice the area of edge and pixel; only of whole numbers.
    area: f32,
}

fn side_of(edge: Edge, center: vec2i, ray: vec3f) -> Side {
    if edge.is_whole {
        let area = cross_wide(edge.along, center - edge.begin);
        return Side(area.high >= 0i && (edge.owns || (area.high | area.low) != 0i), float_of(area));
    }
    let away = dot3(edge.plane, ray);
    return Side(away > 0.0 || (away == 0.0 && edge.owns), 0.0);
}

fn ray_of(pixel: vec2i) -> vec3f {
    let from_middle = vec2f(pixel) + 0.5 - frame.middle_px;
    return vec3f(from_middle.x * frame.per_focal_px, -from_middle.y * frame.per_focal_px, 1.0);
}

// Smallest and largest column in some rows that an edge between tame vertices reaches; an empty range where it is not there.
fn columns_of(a: vec2i, b: vec2i, rows: vec2f) -> vec2f {
    let p = vec2f(a);
    let q = vec2f(b);
    let slope = 1.0 / (q.y - p.y);
    let at = select(clamp((rows - p.y) * slope, vec2f(0.0), vec2f(1.0)), vec2f(0.0, 1.0), p.y == q.y);
    let x = p.x + at * (q.x - p.x);
    let is_there = max(p.y, q.y) >= rows.x && min(p.y, q.y) <= rows.y;
    return select(vec2f(1e9, -1e9), vec2f(min(x.x, x.y), max(x.x, x.y)), is_there);
}

fn draw_triangle(node: Node, index: u32, number: u32, share: u32, shares: u32, in_tile: vec2i) {
    let corners = corners_of(page_word(node.triangles_at + index));
    let a = vertex_of(node, corners.x);
    var b = vertex_of(node, corners.y);
    var c = vertex_of(node, corners.z);
    let is_tame = a.tame && b.tame && c.tame;
    // Its plane in whole steps, so that nothing is lost where it lies along an axis, however near the eye is; then in view.
    let first = vec3i(position_of(node, corners.x));
    let to_b = vec3f(vec3i(position_of(node, corners.y)) - first);
    let to_c = vec3f(vec3i(position_of(node, corners.z)) - first);
    let across = vec3f(
        to_b.y * to_c.z - to_b.z * to_c.y,
        to_b.z * to_c.x - to_b.x * to_c.z,
        to_b.x * to_c.y - to_b.y * to_c.x,
    );
    let eye_off = dot3(across, vec3f(node.offset + first) + node.to_eye);
    let normal = in_view(node, across) * (1.0 / dot3(node.right, node.right));
    let area = cross_wide(b.at - a.at, c.at - a.at);
    let is_turned = select(eye_off < 0.0, area.high < 0i, is_tame);
    if select(eye_off == 0.0, (area.high | area.low) == 0i, is_tame) {
        return;
    }
    let flat = flat_of(a, b, c, is_turned);
    let turned_area = cross_wide(flat.b - flat.a, flat.c - flat.a);
    let whole = float_of(turned_area);
    if is_turned {
        let third = c;
        c = b;
        b = third;
    }
    let ab = edge_of(a, b);
    let bc = edge_of(b, c);
    let ca = edge_of(c, a);
    var window = vec4i(0i, i32(frame.first_row), i32(frame.size_px.x), i32(frame.end_row));
    if is_tame {
        window = window_of(min(min(a.at, b.at), c.at), max(max(a.at, b.at), c.at));
    }
    let first_tile_row = window.y >> TILE_LOG2;
    for (var tile_row = first_tile_row + i32(share); tile_row << TILE_LOG2 < window.w; tile_row += i32(shares)) {
        let y = (tile_row << TILE_LOG2) + in_tile.y;
        var reach = vec2i(window.x, window.z);
        if is_tame {
            // Half a pixel more than its rows, a pixel more than its columns.
            let rows = vec2f(f32(tile_row << (TILE_LOG2 + SUB_LOG2)), f32((tile_row + 1i) << (TILE_LOG2 + SUB_LOG2)));
            let columns_ab = columns_of(a.at, b.at, rows);
            let columns_bc = columns_of(b.at, c.at, rows);
            let columns_ca = columns_of(c.at, a.at, rows);
            let low = min(min(columns_ab.x, columns_bc.x), columns_ca.x) * (1.0 / f32(1u << SUB_LOG2)) - 1.0;
            let high = max(max(columns_ab.y, columns_bc.y), columns_ca.y) * (1.0 / f32(1u << SUB_LOG2)) + 1.0;
            reach = vec2i(max(window.x, i32(clamp(low, -MOST_PX, MOST_PX))), min(window.z, i32(clamp(high, -MOST_PX, MOST_PX)) + 1i));
        }
        for (var x = reach.x + in_tile.x; x < reach.y; x += 8i) {
            let pixel = vec2i(x, y);
            let center = center_of(pixel);
            let ray = ray_of(pixel);
            let side_ab = side_of(ab, center, ray);
            let side_bc = side_of(bc, center, ray);
            let side_ca = side_of(ca, center, ray);
            let is_inside = side_ab.is_inside && side_bc.is_inside && side_ca.is_inside;
            var z = depth_in(flat, vec3f(side_bc.area, side_ca.area, side_ab.area), whole);
            if !is_tame {
                z = max(eye_off * (1.0 / dot3(normal, ray)), frame.near);
            }
            // Written so that what is no number is not drawn.
            if is_inside && y >= window.y && y < window.w && z < 3e38 && shows_in(node, pixel) {
                deliver(key_of(pixel), Meeting(z), Splat(number));
            }
        }
    }
}

fn draw_spot(node: Node, index: u32, number: u32, share: u32, shares: u32, in_tile: vec2i) {
    var spot: Spot;
    if kind == POINTS {
        spot = point_of(node, index);
    } else {
        spot = line_of(node, corners_of(page_word(node.borders_at + index)).xy);
    }
    let window = spot.window;
    for (var tile_row = (window.y >> TILE_LOG2) + i32(share); tile_row << TILE_LOG2 < window.w; tile_row += i32(shares)) {
        let y = (tile_row << TILE_LOG2) + in_tile.y;
        for (var x = window.x + in_tile.x; x < window.z; x += 8i) {
            let pixel = vec2i(x, y);
            let z = depth_of_spot(spot, pixel);
            let is_inside = z > 0.0 && y >= window.y && y < window.w;
            if is_inside && shows_in(node, pixel) && (kind == POINTS || is_gap(spot, pixel, z)) {
                deliver(key_of(pixel), Meeting(z), Splat(number));
            }
        }
    }
}
