//! Connectivity, the coder's side: any triangles as steps of a [`Front`].
//!
//! In: triangles. Out: the same triangles in the order and with the numbering that a decoder gives them, and what it must be told.

use super::front::{self, At, Front, Store};

/// Most new vertices that one token adds.
pub(super) const MOST_ADDED: u32 = 6;
/// Tokens: 5 · new vertices + how it ends, and one for [`MOST_ADDED`] without an end.
pub(super) const TOKENS: usize = 5 * MOST_ADDED as usize + 1;
/// Ends of a token.
pub(super) const CLOSE: u8 = 0;
pub(super) const BORDER: u8 = 1;
pub(super) const SKIP: u8 = 2;
pub(super) const BACK: u8 = 3;
pub(super) const RARE: u8 = 4;
/// How many.
pub(super) const ENDS: u8 = 5;
/// Rare steps: no triangle, though this is not an edge of just one; then 3, 4 … slots back; from [`TO_KNOWN`] on a triangle with a
/// vertex that was there before.
pub(super) const SEAM: u32 = 0;
pub(super) const TO_KNOWN: u32 = front::MOST_BACK - front::BACK + 1;

/// Triangles as steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Woven {
    pub(super) tokens: Vec<u8>,
    /// Details of rare steps, and of first triangles: 0 for a new vertex, else how many vertices ago it was new.
    pub(super) rare: Vec<u32>,
    /// Old numbers of the vertices, in the order in which they become known.
    pub(super) order: Vec<u32>,
    /// In new numbers.
    pub(super) triangles: Vec<[u32; 3]>,
    /// In new numbers.
    pub(super) borders: Vec<[u32; 2]>,
    /// For each vertex what its position is predicted from.
    pub(super) made: Vec<Made>,
}

/// What a new vertex is put beside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Made {
    /// The edge and the third vertex of the known triangle there; three times the vertex before where there is none.
    pub(super) beside: [u32; 3],
    /// The triangle whose plane counts.
    pub(super) plane: [u32; 3],
}

impl Made {
    /// Of a vertex that begins a component, or has no triangle.
    fn after(known: usize) -> Self {
        let before = [known.saturating_sub(1) as u32; 3];
        Self { beside: before, plane: before }
    }
}

/// Sides of triangles by their vertices.
struct Sides {
    /// From, to, and 3 · triangle + corner; sorted.
    sides: Vec<(u32, u32, u32)>,
    /// How many of the sides alike, from this one on, are known to be taken.
    taken: Vec<u32>,
}

impl Sides {
    fn of(triangles: &[[u32; 3]]) -> Self {
        let mut sides: Vec<_> = triangles
            .iter()
            .enumerate()
            .flat_map(|(at, triangle)| {
                (0..3).map(move |corner| (triangle[corner], triangle[(corner + 1) % 3], (3 * at + corner) as u32))
            })
            .collect();
        sides.sort_unstable();
        Self { taken: vec![0; sides.len()], sides }
    }

    fn first(&self, from: u32, to: u32) -> usize {
        self.sides.partition_point(|side| (side.0, side.1) < (from, to))
    }

    /// How many there are, up to 2.
    fn count(&self, from: u32, to: u32) -> usize {
        let first = self.first(from, to);
        self.sides[first..].iter().take(2).take_while(|side| (side.0, side.1) == (from, to)).count()
    }

    /// True when just one triangle has it, and once.
    fn is_border(&self, from: u32, to: u32) -> bool {
        from != to && self.count(from, to) + self.count(to, from) == 1
    }

    /// A side of a triangle that is not yet woven.
    fn free(&mut self, from: u32, to: u32, woven: &[bool]) -> Option<u32> {
        let first = self.first(from, to);
        loop {
            let at = first + *self.taken.get(first)? as usize;
            let side = self.sides.get(at).filter(|side| (side.0, side.1) == (from, to))?;
            if !woven[side.2 as usize / 3] {
                return Some(side.2);
            }
            self.taken[first] += 1;
        }
    }
}

/// Edges of just one triangle, each as in its triangle, in the order of the triangles. A side whose ends are one vertex is none.
pub(in super::super) fn borders_of(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let sides = Sides::of(triangles);
    let edges = triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    edges.filter(|[from, to]| sides.is_border(*from, *to)).collect()
}

