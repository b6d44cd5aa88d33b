//! The stranger's front of rings, as in *Triangles* and *Positions* of `docs/format.md`.

use std::collections::HashMap;

pub(crate) fn cross(u: [f32; 3], v: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        u[j] * v[k] - u[k] * v[j]
    })
}

pub(crate) fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

/// A slot: vertex (none for a hole), next, before, opposite, and whether its ring is done.
#[derive(Clone, Copy, Debug)]
struct Slot(Option<u32>, usize, usize, u32, bool);

#[derive(Default)]
pub(crate) struct Front {
    pub(crate) rares: std::collections::VecDeque<u64>,
    slots: Vec<Slot>,
    newest: HashMap<u32, usize>,
    stack: Vec<usize>,
    pub(crate) focus: Option<usize>,
    opposite: u32,
    pub(crate) places: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) borders: Vec<[u32; 2]>,
}

impl Front {
    fn place(&mut self, guess: [f32; 3], step: [f32; 3]) -> u32 {
        self.places.push([0, 1, 2].map(|axis| guess[axis] + step[axis]));
        self.places.len() as u32 - 1
    }

    fn step(&self, differences: &[Vec<i64>]) -> [f32; 3] {
        [0, 1, 2].map(|stream| differences[stream][self.places.len()] as f32)
    }

    pub(crate) fn place_alone(&mut self, differences: &[Vec<i64>]) -> u32 {
        let before = self.places.last().copied().unwrap_or([0.0; 3]);
        let step = self.step(differences);
        self.place(before, step)
    }

    fn slot(&mut self, vertex: Option<u32>, next: usize, before: usize, opposite: u32) -> usize {
        self.slots.push(Slot(vertex, next, before, opposite, false));
        let slot = self.slots.len() - 1;
        (self.slots[next].2, self.slots[before].1) = (slot, slot);
        slot
    }

    /// Slots of f and n, and their vertices.
    fn edge(&self) -> (usize, usize, u32, u32) {
        let f = self.focus.unwrap();
        let n = self.slots[f].1;
        (f, n, self.slots[f].0.unwrap(), self.slots[n].0.unwrap())
    }

    fn begin(&mut self, differences: &[Vec<i64>]) {
        let corners = [(); 3].map(|()| match self.rares.pop_front().unwrap() {
            0 => self.place_alone(differences),
            ago => self.places.len() as u32 - ago as u32,
        });
        let first = self.slots.len();
        for (corner, vertex) in corners.into_iter().enumerate() {
            let [next, before] = [1, 2].map(|by| first + (corner + by) % 3);
            self.slots.push(Slot(Some(vertex), next, before, corners[(corner + 2) % 3], false));
            self.newest.insert(vertex, first + corner);
        }
        self.triangles.push(corners);
        (self.focus, self.opposite) = (Some(first), corners[2]);
    }

    pub(crate) fn token(&mut self, token: u64, differences: &[Vec<i64>]) {
        if self.focus.is_none() {
            self.begin(differences);
        }
        let (added, end) = (token / 5, token % 5);
        if added > 0 {
            self.add(added, differences);
        }
        if added == 6 {
            return;
        }
        let (f, n, from, to) = self.edge();
        match end {
            0 => {
                let p = self.slots[f].2;
                self.triangles.push([to, from, self.slots[p].0.unwrap()]);
                (self.slots[p].1, self.slots[n].2) = (n, p);
                (self.focus, self.opposite) = (Some(p), from);
                if self.slots[n].1 == p {
                    self.done(&[p, n]);
                }
            }
            1 => {
                self.borders.push([from, to]);
                self.end();
            }
            2 => {
                let s = self.slots[n].1;
                self.triangles.push([to, from, self.slots[s].0.unwrap()]);
                (self.slots[f].1, self.slots[s].2) = (s, f);
                self.opposite = to;
            }
            3 => self.join_back(2),
            _ => match self.rares.pop_front().unwrap() {
                0 => self.end(),
                back @ 1..=5 => self.join_back(back + 2),
                ago => {
                    let vertex = self.places.len() as u32 - (ago as u32 - 5);
                    let slot = self.newest[&vertex];
                    if self.has_left(slot) || slot == f || slot == n {
                        self.put(vertex);
                    } else {
                        self.join(slot);
                    }
                }
            },
        }
    }

