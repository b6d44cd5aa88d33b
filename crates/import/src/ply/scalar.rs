//! The eight number types of PLY, and how to decode them.
//!
//! Every number becomes an `f64`, which holds each value of each type exactly.

/// A number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// Of a binary file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

impl Scalar {
    /// The type that a header calls `name`.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of one in a binary file: 1 to 8.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value that means full intensity in a colour channel.
    pub(super) fn full_intensity(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => 255.0,
            Self::I16 => f64::from(i16::MAX),
            Self::U16 => f64::from(u16::MAX),
            Self::I32 => f64::from(i32::MAX),
            Self::U32 => f64::from(u32::MAX),
            Self::F32 | Self::F64 => 1.0,
        }
    }

    /// The number in the first [`Self::size`] of `bytes`.
    #[inline]
    pub(super) fn decode(self, order: ByteOrder, bytes: &[u8]) -> f64 {
        with_decoder!(self, order, decode => decode(bytes))
    }
}

/// Evaluates an expression with `$decode` bound to the function `&[u8] -> f64` for a type and a byte order, once for each of
/// the combinations: around a loop, the choice is made outside it.
macro_rules! with_decoder {
    ($scalar:expr, $order:expr, $decode:ident => $body:expr) => {{
        use $crate::ply::scalar::{ByteOrder, Scalar, with_decoder};
        match ($scalar, $order) {
            (Scalar::I8, _) => with_decoder!(@i8, from_le_bytes, $decode, $body),
            (Scalar::U8, _) => with_decoder!(@u8, from_le_bytes, $decode, $body),
            (Scalar::I16, ByteOrder::Little) => with_decoder!(@i16, from_le_bytes, $decode, $body),
            (Scalar::I16, ByteOrder::Big) => with_decoder!(@i16, from_be_bytes, $decode, $body),
            (Scalar::U16, ByteOrder::Little) => with_decoder!(@u16, from_le_bytes, $decode, $body),
            (Scalar::U16, ByteOrder::Big) => with_decoder!(@u16, from_be_bytes, $decode, $body),
            (Scalar::I32, ByteOrder::Little) => with_decoder!(@i32, from_le_bytes, $decode, $body),
            (Scalar::I32, ByteOrder::Big) => with_decoder!(@i32, from_be_bytes, $decode, $body),
            (Scalar::U32, ByteOrder::Little) => with_decoder!(@u32, from_le_bytes, $decode, $body),
            (Scalar::U32, ByteOrder::Big) => with_decoder!(@u32, from_be_bytes, $decode, $body),
            (Scalar::F32, ByteOrder::Little) => with_decoder!(@f32, from_le_bytes, $decode, $body),
            (Scalar::F32, ByteOrder::Big) => with_decoder!(@f32, from_be_bytes, $decode, $body),
            (Scalar::F64, ByteOrder::Little) => with_decoder!(@f64, from_le_bytes, $decode, $body),
            (Scalar::F64, ByteOrder::Big) => with_decoder!(@f64, from_be_bytes, $decode, $body),
        }
    }};
    (@$type:ty, $from_bytes:ident, $decode:ident, $body:expr) => {{
        let $decode = |bytes: &[u8]| {
            let bytes = bytes.first_chunk().expect("a whole number was asked for");
            f64::from(<$type>::$from_bytes(*bytes))
        };
        $body
    }};
}
pub(super) use with_decoder;
