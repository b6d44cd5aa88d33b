//! Views packed by meshoptimizer: the extension EXT_meshopt_compression, bit streams of version 0 for attributes and 0 and 1
//! for indices, and its filters.
//!
//! Written from the extension's specification (appendices A and B). In: the packed bytes. Out: the unpacked ones, `count`
//! times `byte_stride` of them. An error says what was found instead of sound data.

use super::json::Meshopt;

type Found<T> = Result<T, String>;

/// Unpacks a view.
pub(super) fn unpack(view: &Meshopt, bytes: &[u8]) -> Found<Vec<u8>> {
    let (count, stride) = (view.count as usize, view.byte_stride as usize);
    let mut unpacked = match view.mode.as_str() {
        "ATTRIBUTES" if stride % 4 == 0 && (4..=256).contains(&stride) => attributes(bytes, count, stride)?,
        "TRIANGLES" if matches!(stride, 2 | 4) && count % 3 == 0 => narrow(triangles(bytes, count)?, stride),
        "INDICES" if matches!(stride, 2 | 4) => narrow(indices(bytes, count)?, stride),
        mode => return Err(format!("mode {} with a stride of {stride}", crate::error::said(mode))),
    };
    match view.filter.as_deref() {
        None | Some("NONE") => {}
        Some("OCTAHEDRAL") if stride == 4 => octahedral::<1>(&mut unpacked),
        Some("OCTAHEDRAL") if stride == 8 => octahedral::<2>(&mut unpacked),
        Some("QUATERNION") if stride == 8 => quaternion(&mut unpacked),
        Some("EXPONENTIAL") if stride % 4 == 0 => exponential(&mut unpacked),
        Some(filter) => return Err(format!("filter {} with a stride of {stride}", crate::error::said(filter))),
    }
    Ok(unpacked)
}

/// Bytes that are taken from the front.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Found<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("an end too early")?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Found<u8> {
        self.take(1).map(|byte| byte[0])
    }

    /// A number of up to 32 bits, 7 in each byte, the lowest first.
    fn varint(&mut self) -> Found<u32> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 127) << shift;
            if byte < 128 {
                break;
            }
        }
        Ok(value)
    }

    fn end(self) -> Found<()> {
        if self.0.is_empty() { Ok(()) } else { Err(format!("{} bytes too many", self.0.len())) }
    }
}

/// Takes signs from the lowest bit.
fn unzigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// Vertices: blocks of up to 256, in them byte after byte of the vertex, groups of 16 differences to the vertex before.
fn attributes(bytes: &[u8], count: usize, stride: usize) -> Found<Vec<u8>> {
    let tail_bytes = stride.max(32);
    if bytes.len() < 1 + tail_bytes {
        return Err("an end too early".to_owned());
    }
    let (body, tail) = bytes.split_at(bytes.len() - tail_bytes);
    if body[0] != 0xa0 {
        return Err(format!("a first byte of {:#x} where attributes have 0xa0", body[0]));
    }
    let mut body = Bytes(&body[1..]);
    let mut last = tail[tail_bytes - stride..].to_vec();
    let mut vertices = Vec::new();
    let block = ((8192 / stride) & !15).min(256);
    while vertices.len() < count * stride {
        let start = vertices.len();
        let elements = block.min(count - start / stride);
        let groups = elements.div_ceil(16);
        vertices.resize(start + elements * stride, 0);
        for (component, last) in last.iter_mut().enumerate() {
            let widths = body.take(groups.div_ceil(4))?;
            for group in 0..groups {
                let mut deltas = [0; 16];
                let bits = match widths[group / 4] >> (group % 4 * 2) & 3 {
                    0 => 0,
                    1 => 2,
                    2 => 4,
                    _ => 8,
                };
                match bits {
                    0 => {}
                    8 => deltas.copy_from_slice(body.take(16)?),
                    bits => {
                        let full = (1 << bits) - 1;
                        let packed = body.take(2 * bits)?;
                        for (index, delta) in deltas.iter_mut().enumerate() {
                            let at = index * bits;
                            let value = packed[at / 8] >> (8 - bits - at % 8) & full;
                            // All ones: the value is too wide, and follows in a byte.
                            *delta = if value == full { body.byte()? } else { value };
                        }
                    }
                }
                for (index, delta) in deltas.into_iter().enumerate().take(elements - 16 * group) {
                    *last = last.wrapping_add(unzigzag(delta.into()) as u8);
                    vertices[start + (16 * group + index) * stride + component] = *last;
                }
            }
        }
    }
    body.end()?;
    Ok(vertices)
}