    fn add(&mut self, added: u64, differences: &[Vec<i64>]) {
        let (_, _, from, to) = self.edge();
        let [f, n, o] = [from, to, self.opposite].map(|vertex| self.places[vertex as usize]);
        let normal = cross(minus(n, f), minus(o, f));
        let [x, y, z] = normal.map(f32::abs);
        let i = if x > y && x > z {
            0
        } else if y > z {
            1
        } else {
            2
        };
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let w = if normal[i] == 0.0 { 0.0 } else { -1.0 / normal[i] };
        let slopes = [normal[j] * w, normal[k] * w];
        for _ in 0..added {
            let (_, _, from, to) = self.edge();
            let [f, n, o] = [from, to, self.opposite].map(|vertex| self.places[vertex as usize]);
            let s = self.step(differences);
            let mut step = [0.0; 3];
            (step[j], step[k]) = (s[0], s[1]);
            step[i] = s[2] + (slopes[0] * s[0] + slopes[1] * s[1]).round_ties_even();
            let vertex = self.place([0, 1, 2].map(|axis| f[axis] + n[axis] - o[axis]), step);
            self.put(vertex);
        }
    }

    /// A vertex between f and n.
    fn put(&mut self, vertex: u32) {
        let (f, n, from, to) = self.edge();
        self.triangles.push([to, from, vertex]);
        let slot = self.slot(Some(vertex), n, f, from);
        self.newest.insert(vertex, slot);
        self.opposite = to;
    }

    fn end(&mut self) {
        let (f, n, ..) = self.edge();
        let h = self.slots[n].1;
        if self.slots[h].0.is_none() {
            (self.slots[f].1, self.slots[h].2) = (h, f);
        } else {
            self.slot(None, n, f, 0);
        }
        self.settle(f);
    }

    fn join_back(&mut self, back: u64) {
        let slot = (0..back).fold(self.focus.unwrap(), |slot, _| self.slots[slot].2);
        self.join(slot);
    }

    fn join(&mut self, j: usize) {
        let (f, n, from, to) = self.edge();
        let vertex = self.slots[j].0.unwrap();
        self.triangles.push([to, from, vertex]);
        let before = self.slots[j].2;
        let twin = self.slot(Some(vertex), n, before, from);
        (self.slots[f].1, self.slots[j].2) = (j, f);
        self.stack.push(twin);
        self.opposite = to;
    }

    fn has_left(&self, slot: usize) -> bool {
        let Slot(_, next, before, _, done) = self.slots[slot];
        done || self.slots[next].2 != slot || self.slots[before].1 != slot
    }

    fn settle(&mut self, mut slot: usize) {
        loop {
            let Slot(_, next, before, opposite, _) = self.slots[slot];
            if self.slots[next].0.is_some() {
                (self.focus, self.opposite) = (Some(slot), opposite);
                return;
            }
            if self.slots[before].0.is_some() {
                slot = before;
            } else if before == next {
                return self.done(&[slot]);
            } else {
                let behind = self.slots[next].1;
                (self.slots[before].1, self.slots[behind].2) = (behind, before);
                slot = self.slots[before].2;
            }
        }
    }

    fn done(&mut self, slots: &[usize]) {
        for slot in slots {
            self.slots[*slot].4 = true;
        }
        self.focus = None;
        while let Some(slot) = self.stack.pop() {
            if !self.has_left(slot) {
                return self.settle(slot);
            }
        }
    }
}
