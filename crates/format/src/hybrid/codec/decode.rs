//! Decoding: all streams of symbols, then the page from them.
//!
//! In: bytes, the model, what the node's record says. Out: a [`Page`], or `None`.
//! What always holds: bytes whatever end in a page of exactly as many vertices, triangles, points and borders as asked for, or in `None`,
//! after work and memory in proportion to these.

use super::front::{self, At, Front};
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
        let (vertices, points, triangles) =
            (record.vertices as usize, record.points as usize, record.triangles as usize);
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
        let states =
            std::array::from_fn(|lane| u32::from_le_bytes(std::array::from_fn(|byte| states[4 * lane + byte])));
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
        bits.numbers(&rare_classes, &mut rare, |out, number| *out = number)?;
        Some(Self { tokens, rare, keys, shift, classes, bits })
    }

    /// Numbers of a stream; the streams' in order.
    fn numbers<T: Clone + Default>(&mut self, stream: usize, of: impl Fn(u32) -> T) -> Option<Vec<T>> {
        let mut out = vec![T::default(); self.classes[stream].len()];
        self.bits.numbers(&self.classes[stream], &mut out, |out, number| *out = of(number))?;
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
    steps: &'a [[i16; 3]],
    positions: Vec<[u16; 3]>,
    triangles: Vec<[u32; 3]>,
    borders: Vec<[u32; 2]>,
    most_borders: usize,
}

/// How far it has come: numbers of the next vertex and triangle.
#[derive(Clone, Copy)]
struct Next {
    vertex: u32,
    triangle: usize,
}

impl Weaving<'_> {
    /// Places the next vertex.
    #[inline(always)]
    fn vertex(&mut self, next: &mut Next, guess: [i32; 3], plane: &Plane) -> Option<u32> {
        let vertex = next.vertex;
        let step = *self.steps.get(vertex as usize)?;
        *self.positions.get_mut(vertex as usize)? = plane.position(guess, step);
        next.vertex += 1;
        Some(vertex)
    }

    /// One that begins a component, or has no triangle.
    fn vertex_alone(&mut self, next: &mut Next) -> Option<u32> {
        let before = next.vertex.checked_sub(1);
        let guess = before.map_or([0; 3], |before| self.positions[before as usize].map(i32::from));
        self.vertex(next, guess, &Plane::NONE)
    }

    #[inline(always)]
    fn triangle(&mut self, next: &mut Next, triangle: [u32; 3]) -> Option<()> {
        *self.triangles.get_mut(next.triangle)? = triangle;
        next.triangle += 1;
        Some(())
    }

    #[inline(never)]
    fn start(&mut self, next: &mut Next) -> Option<At> {
        let mut corners = [0; 3];
        for corner in &mut corners {
            *corner = match *self.rare.next()? {
                0 => self.vertex_alone(next)?,
                back => next.vertex.checked_sub(back)?,
            };
        }
        self.triangle(next, corners)?;
        Some(self.front.start(corners))
    }

    /// All triangles. What changes with each is kept in variables of its own.
    #[inline(never)]
    fn weave(&mut self, mut at: At, tokens: &[u8]) -> Option<Next> {
        let mut next = Next { vertex: 0, triangle: 0 };
        for token in tokens {
            if at.is_closed {
                let mut after = next;
                at = self.start(&mut after)?;
                next = after;
            }
            let (added, end) = (token / weave::ENDS, token % weave::ENDS);
            if added > 0 {
                let [a, mut b, mut c] = [at.from, at.to, at.opposite].map(|vertex| self.positions[vertex as usize]);
                let plane = Plane::of(a, b, c);
                for _ in 0..added {
                    let vertex = self.vertex(&mut next, parallelogram(a, b, c), &plane)?;
                    (c, b) = (b, self.positions[vertex as usize]);
                    let triangle = self.front.add(&mut at, vertex);
                    self.triangle(&mut next, triangle)?;
                }
                if u32::from(added) >= weave::MOST_ADDED {
                    continue;
                }
            }
            let triangle = match end {
                weave::CLOSE => self.front.close(&mut at)?,
                weave::BORDER => {
                    if self.borders.len() >= self.most_borders {
                        return None;
                    }
                    self.borders.push([at.from, at.to]);
                    self.front.end(&mut at);
                    continue;
                }
                weave::SKIP => self.front.skip(&mut at)?,
                weave::BACK => self.front.join_back(&mut at, front::BACK)?,
                _ => {
                    let triangle;
                    (at, triangle) = self.rare(at, next.vertex)?;
                    match triangle {
                        Some(triangle) => triangle,
                        None => continue,
                    }
                }
            };
            self.triangle(&mut next, triangle)?;
        }
        at.is_closed.then_some(next)
    }

    #[inline(never)]
    fn rare(&mut self, mut at: At, known: u32) -> Option<(At, Option<[u32; 3]>)> {
        let triangle = match *self.rare.next()? {
            weave::SEAM => {
                self.front.end(&mut at);
                None
            }
            back @ 1..weave::TO_KNOWN => Some(self.front.join_back(&mut at, front::BACK + back)?),
            ago => {
                let triangle;
                (at, triangle) = self.front.join(at, known.checked_sub(ago - weave::TO_KNOWN + 1)?);
                Some(triangle)
            }
        };
        Some((at, triangle))
    }
}

