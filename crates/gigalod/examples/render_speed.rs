//! How many splats a CPU-second draws, through compute passes and through the pipeline, side by side in one run.
//!
//! `cargo run --release --example render_speed -- FILE.glod [--error PX] [--kernel NAME] [--size WxH] [--orbit AZ,EL,ZOOM]
//! [--rounds N] [--extent PX] [--ways compute,quads,…]`
//!
//! Takes a built model; prints one JSON object on a line: for each way CPU-seconds (user and system, of the whole process) of
//! the median frame, sent and drawn, and drawn only (the list already lies on the device), and points per CPU-second of both,
//! less what a frame of that size costs with a single splat: what is paid for each pixel and not for each point; and how many pixels
//! a point covers, which is more than one where the data are coarser.
//!
//! Ways: `compute`: as the renderer does. `quads`: the same with every splat through the pipeline (extent 0). `depth_test`: the
//! pipeline with a depth test, as on devices without storage buffers. `one`: a frame of one splat.

use anyhow::{Context, Result, bail};
use gigalod::format::splats::SplatFile;
use gigalod::format::{Container, FileStore};
use gigalod::geom::{Camera, ImageSize};
use gigalod::render::{Frame, Gpu, GpuLevel, Kernel, Look, Renderer};
use gigalod::runtime::residency::InlineLoader;
use gigalod::runtime::splats::{SplatList, SplatPiece};
use gigalod::runtime::{DrawSource, Fineness, Instance, Residency, Scene, Similarity, ViewId};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

struct Options {
    threshold_px: f32,
    kernel: Kernel,
    size: ImageSize,
    orbit: [f64; 3],
    rounds: usize,
    extent: Option<u32>,
    ways: Option<Vec<String>>,
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, rest @ ..] = &arguments[..] else { bail!("usage: render_speed FILE.glod [--error PX] …") };
    let options = parse(rest)?;
    let container = Container::open(Arc::new(FileStore::open(Path::new(file)).context(file.clone())?))?;
    let splats = Arc::new(SplatFile::open(container)?);
    let up = splats.skeleton().root().up;
    let mut residency = Residency::new(8 << 30, Box::new(InlineLoader::default()));
    let id = residency.add(splats);
    let mut scene = Scene::new(residency);
    scene.add(Instance { file: id, placement: Similarity::IDENTITY });
    let [azimuth, elevation, zoom] = options.orbit;
    let bounds = scene.bounds();
    let camera = Camera::orbit(&bounds, up, [azimuth, elevation], zoom, 40f64.to_radians(), options.size);
    scene.select_converged(ViewId(0), &camera, &Fineness::px(options.threshold_px));
    let list = scene.draws(ViewId(0)).map(|(_, selection)| selection.draw.clone()).next().context("one model")?;
    let DrawSource::Splats(splats) = &list else { bail!("a list of splats") };
    let (ball, normal_color) = splats.iter().next().context("a splat")?;
    let mut piece = SplatPiece::default();
    piece.push(*ball, normal_color);
    let one = DrawSource::Splats(SplatList { pieces: vec![piece] });
    let frame = |source| Frame {
        camera,
        look: Look { kernel: options.kernel, ..Look::default() },
        draws: vec![(Similarity::IDENTITY, source)],
    };

    let mut native = Renderer::new(Gpu::open()?)?;
    if let Some(extent) = options.extent {
        native.set_compute_extent(extent);
    }
    let mut quads = Renderer::new(Gpu::open()?)?;
    quads.set_compute_extent(0);
    let mut depth_test = Renderer::new(Gpu::open_at(GpuLevel::WebGl)?)?;
    let mut for_one = Renderer::new(Gpu::open()?)?;
    let way = |name, renderer, source| Way { name, renderer, source, sent: vec![], drawn: vec![] };
    let mut ways =
        vec![way("one", &mut for_one, &one), way("compute", &mut native, &list), way("quads", &mut quads, &list)];
    if !options.kernel.is_gauss() {
        ways.push(way("depth_test", &mut depth_test, &list));
    }
    if let Some(wanted) = &options.ways {
        ways.retain(|way| way.name == "one" || wanted.iter().any(|wanted| wanted == way.name));
    }
    // The first frame compiles and makes buffers.
    for round in 0..=options.rounds {
        for way in &mut ways {
            let begun = cpu_seconds()?;
            way.renderer.draw(&frame(way.source))?;
            let sent = cpu_seconds()?;
            way.renderer.redraw()?;
            if round > 0 {
                way.sent.push(sent - begun);
                way.drawn.push(cpu_seconds()? - sent);
            }
        }
    }
    let points = splats.len() as f64;
    let medians: Vec<_> =
        ways.iter_mut().map(|way| (way.name, median(&mut way.sent), median(&mut way.drawn))).collect();
    let (_, one_sent, one_drawn) = medians[0];
    let per_second = |seconds: f64| if seconds > 0.0 { Value::from((points / seconds).round()) } else { Value::Null };
    let ways: serde_json::Map<String, Value> = medians
        .iter()
        .map(|(name, sent, drawn)| {
            let figures = json!({
                "cpu_seconds": sent,
                "cpu_seconds_without_upload": drawn,
                "points_per_cpu_second": per_second(sent - one_sent),
                "points_per_cpu_second_without_upload": per_second(drawn - one_drawn),
            });
            (name.to_string(), figures)
        })
        .collect();
    let adapter = native.gpu().adapter();
    let report = json!({
        "file": file, "adapter": adapter, "wide_keys": native.gpu().has_wide_keys(), "points": points,
        "pixels_per_point": scene.area_px(ViewId(0), &camera) / points,
        "threshold_px": options.threshold_px, "kernel": format!("{:?}", options.kernel), "ways": ways,
    });
    println!("{report}");
    Ok(())
}

