//! The front: closed chains of edges between the triangles that are known and those that are not, and what can happen to it.
//!
//! Coder and decoder move the same front by the same steps, so they agree about what an edge leads to. The front is a ring of
//! *slots*; each has a vertex and stands for the edge to the next slot, with known triangles on its left. Slots that have no vertex are
//! *holes*: edges that nothing more is joined to. At any time one slot, the *focus*, has an edge that is live.
//!
//! What always holds: whatever steps are taken, links lead to slots; no two holes are neighbours; a slot with a vertex has a live edge
//! before or after it. Steps that cannot be taken say so and change nothing.
//!
//! Source: Gumhold & Straßer, *Real time compression of triangle mesh connectivity*, SIGGRAPH 1998. Differs: vertices are addressed by
//! their numbers, so that any triangles whatever can be coded; rings are not split but closed by *zips*.

/// Vertex of a hole.
const HOLE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Slot {
    vertex: u32,
    next: u32,
    previous: u32,
    /// Third vertex of the known triangle at the edge.
    opposite: u32,
}

/// How many slots before the focus [`Front::join_back`] reaches: the slot before it is [`Front::close`]'s.
pub(super) const BACK: u32 = 2;
pub(super) const MOST_BACK: u32 = 7;

/// A ring, seen from its focus.
#[derive(Debug, Default)]
pub(super) struct Front {
    slots: Vec<Slot>,
    /// Its edge is the one that is looked at.
    focus: u32,
    /// The slot after it.
    after: u32,
    /// Vertices of these two, and the third of the known triangle between them.
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) opposite: u32,
    /// True when no ring has a live edge.
    pub(super) is_closed: bool,
    /// The slot that a vertex got last.
    slot_of: Vec<u32>,
    /// A slot of each ring that waits.
    waiting: Vec<u32>,
}

impl Front {
    /// Closed, with room for some slots.
    pub(super) fn new(slots: usize, vertices: usize) -> Self {
        Self { slots: Vec::with_capacity(slots), slot_of: vec![0; vertices], is_closed: true, ..Self::default() }
    }

    #[inline(always)]
    fn slot(&mut self, at: u32) -> &mut Slot {
        &mut self.slots[at as usize]
    }

    /// A new ring around one triangle.
    pub(super) fn start(&mut self, [a, b, c]: [u32; 3]) {
        let first = self.slots.len() as u32;
        self.slots.extend([
            Slot { vertex: a, next: first + 1, previous: first + 2, opposite: c },
            Slot { vertex: b, next: first + 2, previous: first, opposite: a },
            Slot { vertex: c, next: first, previous: first + 1, opposite: b },
        ]);
        for (slot, vertex) in (first..).zip([a, b, c]) {
            self.slot_of[vertex as usize] = slot;
        }
        (self.focus, self.after) = (first, first + 1);
        (self.from, self.to, self.opposite) = (a, b, c);
        self.is_closed = false;
    }

    /// Joins a triangle with a vertex that is put between the two.
    #[inline(always)]
    pub(super) fn add(&mut self, vertex: u32) -> [u32; 3] {
        let (slot, focus, after) = (self.slots.len() as u32, self.focus, self.after);
        self.slots.push(Slot { vertex, next: after, previous: focus, opposite: self.from });
        self.slot(after).previous = slot;
        self.slot(focus).next = slot;
        self.slot_of[vertex as usize] = slot;
        let triangle = [self.to, self.from, vertex];
        (self.after, self.opposite, self.to) = (slot, self.to, vertex);
        triangle
    }

    /// The slot and vertex that [`Self::close`] would join the edge with.
    #[inline(always)]
    fn closing(&self) -> Option<(u32, u32)> {
        let before = self.slots[self.focus as usize].previous;
        let vertex = self.slots[before as usize].vertex;
        (vertex != HOLE && before != self.after).then_some((before, vertex))
    }

    /// The same for [`Self::skip`].
    #[inline(always)]
    fn skipping(&self) -> Option<(u32, u32)> {
        let third = self.slots[self.after as usize].next;
        let vertex = self.slots[third as usize].vertex;
        (vertex != HOLE && third != self.focus && self.after != self.focus).then_some((third, vertex))
    }

    /// True when [`Self::close`] would join the edge with this vertex.
    pub(super) fn can_close(&self, vertex: u32) -> bool {
        self.closing().is_some_and(|(_, found)| found == vertex)
    }

    /// The same for [`Self::skip`].
    pub(super) fn can_skip(&self, vertex: u32) -> bool {
        self.skipping().is_some_and(|(_, found)| found == vertex)
    }

    /// Joins a triangle with the slot before the focus, which leaves the ring.
    #[inline(always)]
    pub(super) fn close(&mut self) -> Option<[u32; 3]> {
        let (before, vertex) = self.closing()?;
        let after = self.after;
        let triangle = [self.to, self.from, vertex];
        self.slot(before).next = after;
        self.slot(after).previous = before;
        (self.focus, self.opposite, self.from) = (before, self.from, vertex);
        if self.slot(after).next == before {
            self.retire(before, after);
        }
        Some(triangle)
    }

