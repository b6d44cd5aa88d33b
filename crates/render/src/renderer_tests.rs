//! Frames drawn in slices: the same picture as in one go, and none at all where they are broken off.

use crate::splats::keyed;
use crate::{Frame, Gpu, Kernel, Look, Picture, Renderer};
use gigalod_geom::quantise::normal;
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::splats::{SplatList, SplatPiece};
use gigalod_runtime::{DrawSource, Interrupt, Similarity, SplatBall};
use glam::{DVec3, Vec3};
use std::time::Duration;

/// Without a device there is nothing to test, unless `REQUIRE_GPU` is set.
fn renderer() -> Option<Renderer> {
    match Gpu::open() {
        Ok(gpu) => Some(Renderer::new(gpu).unwrap()),
        Err(error) => {
            assert!(std::env::var_os("REQUIRE_GPU").is_none(), "REQUIRE_GPU is set, but {error}");
            println!("skipped: {error}");
            None
        }
    }
}

/// A wall of splats that get nearer from one to the next, in each pixel several; every hundredth too large for the compute pass.
fn wall(splats: usize, hue: u32) -> DrawSource {
    let mut piece = SplatPiece::default();
    for at in 0..splats {
        let (x, y) = ((at % 190) as f32 / 100.0 - 0.95, (at / 190 % 110) as f32 / 100.0 - 0.55);
        let radius = if at % 100 == 0 { 0.4 } else { 0.02 };
        let ball = SplatBall { center_in_eye: [x, y, -1.5 + at as f32 * 1e-6], radius };
        piece.push(ball, u32::from(normal::encode(Vec3::Z)) | ((at as u32 % 0xfff) | hue) << 16);
    }
    DrawSource::Splats(SplatList { pieces: vec![piece] })
}

fn frame<'a>(kernel: Kernel, sources: &'a [DrawSource]) -> Frame<'a> {
    let size = ImageSize { width: 320, height: 200 };
    let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.8, size);
    let beside = |at: usize| Similarity { position: DVec3::new(0.1 * at as f64, 0.0, 0.05), ..Similarity::IDENTITY };
    let draws = sources.iter().enumerate().map(|(at, source)| (beside(at), source)).collect();
    Frame { camera, look: Look { kernel, ..Look::default() }, draws }
}

fn same(a: &Picture, b: &Picture) -> bool {
    a.rgba == b.rgba && a.depth == b.depth && a.footprint_px == b.footprint_px
}

/// As [`Renderer::picture`], with something that may break it off; and whether it went through.
fn interruptible(renderer: &mut Renderer, frame: &Frame<'_>, interrupt: &Interrupt) -> (bool, Picture) {
    let drawn = renderer.submit(frame, true, Some(interrupt)).unwrap();
    (drawn, renderer.read().unwrap())
}

#[test]
fn slices_make_the_same_picture_and_a_broken_off_frame_none() {
    let Some(mut renderer) = renderer() else { return };
    let (sources, others) = ([wall(60_000, 0), wall(30_000, 0x1000)], [wall(80_000, 0x2000)]);
    assert!(keyed::most_in_slice(60_000, 1e9) <= 60_000 / 4, "there is more than one slice");
    for kernel in [Kernel::Round, Kernel::Square, Kernel::Gauss] {
        let (shown, wanted) = (frame(kernel, &sources), frame(kernel, &others));
        let expected = renderer.picture(&wanted).unwrap();
        let before = renderer.picture(&shown).unwrap();
        let interrupt = Interrupt::default();
        let (drawn, picture) = interruptible(&mut renderer, &shown, &interrupt);
        assert!(drawn && same(&picture, &before), "{kernel:?}");
        interrupt.set();
        let (drawn, picture) = interruptible(&mut renderer, &wanted, &interrupt);
        assert!(!drawn && picture.rgba == before.rgba, "{kernel:?}: what is shown is touched");
        assert!(!renderer.draw_interruptible(&wanted, &interrupt).unwrap());
        interrupt.clear();
        let (drawn, picture) = interruptible(&mut renderer, &wanted, &interrupt);
        assert!(drawn && same(&picture, &expected), "{kernel:?}: it can be drawn after all");
    }
}

/// Wherever it comes, it is either in time or not.
#[test]
fn an_interrupt_at_any_moment_leaves_one_picture_or_the_other() {
    let Some(mut renderer) = renderer() else { return };
    let (sources, others) = ([wall(60_000, 0)], [wall(80_000, 0x2000)]);
    let (shown, wanted) = (frame(Kernel::Round, &sources), frame(Kernel::Round, &others));
    let expected = renderer.picture(&wanted).unwrap();
    for at in 0..10 {
        let before = renderer.picture(&shown).unwrap();
        let interrupt = Interrupt::default();
        let (drawn, picture) = std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(at));
                interrupt.set();
            });
            interruptible(&mut renderer, &wanted, &interrupt)
        });
        let right = if drawn { &expected } else { &before };
        assert!(picture.rgba == right.rgba, "interrupted after {at} ms");
    }
}
