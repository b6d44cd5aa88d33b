//! Pages of both codecs, read from `docs/format.md` alone: no line of it calls the crate. It trusts its input.
//! Slow and obvious: one table of frequencies a context, one symbol after the other.

use crate::stranger::{Bytes, sphere_codes};
use std::collections::{BTreeMap, HashMap};

/// A node's word and colour.
type Word = (u32, Option<u16>);

/// A page's families of groups of nodes, each a word and a colour; and what its links say.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    pub(crate) families: Vec<Vec<Vec<Word>>>,
    pub(crate) runs: Vec<(u32, u16)>,
    pub(crate) links: Vec<(u16, u16)>,
}

/// What the record says of a page.
#[derive(Clone, Copy)]
pub(crate) struct Counts {
    pub(crate) nodes: usize,
    pub(crate) words: usize,
    pub(crate) families: usize,
    pub(crate) has_colors: bool,
}

fn runs_at(page: &Bytes<'_>, at: usize, count: usize) -> Vec<(u32, u16)> {
    (0..count).map(|run| at as u64 + 6 * run as u64).map(|at| (page.u32(at), page.u16(at + 4))).collect()
}

/// Cuts nodes into groups and groups into families.
fn cut(nodes: Vec<Word>, sizes: &[usize], families: &[usize]) -> Vec<Vec<Vec<Word>>> {
    let (mut nodes, mut sizes) = (nodes.into_iter(), sizes.iter());
    let cut = families
        .iter()
        .map(|groups| sizes.by_ref().take(*groups).map(|size| nodes.by_ref().take(*size).collect()).collect())
        .collect();
    assert!(nodes.next().is_none() && sizes.next().is_none());
    cut
}

/// Codec 0.
pub(crate) fn raw(bytes: &[u8], counts: Counts) -> Contents {
    let Counts { nodes: n, words: w, families: f, has_colors } = counts;
    let page = Bytes(bytes);
    let (g, r) = (usize::from(page.u16(0)), usize::from(bytes[2]));
    let sizes_at = 4 + 6 * r;
    let families_at = sizes_at + g.div_ceil(4);
    let nodes_at = families_at + f.div_ceil(4);
    let colors_at = nodes_at + 4 * n;
    let links_at = colors_at + if has_colors { 2 * n } else { 0 };
    assert_eq!(bytes.len(), links_at + 2 * (w - n));
    let two_bits = |from: usize, at: usize| usize::from(bytes[from + at / 4] >> (at % 4 * 2) & 3) + 1;
    let sizes: Vec<usize> = (0..g).map(|group| two_bits(sizes_at, group)).collect();
    let families: Vec<usize> = (0..f).map(|family| two_bits(families_at, family)).collect();
    let color = |node: usize| has_colors.then(|| page.u16((colors_at + 2 * node) as u64));
    let nodes = (0..n).map(|node| (page.u32((nodes_at + 4 * node) as u64), color(node))).collect();
    let links = (0..w - n).map(|link| page.u16((links_at + 2 * link) as u64)).map(|bits| (bits >> 12, bits & 0xFFF));
    Contents { families: cut(nodes, &sizes, &families), runs: runs_at(&page, 4, r), links: links.collect() }
}

const KIND: i64 = 0;
const CONE_AND_FACE: i64 = 28;
const CLASSES: i64 = 188;
const EDGE: i64 = 236;
const ALONG_1: i64 = 264;
const ALONG_2: i64 = 342;
const ACROSS: i64 = 576;
const GREEN: i64 = 602;
const RED: i64 = 604;
const BLUE: i64 = 608;
const FAMILY: i64 = 612;
const RUN: i64 = 616;
const SKIP: i64 = 632;

/// The legal symbols of all contexts.
fn contexts() -> BTreeMap<i64, Vec<u64>> {
    let mut contexts = BTreeMap::new();
    for number in 0..28 {
        let odd_only = number / 4 >= 5;
        let symbols = (0..16).filter(|symbol| *symbol != 2 && *symbol != 3 && (!odd_only || symbol % 2 == 1));
        contexts.insert(KIND + number, symbols.collect());
    }
    for number in 0..80 {
        contexts.insert(CONE_AND_FACE + 2 * number, (0..24).collect());
    }
    for number in 0..16 {
        contexts.insert(CLASSES + 3 * number, (0..6).flat_map(|k| (0..6).map(move |m| 8 * k + m)).collect());
    }
    for number in 0..28 {
        contexts.insert(EDGE + number, (0..13).collect());
    }
    for s in 1..=13u64 {
        let corners: Vec<u64> = (0..=13 - s).collect();
        let s = s as i64 - 1;
        contexts.extend((0..6).map(|side| (ALONG_1 + s * 6 + side, corners.clone())));
        contexts.extend((0..18).map(|number| (ALONG_2 + s * 18 + number, corners.clone())));
        contexts.extend((0..2).map(|inner| (ACROSS + s * 2 + inner, corners.clone())));
    }
    contexts.extend((GREEN..SKIP + 4).map(|number| (number, (0..16).collect())));
    contexts
}