/// Undoes [`super::Prepared::encode`].
pub(in super::super) fn decode(bytes: &[u8], model: &Model, record: &NodeRecord, root: &Root) -> Option<Page> {
    let (vertices, points, triangles) = (record.vertices as usize, record.points as usize, record.triangles as usize);
    let mut streams = Streams::read(bytes, model, record, root)?;
    let mut steps = vec![[0; 3]; vertices];
    for coordinate in 0..3 {
        streams.bits.numbers(&streams.classes[coordinate], &mut steps, |step: &mut [i16; 3], number| {
            step[coordinate] = unfolded(number) as i16;
        })?;
    }
    let (front, at) = Front::new(vertices + vertices / 4 + 64, vertices);
    let mut weaving = Weaving {
        front,
        rare: streams.rare.iter(),
        steps: &steps,
        positions: vec![[0; 3]; vertices + points],
        triangles: vec![[0; 3]; triangles],
        borders: Vec::with_capacity(record.borders as usize),
        most_borders: record.borders as usize,
    };
    let mut next = weaving.weave(at, &streams.tokens)?;
    while (next.vertex as usize) < vertices {
        weaving.vertex_alone(&mut next)?;
    }
    let Weaving { rare, positions, triangles: woven, borders, .. } = weaving;
    if rare.len() > 0 || next.triangle != triangles || borders.len() != record.borders as usize {
        return None;
    }
    let mut page = Page { positions, triangles: woven, borders, ..Page::default() };
    vertex_normals(&mut page, &mut streams, vertices, root.normal_bits)?;
    if root.has_colors {
        vertex_colors(&mut page, &mut streams, vertices)?;
    }
    all_points(&mut page, &mut streams, vertices, root)?;
    streams.bits.is_within().then_some(page)
}

fn vertex_normals(page: &mut Page, streams: &mut Streams, vertices: usize, bits: u32) -> Option<()> {
    let most = ((1 << bits) - 1) as f32;
    let mask = (1 << bits) - 1;
    let mut differences = vec![[0; 2]; vertices];
    for coordinate in 0..2 {
        let set = |difference: &mut [u16; 2], number: u32| difference[coordinate] = number as u16;
        streams.bits.numbers(&streams.classes[3 + coordinate], &mut differences, set)?;
    }
    let sums = predict::normals(&page.positions, &page.triangles, vertices);
    page.normals.reserve_exact(page.positions.len());
    page.normals.extend(sums.iter().zip(differences).map(|(sum, [u, v])| {
        let [guess_u, guess_v] = predict::octahedral(*sum, most);
        predict::wrapped(guess_u, u32::from(u), mask) | predict::wrapped(guess_v, u32::from(v), mask) << 16
    }));
    Some(())
}

fn vertex_colors(page: &mut Page, streams: &mut Streams, vertices: usize) -> Option<()> {
    let byte = |number: u32| unfolded(number) as u8;
    let [green, red, blue] = [streams.numbers(5, byte)?, streams.numbers(6, byte)?, streams.numbers(7, byte)?];
    page.colors.reserve_exact(page.positions.len());
    let edges = predict::edges(&page.triangles, vertices);
    for (((edge, green), red), blue) in edges.into_iter().zip(green).zip(red).zip(blue) {
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