/// A way of drawing, and CPU-seconds of its frames.
struct Way<'a> {
    name: &'static str,
    renderer: &'a mut Renderer,
    source: &'a DrawSource,
    sent: Vec<f64>,
    drawn: Vec<f64>,
}

fn median(seconds: &mut [f64]) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

/// User and system time of this process.
fn cpu_seconds() -> Result<f64> {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    let usage = getrusage(UsageWho::RUSAGE_SELF)?;
    Ok((usage.user_time().num_microseconds() + usage.system_time().num_microseconds()) as f64 * 1e-6)
}

fn parse(arguments: &[String]) -> Result<Options> {
    let mut options = Options {
        threshold_px: 1.0,
        kernel: Kernel::Round,
        size: ImageSize { width: 1280, height: 720 },
        orbit: [0.0, 0.0, 1.0],
        rounds: 7,
        extent: None,
        ways: None,
    };
    for pair in arguments.chunks(2) {
        let [name, value] = pair else { bail!("{} without a value", pair[0]) };
        match name.as_str() {
            "--error" => options.threshold_px = value.parse()?,
            "--rounds" => options.rounds = value.parse()?,
            "--extent" => options.extent = Some(value.parse()?),
            "--ways" => options.ways = Some(value.split(',').map(String::from).collect()),
            "--kernel" => {
                let named = |kernel: &&Kernel| format!("{kernel:?}").eq_ignore_ascii_case(&value.replace('-', ""));
                options.kernel = *Kernel::ALL.iter().find(named).context("no such kernel")?;
            }
            "--size" => {
                let (width, height) = value.split_once('x').context("WxH")?;
                options.size = ImageSize { width: width.parse()?, height: height.parse()? };
            }
            "--orbit" => {
                let numbers = value.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
                options.orbit = numbers.try_into().ok().context("AZ,EL,ZOOM")?;
            }
            _ => bail!("unknown option {name}"),
        }
    }
    Ok(options)
}
