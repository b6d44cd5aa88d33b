//! How fast warm cuts are: nodes visited a CPU-second, milliseconds a cut, allocations a cut.
//!
//! `cargo run --release --package gigalod-runtime --example select_speed -- MODEL.glod [SECONDS]`
//!
//! Everything wanted is loaded first; then the camera turns by a hundredth of a degree from cut to cut, as a moving one does.
//! CPU time is user and system time of all threads. Prints one line of JSON.

#[path = "../../gigalod/tests/counting/mod.rs"]
mod counting;

use gigalod_format::splats::SplatFile;
use gigalod_format::{Container, FileStore};
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::residency::ThreadedLoader;
use gigalod_runtime::{Fineness, Instance, Residency, Scene, Similarity, ViewId};
use std::sync::Arc;
use std::time::Instant;

const SIZE: ImageSize = ImageSize { width: 1280, height: 720 };
const VIEW: ViewId = ViewId(0);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, rest @ ..] = &arguments[..] else {
        eprintln!("usage: select_speed MODEL.glod [SECONDS]");
        std::process::exit(2);
    };
    let seconds: f64 = rest.first().map_or(1.0, |text| text.parse().expect("seconds"));
    let store = Arc::new(FileStore::open(model.as_ref()).expect("the file opens"));
    let file = Arc::new(SplatFile::open(Container::open(store).expect("a container")).expect("a skeleton"));
    let mut lines = Vec::new();
    for threads in [1, 2] {
        let only = rest.get(1).map(String::as_str);
        for (pose, zoom) in [("default", 1.0), ("close", 6.0), ("inside", 300.0)] {
            for threshold_px in [0.0, 0.5, 1.0, 4.0] {
                if threshold_px == 0.0 && pose == "inside"
                    || only.is_some_and(|only| only != format!("{pose}{threshold_px}x{threads}"))
                {
                    continue;
                }
                lines.push(measure(&file, threads, (pose, zoom), threshold_px, seconds));
            }
        }
    }
    println!("{{\"model\":\"{model}\",\"cuts\":[{}]}}", lines.join(","));
}

/// Cameras that take turns, each a little beside the last.
const STEPS: u64 = 10;

/// One line: warm cuts of one pose.
fn measure(
    file: &Arc<SplatFile>,
    threads: usize,
    (pose, zoom): (&str, f64),
    threshold_px: f32,
    seconds: f64,
) -> String {
    let mut residency = Residency::new(16 << 30, Box::new(ThreadedLoader::new(2).expect("threads")));
    let id = residency.add(file.clone());
    let mut scene = Scene::new(residency);
    scene.splats_mut().set_threads(threads);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });
    let (bounds, up) = (scene.bounds(), file.skeleton().root().up);
    let camera = |turn: u64| {
        let azimuth_deg = 20.0 + 0.01 * turn as f64;
        Camera::orbit(&bounds, up, [azimuth_deg, 10.0], zoom, 40f64.to_radians(), SIZE)
    };
    // Close to a surface each step needs other pages.
    for turn in 0..STEPS {
        scene.select_converged(VIEW, &camera(turn), &Fineness::px(threshold_px));
    }
    scene.select(VIEW, &camera(0), &Fineness::px(threshold_px));
    scene.serve();
    let (mut cuts, mut visited, mut drawn) = (0, 0, 0);
    let cpu = cpu_seconds();
    let (wall, allocations) = (Instant::now(), counting::allocations());
    while wall.elapsed().as_secs_f64() < seconds {
        cuts += 1;
        let report = scene.select(VIEW, &camera(cuts % STEPS), &Fineness::px(threshold_px));
        scene.serve();
        visited += report.visited;
        drawn = report.drawn;
    }
    let allocations = counting::allocations() - allocations;
    let (cpu, wall) = (cpu_seconds() - cpu, wall.elapsed().as_secs_f64());
    format!(
        "{{\"pose\":\"{pose}\",\"threshold_px\":{threshold_px},\"threads\":{threads},\"drawn\":{drawn},\"visited\":{},\
         \"ms\":{:.3},\"cpu_ms\":{:.3},\"m_nodes_per_cpu_s\":{:.2},\"allocations\":{:.2}}}",
        visited / cuts,
        wall / cuts as f64 * 1e3,
        cpu / cuts as f64 * 1e3,
        visited as f64 / cpu / 1e6,
        allocations as f64 / cuts as f64,
    )
}

/// User and system time of this process, in steps of 10 ms.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().expect("ticks") / 100.0).sum()
}
