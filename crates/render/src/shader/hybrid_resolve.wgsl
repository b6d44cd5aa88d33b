// hybrid_resolve.wgsl: keys to G-buffer.
//
// Draw      one triangle that covers the picture; the scissor cuts out the band.
// Reads     frame; found keys; runs, nodes, pages.
// Writes    as splat_resolve.wgsl; w of the normal: 0 for a triangle, half the width in pixels for points and lines.
// Limits    none beyond the baseline of WebGPU.

#import hybrid_params.wgsl

@group(0) @binding(0) var<uniform> frame: HybridParams;
// Inverted number, nearness; in rows as long as those of the store.
@group(0) @binding(9) var found: texture_2d<u32>;

// True where there is something besides triangles; where vertices have colours.
override has_spots: bool = true;
override has_colors: bool = true;

#import dot.wgsl
#import hybrid_store.wgsl
#import hybrid_place.wgsl
#import nearness.wgsl
#import splat_surface.wgsl

// What is asked of the pass here is known at run time.
var<private> kind: u32;
const TRIANGLES: u32 = 0u;
const POINTS: u32 = 1u;
const LINES: u32 = 2u;

#import hybrid_spots.wgsl

// Unit vector of a code on the octahedron: |x| + |y| + |z| = 1, the lower half folded outward.
fn normal_of(code: u32, per_step: f32) -> vec3f {
    let at = vec2f(vec2u(code & 0xfffu, (code >> 12u) & 0xfffu)) * per_step - 1.0;
    let z = 1.0 - abs(at.x) - abs(at.y);
    let fold = max(-z, 0.0);
    let n = vec3f(at.x + select(fold, -fold, at.x >= 0.0), at.y + select(fold, -fold, at.y >= 0.0), z);
    return n * inverseSqrt(dot3(n, n));
}

fn linear_of(packed: u32) -> vec3f {
    let encoded = vec3f(vec3u(packed & 255u, (packed >> 8u) & 255u, (packed >> 16u) & 255u)) * (1.0 / 255.0);
    let curve = pow((encoded + 0.055) * (1.0 / 1.055), vec3f(2.4));
    return select(curve, encoded * (1.0 / 12.92), encoded <= vec3f(0.04045));
}