/// Frequencies by context, then symbol.
pub(crate) struct Model(BTreeMap<i64, Vec<(u64, u64)>>);

impl Model {
    pub(crate) fn read(bytes: &[u8]) -> Self {
        let mut rest = bytes.iter().copied();
        let mut byte = || u64::from(rest.next().unwrap());
        let mut tables = BTreeMap::new();
        for (context, legal) in contexts() {
            let mask_bytes = (legal.last().unwrap() + 1).div_ceil(8);
            let mask = (0..mask_bytes).map(|at| byte() << (8 * at)).sum::<u64>();
            let has_own = |symbol: &u64| mask >> symbol & 1 == 1;
            assert!((0..64).filter(has_own).all(|symbol| legal.contains(&symbol)));
            let mut own = legal.iter().copied().filter(has_own).count();
            let mut left = 512 - (legal.len() - own) as u64;
            let mut table = Vec::new();
            for (place, symbol) in legal.iter().enumerate() {
                let frequency = if mask == 0 {
                    let share = 512 / legal.len() as u64;
                    if place == 0 { 512 - share * (legal.len() as u64 - 1) } else { share }
                } else if !has_own(symbol) {
                    1
                } else if own == 1 {
                    left
                } else {
                    own -= 1;
                    let low = byte();
                    let value = if low < 128 { low } else { low - 128 + 128 * byte() };
                    left -= value;
                    value
                };
                table.push((*symbol, frequency));
            }
            assert_eq!(table.iter().map(|(_, frequency)| frequency).sum::<u64>(), 512);
            tables.insert(context, table);
        }
        assert_eq!(rest.next(), None);
        Self(tables)
    }
}

/// The words that all lanes take from.
struct Words(std::vec::IntoIter<u64>);

impl Words {
    fn symbol(&mut self, x: &mut u64, model: &Model, context: i64) -> i64 {
        let slot = *x % 512;
        let mut start = 0;
        for (symbol, frequency) in &model.0[&context] {
            if slot < start + frequency {
                self.fill(x, frequency * (*x / 512) + slot - start);
                return *symbol as i64;
            }
            start += frequency;
        }
        unreachable!("frequencies sum to 512")
    }

    fn bits(&mut self, x: &mut u64, bits: i64) -> i64 {
        let value = *x % (1 << bits);
        self.fill(x, *x >> bits);
        value as i64
    }

    fn fill(&mut self, x: &mut u64, next: u64) {
        *x = if next < 65536 { 65536 * next + self.0.next().unwrap() } else { next };
    }
}

/// 0, 1, 2, 3, 4 … as 0, −1, 1, −2, 2 ….
fn unfold(folded: i64) -> i64 {
    if folded % 2 == 0 { folded / 2 } else { -(folded + 1) / 2 }
}

fn slope(i: i64) -> i64 {
    let t = (std::f64::consts::FRAC_PI_4 * ((2 * i + 1) as f64 / 52.0 - 1.0)).tan();
    (4096.0 * t).round() as i64
}

/// One lane. Fields of the node before keep their values until the node's own replace them.
#[derive(Default)]
struct Lane {
    x: u64,
    left: usize,
    inner_before: i64,
    s_before: i64,
    near: i64,
    guess: [i64; 3],
    /// Of the nodes of the group so far.
    p: i64,
    normals: Vec<[i64; 3]>,
    offsets: [i64; 3],
    kind: i64,
    cone: i64,
    face: i64,
    turn: i64,
    classes: i64,
    column: i64,
    row: i64,
    s: i64,
    corner: [i64; 3],
    symbol: i64,
    /// Red, green, blue, and green before.
    color: [i64; 3],
    green_before: i64,
    h: i64,
    nodes: Vec<Word>,
    sizes: Vec<usize>,
}

