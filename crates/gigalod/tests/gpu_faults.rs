//! When the device fails: lost, out of memory, not enough of it allowed. Each is said, and survived.

mod common;

use common::renderer;
use gigalod::geom::quantise::normal;
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Frame, Kernel, Look, Picture, RenderError, Renderer};
use gigalod::runtime::splats::{SplatList, SplatPiece};
use gigalod::runtime::{DrawSource, Similarity, SplatBall};
use glam::{DVec3, Vec3};

const SIZE: ImageSize = ImageSize { width: 320, height: 200 };

/// A wall of splats in front of the camera, two pixels across at most.
fn wall(splats: usize) -> DrawSource {
    let mut piece = SplatPiece::default();
    for at in 0..splats {
        let (x, y) = ((at % 300) as f32 / 150.0 - 1.0, (at / 300 % 190) as f32 / 150.0 - 0.63);
        let ball = SplatBall { center_in_eye: [x, y, -1.5 - at as f32 * 1e-6], radius: 0.006 };
        piece.push(ball, u32::from(normal::encode(Vec3::Z)) | (at as u32 % 0xffff) << 16);
    }
    DrawSource::Splats(SplatList { pieces: vec![piece] })
}

fn frame(source: &DrawSource, kernel: Kernel, size: ImageSize) -> Frame<'_> {
    let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.8, size);
    Frame { camera, look: Look { kernel, ..Look::default() }, draws: vec![(Similarity::IDENTITY, source)] }
}

fn same(a: &Picture, b: &Picture) -> bool {
    a.rgba == b.rgba && a.depth == b.depth
}

#[test]
fn a_lost_device_is_said_and_a_new_one_draws_the_same() {
    let Some(mut renderer) = renderer() else { return };
    let source = wall(20_000);
    let frame = frame(&source, Kernel::Round, SIZE);
    let expected = renderer.picture(&frame).unwrap();
    renderer.gpu().close();
    for _ in 0..2 {
        assert!(matches!(renderer.draw(&frame), Err(RenderError::DeviceLost(_))), "until it is opened anew");
        assert!(matches!(renderer.picture(&frame), Err(RenderError::DeviceLost(_))));
    }
    renderer.recover().unwrap();
    assert!(same(&renderer.picture(&frame).unwrap(), &expected));
}

#[test]
fn a_budget_is_kept_or_the_frame_refused() {
    let Some(mut renderer) = renderer() else { return };
    let source = wall(50_000);
    let size = ImageSize { width: 1000, height: 700 };
    for kernel in [Kernel::Round, Kernel::Gauss] {
        renderer.set_budget(None);
        let expected = renderer.picture(&frame(&source, kernel, size)).unwrap();
        // One larger, to be freed.
        renderer.draw(&frame(&wall(600_000), kernel, size)).unwrap();
        let free = renderer.gpu_bytes();
        let budget = 40 << 20;
        assert!(free > budget, "{free}");
        renderer.set_budget(Some(budget));
        let most = renderer.most_splats(size, &Look { kernel, ..Look::default() });
        assert!((50_000..2_000_000).contains(&most), "{most}");
        // A smaller budget leaves fewer rows of keys at a time; the picture is the same.
        assert!(same(&renderer.picture(&frame(&source, kernel, size)).unwrap(), &expected), "{kernel:?}");
        assert!(renderer.gpu_bytes() <= budget, "{}", renderer.gpu_bytes());
        renderer.picture(&frame(&wall(most as usize), kernel, size)).unwrap();
        assert!(renderer.gpu_bytes() <= budget && renderer.gpu_bytes() > budget - (1 << 20));
        // What was promised is not far from what is possible.
        let too_many = wall(most as usize + 100_000);
        match renderer.draw(&frame(&too_many, kernel, size)) {
            Err(RenderError::Budget { needed, budget: allowed }) => assert!(allowed == budget && needed > budget),
            // Without readback there is a little more room.
            Ok(()) => assert!(renderer.gpu_bytes() <= budget),
            other => panic!("{other:?}"),
        }
        assert!(matches!(
            renderer.draw(&frame(&wall(most as usize + 1_000_000), kernel, size)),
            Err(RenderError::Budget { .. })
        ));
        assert!(same(&renderer.picture(&frame(&source, kernel, size)).unwrap(), &expected), "a refusal costs nothing");
        renderer.set_budget(Some(8 << 20));
        assert_eq!(renderer.most_splats(size, &Look { kernel, ..Look::default() }), 0);
        assert!(matches!(renderer.draw(&frame(&source, kernel, size)), Err(RenderError::Budget { .. })));
    }
}

/// A frame like the last one takes nothing new.
#[test]
fn warm_frames_take_no_more_memory() {
    let Some(mut renderer) = renderer() else { return };
    let (large, small) = (wall(100_000), wall(90_000));
    renderer.picture(&frame(&large, Kernel::Round, SIZE)).unwrap();
    let warm = renderer.gpu_bytes();
    for source in [&small, &large, &small] {
        renderer.draw(&frame(source, Kernel::Round, SIZE)).unwrap();
        assert_eq!(renderer.gpu_bytes(), warm);
    }
}

/// Runs in a process of its own, whose address space ends soon after what it has: the software adapter's memory is the host's.
#[cfg(target_os = "linux")]
#[test]
fn out_of_memory_is_said_and_a_coarser_frame_drawn() {
    use std::process::Command;
    if std::env::var_os("GIGALOD_TEST_OUT_OF_MEMORY").is_some() {
        return run_out_of_memory();
    }
    let Some(renderer) = renderer() else { return };
    if !renderer.gpu().adapter().contains("llvmpipe") {
        println!("skipped: {} has memory of its own", renderer.gpu().adapter());
        return;
    }
    let this = std::env::current_exe().unwrap();
    let status = Command::new(this)
        .args(["--exact", "out_of_memory_is_said_and_a_coarser_frame_drawn", "--nocapture"])
        .env("GIGALOD_TEST_OUT_OF_MEMORY", "1")
        .status()
        .unwrap();
    assert!(status.success(), "{status}");
}

#[cfg(target_os = "linux")]
fn run_out_of_memory() {
    use nix::sys::resource::{Resource, setrlimit};
    let mut renderer: Renderer = renderer().expect("it was there a moment ago");
    let (fine, coarse) = (wall(12_000_000), wall(50_000));
    let expected = renderer.picture(&frame(&coarse, Kernel::Round, SIZE)).unwrap();
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: u64 = statm.split(' ').next().unwrap().parse().unwrap();
    let limit = pages * 4096 + (100 << 20);
    setrlimit(Resource::RLIMIT_AS, limit, limit).unwrap();
    match renderer.draw(&frame(&fine, Kernel::Round, SIZE)) {
        Err(RenderError::OutOfMemory(why)) => println!("as it should be: {why}"),
        other => panic!("240 MB within 100 MB: {other:?}"),
    }
    let again = match renderer.picture(&frame(&coarse, Kernel::Round, SIZE)) {
        // A driver may give the device up.
        Err(RenderError::DeviceLost(why)) => {
            println!("lost too: {why}");
            renderer.recover().unwrap();
            renderer.picture(&frame(&coarse, Kernel::Round, SIZE)).unwrap()
        }
        other => other.unwrap(),
    };
    assert!(same(&again, &expected));
}
