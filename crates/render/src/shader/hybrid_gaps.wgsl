// Where a line may show: in gaps between nodes that were simplified each for itself, and nowhere else. It covers whatever gap may be on
// its edge, so it also sticks out where there is none: over a surface that is there, and beyond outlines.
//
// A pixel is in a gap where what was drawn before lies deeper than the line is wide, and on both sides of the line, as near as a gap may
// be wide, something is no deeper than a surface may recede on the way. Beyond an outline that is so on one side only.

// Depths of all that was drawn before, as bits.
@group(0) @binding(9) var before: texture_2d<u32>;

// Farther away than this, in pixels, no other side is looked for.
const MOST_REACH_PX: f32 = 32.0;
// Surfaces that are steeper than this, in depth over width, are taken for others.
const STEEPEST: f32 = 16.0;

// What lies beyond the picture is taken for near: a gap does not end there.
fn depth_before(pixel: vec2i) -> f32 {
    let size = vec2i(textureDimensions(before));
    let is_inside = all(pixel >= vec2i(0i)) && all(pixel < size);
    let bits = textureLoad(before, clamp(pixel, vec2i(0i), size - 1i), 0).x;
    return select(0.0, bitcast<f32>(bits), is_inside);
}

fn is_gap(line: Spot, pixel: vec2i, z: f32) -> bool {
    let pixel_size = z * frame.per_focal_px;
    let half_px = max(line.half_px.x, line.half_px.y);
    if depth_before(pixel) <= z + half_px * pixel_size {
        return false;
    }
    let edge = line.b - line.a;
    let length_squared = dot2(edge, edge);
    let across = select(vec2f(1.0, 0.0), vec2f(-edge.y, edge.x) * inverseSqrt(length_squared), length_squared > 0.0);
    let reach = i32(min(ceil(2.0 * half_px), MOST_REACH_PX)) + 1i;
    let most = z + (half_px + 1.0) * (STEEPEST * pixel_size);
    var has_left = false;
    var has_right = false;
    for (var step = 1i; step <= reach; step++) {
        let off = vec2i(floor(across * f32(step) + 0.5));
        has_left = has_left || depth_before(pixel - off) <= most;
        has_right = has_right || depth_before(pixel + off) <= most;
        if has_left && has_right {
            return true;
        }
    }
    return false;
}