impl Lane {
    fn axes(&self) -> [usize; 3] {
        let a = self.face as usize / 2;
        [a, (a + 1) % 3, (a + 2) % 3]
    }

    fn d(&self, axis: usize) -> i64 {
        2 * self.corner[axis] + self.s - 13
    }

    fn side(&self, axis: usize) -> i64 {
        match self.offsets[axis] {
            _ if self.p == 0 => 0,
            ..-8 => 1,
            -8..=-3 => 2,
            -2..=2 => 3,
            3..=8 => 4,
            _ => 5,
        }
    }

    /// Field 1–14.
    fn read(&mut self, field: usize, words: &mut Words, model: &Model) {
        let (sibling, inner) = (i64::from(self.p > 0), i64::from(self.kind / 2 >= 2));
        let [a, b, c] = self.axes();
        let mut x = self.x;
        match field {
            1 => {
                let q = if self.p == 0 { 0 } else { 1 + 2 * (self.p - 1) + self.inner_before };
                self.kind = words.symbol(&mut x, model, KIND + q * 4 + self.cone);
            }
            2 => {
                let number = 2 * (((inner * 2 + sibling) * 4 + self.cone) * 5 + self.near);
                let symbol = words.symbol(&mut x, model, CONE_AND_FACE + number);
                (self.turn, self.cone) = (symbol / 4, symbol % 4);
                self.face = match self.turn {
                    0 | 1 => self.face ^ self.turn,
                    turn => 2 * ((self.face / 2 + turn / 2) % 3) + turn % 2,
                };
            }
            3 => {
                let number = 3 * (4 * self.cone + 2 * sibling + i64::from(self.turn > 0));
                self.classes = words.symbol(&mut x, model, CLASSES + number);
            }
            4 => {
                let (k, m) = (self.classes / 8, self.classes % 8);
                let bits = words.bits(&mut x, k + m);
                let (u, v) = (bits % (1 << k), bits >> k);
                self.column = (self.guess[b] + unfold((1 << k) + u - 1)).rem_euclid(52);
                self.row = (self.guess[c] + unfold((1 << m) + v - 1)).rem_euclid(52);
                let mut normal = [0; 3];
                (normal[a], normal[b], normal[c]) = (51 * (1 - self.face % 2), self.column, self.row);
                self.normals.push(normal);
                let i = self.normals.len() as i64;
                let sum = |axis: usize| self.normals.iter().map(|normal| normal[axis]).sum::<i64>();
                self.guess = [0, 1, 2].map(|axis| (2 * sum(axis) + i) / (2 * i));
                let (column, row) = (self.guess[b], self.guess[c]);
                let (from_column, from_row) = (column.min(51 - column), row.min(51 - row));
                self.near = if from_column < 8 && from_column <= from_row {
                    1 + i64::from(column >= 26)
                } else if from_row < 8 {
                    3 + i64::from(row >= 26)
                } else {
                    0
                };
            }
            5 => self.s = words.symbol(&mut x, model, EDGE + 14 * inner + self.s_before) + 1,
            6 => self.corner[b] = words.symbol(&mut x, model, ALONG_1 + (self.s - 1) * 6 + self.side(b)),
            7 => {
                let number = ((self.s - 1) * 6 + self.side(c)) * 3 + (self.d(b).abs() / 3).min(2);
                self.corner[c] = words.symbol(&mut x, model, ALONG_2 + number);
            }
            8 => {
                let difference = words.symbol(&mut x, model, ACROSS + (self.s - 1) * 2 + inner);
                let sigma = if self.face % 2 == 0 { 1 } else { -1 };
                let plane = slope(self.column) * self.d(b) + slope(self.row) * self.d(c);
                let passes = (4096 * (14 - self.s) - sigma * plane).div_euclid(8192).clamp(0, 13 - self.s);
                self.corner[a] = (passes + difference) % (14 - self.s);
            }
            9 => {
                self.symbol = words.symbol(&mut x, model, GREEN + sibling);
                self.green_before = self.color[1];
                self.h = [0, 1, 1, 2, 2, 2, 2].get(self.symbol as usize).copied().unwrap_or(3);
            }
            11 => self.symbol = words.symbol(&mut x, model, RED + self.h),
            13 => self.symbol = words.symbol(&mut x, model, BLUE + self.h),
            10 | 12 | 14 => {
                let channel = [1, 0, 2][(field - 10) / 2];
                self.color[channel] = if self.symbol == 15 {
                    words.bits(&mut x, 8)
                } else if channel == 1 {
                    self.green_before + unfold(self.symbol)
                } else {
                    let moved = (self.color[1] - self.green_before) / 2;
                    (self.color[channel] + moved).clamp(0, 31) + unfold(self.symbol)
                };
            }
            _ => unreachable!("there are 14 fields"),
        }
        self.x = x;
    }

