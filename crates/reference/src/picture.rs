//! Pictures and masks: rows of pixels, top left first.

use crate::distance_transform::squared_distance_px;
use gigalod_geom::ImageSize;

/// An 8-bit sRGB picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width and height.
    pub size: ImageSize,
    /// `size.pixels()` colours, row by row from the top left.
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(size: ImageSize, color: [u8; 3]) -> Self {
        Self { size, pixels: vec![color; size.pixels()] }
    }

    /// A picture from packed bytes, `3 * size.pixels()` of them; `None` for any other number.
    pub fn from_bytes(size: ImageSize, rgb: &[u8]) -> Option<Self> {
        let (pixels, rest) = rgb.as_chunks::<3>();
        (pixels.len() == size.pixels() && rest.is_empty()).then(|| Self { size, pixels: pixels.to_vec() })
    }

    /// Packed bytes: `3 * size.pixels()`.
    pub fn as_bytes(&self) -> &[u8] {
        self.pixels.as_flattened()
    }
}

/// A set of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Width and height.
    pub size: ImageSize,
    /// `size.pixels()` memberships, row by row from the top left.
    pub members: Vec<bool>,
}

impl Mask {
    /// Number of pixels in the set.
    pub fn count(&self) -> usize {
        self.members.iter().filter(|&&member| member).count()
    }

    /// All pixels whose centre is at most `radius_px` from the centre of a pixel of the set.
    pub fn dilated(&self, radius_px: f64) -> Self {
        let near = squared_distance_px(self).into_iter().map(|squared| squared <= radius_px * radius_px).collect();
        Self { size: self.size, members: near }
    }
}
