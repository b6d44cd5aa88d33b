//! The stage without a window: a device that is lost, and another that goes on.

use crate::mailbox::{Mailbox, ModelKey, News, Order, Wish};
use crate::settings::Settings;
use crate::stage::Stage;
use crate::viewer_tests::statue;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Camera, ImageSize};
use gigalod_render::{Gpu, Renderer};
use gigalod_runtime::Similarity;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Without a device there is nothing to test, unless `REQUIRE_GPU` is set.
fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("REQUIRE_GPU").is_none(), "REQUIRE_GPU is set, but {error}");
            println!("skipped: {error}");
            None
        }
    }
}

/// Something that the stage says; at most a minute, which is a failure.
fn hears<T>(mailbox: &Mailbox, what: impl Fn(News) -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(heard) = mailbox.collect().news.into_iter().find_map(&what) {
            return heard;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "it never came to be so");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn picture(news: News) -> Option<(PathBuf, Vec<u8>)> {
    match news {
        News::Picture(name, _, rgba) => Some((name, rgba)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_lost_device_is_told_and_another_draws_what_was_asked_of_it() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = statue(folder.path());
    let mailbox = Arc::new(Mailbox::new(|| {}));
    let settings = Settings::default();
    let stage = Stage::new(mailbox.clone(), Renderer::new(gpu.clone()).unwrap(), settings).unwrap();
    let thread = std::thread::spawn(|| stage.run());
    let size = ImageSize { width: 320, height: 200 };
    let wish = |azimuth_deg: f64| Wish {
        camera: Camera::orbit(&file.skeleton().root().bounds, UpAxis::Y, [azimuth_deg, 0.0], 1.0, 0.7, size),
        look: settings.look(),
        tint: settings.tint,
        finest_px: settings.finest_px,
        target_ms: settings.target_ms,
        cpu_budget: settings.cpu_budget,
        gpu_budget: settings.gpu_budget,
    };
    mailbox.order(Order::Add(ModelKey(0), file.clone().into(), vec![Similarity::IDENTITY]));
    mailbox.wish(1, wish(20.0));
    mailbox.order(Order::Picture("before".into()));
    let (name, before) = hears(&mailbox, picture);
    assert_eq!(name, PathBuf::from("before"));
    assert!(mailbox.shown().is_some());
    // At rest: the picture is what needs the device.
    gpu.close();
    mailbox.order(Order::Picture("after".into()));
    let lost = |news| matches!(news, News::DeviceLost(_)).then_some(());
    hears(&mailbox, lost);
    assert!(mailbox.shown().is_none(), "what lies on a lost device cannot be shown");
    let other = Gpu::open().unwrap();
    mailbox.order(Order::MoveTo(Box::new(other.clone())));
    let (name, after) = hears(&mailbox, picture);
    assert_eq!(name, PathBuf::from("after"), "it was not forgotten");
    assert!(before == after, "the same picture");
    // While it moves.
    other.close();
    mailbox.wish(2, wish(50.0));
    hears(&mailbox, lost);
    mailbox.order(Order::MoveTo(Box::new(Gpu::open().unwrap())));
    mailbox.wish(3, wish(20.0));
    mailbox.order(Order::Picture("again".into()));
    let (_, again) = hears(&mailbox, picture);
    assert!(before == again, "the same picture");
    mailbox.close();
    thread.join().unwrap();
}
