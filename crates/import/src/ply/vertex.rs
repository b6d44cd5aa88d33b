//! From the numbers of a vertex to its position, normal and colour.
//!
//! In: the properties of the element `vertex`, then its values: one vertex at a time ([`Channels::push`]) or many rows of a
//! binary file at once ([`Channels::push_rows`]). Out: vertices at the end of a [`VertexBatch`]. Both ways give the same bits.

use super::{
    header::Element,
    scalar::{ByteOrder, Scalar, with_decoder},
};
use crate::{Attributes, ImportError, Place, VertexBatch};
use glam::{DVec3, Vec3};

/// The numbers that are kept of a vertex: x y z, nx ny nz, red green blue. Those that the file lacks stay 0.
pub(super) type Row = [f64; 9];

/// Which properties a vertex is made of.
pub(super) struct Channels {
    position: [Channel; 3],
    normal: Option<[Channel; 3]>,
    color: Option<[Channel; 3]>,
}

#[derive(Clone, Copy)]
struct Channel {
    /// Number of the property.
    property: usize,
    scalar: Scalar,
    /// Where it is in a row of a binary file; meaningless where a list comes before it.
    offset: usize,
}

/// Rows of one size, back to back.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub(super) bytes: &'a [u8],
    /// Bytes of a row.
    pub(super) stride: usize,
    pub(super) order: ByteOrder,
}

impl Channels {
    /// Finds the channels by name.
    ///
    /// # Errors
    /// There is no position.
    pub(super) fn of(element: &Element) -> Result<Self, ImportError> {
        let channel = |name: &str| {
            let (property, scalar) = element.single(name)?;
            let offset = element.properties[..property].iter().map(|property| property.least_bytes()).sum();
            Some(Channel { property, scalar, offset })
        };
        let triple = |[a, b, c]: [&str; 3]| Some([channel(a)?, channel(b)?, channel(c)?]);
        let position = triple(["x", "y", "z"]).ok_or_else(|| {
            let expected = "single numbers `x`, `y` and `z` in the element `vertex`";
            ImportError::malformed(expected, element.property_names(), Place::line(element.line))
        })?;
        let color_names = [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"], ["r", "g", "b"]];
        Ok(Self { position, normal: triple(["nx", "ny", "nz"]), color: color_names.into_iter().find_map(triple) })
    }

    pub(super) fn attributes(&self) -> Attributes {
        Attributes { normals: self.normal.is_some(), colors: self.color.is_some() }
    }

    /// Where in a [`Row`] each of `property_count` properties goes, if anywhere.
    pub(super) fn slots(&self, property_count: usize) -> Vec<Option<usize>> {
        let mut slots = vec![None; property_count];
        let triples = [Some(self.position), self.normal, self.color];
        for (first, triple) in [0, 3, 6].into_iter().zip(triples) {
            for (slot, channel) in (first..).zip(triple.into_iter().flatten()) {
                slots[channel.property] = Some(slot);
            }
        }
        slots
    }

    /// Appends a vertex; false, and nothing, where its position is not finite.
    pub(super) fn push(&self, row: &Row, vertices: &mut VertexBatch) -> bool {
        let [x, y, z, nx, ny, nz, red, green, blue] = *row;
        let position = DVec3::new(x, y, z);
        if !position.is_finite() {
            return false;
        }
        vertices.positions.push(position);
        if self.normal.is_some() {
            vertices.normals.push(finite_or_zero(Vec3::new(nx as f32, ny as f32, nz as f32)));
        }
        if let Some([r, g, b]) = self.color {
            vertices.colors.push([
                color8(red, r.scalar.full_intensity()),
                color8(green, g.scalar.full_intensity()),
                color8(blue, b.scalar.full_intensity()),
            ]);
        }
        true
    }

    /// Appends vertices up to the first whose position is not finite; returns how many.
    ///
    /// Goes through the rows once for each property: they are in the cache, and the type is looked at once for all of them.
    pub(super) fn push_rows(&self, rows: Rows<'_>, vertices: &mut VertexBatch) -> usize {
        let VertexBatch { positions, normals, colors } = vertices;
        let [x, y, z] = self.position;
        let start = positions.len();
        positions.resize(start + rows.bytes.len() / rows.stride, DVec3::ZERO);
        let added = &mut positions[start..];
        rows.column(x, added.iter_mut().map(|position| &mut position.x), |value| value);
        rows.column(y, added.iter_mut().map(|position| &mut position.y), |value| value);
        rows.column(z, added.iter_mut().map(|position| &mut position.z), |value| value);
        let count = added.iter().position(|position| !position.is_finite()).unwrap_or(added.len());
        let end = start + count;
        positions.truncate(end);
        if let Some([nx, ny, nz]) = self.normal {
            normals.resize(end, Vec3::ZERO);
            let added = &mut normals[start..];
            rows.column(nx, added.iter_mut().map(|normal| &mut normal.x), |value| value as f32);
            rows.column(ny, added.iter_mut().map(|normal| &mut normal.y), |value| value as f32);
            rows.column(nz, added.iter_mut().map(|normal| &mut normal.z), |value| value as f32);
            added.iter_mut().for_each(|normal| *normal = finite_or_zero(*normal));
        }
        if let Some(color) = self.color {
            colors.resize(end, [0; 3]);
            for (axis, channel) in color.into_iter().enumerate() {
                let full = channel.scalar.full_intensity();
                rows.column(channel, colors[start..].iter_mut().map(|color| &mut color[axis]), |value| {
                    color8(value, full)
                });
            }
        }
        count
    }
}

impl Rows<'_> {
    /// Writes one number of each row, converted, until there is no more row or no more room.
    fn column<'a, T: 'a>(self, channel: Channel, into: impl Iterator<Item = &'a mut T>, convert: impl Fn(f64) -> T) {
        let field = channel.offset..channel.offset + channel.scalar.size();
        with_decoder!(channel.scalar, self.order, decode => {
            for (row, value) in self.bytes.chunks_exact(self.stride).zip(into) {
                *value = convert(decode(&row[field.clone()]));
            }
        });
    }
}