fn cross3(a: vec3f, b: vec3f) -> vec3f {
    return vec3f(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

@fragment
fn resolve(@builtin(position) position: vec4f) -> Surface {
    let pixel = vec2i(position.xy);
    let at = u32((pixel.y - i32(frame.first_row)) * i32(frame.size_px.x) + pixel.x);
    let key = textureLoad(found, texel_of(at), 0).xy;
    if key.y == 0u {
        discard;
    }
    let number = ~key.x;
    let run_index = number >> RUN_LOG2;
    let run = run_at(run_index);
    let node = node_at(run.node);
    let index = run.first + (number & ((1u << RUN_LOG2) - 1u));

    // Up to three vertices, and how much each has of what is seen.
    var corners: vec3u;
    var shares = vec3f(1.0, 0.0, 0.0);
    var footprint_px = 0.0;
    var is_triangle = true;
    if has_spots {
        kind = select(select(TRIANGLES, POINTS, run_index >= frame.first_point_run), LINES, run_index >= frame.first_line_run);
        is_triangle = kind == TRIANGLES;
    }
    if is_triangle {
        corners = corners_of(page_word(node.triangles_at + index));
        shares = shares_of(node, corners, position.xy);
    } else if kind == POINTS {
        corners = vec3u(node.vertices + index);
        footprint_px = point_of(node, index).half_px.x;
    } else {
        let ends = corners_of(page_word(node.borders_at + index)).xy;
        let line = line_of(node, ends);
        corners = vec3u(ends, ends.x);
        let place = place_on(line, pixel);
        footprint_px = line.half_px.x + (line.half_px.y - line.half_px.x) * place;
        // From even steps on the screen to even steps along the line.
        let of_b = place * line.per_z.y;
        let of_a = (1.0 - place) * line.per_z.x;
        let along = line.along.x + (line.along.y - line.along.x) * of_b * (1.0 / (of_a + of_b));
        shares = vec3f(1.0 - along, along, 0.0);
    }

    let look = node_word(run.node, 6u);
    let turn = node_word(run.node, 7u);
    let per_step = bitcast<f32>(look.w);
    let looks = array(page_word(node.normals_at + corners.x), page_word(node.normals_at + corners.y), page_word(node.normals_at + corners.z));
    let normal = normal_of(looks[0].x, per_step) * shares.x + normal_of(looks[1].x, per_step) * shares.y
        + normal_of(looks[2].x, per_step) * shares.z;
    // What fills a gap is seen from the side that its neighbours are seen from; lines have no side but that of their normals.
    let is_line = !is_triangle && kind == LINES;
    let shows_back = is_line && dot3(normal, steps_of(node, corners.x)) > 0.0;
    let turned = select(normal, -normal, shows_back || (is_triangle && is_back(node, corners, normal)));
    let model_x = bitcast<vec3f>(look.xyz);
    let model_y = bitcast<vec3f>(turn.xyz);
    let in_world = model_x * turned.x + model_y * turned.y + cross3(model_x, model_y) * turned.z;
    var albedo = linear_of(turn.w);
    if has_colors && (turn.w >> 24u) != 0u {
        albedo = linear_of(looks[0].y) * shares.x + linear_of(looks[1].y) * shares.y + linear_of(looks[2].y) * shares.z;
    }

    let z = depth_of(key.y);
    var out: Surface;
    out.albedo = vec4f(albedo, 1.0);
    out.normal_footprint = vec4f(in_world, footprint_px);
    out.depth_bits = bitcast<u32>(z);
    out.depth_test = frame.near * (1.0 / z);
    return out;
}

// True where a normal points to the side of a triangle that is not seen; the model's axes.
fn is_back(node: Node, corners: vec3u, normal: vec3f) -> bool {
    let first = vec3i(position_of(node, corners.x));
    let to_b = vec3f(vec3i(position_of(node, corners.y)) - first);
    let to_c = vec3f(vec3i(position_of(node, corners.z)) - first);
    let across = cross3(to_b, to_c);
    let seen_from = -(vec3f(node.offset + first) + node.to_eye);
    return (dot3(across, normal) < 0.0) != (dot3(across, seen_from) < 0.0);
}

// Where the ray of a pixel meets a triangle's plane, as shares of its corners. Edges are differences of whole steps, so they are
// exact however far the eye is. Source: Möller & Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, JGT 2(1), 1997.
fn shares_of(node: Node, corners: vec3u, position_px: vec2f) -> vec3f {
    let from_middle = position_px - frame.middle_px;
    let ray = vec3f(from_middle.x * frame.per_focal_px, -from_middle.y * frame.per_focal_px, 1.0);
    let from_a = vec3i(position_of(node, corners.x));
    let to_b = in_view(node, vec3f(vec3i(position_of(node, corners.y)) - from_a));
    let to_c = in_view(node, vec3f(vec3i(position_of(node, corners.z)) - from_a));
    let a = in_view(node, vec3f(node.offset + from_a) + node.to_eye);
    let across_c = cross3(ray, to_c);
    let across_b = cross3(-a, to_b);
    let per_volume = 1.0 / dot3(to_b, across_c);
    let of_b = clamp(dot3(-a, across_c) * per_volume, 0.0, 1.0);
    let of_c = clamp(dot3(ray, across_b) * per_volume, 0.0, 1.0);
    let all = max(of_b + of_c, 1.0);
    let found = vec2f(of_b, of_c) * (1.0 / all);
    // Of a triangle that is seen from its edge: any.
    let known = select(vec2f(0.0), found, found >= vec2f(0.0));
    return vec3f(1.0 - known.x - known.y, known);
}
