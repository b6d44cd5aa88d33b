//! The front: closed chains of edges between the triangles that are known and those that are not, and what can happen to it.
//!
//! Coder and decoder move the same front by the same steps, so they agree about what an edge leads to. The front is rings of *slots*;
//! each has a vertex and stands for the edge to the next slot, with a known triangle on its left. Slots that have no vertex are
//! *holes*: edges that nothing more is joined to. At any time one slot, the *focus*, has an edge that is live: [`At`].
//!
//! What always holds: whatever steps are taken, links lead to slots; no two holes are neighbours; a slot with a vertex has a live edge
//! before or after it. Steps that cannot be taken say so and change nothing.
//!
//! Source: Gumhold & Straßer, *Real time compression of triangle mesh connectivity*, SIGGRAPH 1998. Differs: the focus stays at a vertex
//! until it is done; vertices are addressed by their numbers, so that any triangles whatever can be coded.

/// Vertex of a hole.
const HOLE: u32 = u32::MAX;

/// How many slots before the focus [`Front::join_back`] reaches: the slot before it is [`Front::close`]'s.
pub(super) const BACK: u32 = 2;
pub(super) const MOST_BACK: u32 = 7;

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    vertex: u32,
    next: u32,
    previous: u32,
    /// Third vertex of the known triangle at the edge.
    opposite: u32,
}

/// The edge that is looked at. Kept apart, so that a decoder has it in registers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct At {
    focus: u32,
    /// The slot after it.
    after: u32,
    /// Vertices of these two, and the third of the known triangle between them.
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) opposite: u32,
    /// Slots that were given out.
    used: u32,
    /// True when no ring has a live edge.
    pub(super) is_closed: bool,
}

/// What the rings are kept in.
#[derive(Debug)]
pub(super) struct Store {
    slots: Vec<Slot>,
    slot_of: Vec<u32>,
    waiting: Vec<u32>,
}

impl Store {
    /// Room for so many slots: each vertex that is added, joined or begun with needs one, and each border.
    pub(super) fn new(slots: usize, vertices: usize) -> Self {
        Self { slots: vec![Slot::default(); slots], slot_of: vec![0; vertices], waiting: Vec::new() }
    }

    /// No ring yet.
    pub(super) fn front(&mut self) -> (Front<'_>, At) {
        let front = Front { slots: &mut self.slots, slot_of: &mut self.slot_of, waiting: &mut self.waiting };
        (front, At { is_closed: true, ..At::default() })
    }
}

/// All rings. What is seldom done gets a copy of the references, so that these stay in registers.
#[derive(Debug)]
pub(super) struct Front<'a> {
    slots: &'a mut [Slot],
    /// The slot that a vertex got last.
    slot_of: &'a mut [u32],
    /// A slot of each ring that waits.
    waiting: &'a mut Vec<u32>,
}

