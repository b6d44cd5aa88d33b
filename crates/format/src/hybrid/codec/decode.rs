//! Decoding: all streams of symbols, then the page from them.
//!
//! In: bytes, the model, what the node's record says. Out: a [`Page`], or `None`.
//! What always holds: bytes whatever end in a page of exactly as many vertices, triangles, points and borders as asked for, or in `None`,
//! after work and memory in proportion to these.

use super::front::{self, Front};
use super::lanes::{BitReader, LANES, Reader};
use super::model::Model;
use super::predict::{self, Plane, parallelogram};
use super::streams::{self, KEYS, OF_POINTS, RARE, SIZES, STREAMS, TOKENS, table_of};
use super::values::unfolded;
use super::{points, weave};
use crate::hybrid::{NodeRecord, Page, Root};

/// Symbols of all streams, and the bits that belong to them.
struct Streams {
    tokens: Vec<u8>,
    rare: Vec<u32>,
    keys: Vec<u8>,
    shift: u32,
    classes: [Vec<u8>; STREAMS.len()],
    bits: BitReader,
}

impl Streams {
    fn read(mut bytes: &[u8], model: &Model, record: &NodeRecord, root: &Root) -> Option<Self> {
        let (vertices, points, triangles) = (record.vertices as usize, record.points as usize, record.triangles as usize);
        let [tokens, rare, raw] = [varint(&mut bytes)?, varint(&mut bytes)?, varint(&mut bytes)?];
        // Each token has a step: a triangle, or one of three edges that nothing is joined to.
        if tokens > 4 * triangles || rare > 8 * triangles {
            return None;
        }
        let shift = u32::from(*bytes.split_off_first()?);
        if shift > 15 {
            return None;
        }
        let counts = streams::counts(vertices, points, root.has_colors);
        let mut sizes = [0; STREAMS.len()];
        for (size, _) in sizes.iter_mut().zip(counts).filter(|(_, count)| *count > 0) {
            *size = usize::from(*bytes.split_off_first()?);
            if *size >= SIZES {
                return None;
            }
        }
        let (states, rest) = bytes.split_first_chunk::<{ 4 * LANES }>()?;
        let states = std::array::from_fn(|lane| {
            u32::from_le_bytes(std::array::from_fn(|byte| states[4 * lane + byte]))
        });
        let (words, raw) = rest.split_at_checked(rest.len().checked_sub(raw)?)?;
        let mut reader = Reader::new(states, words)?;
        let mut symbols = |table, count| {
            let mut out = vec![0; count];
            reader.symbols(model.slots(table), &mut out).map(|()| out)
        };
        let (tokens, rare_classes, keys) = (symbols(TOKENS, tokens)?, symbols(RARE, rare)?, symbols(KEYS, points)?);
        let mut classes: [Vec<u8>; STREAMS.len()] = Default::default();
        for (stream, classes) in classes.iter_mut().enumerate() {
            *classes = symbols(table_of(STREAMS[stream], sizes[stream]), counts[stream])?;
        }
        if !reader.is_at_end() {
            return None;
        }
        let mut bits = BitReader::new(raw);
        let mut rare = vec![0; rare];
        bits.numbers(&rare_classes, &mut rare, |number| number)?;
        Some(Self { tokens, rare, keys, shift, classes, bits })
    }

    /// Numbers of a stream; the streams' in order.
    fn numbers<T: Clone + Default>(&mut self, stream: usize, of: impl Fn(u32) -> T) -> Option<Vec<T>> {
        let mut out = vec![T::default(); self.classes[stream].len()];
        self.bits.numbers(&self.classes[stream], &mut out, of)?;
        Some(out)
    }
}

fn varint(bytes: &mut &[u8]) -> Option<usize> {
    let mut number = 0;
    for shift in [0, 7, 14, 21] {
        let byte = *bytes.split_off_first()?;
        number |= usize::from(byte & 127) << shift;
        if byte < 128 {
            return Some(number);
        }
    }
    None
}