    /// After a node's last field.
    fn finish(&mut self, codes: &HashMap<(i64, [i64; 3]), usize>, has_colors: bool) {
        let normal = self.face * 2704 + self.row * 52 + self.column;
        let sphere = codes[&(self.s, self.corner)] as i64;
        let bits = sphere << 19 | normal << 5 | self.cone << 3 | (self.kind / 2);
        let color = has_colors.then_some((self.color[0] << 11 | self.color[1] << 5 | self.color[2]) as u16);
        self.nodes.push((bits as u32, color));
        self.inner_before = i64::from(self.kind / 2 >= 2);
        self.s_before = self.s;
        for axis in 0..3 {
            self.offsets[axis] += self.d(axis);
        }
        self.p += 1;
        if self.kind % 2 == 1 {
            self.sizes.push(self.p as usize);
            (self.p, self.s_before, self.offsets) = (0, 0, [0; 3]);
            self.normals.clear();
        }
        self.left -= 1;
    }
}

/// Codec 1.
pub(crate) fn coded(bytes: &[u8], counts: Counts, model: &Model) -> Contents {
    let Counts { nodes: n, words: w, families: f, has_colors } = counts;
    let page = Bytes(bytes);
    let codes: HashMap<_, _> = sphere_codes().into_iter().enumerate().map(|(code, cells)| (cells, code)).collect();
    let mut lengths: Vec<usize> = (0..3).map(|lane| usize::from(page.u16(16 + 2 * lane))).collect();
    lengths.push(n - lengths.iter().sum::<usize>());
    let mut lanes: Vec<Lane> = (0..4)
        .map(|lane| Lane {
            x: page.u32(4 * lane as u64).into(),
            left: lengths[lane],
            guess: [26; 3],
            ..Lane::default()
        })
        .collect();
    let r = usize::from(bytes[22]);
    let words: Vec<u64> =
        bytes[24 + 6 * r..].chunks(2).map(|word| u64::from(word[0]) + 256 * u64::from(word[1])).collect();
    let mut words = Words(words.into_iter());
    let fields = 1..=if has_colors { 14 } else { 8 };
    while lanes.iter().all(|lane| lane.left > 0) {
        for field in fields.clone() {
            lanes.iter_mut().for_each(|lane| lane.read(field, &mut words, model));
        }
        lanes.iter_mut().for_each(|lane| lane.finish(&codes, has_colors));
    }
    for lane in &mut lanes {
        while lane.left > 0 {
            fields.clone().for_each(|field| lane.read(field, &mut words, model));
            lane.finish(&codes, has_colors);
        }
        assert_eq!(lane.p, 0, "a lane ends with a group");
    }

    let mut families = Vec::new();
    while families.len() < f {
        let before = families.last().map_or(0, |groups| groups - 1);
        let pair = words.symbol(&mut lanes[0].x, model, FAMILY + before as i64) as usize;
        families.extend([pair / 4 + 1, pair % 4 + 1]);
    }
    assert!(families.len() == f || families.pop() == Some(1));
    let (mut links, mut classes) = (Vec::<(u16, u16)>::new(), [0; 16]);
    for _ in 0..w - n {
        let before = links.last().map_or(0, |(run, _)| *run);
        let run = words.symbol(&mut lanes[1].x, model, RUN + i64::from(before));
        let class = &mut classes[run as usize];
        let mut skip = words.symbol(&mut lanes[2].x, model, SKIP + *class);
        if skip == 15 {
            skip = words.bits(&mut lanes[2].x, 6) * 64;
            skip += words.bits(&mut lanes[2].x, 6);
        }
        *class = match skip {
            0 | 1 => skip,
            2..=14 => 2,
            _ => 3,
        };
        links.push((run as u16, skip as u16));
    }
    assert!(words.0.next().is_none() && lanes.iter().all(|lane| lane.x == 65536));
    let sizes: Vec<usize> = lanes.iter().flat_map(|lane| lane.sizes.clone()).collect();
    let nodes = lanes.into_iter().flat_map(|lane| lane.nodes).collect();
    Contents { families: cut(nodes, &sizes, &families), runs: runs_at(&page, 24, r), links }
}