/// The last vertices and edges that triangles named.
struct Recent<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, item: T) {
        self.items[self.next] = item;
        self.next = (self.next + 1) % 16;
    }

    /// The item pushed `back` times ago; 1 is the last.
    fn back(&self, back: usize) -> T {
        self.items[(self.next + 32 - back) % 16]
    }
}

fn triangles(bytes: &[u8], count: usize) -> Found<Vec<u32>> {
    let faces = count / 3;
    if bytes.len() < 1 + faces + 16 {
        return Err("an end too early".to_owned());
    }
    let version = bytes[0] & 15;
    if bytes[0] & 0xf0 != 0xe0 || version > 1 {
        return Err(format!("a first byte of {:#x} where triangles have 0xe0 or 0xe1", bytes[0]));
    }
    let (codes, rest) = bytes[1..].split_at(faces);
    let (data, table) = rest.split_at(rest.len() - 16);
    let mut data = Bytes(data);
    let mut edges = Recent { items: [[u32::MAX; 2]; 16], next: 0 };
    let mut vertices = Recent { items: [u32::MAX; 16], next: 0 };
    let (mut next, mut last) = (0u32, 0u32);
    // Vertices by how long ago they were named, as far as the code reaches.
    let most_recent = if version == 1 { 13 } else { 15 };
    let mut indices = Vec::with_capacity(count);
    let mut new = |next: &mut u32| {
        let vertex = *next;
        *next = next.wrapping_add(1);
        vertex
    };
    let step = |data: &mut Bytes<'_>, last: &mut u32| -> Found<u32> {
        *last = last.wrapping_add(unzigzag(data.varint()?));
        Ok(*last)
    };
    for &code in codes {
        let (high, low) = (usize::from(code >> 4), usize::from(code & 15));
        if high < 15 {
            // A triangle at a recent edge.
            let [a, b] = edges.back(1 + high);
            let c = if low == 0 {
                new(&mut next)
            } else if low < most_recent {
                vertices.back(1 + low)
            } else {
                match low {
                    13 => last = last.wrapping_sub(1),
                    14 => last = last.wrapping_add(1),
                    _ => _ = step(&mut data, &mut last)?,
                }
                last
            };
            if low == 0 || low >= most_recent {
                vertices.push(c);
            }
            edges.push([c, b]);
            edges.push([a, c]);
            indices.extend([a, b, c]);
            continue;
        }
        let (is_listed, pair) = if low < 14 { (true, table[low]) } else { (false, data.byte()?) };
        let (second, third) = (usize::from(pair >> 4), usize::from(pair & 15));
        if !is_listed && pair == 0 {
            next = 0;
        }
        let is_new_first = low != 15;
        let mut a = if is_new_first { new(&mut next) } else { 0 };
        let recent = |back: usize, next: &mut u32, new: &mut dyn FnMut(&mut u32) -> u32| match back {
            0 => new(next),
            back => vertices.back(back),
        };
        let mut b = recent(second, &mut next, &mut new);
        let mut c = recent(third, &mut next, &mut new);
        if !is_listed {
            if !is_new_first {
                a = step(&mut data, &mut last)?;
            }
            if second == 15 {
                b = step(&mut data, &mut last)?;
            }
            if third == 15 {
                c = step(&mut data, &mut last)?;
            }
        }
        vertices.push(a);
        let is_pushed = |back: usize| back == 0 || (!is_listed && back == 15);
        if is_pushed(second) {
            vertices.push(b);
        }
        if is_pushed(third) {
            vertices.push(c);
        }
        edges.push([b, a]);
        edges.push([c, b]);
        edges.push([a, c]);
        indices.extend([a, b, c]);
    }
    data.end()?;
    Ok(indices)
}

