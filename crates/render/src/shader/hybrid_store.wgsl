// Nodes on the device: textures, because the software adapter reads those several times faster than buffers. Host twins:
// hybrid/arena.rs (pages) and hybrid/params.rs (nodes, runs).
//
// Pages: two words a texel. Of each page positions (x | y << 16, z), then normals and colours (u | v << 16, red | green << 8 |
// blue << 16), then triangles and borders, whose numbers have 21 bits each.
@group(0) @binding(1) var pages: texture_2d<u32>;
// NODE_TEXELS for each drawn node.
@group(0) @binding(2) var nodes: texture_2d<u32>;
// Node, and where in it: first >> RUN_LOG2 in the upper bits, the last one's number in the run in the lower.
@group(0) @binding(3) var runs: texture_2d<u32>;

// Texels in a row of the textures, as a power of two.
const STORE_WIDTH_LOG2: u32 = 12u;
const NODE_TEXELS: u32 = 8u;
// Primitives in a run, as a power of two: the number of a primitive is that of its run times this, and its place in it.
const RUN_LOG2: u32 = 10u;

struct Node {
    // Its smallest corner, in steps of its level, relative to a point of the grid near the eye.
    offset: vec3i,
    // Where in the pages they begin.
    positions_at: u32,
    normals_at: u32,
    triangles_at: u32,
    borders_at: u32,
    // Of its page; points come after them.
    vertices: u32,
    // World units: how large points are at least, and half the width of lines.
    spacing: f32,
    half_width: f32,
    // View axes in the model's axes, times the length of a step in world units.
    right: vec3f,
    up: vec3f,
    forward: vec3f,
    // What brings steps from that point of the grid to the eye.
    to_eye: vec3f,
    // Pixels that show it: of these ranks, from | end << 8.
    ranks: u32,
}

struct Run {
    node: u32,
    first: u32,
    count: u32,
}

fn texel_of(at: u32) -> vec2u {
    return vec2u(at & ((1u << STORE_WIDTH_LOG2) - 1u), at >> STORE_WIDTH_LOG2);
}

fn node_word(node: u32, texel: u32) -> vec4u {
    return textureLoad(nodes, texel_of(node * NODE_TEXELS + texel), 0);
}

fn node_at(at: u32) -> Node {
    let places = node_word(at, 0u);
    let more = node_word(at, 1u);
    let right = node_word(at, 2u);
    let up = node_word(at, 3u);
    let forward = node_word(at, 4u);
    let to_eye = node_word(at, 5u);
    var out: Node;
    out.offset = bitcast<vec3i>(places.xyz);
    out.positions_at = places.w;
    out.normals_at = more.x;
    out.triangles_at = more.y;
    out.borders_at = more.z;
    out.spacing = bitcast<f32>(more.w);
    out.half_width = bitcast<f32>(right.w);
    out.right = bitcast<vec3f>(right.xyz);
    out.vertices = up.w;
    out.up = bitcast<vec3f>(up.xyz);
    out.forward = bitcast<vec3f>(forward.xyz);
    out.ranks = forward.w;
    out.to_eye = bitcast<vec3f>(to_eye.xyz);
    return out;
}

fn run_at(at: u32) -> Run {
    let words = textureLoad(runs, texel_of(at), 0);
    let members = (1u << RUN_LOG2) - 1u;
    return Run(words.x, words.y & ~members, (words.y & members) + 1u);
}

fn page_word(at: u32) -> vec2u {
    return textureLoad(pages, texel_of(at), 0).xy;
}

// Vertices of a triangle, or of a border edge (two).
fn corners_of(words: vec2u) -> vec3u {
    let mask = (1u << 21u) - 1u;
    return vec3u(words.x & mask, ((words.x >> 21u) | (words.y << 11u)) & mask, words.y >> 10u);
}
