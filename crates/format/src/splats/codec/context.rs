//! What each symbol's probabilities depend on: the state of one lane, before and within a node.
//!
//! Coder and decoder both ask this for contexts and tell it what the symbols were, so they cannot disagree. In: symbols, or
//! what they stand for. Out: context numbers, guesses, and the fields of the node. Nothing here branches on what was coded,
//! so that a decoder can work on several lanes at once.
//!
//! What always holds: any legal symbols whatever keep the state in range; a node that there cannot be is only marked.

use super::model::first;
use super::tables::{
    ALL, BORDERS, CELLS, CODES, FACE, FACES, FIELD, FIRST_OF_EDGE, Face, GRID, OUT, SIDES, SLOPES, TURNS, size_class,
};

/// One lane's contexts.
#[derive(Clone, Copy)]
pub(super) struct Context {
    /// Context of the next kind, without the cone before.
    kind: u32,
    /// Place in the group, 0–3, and 1 if that is not 0.
    place: u32,
    sibling: u32,
    /// Cone of the node before; then of this one.
    cone: u32,
    /// Edge of the node before in the group, 0 for none.
    edge_before: u32,
    /// Sums of 2 · corner + edge over the nodes before in the group.
    sums: u64,
    /// Of the node before; then of this one.
    face: u32,
    of_face: Face,
    /// Sums of the normals of the group: column and row on their axes, 51 or 0 on the face's.
    normals: u64,
    /// Means of these, in the lowest six bits of each: what is most likely next.
    guess: u64,
    /// Which border of the face the guess is near.
    near: u32,
    /// Of this node: three lowest bits, last of its group, inner.
    tree: u32,
    last: u32,
    inner: u32,
    /// 4 · cone + 2 · sibling + (1 where the face is not that of the node before).
    by_cone: u32,
    normal_code: u32,
    slopes: [i32; 2],
    edge: u32,
    corners: u64,
    /// First corner along, doubled, and the edge.
    along: u32,
    /// 4096 · where the tangent plane passes, doubled.
    plane: i32,
    /// Red, green, blue of the node before.
    color: [i32; 3],
}

impl Default for Context {
    fn default() -> Self {
        Self {
            kind: first::KIND,
            place: 0,
            sibling: 0,
            cone: 0,
            edge_before: 0,
            sums: 0,
            face: 0,
            of_face: FACE[0],
            normals: 0,
            guess: 26 * ALL,
            near: 0,
            tree: 0,
            last: 0,
            inner: 0,
            by_cone: 0,
            normal_code: 0,
            slopes: [0; 2],
            edge: 0,
            corners: 0,
            along: 0,
            plane: 0,
            color: [0; 3],
        }
    }
}

impl Context {
    /// Symbol: 2 · the node's three lowest bits + (1 if it is the last of its group).
    #[inline(always)]
    pub(super) fn kind(&self) -> u32 {
        self.kind + self.cone
    }

    #[inline(always)]
    pub(super) fn set_kind(&mut self, symbol: u32) {
        self.tree = symbol >> 1;
        self.last = symbol & 1;
        self.inner = u32::from(symbol > 3);
    }

    /// Symbol: 4 · how the face lies to the one before + the cone.
    #[inline(always)]
    pub(super) fn cone_and_face(&self) -> u32 {
        first::CONE_AND_FACE + (((self.inner * 2 + self.sibling) * 4 + self.cone) * 5 + self.near) * 2
    }

    #[inline(always)]
    pub(super) fn set_cone_and_face(&mut self, symbol: u32) {
        self.cone = symbol & 3;
        let turn = symbol >> 2;
        self.face = u32::from(FACES[(self.face * 8 + turn) as usize & 63]);
        self.of_face = FACE[self.face as usize & 7];
        self.by_cone = (self.cone * 2 + self.sibling) * 2 + u32::from(turn > 0);
    }

    /// How `face` lies to the face before.
    #[inline(always)]
    pub(super) fn turn_to(&self, face: u32) -> u32 {
        u32::from(TURNS[(self.face * 8 + face) as usize & 63])
    }

    /// Most likely column and row on the face.
    #[inline(always)]
    pub(super) fn guesses(&self) -> [u32; 2] {
        [(self.guess >> self.of_face.along_1) as u32 & 63, (self.guess >> self.of_face.along_2) as u32 & 63]
    }

    /// Symbol: 8 · class of the column's step from its guess + class of the row's.
    #[inline(always)]
    pub(super) fn classes(&self) -> u32 {
        first::CLASSES + self.by_cone * 3
    }

    /// Column and row.
    #[inline(always)]
    pub(super) fn set_normal(&mut self, column: u32, row: u32) {
        // Rounded means of 1, 2, 3 and 4, as products with 2^12 over the number.
        const SHARE: [u16; 4] = [1 << 12, 1 << 11, 1366, 1 << 10];
        let Face { top, along_1, along_2, .. } = self.of_face;
        self.normals += top | u64::from(column) << along_1 | u64::from(row) << along_2;
        self.guess = (self.normals * u64::from(SHARE[self.place as usize & 3]) + (ALL << 11)) >> 12;
        let guess = self.guesses();
        let near = BORDERS[0][guess[0] as usize & 63].min(BORDERS[1][guess[1] as usize & 63]);
        self.near = u32::from(near) & 7;
        self.normal_code = (self.face * GRID + row) * GRID + column;
        let negative = (self.face & 1) << 6;
        self.slopes = [column, row].map(|at| i32::from(SLOPES[(negative | at) as usize & 127]));
    }

