//! A reader of hybrid files made from `docs/format.md` alone: plain, slow, and without any of the engine's code. It trusts what it reads.

use crate::stranger_front::{Front, cross, minus};

/// What a page holds.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Read {
    pub(crate) positions: Vec<[u16; 3]>,
    pub(crate) normals: Vec<[u32; 2]>,
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) borders: Vec<[u32; 2]>,
}

fn number(bytes: &[u8], at: usize, length: usize) -> u64 {
    (0..length).fold(0, |sum, byte| sum | u64::from(bytes[at + byte]) << (8 * byte))
}

fn unfolded(number: u64) -> i64 {
    if number.is_multiple_of(2) { (number / 2) as i64 } else { -((number / 2) as i64) - 1 }
}

/// Frequencies of all tables.
fn model(bytes: &[u8]) -> Vec<Vec<u64>> {
    let legal = |table: usize| match table {
        0 => 31,
        1 => 48,
        2 => 49,
        3..19 => 42,
        19..35 | 51..67 => 26,
        _ => 18,
    };
    let mut at = 0;
    let mut tables = Vec::new();
    for table in 0..83 {
        let legal: usize = legal(table);
        let mask = number(bytes, at, legal.div_ceil(8));
        at += legal.div_ceil(8);
        let own: Vec<usize> = (0..legal).filter(|symbol| mask >> symbol & 1 != 0).collect();
        let mut frequencies = vec![1; legal];
        match own.split_last() {
            None => {
                frequencies = vec![2048 / legal as u64; legal];
                frequencies[0] += 2048 % legal as u64;
            }
            Some((last, others)) => {
                for symbol in others {
                    let low = u64::from(bytes[at]);
                    at += 1;
                    frequencies[*symbol] = low;
                    if low >= 128 {
                        frequencies[*symbol] = low - 128 + 128 * u64::from(bytes[at]);
                        at += 1;
                    }
                }
                frequencies[*last] = 0;
                frequencies[*last] = 2048 - frequencies.iter().sum::<u64>();
            }
        }
        tables.push(frequencies);
    }
    assert_eq!(at, bytes.len());
    tables
}

/// All pages of a file.
pub(crate) fn read(file: &[u8]) -> Vec<Read> {
    assert_eq!(number(file, 12, 4), 2);
    let (skeleton, mut page_at) = (number(file, 32, 8) as usize, number(file, 72, 8) as usize);
    let nodes = number(file, skeleton + 80, 8) as usize;
    let bits = u32::from(file[skeleton + 101]);
    let has_colors = file[skeleton + 102] & 2 != 0;
    let model_bytes = number(file, skeleton + 108, 4) as usize;
    let records = skeleton + 112;
    let model = model(&file[records + 44 * nodes..][..model_bytes]);
    let mut pages = Vec::new();
    for node in 0..nodes {
        let record = &file[records + 44 * node..][..44];
        let [vertices, triangles, points] = [24, 27, 30].map(|at| number(record, at, 3) as usize);
        let bytes = &file[page_at..][..number(record, 36, 4) as usize];
        page_at += bytes.len();
        let streams = Streams::read(bytes, &model, [vertices, points], has_colors);
        pages.push(streams.page([vertices, triangles, points], bits, has_colors));
    }
    pages
}

struct Streams {
    tokens: Vec<u64>,
    rares: Vec<u64>,
    keys: Vec<(u64, u64)>,
    shift: u32,
    /// Unfolded.
    differences: Vec<Vec<i64>>,
}

impl Streams {
    fn read(bytes: &[u8], model: &[Vec<u64>], [vertices, points]: [usize; 2], has_colors: bool) -> Self {
        let mut at = 0;
        let mut varint = || {
            let (mut number, mut shift) = (0, 0);
            loop {
                number |= usize::from(bytes[at] & 127) << shift;
                shift += 7;
                at += 1;
                if bytes[at - 1] < 128 {
                    return number;
                }
            }
        };
        let [tokens, rares, raw] = [varint(), varint(), varint()];
        let shift = u32::from(bytes[at]);
        at += 1;
        let of_colors = |count: usize| if has_colors { count } else { 0 };
        let counts: Vec<(usize, usize)> = [
            (3, vertices, 3),
            (19, vertices, 2),
            (35, of_colors(vertices), 3),
            (51, points, 2),
            (67, of_colors(points), 3),
        ]
        .into_iter()
        .flat_map(|(table, count, times)| vec![(table, count); times])
        .collect();
        let mut streams = vec![(0, tokens), (1, rares), (2, points)];
        for (table, count) in counts {
            let size = if count > 0 {
                at += 1;
                usize::from(bytes[at - 1])
            } else {
                0
            };
            streams.push((table + size, count));
        }
        let mut states: Vec<u64> = (0..4).map(|lane| number(bytes, at + 4 * lane, 4)).collect();
        at += 16;
        let symbols: Vec<Vec<u64>> = streams
            .into_iter()
            .map(|(table, count)| {
                (0..count)
                    .map(|symbol| {
                        let x = &mut states[symbol % 4];
                        let slot = *x % 2048;
                        let (mut start, mut found) = (0, 0);
                        while start + model[table][found] <= slot {
                            start += model[table][found];
                            found += 1;
                        }
                        *x = model[table][found] * (*x / 2048) + slot - start;
                        if *x < 65_536 {
                            *x = 65_536 * *x + number(bytes, at, 2);
                            at += 2;
                        }
                        found as u64
                    })
                    .collect()
            })
            .collect();
        assert_eq!((states, at), (vec![65_536; 4], bytes.len() - raw));
        let (raw, mut used) = (&bytes[at..], 0);
        let mut raw_bits = |count: u64| {
            (0..count).fold(0, |sum, bit| {
                used += 1;
                sum | u64::from(raw[(used - 1) / 8] >> ((used - 1) % 8) & 1) << bit
            })
        };
        let mut value = |class: &u64| {
            let bits = if *class < 8 { 0 } else { 2 + (class - 8) / 2 };
            (if *class < 8 { *class } else { (2 + class % 2) << bits }) + raw_bits(bits)
        };
        let rares = symbols[1].iter().map(&mut value).collect();
        let differences =
            symbols[3..].iter().map(|classes| classes.iter().map(|class| unfolded(value(class))).collect()).collect();
        let keys = symbols[2].iter().map(|class| (*class, raw_bits(class.saturating_sub(1)))).collect();
        Self { tokens: symbols[0].clone(), rares, keys, shift, differences }
    }

