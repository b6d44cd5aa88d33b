//! Coding, first half: a page in the order of its decoder, and the numbers that are to be coded.

use super::lanes::{BitWriter, Writer};
use super::model::Model;
use super::predict::{Plane, normals, octahedral, parallelogram};
use super::streams::{FIXED, KEYS, OF_POINTS, RARE, STREAMS, TOKENS, table_of};
use super::values::{BASES, EXTRA_BITS, class_of, folded};
use super::weave::{Woven, weave};
use super::{points, predict};
use crate::hybrid::{Page, stored};
use glam::Vec4;

/// A page ready to be coded, under any model.
#[derive(Clone, Debug)]
pub struct Prepared {
    page: Page,
    vertices: usize,
    pub(super) tokens: Vec<u8>,
    pub(super) rare: Vec<u32>,
    /// Of the keys of points, which are coarser than positions by this many bits.
    pub(super) key_classes: Vec<u8>,
    keys: Vec<u64>,
    shift: u32,
    /// Folded differences of each stream.
    pub(super) differences: [Vec<u32>; STREAMS.len()],
}

impl Prepared {
    /// Prepares a page of so many vertices; the other positions are points.
    ///
    /// # Panics
    /// When an index is not below the number of vertices, an attribute is not there for each position, or a code of a normal has
    /// more bits.
    pub fn new(page: &Page, vertices: u32, normal_bits: u32) -> Self {
        let vertices = vertices as usize;
        let count = page.positions.len();
        assert!(vertices <= count, "{vertices} vertices of {count} positions");
        assert_eq!(page.normals.len(), count, "normals of a page");
        assert!(page.colors.is_empty() || page.colors.len() == count, "colours of a page");
        let woven = weave(&page.triangles, vertices);
        let (order, shift) = sorted(page, vertices, &woven);
        let page = Page {
            positions: order.iter().map(|old| page.positions[*old as usize]).collect(),
            normals: order.iter().map(|old| page.normals[*old as usize]).collect(),
            colors: match page.colors.is_empty() {
                true => Vec::new(),
                false => order.iter().map(|old| page.colors[*old as usize]).collect(),
            },
            triangles: woven.triangles.clone(),
            borders: woven.borders.clone(),
        };
        let mut differences: [Vec<u32>; STREAMS.len()] = Default::default();
        let known: Vec<Vec4> = page.positions[..vertices].iter().copied().map(predict::point).collect();
        positions(&known, &woven, &mut differences);
        vertex_normals(&page, &known, normal_bits, &mut differences);
        colors(&page, vertices, &mut differences);
        let mut prepared = Self {
            page,
            vertices,
            tokens: woven.tokens,
            rare: woven.rare,
            key_classes: Vec::new(),
            keys: Vec::new(),
            shift,
            differences,
        };
        prepared.points(normal_bits);
        prepared
    }

    /// The page as its decoder will give it.
    pub fn page(&self) -> &Page {
        &self.page
    }

    /// The same, given away.
    pub fn into_page(self) -> Page {
        self.page
    }

    fn points(&mut self, normal_bits: u32) {
        let vertices = self.vertices;
        let mut before = 0;
        for position in &self.page.positions[vertices..] {
            let key = points::key_of(position.map(|coordinate| coordinate >> self.shift));
            self.key_classes.push(points::class_of(key, before));
            self.keys.push(key);
            before = key;
        }
        let mut before = predict::middle(normal_bits);
        for normal in &self.page.normals[vertices..] {
            let code = [(normal & 0xFFFF) as i32, (normal >> 16) as i32];
            for coordinate in 0..2 {
                let difference = predict::difference(code[coordinate], before[coordinate], normal_bits);
                self.differences[OF_POINTS + coordinate].push(difference);
            }
            before = code;
        }
        if !self.page.colors.is_empty() {
            let mut before = [0; 4];
            for color in &self.page.colors[vertices..] {
                for (channel, difference) in predict::color_differences(*color, before).into_iter().enumerate() {
                    self.differences[OF_POINTS + 2 + channel].push(difference);
                }
                before = *color;
            }
        }
    }

