// Points and lines on the screen, shared by all hybrid passes.
//
// A point is a ball that is as wide as its node's spacing. What points stand for lies in their balls, so these cover a pixel's centre
// wherever that does, however small they are. The depth is the middle's.
//
// A line is what lies near a border edge: as far as its node's error (and a bit, for neighbours' rounding), so that it covers whatever gap may be there.
// It lies a little behind the edge, so that it does not show in front of surfaces that recede, and by less than the node's error.

// Vertices are rounded by up to this on the screen, in pixels.
const ROUNDING_PX: f32 = 0.003;
// Largest radius of a ball, in its depth: of one that reaches the eye there is no outline.
const MOST_BALL: f32 = 0.9;
// How far behind its edge a line lies, in half widths.
const BEHIND: f32 = 0.25;

struct Spot {
    // Pixels it may show in, as of `window_of`.
    window: vec4i,
    // Ends, in pixels; for a point only the first.
    a: vec2f,
    b: vec2f,
    // Half widths there, in pixels.
    half_px: vec2f,
    // 1 / depth there.
    per_z: vec2f,
    // Where along the edge what shows begins and ends.
    along: vec2f,
}

fn window_of_px(low: vec2f, high: vec2f) -> vec4i {
    // Centres from `low` on, and before `high`.
    let least = vec2f(0.0, f32(frame.first_row));
    let most = vec2f(frame.size_px.x, f32(frame.end_row));
    let first = clamp(ceil(low - 0.5), least, most);
    return vec4i(vec4f(first, clamp(ceil(high - 0.5), first, most)));
}

fn point_of(node: Node, index: u32) -> Spot {
    var out: Spot;
    let view = in_view(node, steps_of(node, node.vertices + index));
    let per_z = 1.0 / view.z;
    if !(view.z > frame.near) {
        return out;
    }
    out.a = px_of(view, per_z);
    // A ball is an ellipse in the picture, longer towards its edges, and its middle is a little nearer to them than that of the ellipse.
    let wide = min(0.5 * node.spacing * per_z, MOST_BALL);
    let slope_squared = dot2(view.xy, view.xy) * (per_z * per_z);
    let stretched = (sqrt(1.0 + slope_squared) + sqrt(slope_squared) * wide) * (1.0 / (1.0 - wide * wide));
    out.half_px = vec2f(wide * frame.focal_px * stretched + ROUNDING_PX);
    out.per_z = vec2f(per_z);
    out.window = window_of_px(out.a - out.half_px.x, out.a + out.half_px.x);
    return out;
}

fn line_of(node: Node, ends: vec2u) -> Spot {
    var out: Spot;
    var a = in_view(node, steps_of(node, ends.x));
    var b = in_view(node, steps_of(node, ends.y));
    // What is nearer than it is wide would be everywhere.
    let nearest = max(node.half_width, frame.near);
    if node.half_width <= 0.0 || max(a.z, b.z) < nearest {
        return out;
    }
    let a_whole = a;
    let b_whole = b;
    out.along = vec2f(0.0, 1.0);
    if a.z < nearest {
        out.along.x = (nearest - a.z) * (1.0 / (b.z - a.z));
        a = a_whole + (b_whole - a_whole) * out.along.x;
        a.z = nearest;
    }
    if b.z < nearest {
        out.along.y = 1.0 - (nearest - b.z) * (1.0 / (a_whole.z - b.z));
        b = a_whole + (b_whole - a_whole) * out.along.y;
        b.z = nearest;
    }
    let per_z = vec2f(1.0 / a.z, 1.0 / b.z);
    out.a = px_of(a, per_z.x);
    out.b = px_of(b, per_z.y);
    out.half_px = per_z * (node.half_width * frame.focal_px);
    out.half_px += ROUNDING_PX;
    let behind = BEHIND * node.half_width;
    out.per_z = vec2f(1.0 / (a.z + behind), 1.0 / (b.z + behind));
    let low = min(out.a - out.half_px.x, out.b - out.half_px.y);
    let high = max(out.a + out.half_px.x, out.b + out.half_px.y);
    out.window = window_of_px(low, high);
    return out;
}

// Where between the ends of a line the point nearest to a pixel's centre lies.
fn place_on(line: Spot, pixel: vec2i) -> f32 {
    let edge = line.b - line.a;
    let from_a = vec2f(pixel) + 0.5 - line.a;
    let length_squared = dot2(edge, edge);
    return select(0.0, clamp(dot2(from_a, edge) * (1.0 / length_squared), 0.0, 1.0), length_squared > 0.0);
}

// Depth of a line in a pixel of its window; 0 where it is not.
fn depth_of_line(line: Spot, pixel: vec2i) -> f32 {
    let place = place_on(line, pixel);
    let away = vec2f(pixel) + 0.5 - (line.a + (line.b - line.a) * place);
    let half_px = line.half_px.x + (line.half_px.y - line.half_px.x) * place;
    let z = 1.0 / (line.per_z.x + (line.per_z.y - line.per_z.x) * place);
    return select(0.0, z, dot2(away, away) <= half_px * half_px);
}

// Depth of a point or line in a pixel of its window; 0 where it is not.
fn depth_of_spot(spot: Spot, pixel: vec2i) -> f32 {
    if kind == POINTS {
        let away = vec2f(pixel) + 0.5 - spot.a;
        return select(0.0, 1.0 / spot.per_z.x, dot2(away, away) <= spot.half_px.x * spot.half_px.x);
    }
    return depth_of_line(spot, pixel);
}