impl Front<'_> {
    #[inline(always)]
    fn lent(&mut self) -> Front<'_> {
        Front { slots: self.slots, slot_of: self.slot_of, waiting: self.waiting }
    }

    #[inline(always)]
    fn slot(&mut self, at: u32) -> &mut Slot {
        &mut self.slots[at as usize]
    }

    #[inline(always)]
    fn give(&mut self, at: &mut At, slot: Slot) -> u32 {
        let given = at.used;
        *self.slot(given) = slot;
        at.used += 1;
        given
    }

    /// A new ring around one triangle.
    #[inline(always)]
    pub(super) fn start(&mut self, at: &mut At, corners: [u32; 3]) {
        *at = self.lent().started(*at, corners);
    }

    #[inline(never)]
    fn started(self, mut at: At, [a, b, c]: [u32; 3]) -> At {
        let first = at.used;
        for (slot, vertex) in (first..).zip([a, b, c]) {
            self.slot_of[vertex as usize] = slot;
        }
        self.slots[first as usize..][..3].copy_from_slice(&[
            Slot { vertex: a, next: first + 1, previous: first + 2, opposite: c },
            Slot { vertex: b, next: first + 2, previous: first, opposite: a },
            Slot { vertex: c, next: first, previous: first + 1, opposite: b },
        ]);
        at.used += 3;
        At { focus: first, after: first + 1, from: a, to: b, opposite: c, is_closed: false, ..at }
    }

    /// Joins a triangle with a vertex that is put between the two. After some of these, [`Self::link`] must come.
    #[inline(always)]
    pub(super) fn add(&mut self, at: &mut At, vertex: u32) -> [u32; 3] {
        let slot = self.give(at, Slot { vertex, next: at.after, previous: at.focus, opposite: at.from });
        self.slot(at.after).previous = slot;
        self.slot_of[vertex as usize] = slot;
        let triangle = [at.to, at.from, vertex];
        (at.after, at.opposite, at.to) = (slot, at.to, vertex);
        triangle
    }

    /// Ends a run of [`Self::add`].
    #[inline(always)]
    pub(super) fn link(&mut self, at: &At) {
        self.slot(at.focus).next = at.after;
    }

    /// The slot and vertex that [`Self::close`] would join the edge with.
    #[inline(always)]
    fn closing(&self, at: &At) -> Option<(u32, u32)> {
        let before = self.slots[at.focus as usize].previous;
        let vertex = self.slots[before as usize].vertex;
        (vertex != HOLE && before != at.after).then_some((before, vertex))
    }

    /// The same for [`Self::skip`].
    #[inline(always)]
    fn skipping(&self, at: &At) -> Option<(u32, u32)> {
        let third = self.slots[at.after as usize].next;
        let vertex = self.slots[third as usize].vertex;
        (vertex != HOLE && third != at.focus && at.after != at.focus).then_some((third, vertex))
    }

    /// True when [`Self::close`] would join the edge with this vertex.
    pub(super) fn can_close(&self, at: &At, vertex: u32) -> bool {
        self.closing(at).is_some_and(|(_, found)| found == vertex)
    }

    /// The same for [`Self::skip`].
    pub(super) fn can_skip(&self, at: &At, vertex: u32) -> bool {
        self.skipping(at).is_some_and(|(_, found)| found == vertex)
    }

    /// Joins a triangle with the slot before the focus, which leaves the ring. A ring of three is done by that.
    #[inline(always)]
    pub(super) fn close(&mut self, at: &mut At) -> Option<[u32; 3]> {
        let (before, vertex) = self.closing(at)?;
        let after = at.after;
        let triangle = [at.to, at.from, vertex];
        self.slot(before).next = after;
        self.slot(after).previous = before;
        (at.focus, at.opposite, at.from) = (before, at.from, vertex);
        if self.slot(after).next == before {
            *at = self.lent().retire(*at, before, after);
        }
        Some(triangle)
    }

    /// Joins a triangle with the slot after the next, which leaves the ring.
    #[inline(always)]
    pub(super) fn skip(&mut self, at: &mut At) -> Option<[u32; 3]> {
        let (third, vertex) = self.skipping(at)?;
        let triangle = [at.to, at.from, vertex];
        self.slot(at.focus).next = third;
        self.slot(third).previous = at.focus;
        (at.after, at.opposite, at.to) = (third, at.to, vertex);
        Some(triangle)
    }

    /// Nothing more is joined to the edge.
    #[inline(always)]
    pub(super) fn end(&mut self, at: &mut At) {
        let (focus, after) = (at.focus, at.after);
        let third = self.slot(after).next;
        let hole = if self.slot(third).vertex == HOLE {
            third
        } else {
            let hole = self.give(at, Slot { vertex: HOLE, next: after, previous: focus, opposite: HOLE });
            self.slot(after).previous = hole;
            hole
        };
        self.slot(focus).next = hole;
        self.slot(hole).previous = focus;
        *at = self.lent().settle(*at, focus);
    }

    /// Joins a triangle with a vertex that is known. Where that still has a slot, the ring becomes two there, or two become one.
    #[inline(always)]
    pub(super) fn join(&mut self, at: &mut At, vertex: u32) -> [u32; 3] {
        let triangle;
        (*at, triangle) = self.lent().joined(*at, vertex);
        triangle
    }

    #[inline(never)]
    fn joined(mut self, mut at: At, vertex: u32) -> (At, [u32; 3]) {
        let slot = self.slot_of[vertex as usize];
        let is_there = self.is_live(slot) && self.slot(slot).vertex == vertex;
        let triangle = if is_there && slot != at.focus && slot != at.after {
            self.join_slot(&mut at, slot, vertex)
        } else {
            let triangle = self.add(&mut at, vertex);
            self.link(&at);
            triangle
        };
        (at, triangle)
    }

    /// How many slots before the focus there is one with this vertex, if [`Self::join_back`] reaches it.
    pub(super) fn back_to(&self, at: &At, vertex: u32) -> Option<u32> {
        (BACK..=MOST_BACK)
            .find(|back| self.back(at, *back).is_some_and(|slot| self.slots[slot as usize].vertex == vertex))
    }

    /// Joins a triangle with the slot so many before the focus. What lies between becomes a ring of its own, and the one in focus.
    #[inline(always)]
    pub(super) fn join_back(&mut self, at: &mut At, back: u32) -> Option<[u32; 3]> {
        let slot = self.back(at, back)?;
        let vertex = self.slot(slot).vertex;
        (vertex != HOLE).then(|| self.join_slot(at, slot, vertex))
    }

    #[inline(always)]
    fn back(&self, at: &At, back: u32) -> Option<u32> {
        let mut slot = at.focus;
        for _ in 0..back {
            slot = self.slots[slot as usize].previous;
            if slot == at.after || slot == at.focus {
                return None;
            }
        }
        Some(slot)
    }

    /// Whether a slot is part of a ring: those that left are no longer their neighbours' neighbour.
    fn is_live(&self, slot: u32) -> bool {
        let Slot { vertex, next, previous, .. } = self.slots[slot as usize];
        vertex != HOLE && self.slots[previous as usize].next == slot && self.slots[next as usize].previous == slot
    }

    #[inline(always)]
    fn join_slot(&mut self, at: &mut At, slot: u32, vertex: u32) -> [u32; 3] {
        let (focus, after, previous) = (at.focus, at.after, self.slots[slot as usize].previous);
        let twin = self.give(at, Slot { vertex, next: after, previous, opposite: at.from });
        self.slot(previous).next = twin;
        self.slot(after).previous = twin;
        self.slot(focus).next = slot;
        self.slot(slot).previous = focus;
        self.waiting.push(twin);
        let triangle = [at.to, at.from, vertex];
        (at.after, at.opposite, at.to) = (slot, at.to, vertex);
        triangle
    }

    /// The ring has only these two slots, with nothing between them any more: another one's turn.
    #[inline(never)]
    fn retire(mut self, at: At, a: u32, b: u32) -> At {
        self.slot(a).vertex = HOLE;
        self.slot(b).vertex = HOLE;
        loop {
            let Some(slot) = self.waiting.pop() else {
                return At { is_closed: true, ..at };
            };
            if self.is_live(slot) {
                return self.settle(at, slot);
            }
        }
    }

    /// The nearest live edge, backwards.
    #[inline(never)]
    fn settle(mut self, at: At, mut focus: u32) -> At {
        loop {
            let Slot { vertex, next, previous, opposite } = *self.slot(focus);
            let to = self.slot(next).vertex;
            if to != HOLE {
                return At { focus, after: next, from: vertex, to, opposite, is_closed: false, ..at };
            }
            if self.slot(previous).vertex != HOLE {
                focus = previous;
                continue;
            }
            if previous == next {
                return self.retire(at, focus, focus);
            }
            // Between two holes: they become one.
            let behind = self.slot(next).next;
            self.slot(previous).next = behind;
            self.slot(behind).previous = previous;
            focus = self.slot(previous).previous;
        }
    }
}