/// What grows while the front moves.
struct Weaving<'a> {
    front: Front,
    rare: std::slice::Iter<'a, u32>,
    steps: [&'a [i16]; 3],
    /// Vertices so far.
    known: usize,
    vertices: usize,
    positions: Vec<[u16; 3]>,
    triangles: Vec<[u32; 3]>,
    most_triangles: usize,
    borders: Vec<[u32; 2]>,
    most_borders: usize,
    /// The edge beside which each vertex was put, where colours need it.
    beside: Option<Vec<[u32; 2]>>,
}

impl Weaving<'_> {
    /// The next vertex.
    #[inline(always)]
    fn vertex(&mut self, guess: [i32; 3], plane: Plane, beside: [u32; 2]) -> Option<u32> {
        let known = self.known;
        let step = [*self.steps[0].get(known)?, *self.steps[1].get(known)?, *self.steps[2].get(known)?];
        *self.positions.get_mut(known)? = plane.position(guess, step);
        if let Some(edges) = &mut self.beside {
            edges.push(beside);
        }
        self.known += 1;
        Some(known as u32)
    }

    /// One that begins a component, or has no triangle.
    fn vertex_alone(&mut self) -> Option<u32> {
        let before = self.known.checked_sub(1);
        let guess = before.map_or([0; 3], |before| self.positions[before].map(i32::from));
        self.vertex(guess, Plane::NONE, [before.unwrap_or(0) as u32; 2])
    }

    fn start(&mut self) -> Option<()> {
        let mut corners = [0; 3];
        for corner in &mut corners {
            *corner = match *self.rare.next()? {
                0 => self.vertex_alone()?,
                back => (self.known as u32).checked_sub(back)?,
            };
        }
        self.triangle(corners)?;
        self.front.start(corners);
        Some(())
    }

    #[inline(always)]
    fn triangle(&mut self, triangle: [u32; 3]) -> Option<()> {
        if self.triangles.len() >= self.most_triangles {
            return None;
        }
        self.triangles.push(triangle);
        Some(())
    }

    #[inline(always)]
    fn token(&mut self, token: u8) -> Option<()> {
        let (added, end) = (token / weave::ENDS, token % weave::ENDS);
        if added > 0 {
            let at = |vertex: u32| self.positions[vertex as usize];
            let plane = Plane::of(at(self.front.from), at(self.front.to), at(self.front.opposite));
            for _ in 0..added {
                let [a, b, c] = [self.front.from, self.front.to, self.front.opposite];
                let guess =
                    parallelogram(self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]);
                let vertex = self.vertex(guess, plane, [a, b])?;
                let triangle = self.front.add(vertex);
                self.triangle(triangle)?;
            }
            if u32::from(added) == weave::MOST_ADDED {
                return Some(());
            }
        }
        match end {
            weave::CLOSE => {
                let triangle = self.front.close()?;
                self.triangle(triangle)
            }
            weave::BORDER => {
                if self.borders.len() >= self.most_borders {
                    return None;
                }
                self.borders.push([self.front.from, self.front.to]);
                self.front.end();
                Some(())
            }
            weave::SKIP => {
                let triangle = self.front.skip()?;
                self.triangle(triangle)
            }
            weave::BACK => {
                let triangle = self.front.join_back(front::BACK)?;
                self.triangle(triangle)
            }
            _ => self.rare(),
        }
    }

    fn rare(&mut self) -> Option<()> {
        match *self.rare.next()? {
            weave::SEAM => {
                self.front.end();
                Some(())
            }
            back @ 1..weave::TO_KNOWN => {
                let triangle = self.front.join_back(front::BACK + back)?;
                self.triangle(triangle)
            }
            ago => {
                let vertex = (self.known as u32).checked_sub(ago - weave::TO_KNOWN + 1)?;
                let triangle = self.front.join(vertex);
                self.triangle(triangle)
            }
        }
    }
}