fn finite_or_zero(normal: Vec3) -> Vec3 {
    if normal.is_finite() { normal } else { Vec3::ZERO }
}

/// The 8-bit value nearest to `value`, where `full` stands for 255. Exact where `full` is 255: `v / 255 * 255` is off by far
/// less than the half that rounding takes. NaN casts to 0.
#[inline]
fn color8(value: f64, full: f64) -> u8 {
    (value * (255.0 / full) + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_keep_their_8_bits_and_everything_else_is_scaled_and_clamped() {
        for value in 0..=255u8 {
            let of = |number: f64, scalar: Scalar| color8(number, scalar.full_intensity());
            let unit = f64::from(value) / 255.0;
            assert_eq!(of(f64::from(value), Scalar::U8), value);
            assert_eq!(of(f64::from(value) * 257.0, Scalar::U16), value);
            assert_eq!(of(f64::from(value) * 16_843_009.0, Scalar::U32), value);
            assert_eq!(of(f64::from(unit as f32), Scalar::F32), value);
            assert_eq!(of(unit, Scalar::F64), value);
        }
        for (number, scalar, color) in [
            (-1.0, Scalar::I8, 0),
            (127.0, Scalar::I8, 127),
            (-32768.0, Scalar::I16, 0),
            (32767.0, Scalar::I16, 255),
            (128.0, Scalar::U16, 0),
            (129.0, Scalar::U16, 1),
            (2_147_483_647.0, Scalar::I32, 255),
            (0.5, Scalar::F32, 128),
            (-0.25, Scalar::F32, 0),
            (1e30, Scalar::F64, 255),
            (f64::NAN, Scalar::F32, 0),
            (f64::INFINITY, Scalar::F32, 255),
            (f64::NEG_INFINITY, Scalar::F32, 0),
            (300.0, Scalar::U8, 255),
        ] {
            assert_eq!(color8(number, scalar.full_intensity()), color, "{number} as {scalar:?}");
        }
    }
}
