//! The stage without a window: pictures for files; a device that is lost, and another that goes on.

use crate::mailbox::{Mailbox, ModelKey, News, Order, Wish};
use crate::settings::Settings;
use crate::stage::Stage;
use crate::viewer_tests::statue;
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera, ImageSize};
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

/// A stage that shows the statue, and wishes for it.
struct Staged {
    _folder: tempfile::TempDir,
    mailbox: Arc<Mailbox>,
    thread: std::thread::JoinHandle<()>,
    bounds: Aabb,
}

impl Staged {
    fn on(gpu: Gpu) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = statue(folder.path());
        let mailbox = Arc::new(Mailbox::new(|| {}));
        let stage = Stage::new(mailbox.clone(), Renderer::new(gpu).unwrap(), Settings::default()).unwrap();
        let thread = std::thread::spawn(|| stage.run());
        let bounds = file.skeleton().root().bounds;
        mailbox.order(Order::Add(ModelKey(0), file.into(), vec![Similarity::IDENTITY]));
        Self { _folder: folder, mailbox, thread, bounds }
    }

    fn wish(&self, azimuth_deg: f64) -> Wish {
        let settings = Settings::default();
        let size = ImageSize { width: 320, height: 200 };
        Wish {
            camera: Camera::orbit(&self.bounds, UpAxis::Y, [azimuth_deg, 0.0], 1.0, 0.7, size),
            look: settings.look(),
            tint: settings.tint,
            cross_fade: settings.cross_fade,
            finest_px: 1.0,
            target_ms: settings.target_ms,
            cpu_budget: settings.cpu_budget,
            gpu_budget: settings.gpu_budget,
        }
    }

    /// Wishes for it, and a picture of it.
    fn takes(&self, number: u64, name: &str, azimuth_deg: f64) {
        self.mailbox.wish(number, self.wish(azimuth_deg));
        self.mailbox.order(Order::Picture(name.into(), self.wish(azimuth_deg)));
    }
}

#[test]
fn the_first_look_at_a_model_waits_for_its_pages_but_not_for_long() {
    let Some(gpu) = gpu() else { return };
    let begun = Instant::now();
    let staged = Staged::on(gpu);
    staged.mailbox.wish(1, staged.wish(20.0));
    let first = loop {
        if let Some(first) = staged.mailbox.collect().figures.into_iter().next() {
            break first;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "it never came to be so");
        std::thread::sleep(Duration::from_millis(1));
    };
    // The root alone is as large as the picture.
    assert!(first.report.max_error_px <= 40.0 || begun.elapsed() > Duration::from_millis(400), "{first:?}");
    staged.mailbox.close();
    staged.thread.join().unwrap();
}

#[test]
fn a_picture_is_as_fine_as_it_gets_whatever_is_wished_for_meanwhile() {
    let Some(gpu) = gpu() else { return };
    let staged = Staged::on(gpu);
    let mailbox = &staged.mailbox;
    let taken = || hears(mailbox, picture);
    staged.takes(1, "rested", 20.0);
    let (_, rested) = taken();
    // Looked away from before it is drawn at all, or as it is being refined.
    let mut number = 2;
    for wait_ms in [0, 20, 60, 200] {
        mailbox.wish(number, staged.wish(80.0));
        std::thread::sleep(Duration::from_millis(wait_ms));
        staged.takes(number + 1, "moved", 20.0);
        std::thread::sleep(Duration::from_millis(wait_ms));
        mailbox.wish(number + 2, staged.wish(50.0 + number as f64));
        number += 3;
        let (name, moved) = taken();
        assert_eq!(name, PathBuf::from("moved"));
        assert!(moved == rested, "the same picture, after {wait_ms} ms");
    }
    // Who asks again and again does not wait longer.
    let mut asked = 0;
    while mailbox.collect().news.is_empty() {
        assert!(asked < 2000, "it never came to be so");
        mailbox.order(Order::Picture(format!("impatient {asked}").into(), staged.wish(20.0)));
        asked += 1;
        std::thread::sleep(Duration::from_millis(5));
    }
    let last = PathBuf::from(format!("impatient {}", asked - 1));
    while asked > 1 && hears(mailbox, picture).0 != last {}
    // In their order, and those that nobody has waited for.
    staged.takes(number, "first", 20.0);
    staged.takes(number + 1, "second", 20.0);
    mailbox.wish(number + 2, staged.wish(0.0));
    mailbox.close();
    staged.thread.join().unwrap();
    let news: Vec<_> = mailbox.collect().news.into_iter().filter_map(picture).collect();
    assert_eq!(news.iter().map(|(name, _)| name.to_str().unwrap()).collect::<Vec<_>>(), ["first", "second"]);
    assert!(news.iter().all(|(_, rgba)| *rgba == rested));
}

#[test]
fn a_lost_device_is_told_and_another_draws_what_was_asked_of_it() {
    let Some(gpu) = gpu() else { return };
    let staged = Staged::on(gpu.clone());
    let mailbox = &staged.mailbox;
    staged.takes(1, "before", 20.0);
    let (name, before) = hears(mailbox, picture);
    assert_eq!(name, PathBuf::from("before"));
    assert!(mailbox.shown().is_some());
    // At rest: the picture is what needs the device.
    gpu.close();
    staged.takes(1, "after", 20.0);
    let lost = |news| matches!(news, News::DeviceLost(_)).then_some(());
    hears(mailbox, lost);
    assert!(mailbox.shown().is_none(), "what lies on a lost device cannot be shown");
    let other = Gpu::open().unwrap();
    mailbox.order(Order::MoveTo(Box::new(other.clone())));
    let (name, after) = hears(mailbox, picture);
    assert_eq!(name, PathBuf::from("after"), "it was not forgotten");
    assert!(before == after, "the same picture");
    // While it moves.
    other.close();
    mailbox.wish(2, staged.wish(50.0));
    hears(mailbox, lost);
    mailbox.order(Order::MoveTo(Box::new(Gpu::open().unwrap())));
    staged.takes(3, "again", 20.0);
    let (_, again) = hears(mailbox, picture);
    assert!(before == again, "the same picture");
    mailbox.close();
    staged.thread.join().unwrap();
}