/// Undoes [`super::Prepared::encode`].
pub(in super::super) fn decode(bytes: &[u8], model: &Model, record: &NodeRecord, root: &Root) -> Option<Page> {
    let (vertices, points, triangles) = (record.vertices as usize, record.points as usize, record.triangles as usize);
    let mut streams = Streams::read(bytes, model, record, root)?;
    let step = |number: u32| unfolded(number) as i16;
    let steps = [streams.numbers(0, step)?, streams.numbers(1, step)?, streams.numbers(2, step)?];
    let mut weaving = Weaving {
        front: Front::new(vertices + vertices / 4 + 64, vertices),
        rare: streams.rare.iter(),
        steps: steps.each_ref().map(|steps| &steps[..]),
        known: 0,
        vertices,
        positions: vec![[0; 3]; vertices + points],
        triangles: Vec::with_capacity(triangles),
        most_triangles: triangles,
        borders: Vec::with_capacity(record.borders as usize),
        most_borders: record.borders as usize,
        beside: root.has_colors.then(|| Vec::with_capacity(vertices)),
    };
    for token in &streams.tokens {
        if weaving.front.is_closed {
            weaving.start()?;
        }
        weaving.token(*token)?;
    }
    while weaving.known < weaving.vertices {
        weaving.vertex_alone()?;
    }
    let Weaving { front, rare, positions, triangles: woven, borders, beside, .. } = weaving;
    if !front.is_closed || rare.len() > 0 || woven.len() != triangles || borders.len() != record.borders as usize {
        return None;
    }
    let mut page = Page { positions, triangles: woven, borders, ..Page::default() };
    vertex_normals(&mut page, &mut streams, vertices, root.normal_bits)?;
    if let Some(beside) = beside {
        vertex_colors(&mut page, &mut streams, &beside)?;
    }
    all_points(&mut page, &mut streams, vertices, root)?;
    streams.bits.is_within().then_some(page)
}

fn vertex_normals(page: &mut Page, streams: &mut Streams, vertices: usize, bits: u32) -> Option<()> {
    let most = ((1 << bits) - 1) as f32;
    let mask = (1 << bits) - 1;
    let sums = predict::normals(&page.positions, &page.triangles, vertices);
    let [u, v] = [streams.numbers(3, |number| number as u16)?, streams.numbers(4, |number| number as u16)?];
    page.normals.reserve_exact(page.positions.len());
    page.normals.extend(sums.iter().zip(u).zip(v).map(|((sum, u), v)| {
        let [guess_u, guess_v] = predict::octahedral([sum[0], sum[1], sum[2]], most);
        predict::wrapped(guess_u, u32::from(u), mask) | predict::wrapped(guess_v, u32::from(v), mask) << 16
    }));
    Some(())
}

fn vertex_colors(page: &mut Page, streams: &mut Streams, beside: &[[u32; 2]]) -> Option<()> {
    let byte = |number: u32| unfolded(number) as u8;
    let [green, red, blue] = [streams.numbers(5, byte)?, streams.numbers(6, byte)?, streams.numbers(7, byte)?];
    page.colors.reserve_exact(page.positions.len());
    for (((edge, green), red), blue) in beside.iter().zip(green).zip(red).zip(blue) {
        let [a, b] = edge.map(|vertex| page.colors.get(vertex as usize).copied().unwrap_or_default());
        page.colors.push(predict::color_from(predict::between(a, b), [green, red, blue]));
    }
    Some(())
}

fn all_points(page: &mut Page, streams: &mut Streams, vertices: usize, root: &Root) -> Option<()> {
    let number = |number: u32| number;
    let [u, v] = [streams.numbers(OF_POINTS, number)?, streams.numbers(OF_POINTS + 1, number)?];
    let mask = (1 << root.normal_bits) - 1;
    let mut before = predict::middle(root.normal_bits);
    for (u, v) in u.into_iter().zip(v) {
        let code = [predict::wrapped(before[0], u, mask), predict::wrapped(before[1], v, mask)];
        page.normals.push(code[0] | code[1] << 16);
        before = code.map(|coordinate| coordinate as i32);
    }
    let byte = |number: u32| unfolded(number) as u8;
    let channels = [2, 3, 4].map(|channel| streams.numbers(OF_POINTS + channel, byte));
    let [green, red, blue] = channels;
    let mut before = [0; 4];
    for ((green, red), blue) in green?.into_iter().zip(red?).zip(blue?) {
        before = predict::color_from(before, [green, red, blue]);
        page.colors.push(before);
    }
    let mut key = 0;
    for (class, position) in streams.keys.iter().zip(&mut page.positions[vertices..]) {
        let bits = streams.bits.bits(points::bits_of(*class))?;
        key = points::key_from(*class, key, bits);
        *position = points::position_of(key).map(|coordinate| coordinate << streams.shift);
    }
    Some(())
}
