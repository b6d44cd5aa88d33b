// Where vertices are: shared by all hybrid passes, so that they agree to the last bit.
//
// Positions are whole steps. Relative to a point of the grid near the eye they are whole too, so equal vertices of nodes of one
// level give equal bits, in whichever node they are. On the screen they are rounded to 1/256 pixel; from there on edges are
// whole numbers, and neighbours share every pixel between them exactly.
//
// Quotients are products with the inverse, and scalar products those of dot.wgsl: so compilers agree.

// Steps on the screen in a pixel, as a power of two.
const SUB_LOG2: u32 = 8u;
// What projects farther away than this, in pixels, is not rounded: differences have 24 bits.
const MOST_PX: f32 = 32000.0;

struct Vertex {
    // World units; x right, y up, z forward.
    in_view: vec3f,
    // 1 / z.
    per_z: f32,
    // In steps on the screen, from the top left corner; only where it is `tame`.
    at: vec2i,
    // In front of the eye, and not too far to the side.
    tame: bool,
}

// Steps from the node's smallest corner.
fn position_of(node: Node, index: u32) -> vec3u {
    let words = page_word(node.positions_at + index);
    return vec3u(words.x & 0xffffu, words.x >> 16u, words.y & 0xffffu);
}

// The same from the eye.
fn steps_of(node: Node, index: u32) -> vec3f {
    return vec3f(node.offset + vec3i(position_of(node, index))) + node.to_eye;
}

fn in_view(node: Node, steps: vec3f) -> vec3f {
    return vec3f(dot3(steps, node.right), dot3(steps, node.up), dot3(steps, node.forward));
}

fn px_of(view: vec3f, per_z: f32) -> vec2f {
    return frame.middle_px + vec2f(view.x, -view.y) * (frame.focal_px * per_z);
}

fn vertex_of(node: Node, index: u32) -> Vertex {
    var out: Vertex;
    out.in_view = in_view(node, steps_of(node, index));
    out.per_z = 1.0 / out.in_view.z;
    let px = px_of(out.in_view, out.per_z);
    // Not a number compares false.
    out.tame = out.in_view.z > frame.near && abs(px.x) < MOST_PX && abs(px.y) < MOST_PX;
    out.at = vec2i(floor(px * f32(1u << SUB_LOG2) + 0.5));
    return out;
}

// What of a box (smallest and largest place on the screen) is in the band: first column and row, column and row after the last
// whose centres lie in it. Empty where the first is not before the end.
fn window_of(low: vec2i, high: vec2i) -> vec4i {
    let half = 1i << (SUB_LOG2 - 1u);
    let first = max((low + (half - 1i)) >> vec2u(SUB_LOG2), vec2i(0i, i32(frame.first_row)));
    let end = min(((high - half) >> vec2u(SUB_LOG2)) + 1i, vec2i(i32(frame.size_px.x), i32(frame.end_row)));
    return vec4i(first, end);
}

fn center_of(pixel: vec2i) -> vec2i {
    return (pixel << vec2u(SUB_LOG2)) + (1i << (SUB_LOG2 - 1u));
}
