//! Pictures of fewer pixels than the screen has, shown magnified: what a moving camera draws when full pixels would come late.
//!
//! Goes in: a camera, and how many of the screen's pixels one drawn pixel shall be wide. Comes out: the camera of the smaller
//! picture, and what an error on it is on the screen.
//!
//! What always holds: the smaller picture shows nothing beyond the screen's, so what was selected for the screen is enough for
//! it; where pixels are as large as the screen's it is the camera itself, bit for bit.
//!
//! A pixel of the screen shows the pixel of the smaller picture that lies at its centre when this is stretched over the screen,
//! which is what [`Magnified::pixel_at`] says. So the surface that it shows was asked for somewhere else, and that distance
//! adds to the error of what is drawn.

use crate::{CutReport, Limit};
use gigalod_geom::{Camera, ImageSize};

/// A picture of fewer pixels, shown as large as the screen's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnified {
    camera: Camera,
    screen: ImageSize,
    /// Pixels of the screen in a pixel of the picture, along a column.
    edge_px: f64,
    shift_px: f64,
}

impl Magnified {
    /// The picture of `camera` with pixels that are about `edge_px` pixels of the screen wide and high; at least 1. It has a
    /// pixel at least.
    pub fn new(camera: &Camera, edge_px: f64) -> Self {
        let screen = camera.size;
        let height =
            (f64::from(screen.height) / edge_px.max(1.0)).round().clamp(1.0, f64::from(screen.height).max(1.0));
        // Not wider than the screen's: what lies beside it may not have been selected.
        let width = (height * screen.aspect() * (1.0 + 1e-12)).floor().clamp(1.0, f64::from(screen.width).max(1.0));
        let size = ImageSize { width: width as u32, height: height as u32 };
        if size == screen {
            return Self { camera: *camera, screen, edge_px: 1.0, shift_px: 0.0 };
        }
        let mut magnified = Self {
            camera: Camera { size, ..*camera },
            screen,
            edge_px: f64::from(screen.height) / height,
            shift_px: 0.0,
        };
        magnified.shift_px = magnified.largest_shift_px();
        magnified
    }

    /// What the picture is drawn with.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The pixel of the picture, `[column, row]`, that a pixel of the screen shows.
    pub fn pixel_at(&self, screen_pixel: [u32; 2]) -> [u32; 2] {
        let (small, screen) = (self.camera.size, self.screen);
        [(screen_pixel[0], small.width, screen.width), (screen_pixel[1], small.height, screen.height)]
            .map(|(at, few, many)| ((u64::from(at) * 2 + 1) * u64::from(few) / (u64::from(many) * 2)) as u32)
    }

    /// How far from a pixel's centre that was drawn which it shows, at most; pixels of the screen.
    pub fn shift_px(&self) -> f64 {
        self.shift_px
    }

    fn largest_shift_px(&self) -> f64 {
        let (small, screen) = (self.camera.size, self.screen);
        let largest = |few: u32, many: u32, axis: usize| {
            let from_middle = |at: u32, of: u32| f64::from(at) + 0.5 - f64::from(of) * 0.5;
            let shift = |at: u32| {
                let shown = self.pixel_at([at; 2])[axis];
                (from_middle(shown, few) * self.edge_px - from_middle(at, many)).abs()
            };
            (0..many).map(shift).fold(0.0, f64::max)
        };
        largest(small.width, screen.width, 0).hypot(largest(small.height, screen.height, 1))
    }

    /// What a cut for the screen's camera is when it is drawn like this: its largest error is that on the screen.
    pub fn report(&self, cut: &CutReport) -> CutReport {
        if self.edge_px == 1.0 {
            return *cut;
        }
        let limited_by = cut.limited_by.max(Some(Limit::Budget));
        // Upwards: a claim is not rounded away.
        let max_error_px = cut.max_error_px + (self.shift_px as f32).next_up();
        CutReport { max_error_px, limited_by, ..*cut }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};
    use proptest::prelude::*;

    fn camera(width: u32, height: u32) -> Camera {
        Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.7, ImageSize { width, height })
    }

    #[test]
    fn pixels_as_large_as_the_screens_are_the_screens() {
        for (width, height) in [(1280, 720), (1, 1), (333, 17), (1, 999), (999, 1)] {
            let camera = camera(width, height);
            let same = Magnified::new(&camera, 1.0);
            assert_eq!((*same.camera(), same.shift_px()), (camera, 0.0));
            let cut = CutReport { max_error_px: 3.0, ..CutReport::default() };
            assert_eq!(same.report(&cut), cut);
        }
        let half = Magnified::new(&camera(1280, 720), 2.0);
        assert_eq!(half.camera().size, ImageSize { width: 640, height: 360 });
        // A quarter of a pixel that is two wide, along both axes.
        assert!((half.shift_px() - 0.5f64.hypot(0.5)).abs() < 1e-9, "{}", half.shift_px());
    }

    proptest! {
        #[test]
        fn no_pixel_is_shown_farther_from_where_it_was_drawn(
            width in 1u32..2000, height in 1u32..2000, edge_px in 1.0f64..9.0, x in 0.0f64..1.0, y in 0.0f64..1.0,
        ) {
            let screen = camera(width, height);
            let small = Magnified::new(&screen, edge_px);
            let pixel = [(x * f64::from(width)) as u32, (y * f64::from(height)) as u32];
            let shown = small.pixel_at(pixel);
            prop_assert!(shown[0] < small.camera().size.width && shown[1] < small.camera().size.height);
            // The ray that was drawn, as the screen's camera sees it.
            let center = |pixel: [u32; 2]| DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + 0.5;
            let ray = small.camera().ray_through(center(shown));
            let drawn_at = screen.pixel_of_view_point(screen.view_point(ray));
            prop_assert!((drawn_at - center(pixel)).length() <= small.shift_px() + 1e-6);
            // Nothing beyond the screen's picture; but for one that is less than a pixel wide.
            let [few, many] = [small.camera(), &screen].map(Camera::tan_half_fov);
            prop_assert!(few.y == many.y && (few.x <= many.x * (1.0 + 1e-9) || small.camera().size.width == 1));
        }
    }
}