/// Indices one by one, as differences to one of the last two.
fn indices(bytes: &[u8], count: usize) -> Found<Vec<u32>> {
    if bytes.len() < 1 + 4 {
        return Err("an end too early".to_owned());
    }
    if bytes[0] & 0xf0 != 0xd0 || bytes[0] & 15 > 1 {
        return Err(format!("a first byte of {:#x} where indices have 0xd0 or 0xd1", bytes[0]));
    }
    let mut data = Bytes(&bytes[1..bytes.len() - 4]);
    let mut last = [0u32; 2];
    let mut indices = Vec::new();
    for _ in 0..count {
        let value = data.varint()?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(unzigzag(value >> 1));
        indices.push(*last);
    }
    data.end()?;
    Ok(indices)
}

fn narrow(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// Whole numbers of `BYTES` bytes.
fn read_signed<const BYTES: usize>(bytes: &[u8]) -> f32 {
    if BYTES == 1 { f32::from(bytes[0] as i8) } else { f32::from(i16::from_le_bytes([bytes[0], bytes[1]])) }
}

fn write_signed<const BYTES: usize>(value: f32, bytes: &mut [u8]) {
    let rounded = (value + if value < 0.0 { -0.5 } else { 0.5 }) as i32;
    bytes[..BYTES].copy_from_slice(&rounded.to_le_bytes()[..BYTES]);
}

/// Unit vectors from an octahedron; the fourth number stays.
fn octahedral<const BYTES: usize>(bytes: &mut [u8]) {
    let most = ((1 << (8 * BYTES - 1)) - 1) as f32;
    for vector in bytes.chunks_exact_mut(4 * BYTES) {
        let [mut x, mut y, one] = std::array::from_fn(|axis| read_signed::<BYTES>(&vector[axis * BYTES..]));
        let z = one - x.abs() - y.abs();
        let folded = z.min(0.0);
        x += if x >= 0.0 { folded } else { -folded };
        y += if y >= 0.0 { folded } else { -folded };
        let length = (x * x + y * y + z * z).sqrt();
        let scale = if length > 0.0 { most / length } else { 0.0 };
        for (axis, value) in [x, y, z].into_iter().enumerate() {
            write_signed::<BYTES>(value * scale, &mut vector[axis * BYTES..]);
        }
    }
}

/// Unit quaternions from their three smaller components.
fn quaternion(bytes: &mut [u8]) {
    for quaternion in bytes.chunks_exact_mut(8) {
        let [x, y, z, code] =
            std::array::from_fn(|axis| i16::from_le_bytes([quaternion[2 * axis], quaternion[2 * axis + 1]]));
        let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(code | 3);
        let [x, y, z] = [x, y, z].map(|value| f32::from(value) * scale);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let largest = (code & 3) as usize;
        for (step, value) in [x, y, z, w].into_iter().enumerate() {
            let at = (largest + step + 1) % 4;
            write_signed::<2>(value * 32767.0, &mut quaternion[2 * at..]);
        }
    }
}

/// `f32`s from an exponent of 8 bits and a mantissa of 24.
fn exponential(bytes: &mut [u8]) {
    let (words, _) = bytes.as_chunks_mut::<4>();
    for word in words {
        let value = i32::from_le_bytes(*word);
        let (exponent, mantissa) = (value >> 24, value << 8 >> 8);
        // Exact: a mantissa of 24 bits times a power of two.
        let number = f64::from(mantissa) * libm::ldexp(1.0, exponent);
        *word = (number as f32).to_le_bytes();
    }
}