    /// The bytes of the page.
    pub fn encode(&self, model: &Model) -> Vec<u8> {
        let mut bits = BitWriter::default();
        let mut classes_of = |numbers: &[u32]| -> Vec<u8> {
            numbers
                .iter()
                .map(|number| {
                    let class = class_of(*number);
                    let at = usize::from(class);
                    bits.put(u64::from(number - BASES[at]), u32::from(EXTRA_BITS[at]));
                    class
                })
                .collect()
        };
        let rare = classes_of(&self.rare);
        let streams: Vec<Vec<u8>> = self.differences.iter().map(|numbers| classes_of(numbers)).collect();
        for (class, key) in self.key_classes.iter().zip(&self.keys) {
            bits.put(*key, points::bits_of(*class));
        }
        let mut raw = bits.bytes();
        // No page may promise much with few bytes.
        let held = self.page.positions.len() + self.page.triangles.len();
        raw.resize(raw.len().max(held.div_ceil(stored::MOST_PER_BYTE as usize)), 0);
        let mut out = Vec::new();
        for count in [self.tokens.len(), self.rare.len(), raw.len()] {
            put_varint(count, &mut out);
        }
        out.push(self.shift as u8);
        let mut coded = Vec::with_capacity(FIXED + STREAMS.len());
        coded.extend([(TOKENS, &self.tokens), (RARE, &rare), (KEYS, &self.key_classes)]);
        for (kind, classes) in STREAMS.iter().zip(&streams) {
            if !classes.is_empty() {
                let size = model.best_size(*kind, classes);
                out.push(size as u8);
                coded.push((table_of(*kind, size), classes));
            }
        }
        let mut writer = Writer::new();
        for (table, symbols) in coded.iter().rev() {
            writer.symbols(model.table(*table), symbols);
        }
        writer.finish(&mut out);
        out.extend(raw);
        out
    }
}

/// Vertices in the order of the weave, then points in that of their keys; and how many low bits no point uses.
fn sorted(page: &Page, vertices: usize, woven: &Woven) -> (Vec<u32>, u32) {
    let mut order = woven.order.clone();
    let mut points: Vec<u32> = (vertices as u32..page.positions.len() as u32).collect();
    points.sort_by_key(|point| {
        let at = *point as usize;
        (points::key_of(page.positions[at]), page.normals[at], page.colors.get(at).copied())
    });
    order.extend(points);
    let used = page.positions[vertices..].as_flattened().iter().fold(0, |used, coordinate| used | coordinate);
    (order, if used == 0 { 0 } else { used.trailing_zeros() })
}

fn positions(points: &[Vec4], woven: &Woven, differences: &mut [Vec<u32>; STREAMS.len()]) {
    for (vertex, made) in woven.made.iter().enumerate() {
        let at = |corner: u32| if vertex == 0 { Vec4::ZERO } else { points[corner as usize] };
        let [a, b, c] = made.beside.map(at);
        let [d, e, f] = made.plane.map(at);
        let step = Plane::of(d, e, f).step(parallelogram(a, b, c), points[vertex]);
        for (stream, step) in differences.iter_mut().zip(step.to_array().into_iter().take(3)) {
            stream.push(folded(step as i32));
        }
    }
}

fn vertex_normals(page: &Page, points: &[Vec4], normal_bits: u32, differences: &mut [Vec<u32>; STREAMS.len()]) {
    let most = ((1 << normal_bits) - 1) as f32;
    let guesses = normals(points, &page.triangles);
    for (direction, normal) in guesses.into_iter().zip(&page.normals) {
        let code = [(normal & 0xFFFF) as i32, (normal >> 16) as i32];
        let guess = octahedral(direction, most);
        for coordinate in 0..2 {
            assert!(
                code[coordinate] >> normal_bits == 0,
                "a normal's code {normal:#010x}, expected {normal_bits} bits"
            );
            differences[3 + coordinate].push(predict::difference(code[coordinate], guess[coordinate], normal_bits));
        }
    }
}

fn colors(page: &Page, vertices: usize, differences: &mut [Vec<u32>; STREAMS.len()]) {
    if page.colors.is_empty() {
        return;
    }
    for (vertex, [a, b]) in predict::edges(&page.triangles, vertices).into_iter().enumerate() {
        let at = |corner: u32| if vertex == 0 { [0; 4] } else { page.colors[corner as usize] };
        let guess = predict::between(at(a), at(b));
        for (channel, difference) in predict::color_differences(page.colors[vertex], guess).into_iter().enumerate() {
            differences[5 + channel].push(difference);
        }
    }
}

/// LEB128.
fn put_varint(mut number: usize, out: &mut Vec<u8>) {
    while number >= 128 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}