    fn page(&self, [vertices, triangles, points]: [usize; 3], bits: u32, has_colors: bool) -> Read {
        let mut front = Front::default();
        front.rares.extend(&self.rares);
        for token in &self.tokens {
            front.token(*token, &self.differences);
        }
        while front.places.len() < vertices {
            front.place_alone(&self.differences);
        }
        assert!(front.focus.is_none() && front.triangles.len() == triangles && front.rares.is_empty());
        let mut page = Read { triangles: front.triangles, borders: front.borders, ..Read::default() };
        page.positions = front.places.iter().map(|place| place.map(|x| x as u16)).collect();
        page.normals = normals(&front.places, &page.triangles, bits, &self.differences);
        let modulus = 1 << bits;
        let mut before = [1i64 << (bits - 1); 2];
        for point in 0..points {
            before = [0, 1].map(|axis| (before[axis] + self.differences[8 + axis][point]).rem_euclid(modulus));
            page.normals.push(before.map(|x| x as u32));
        }
        if has_colors {
            colors(&mut page, vertices, points, &self.differences);
        }
        let mut key = 0u64;
        for (class, raw) in &self.keys {
            if *class > 0 {
                key = key >> class << class | 1 << (class - 1) | raw;
            }
            let gathered = |axis: u32| (0..16).fold(0, |sum, bit| sum | (key >> (3 * bit + axis) & 1) << bit);
            page.positions.push([0, 1, 2].map(|axis| (gathered(axis) << self.shift) as u16));
        }
        page
    }
}

fn normals(places: &[[f32; 3]], triangles: &[[u32; 3]], bits: u32, differences: &[Vec<i64>]) -> Vec<[u32; 2]> {
    let mut sums = vec![[0f32; 3]; places.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| places[vertex as usize]);
        let normal = cross(minus(b, a), minus(c, a));
        for vertex in triangle {
            sums[*vertex as usize] = [0, 1, 2].map(|axis| sums[*vertex as usize][axis] + normal[axis]);
        }
    }
    let most = ((1u32 << bits) - 1) as f32;
    sums.iter()
        .enumerate()
        .map(|(vertex, [x, y, z])| {
            let sum = x.abs() + y.abs() + z.abs();
            let scale = 1.0 / if sum == 0.0 { 1.0 } else { sum };
            let (mut x, mut y) = (x * scale, y * scale);
            if *z < 0.0 {
                (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
            }
            let code = [x, y].map(|x| ((x * 0.5 + 0.5) * most).round_ties_even() as i64);
            [0, 1].map(|axis| (code[axis] + differences[3 + axis][vertex]).rem_euclid(1 << bits) as u32)
        })
        .collect()
}

fn colors(page: &mut Read, vertices: usize, points: usize, differences: &[Vec<i64>]) {
    let add = |guess: [u8; 3], first: usize, at: usize| {
        let [green, red, blue] = [0, 1, 2].map(|stream| differences[first + stream][at]);
        let sum = [red + green, green, blue + green];
        [0, 1, 2].map(|channel| (i64::from(guess[channel]) + sum[channel]).rem_euclid(256) as u8)
    };
    for vertex in 0..vertices {
        let first = page.triangles.iter().find(|triangle| triangle.contains(&(vertex as u32)));
        let guess = match first {
            Some([a, b, c]) if ![*a, *b].contains(&(vertex as u32)) && *c == vertex as u32 => {
                let [a, b] = [a, b].map(|corner| page.colors[*corner as usize]);
                [0, 1, 2].map(|channel| ((u16::from(a[channel]) + u16::from(b[channel])) / 2) as u8)
            }
            _ if vertex == 0 => [0; 3],
            _ => page.colors[vertex - 1],
        };
        page.colors.push(add(guess, 5, vertex));
    }
    let mut before = [0; 3];
    for point in 0..points {
        before = add(before, 10, point);
        page.colors.push(before);
    }
}
