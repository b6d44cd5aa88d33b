//! Decoding: all streams of symbols, then the page from them.
//!
//! In: bytes, the model, what the node's record says. Out: a [`Page`], or `None`.
//! What always holds: bytes whatever end in a page of exactly as many vertices, triangles, points and borders as asked for, or in `None`,
//! after work and memory in proportion to these.

use super::front::{self, Store};
use super::lanes::{BitReader, LANES, Reader};
use super::model::Model;
use super::predict::{self, Plane, parallelogram};
use super::streams::{self, KEYS, OF_POINTS, RARE, SIZES, STREAMS, TOKENS, table_of};
use super::values::unfolded;
use super::{points, weave};
use crate::hybrid::{NodeRecord, Page, Root};
use glam::Vec4;

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
        bits.numbers::<2, _>(&rare_classes, &mut rare, |out, number| *out = number)?;
        Some(Self { tokens, rare, keys, shift, classes, bits })
    }

    /// Numbers of a stream; the streams' in order.
    fn numbers<T: Clone + Default>(&mut self, stream: usize, of: impl Fn(u32) -> T) -> Option<Vec<T>> {
        let mut out = vec![T::default(); self.classes[stream].len()];
        self.bits.numbers::<3, _>(&self.classes[stream], &mut out, |out, number| *out = of(number))?;
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

/// What the triangles are made from, and what they become.
struct Weaving<'a> {
    tokens: &'a [u8],
    rare: &'a [u32],
    /// At first the steps to them.
    points: &'a mut [Vec4],
    triangles: &'a mut [[u32; 3]],
    borders: &'a mut Vec<[u32; 2]>,
    most_borders: usize,
}

/// All triangles, and the vertices that have none. What changes with each triangle is kept in variables.
#[inline(never)]
fn weave(weaving: Weaving<'_>) -> Option<()> {
    let Weaving { tokens, rare, points, triangles, borders, most_borders } = weaving;
    let mut store = Store::new(points.len() + rare.len() + tokens.len(), points.len());
    let (mut front, mut at) = store.front();
    let mut rare = rare.iter();
    let (mut next_vertex, mut triangles) = (0, triangles.iter_mut());
    for token in tokens {
        if at.is_closed {
            let mut corners = [0; 3];
            for corner in &mut corners {
                *corner = match *rare.next()? {
                    0 => {
                        place_alone(points, next_vertex)?;
                        next_vertex += 1;
                        next_vertex - 1
                    }
                    back => next_vertex.checked_sub(back)?,
                };
            }
            *triangles.next()? = corners;
            front.start(&mut at, corners);
        }
        let (added, end) = (token / weave::ENDS, token % weave::ENDS);
        if added > 0 {
            let [a, mut b, mut c] = [at.from, at.to, at.opposite].map(|vertex| points[vertex as usize]);
            let plane = Plane::of(a, b, c);
            for _ in 0..added {
                let place = points.get_mut(next_vertex as usize)?;
                *place = plane.position(parallelogram(a, b, c), *place);
                (c, b) = (b, *place);
                *triangles.next()? = front.add(&mut at, next_vertex);
                next_vertex += 1;
            }
            front.link(&at);
            if u32::from(added) >= weave::MOST_ADDED {
                continue;
            }
        }
        *triangles.next()? = match end {
            weave::CLOSE => front.close(&mut at)?,
            weave::BORDER => {
                if borders.len() >= most_borders {
                    return None;
                }
                borders.push([at.from, at.to]);
                front.end(&mut at);
                continue;
            }
            weave::SKIP => front.skip(&mut at)?,
            weave::BACK => front.join_back(&mut at, front::BACK)?,
            _ => match *rare.next()? {
                weave::SEAM => {
                    front.end(&mut at);
                    continue;
                }
                back @ 1..weave::TO_KNOWN => front.join_back(&mut at, front::BACK + back)?,
                ago => front.join(&mut at, next_vertex.checked_sub(ago - weave::TO_KNOWN + 1)?),
            },
        };
    }
    for vertex in next_vertex..points.len() as u32 {
        place_alone(points, vertex)?;
    }
    (at.is_closed && rare.len() == 0 && triangles.len() == 0).then_some(())
}

/// Places a vertex that begins a component or has no triangle.
fn place_alone(points: &mut [Vec4], vertex: u32) -> Option<()> {
    let before = vertex.checked_sub(1).map_or(Vec4::ZERO, |before| points[before as usize]);
    let place = points.get_mut(vertex as usize)?;
    *place = Plane::NONE.position(before, *place);
    Some(())
}

/// Undoes [`super::Prepared::encode`].
pub(in super::super) fn decode(bytes: &[u8], model: &Model, record: &NodeRecord, root: &Root) -> Option<Page> {
    let (vertices, points, triangles) = (record.vertices as usize, record.points as usize, record.triangles as usize);
    let mut streams = Streams::read(bytes, model, record, root)?;
    let mut known = vec![Vec4::ZERO; vertices];
    let [first, second, third, ..] = &streams.classes;
    let step = |number| unfolded(number) as f32;
    streams.bits.numbers::<3, _>(first, &mut known, |point, number| point.x = step(number))?;
    streams.bits.numbers::<3, _>(second, &mut known, |point, number| point.y = step(number))?;
    streams.bits.numbers::<3, _>(third, &mut known, |point, number| point.z = step(number))?;
    let mut page = Page {
        positions: vec![[0; 3]; vertices + points],
        triangles: vec![[0; 3]; triangles],
        borders: Vec::with_capacity(record.borders as usize),
        ..Page::default()
    };
    weave(Weaving {
        tokens: &streams.tokens,
        rare: &streams.rare,
        points: &mut known,
        triangles: &mut page.triangles,
        borders: &mut page.borders,
        most_borders: record.borders as usize,
    })?;
    if page.borders.len() != record.borders as usize {
        return None;
    }
    predict::positions(&known, record.extent_steps, &mut page.positions)?;
    vertex_normals(&mut page, &mut streams, &known, root.normal_bits)?;
    if root.has_colors {
        vertex_colors(&mut page, &mut streams, vertices)?;
    }
    all_points(&mut page, &mut streams, record, root)?;
    streams.bits.is_within().then_some(page)
}

fn vertex_normals(page: &mut Page, streams: &mut Streams, known: &[Vec4], bits: u32) -> Option<()> {
    let most = ((1 << bits) - 1) as f32;
    let mask = (1 << bits) - 1;
    let mut differences = vec![[0; 2]; known.len()];
    let [_, _, _, first, second, ..] = &streams.classes;
    streams.bits.numbers::<3, _>(first, &mut differences, |[u, _], number| *u = number as u16)?;
    streams.bits.numbers::<3, _>(second, &mut differences, |[_, v], number| *v = number as u16)?;
    let sums = predict::normals(known, &page.triangles);
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

fn all_points(page: &mut Page, streams: &mut Streams, record: &NodeRecord, root: &Root) -> Option<()> {
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
    let (mut key, most) = (0, record.extent_steps);
    for (class, position) in streams.keys.iter().zip(&mut page.positions[record.vertices as usize..]) {
        let bits = streams.bits.bits(points::bits_of(*class))?;
        key = points::key_from(*class, key, bits);
        *position = points::position_of(key).map(|coordinate| coordinate << streams.shift);
        if (0..3).any(|axis| position[axis] > most[axis]) {
            return None;
        }
    }
    Some(())
}