    /// Joins a triangle with the slot after the next, which leaves the ring.
    #[inline(always)]
    pub(super) fn skip(&mut self) -> Option<[u32; 3]> {
        let (third, vertex) = self.skipping()?;
        let focus = self.focus;
        let triangle = [self.to, self.from, vertex];
        self.slot(focus).next = third;
        self.slot(third).previous = focus;
        (self.after, self.opposite, self.to) = (third, self.to, vertex);
        Some(triangle)
    }

    /// Nothing more is joined to the edge.
    #[inline(always)]
    pub(super) fn end(&mut self) {
        let (focus, after) = (self.focus, self.after);
        let third = self.slot(after).next;
        let hole = if self.slot(third).vertex == HOLE {
            third
        } else {
            let hole = self.slots.len() as u32;
            self.slots.push(Slot { vertex: HOLE, next: after, previous: focus, opposite: HOLE });
            self.slot(after).previous = hole;
            hole
        };
        self.slot(focus).next = hole;
        self.slot(hole).previous = focus;
        self.settle(focus);
    }

    /// Joins a triangle with a vertex that is known. Where that still has a slot, the ring becomes two there, or two become one.
    pub(super) fn join(&mut self, vertex: u32) -> [u32; 3] {
        let slot = self.slot_of[vertex as usize];
        let is_there = self.is_live(slot) && self.slot(slot).vertex == vertex;
        if is_there && slot != self.focus && slot != self.after { self.join_slot(slot, vertex) } else { self.add(vertex) }
    }

    /// How many slots before the focus there is one with this vertex, if [`Self::join_back`] reaches it.
    pub(super) fn back_to(&self, vertex: u32) -> Option<u32> {
        (BACK..=MOST_BACK).find(|back| self.back(*back).is_some_and(|slot| self.slots[slot as usize].vertex == vertex))
    }

    /// Joins a triangle with the slot so many before the focus. What lies between becomes a ring of its own, and the one in focus.
    #[inline(always)]
    pub(super) fn join_back(&mut self, back: u32) -> Option<[u32; 3]> {
        let slot = self.back(back)?;
        let vertex = self.slot(slot).vertex;
        (vertex != HOLE).then(|| self.join_slot(slot, vertex))
    }

    #[inline(always)]
    fn back(&self, back: u32) -> Option<u32> {
        let mut slot = self.focus;
        for _ in 0..back {
            slot = self.slots[slot as usize].previous;
            if slot == self.after {
                return None;
            }
        }
        (slot != self.focus).then_some(slot)
    }

    /// Whether a slot is part of a ring: those that left are no longer their neighbours' neighbour.
    fn is_live(&self, slot: u32) -> bool {
        let Slot { vertex, next, previous, .. } = self.slots[slot as usize];
        vertex != HOLE && self.slots[previous as usize].next == slot && self.slots[next as usize].previous == slot
    }

    #[inline(always)]
    fn join_slot(&mut self, slot: u32, vertex: u32) -> [u32; 3] {
        let (focus, after, previous) = (self.focus, self.after, self.slots[slot as usize].previous);
        let twin = self.slots.len() as u32;
        self.slots.push(Slot { vertex, next: after, previous, opposite: self.from });
        self.slot(previous).next = twin;
        self.slot(after).previous = twin;
        self.slot(focus).next = slot;
        self.slot(slot).previous = focus;
        self.waiting.push(twin);
        let triangle = [self.to, self.from, vertex];
        (self.after, self.opposite, self.to) = (slot, self.to, vertex);
        triangle
    }

    /// The ring has only these two slots, with nothing between them any more.
    fn retire(&mut self, a: u32, b: u32) {
        self.slot(a).vertex = HOLE;
        self.slot(b).vertex = HOLE;
        loop {
            let Some(slot) = self.waiting.pop() else {
                self.is_closed = true;
                return;
            };
            if self.is_live(slot) {
                return self.settle(slot);
            }
        }
    }

    /// Moves the focus to the nearest live edge, backwards.
    #[inline(always)]
    fn settle(&mut self, mut focus: u32) {
        loop {
            let Slot { vertex, next, previous, opposite } = *self.slot(focus);
            let to = self.slot(next).vertex;
            if to != HOLE {
                (self.focus, self.after) = (focus, next);
                (self.from, self.to, self.opposite) = (vertex, to, opposite);
                return;
            }
            if self.slot(previous).vertex != HOLE {
                focus = previous;
                continue;
            }
            if previous == next {
                return self.retire(focus, focus);
            }
            // Between two holes: they become one.
            let behind = self.slot(next).next;
            self.slot(previous).next = behind;
            self.slot(behind).previous = previous;
            focus = self.slot(previous).previous;
        }
    }
}