    #[inline(always)]
    pub(super) fn edge(&self) -> u32 {
        first::EDGE + self.inner * 14 + self.edge_before
    }

    #[inline(always)]
    pub(super) fn set_edge(&mut self, symbol: u32) {
        self.edge = symbol + 1;
    }

    #[inline(always)]
    fn side(&self, shift: u32) -> u32 {
        u32::from(SIDES[(self.place * 128 + (self.sums >> shift) as u32 % 128) as usize & 511])
    }

    #[inline(always)]
    pub(super) fn along_1(&self) -> u32 {
        (first::ALONG_1 - 6) + self.edge * 6 + self.side(self.of_face.along_1)
    }

    #[inline(always)]
    pub(super) fn set_along_1(&mut self, symbol: u32) {
        self.along = 2 * symbol + self.edge;
        self.corners = u64::from(symbol) << self.of_face.along_1;
        self.plane = self.slopes[0] * (self.along as i32 - CELLS as i32);
    }

    #[inline(always)]
    pub(super) fn along_2(&self) -> u32 {
        let out = u32::from(OUT[self.along as usize & 31]);
        (first::ALONG_2 - 18) + (self.edge * 6 + self.side(self.of_face.along_2)) * 3 + out
    }

    #[inline(always)]
    pub(super) fn set_along_2(&mut self, symbol: u32) {
        self.corners |= u64::from(symbol) << self.of_face.along_2;
        self.plane += self.slopes[1] * ((2 * symbol + self.edge) as i32 - CELLS as i32);
    }

    #[inline(always)]
    pub(super) fn across(&self) -> u32 {
        (first::ACROSS - 2) + self.edge * 2 + self.inner
    }

    /// Where the tangent plane through the parent's centre passes.
    #[inline(always)]
    pub(super) fn across_guess(&self) -> u32 {
        let places = self.places() as i32;
        (((places << 12) + self.plane) >> 13).clamp(0, places - 1) as u32
    }

    /// Number of corners on an axis.
    #[inline(always)]
    pub(super) fn places(&self) -> u32 {
        CELLS + 1 - self.edge
    }

    #[inline(always)]
    pub(super) fn set_across(&mut self, symbol: u32) {
        let corner = self.across_guess() + symbol;
        let corner = if corner >= self.places() { corner - self.places() } else { corner };
        self.corners |= u64::from(corner) << self.of_face.across;
    }

    /// The node's bits, and its sphere: `NONE` where there is no such. Then the next one begins.
    #[inline(always)]
    pub(super) fn finish(&mut self) -> (u32, u16) {
        let places = self.places();
        let [x, y, z] = [0, FIELD, 2 * FIELD].map(|shift| (self.corners >> shift) as u32 & 15);
        let at = u32::from(FIRST_OF_EDGE[self.edge as usize & 15]) + (x * places + y) * places + z;
        let sphere = CODES[at as usize & (CODES.len() - 1)];
        let bits = u32::from(sphere) << 19 | self.normal_code << 5 | self.cone << 3 | self.tree;
        // The next node, in this group or another.
        let keep = self.last.wrapping_sub(1);
        let keep_wide = u64::from(self.last).wrapping_sub(1);
        self.sums = (self.sums + 2 * self.corners + u64::from(self.edge) * ALL) & keep_wide;
        self.normals &= keep_wide;
        self.edge_before = self.edge & keep;
        self.kind = first::KIND + ((4 + 8 * self.place + 4 * self.inner) & keep);
        self.place = (self.place + 1) & keep;
        self.sibling = keep & 1;
        (bits, sphere)
    }

    /// 1 for the node that is about to be finished, if it is the last of its group; and the nodes in the group so far.
    #[inline(always)]
    pub(super) fn last_and_size(&self) -> (u32, u32) {
        (self.last, self.place + 1)
    }

    /// True where a group begins.
    pub(super) fn begins_group(&self) -> bool {
        self.place == 0
    }

    /// Context of green and its guess. To be asked before [`Context::finish`].
    pub(super) fn green(&self) -> (u32, i32) {
        (first::GREEN + self.sibling, self.color[1])
    }

    /// Contexts of red and blue and their guesses, by green and its symbol: grey stays grey, so they are expected to move by
    /// half of what green, which counts in finer steps, moves.
    pub(super) fn red_and_blue(&self, green: i32, step: u32) -> [(u32, i32); 2] {
        let moved = (green - self.color[1]) / 2;
        [(first::RED, self.color[0]), (first::BLUE, self.color[2])]
            .map(|(context, before)| (context + size_class(step), (before + moved).clamp(0, 31)))
    }

    pub(super) fn set_color(&mut self, color: [i32; 3]) {
        self.color = color;
    }
}