struct Weaver<'a> {
    triangles: &'a [[u32; 3]],
    sides: Sides,
    woven: Vec<bool>,
    /// New numbers of vertices, or [`UNKNOWN`].
    numbers: Vec<u32>,
    /// New vertices since the last token.
    added: u32,
    /// Where the front was at the begin of the token.
    plane: [u32; 3],
    out: Woven,
}

const UNKNOWN: u32 = u32::MAX;

impl Weaver<'_> {
    /// The new number of a vertex, which may become known by this.
    fn number(&mut self, old: u32, made: Made) -> u32 {
        let number = &mut self.numbers[old as usize];
        if *number == UNKNOWN {
            *number = self.out.order.len() as u32;
            self.out.order.push(old);
            self.out.made.push(made);
        }
        *number
    }

    fn end_token(&mut self, end: u8) {
        self.out.tokens.push(ENDS * self.added as u8 + end);
        self.added = 0;
    }

    fn rare(&mut self, value: u32) {
        self.end_token(RARE);
        self.out.rare.push(value);
    }

    fn start(&mut self, triangle: usize, front: &mut Front<'_>, at: &mut At) {
        self.woven[triangle] = true;
        let corners = self.triangles[triangle].map(|old| {
            let known = self.out.order.len();
            let number = self.number(old, Made::after(known));
            self.out.rare.push(known as u32 - number);
            number
        });
        self.out.triangles.push(corners);
        front.start(at, corners);
    }

    fn step(&mut self, front: &mut Front<'_>, at: &mut At) {
        let [from, to] = [at.from, at.to].map(|new| self.out.order[new as usize]);
        let Some(side) = self.sides.free(to, from, &self.woven) else {
            if self.sides.is_border(from, to) {
                self.out.borders.push([at.from, at.to]);
                self.end_token(BORDER);
                front.end(at);
            } else {
                self.rare(SEAM);
                front.end(at);
            }
            return;
        };
        self.woven[side as usize / 3] = true;
        let old = self.triangles[side as usize / 3][(side as usize % 3 + 2) % 3];
        let known = self.out.order.len() as u32;
        let beside = [at.from, at.to, at.opposite];
        if self.added == 0 {
            self.plane = beside;
        }
        let number = self.number(old, Made { beside, plane: self.plane });
        let triangle = if number == known {
            self.added += 1;
            if self.added == MOST_ADDED {
                self.end_token(0);
            }
            let triangle = front.add(at, number);
            front.link(at);
            triangle
        } else if front.can_close(at, number) {
            self.end_token(CLOSE);
            front.close(at).expect("it was asked")
        } else if front.can_skip(at, number) {
            self.end_token(SKIP);
            front.skip(at).expect("it was asked")
        } else if let Some(back) = front.back_to(at, number) {
            match back {
                front::BACK => self.end_token(BACK),
                _ => self.rare(back - front::BACK),
            }
            front.join_back(at, back).expect("it was asked")
        } else {
            self.rare(TO_KNOWN + known - 1 - number);
            front.join(at, number)
        };
        self.out.triangles.push(triangle);
    }
}

/// Weaves triangles of so many vertices; those without a triangle come last.
pub(super) fn weave(triangles: &[[u32; 3]], vertices: usize) -> Woven {
    let mut weaver = Weaver {
        triangles,
        sides: Sides::of(triangles),
        woven: vec![false; triangles.len()],
        numbers: vec![UNKNOWN; vertices],
        added: 0,
        plane: [0; 3],
        out: Woven::default(),
    };
    // Three slots for the corners of each triangle and one for each of its sides are more than enough.
    let mut store = Store::new(6 * triangles.len(), vertices);
    let (mut front, mut at) = store.front();
    for triangle in 0..triangles.len() {
        if !weaver.woven[triangle] {
            weaver.start(triangle, &mut front, &mut at);
            while !at.is_closed {
                weaver.step(&mut front, &mut at);
            }
        }
    }
    for old in 0..vertices {
        weaver.number(old as u32, Made::after(weaver.out.order.len()));
    }
    weaver.out
}
