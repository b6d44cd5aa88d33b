// Which pixels show a node while it fades into its children, or its parent into it. Host twin: runtime/hybrid/fade.rs.

// How many ranks pixels have.
const RANKS: u32 = 64u;

// Neighbours have ranks that are far apart: the order of Bayer's matrix of 8×8 (Bayer, An optimum method for two-level rendition of
// continuous-tone pictures, ICC 1973).
fn rank_of(pixel: vec2i) -> u32 {
    let y = u32(pixel.y);
    let x = u32(pixel.x) ^ y;
    let rank = ((x & 1u) << 5u) | ((y & 1u) << 4u) | ((x & 2u) << 2u) | ((y & 2u) << 1u) | ((x & 4u) >> 1u) | ((y & 4u) >> 2u);
    return (rank + frame.turn) & (RANKS - 1u);
}

fn shows_in(node: Node, pixel: vec2i) -> bool {
    if node.ranks == (RANKS << 8u) {
        return true;
    }
    let rank = rank_of(pixel);
    return rank >= (node.ranks & 0xffu) && rank < (node.ranks >> 8u);
}
