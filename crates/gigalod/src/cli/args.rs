//! All commands and their options.

mod synth;

use super::parse;
use clap::{Args, Parser, Subcommand, ValueEnum};
use gigalod_geom::{ImageSize, LengthUnit};
use gigalod_render::Kernel;
use glam::DVec3;
use std::path::PathBuf;
pub(crate) use synth::*;

/// Shows models too big for memory at a guaranteed error on screen.
///
/// Convert once with `build`, look at once with `render`. New here? Run `gigalod demo`.
#[derive(Parser, Debug)]
#[command(version, propagate_version = true, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// Print one JSON object on standard output, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Say more on standard error
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    #[cfg(feature = "view")]
    View(Box<ViewArgs>),
    Build(BuildArgs),
    Render(Box<RenderArgs>),
    Bench(Box<BenchArgs>),
    Info(InfoArgs),
    Verify(VerifyArgs),
    Export(ExportArgs),
    Compare(CompareArgs),
    Synth(SynthArgs),
    Demo(DemoArgs),
}

/// Convert a model into a .glod file
///
/// Reads meshes (PLY, OBJ, STL, OFF, glTF and GLB) and clouds of points (PLY, LAS and LAZ, E57, PCD, PTS, XYZ), told apart by
/// their content; text formats, PLY, STL and LAS also gzipped. The output appears under its name only when it is complete.
/// Several files become one model, in the coordinates that they have; all of them meshes, or all of them clouds. A folder stands
/// for the models in it.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  gigalod build statue.ply.gz -o statue.glod\n  \
    gigalod build tiles/ more.laz --units us-ft -o county.glod")]
pub(crate) struct BuildArgs {
    /// Models to convert, files or folders: together one model
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// File to write; replaced if it exists
    #[arg(short, long, value_name = "OUT.glod")]
    pub(crate) output: PathBuf,
    /// Which way is up [default: as the format has it]
    #[arg(long, value_enum)]
    pub(crate) up: Option<UpAxisArg>,
    /// What a length of 1 in the input is: m, mm, cm, km, ft, us-ft or in [default: what the input says, if anything]
    ///
    /// It is kept for `info` and `verify` to show. Coordinates, and all lengths in options and reports, stay in this unit.
    #[arg(long, value_parser = parse::unit, value_name = "UNIT")]
    pub(crate) units: Option<LengthUnit>,
    /// Continue a build that was interrupted, if there is one
    ///
    /// A build that does not fit into half of --memory works in a folder beside the output, .NAME.glod.build, and can go on
    /// there after anything: with the same input and options, or it is refused; --memory and --threads may differ. Without
    /// --resume what is there is removed and the build starts anew. The folder takes up to three times the input's size.
    #[arg(long)]
    pub(crate) resume: bool,
    #[command(flatten)]
    pub(crate) options: BuildOptions,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct BuildOptions {
    /// Representation
    #[arg(long = "as", value_enum, default_value_t = Representation::Auto)]
    pub(crate) representation: Representation,
    /// Hybrid: the error of a node is at most the edge of its cell divided by this, 8 to 1024 [default: 64]
    ///
    /// Larger draws fewer primitives from afar, and takes more room on disk.
    #[arg(long, value_parser = clap::value_parser!(u32).range(8..=1024), allow_negative_numbers = true, value_name = "R")]
    pub(crate) res: Option<u32>,
    /// Hybrid: most triangles of a leaf, 64 to 65536 [default: 4096]
    #[arg(long, value_parser = clap::value_parser!(u32).range(64..=65_536), allow_negative_numbers = true, value_name = "N")]
    pub(crate) tmax: Option<u32>,
    /// Hybrid: bound errors of shading and colour too, or of geometry alone, which takes half the room
    #[arg(long, value_enum, default_value_t = Appearance::On)]
    pub(crate) appearance: Appearance,
    /// Most memory to use, as 512MiB or 4GB; at least 64MiB
    #[arg(long, default_value = "2GiB", value_parser = parse::memory, allow_negative_numbers = true, value_name = "SIZE")]
    pub(crate) memory: u64,
    /// Worker threads; 0 for one on each core
    #[arg(long, default_value = "0", value_parser = parse::threads, allow_negative_numbers = true, value_name = "N")]
    pub(crate) threads: usize,
    /// Sample triangles that are larger than this so finely, in the model's units [default: what suits the model]
    ///
    /// Of a scan, only what is out of all proportion is cut by default; of anything else, such as a building, so much that there
    /// are about 2 million samples, or one a triangle if these are more. Smaller takes more time and room, and looks sharper
    /// close up.
    #[arg(long, value_parser = parse::positive, allow_hyphen_values = true, value_name = "UNITS")]
    pub(crate) spacing: Option<f64>,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Representation {
    /// What suits the input best: hybrid for meshes without materials, else splats
    Auto,
    /// A hierarchy of bounding spheres, drawn as points
    Splats,
    /// An octree of simplified triangles and points, with proven errors
    Hybrid,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Appearance {
    On,
    Off,
}

impl BuildOptions {
    /// Within this much memory, all else as it is by default.
    pub(crate) fn within(memory: u64) -> Self {
        Self {
            representation: Representation::Auto,
            res: None,
            tmax: None,
            appearance: Appearance::On,
            memory,
            threads: 0,
            spacing: None,
        }
    }

    /// What the bytes of a result depend on, in a line; empty where all is as it is by default.
    pub(crate) fn recipe(&self) -> String {
        let mut recipe = String::new();
        if self.representation != Representation::Auto {
            recipe += &format!("as {:?}\n", self.representation).to_lowercase();
        }
        let numbers = [("res", self.res.map(f64::from)), ("tmax", self.tmax.map(f64::from)), ("spacing", self.spacing)];
        for (name, value) in numbers {
            if let Some(value) = value {
                recipe += &format!("{name} {value}\n");
            }
        }
        if self.appearance == Appearance::Off {
            recipe += "appearance off\n";
        }
        recipe
    }

    /// The same as arguments of `gigalod build`.
    #[cfg(feature = "view")]
    pub(crate) fn recipe_arguments(&self) -> Vec<String> {
        let recipe = self.recipe();
        let option = |line: &str| line.split_once(' ').map(|(name, value)| [format!("--{name}"), value.to_string()]);
        recipe.lines().filter_map(option).flatten().collect()
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UpAxisArg {
    Y,
    Z,
}

/// Draw a picture of a model
///
/// A raw model is first built into the cache of the user ($XDG_CACHE_HOME/gigalod or ~/.cache/gigalod).
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  gigalod render statue.glod -o statue.png\n  \
    gigalod render statue.glod -o face.png --orbit 30,10,4 --error 0.5\n  \
    gigalod render statue.glod -o levels.png --lod-colors --error 8")]
pub(crate) struct RenderArgs {
    /// Model: .glod, or a raw one; or a scene: .toml
    pub(crate) file: PathBuf,
    /// Picture to write, a PNG; replaced if it exists
    #[arg(short, long, value_name = "OUT.png")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) draw: DrawArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    /// Also write the distance along the view axis, in model units: one 32-bit channel Z
    #[arg(long, value_name = "OUT.exr")]
    pub(crate) depth: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) build: BuildOptions,
}

/// How models are drawn, whatever for.
#[derive(Args, Debug)]
pub(crate) struct DrawArgs {
    /// Width and height in pixels
    #[arg(long, default_value = "1280x720", value_parser = parse::image_size, allow_hyphen_values = true, value_name = "WxH")]
    pub(crate) size: ImageSize,
    /// Largest error on screen, in pixels [default: 1, the diameter of splats; 0.5 where all models are hybrid]
    #[arg(long, value_parser = parse::positive, allow_hyphen_values = true, value_name = "PX")]
    pub(crate) error: Option<f64>,
    /// Draw all leaves, whatever their size on screen
    #[arg(long, conflicts_with = "error")]
    pub(crate) full: bool,
    /// Shape of splats
    #[arg(long, value_enum, default_value_t = KernelArg::Round)]
    pub(crate) kernel: KernelArg,
    /// Places at which each pixel is looked at, 1 to 64: edges are smoother, and a picture takes as many times as long [default: 1; in
    /// the viewer 17, once all else is drawn]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=64), allow_negative_numbers = true, value_name = "N")]
    pub(crate) samples: Option<u32>,
    /// Direction towards the light [default: the scene's, or a lamp at the viewer's shoulder]
    #[arg(long, value_parser = parse::direction, allow_hyphen_values = true, value_name = "X,Y,Z")]
    pub(crate) light: Option<DVec3>,
    /// Colour where there is nothing [default: the scene's, or #202024]
    #[arg(long, value_parser = parse::color, value_name = "#RRGGBB")]
    pub(crate) background: Option<[u8; 3]>,
    /// Colour each level of detail differently
    #[arg(long)]
    pub(crate) lod_colors: bool,
    /// Let levels of hybrid models fade into each other, pixel by pixel: nothing pops where --error is more than half a pixel, and more
    /// is drawn
    #[arg(long)]
    pub(crate) cross_fade: bool,
    /// Most memory for the model: decoded pages, and lists of what is drawn
    #[arg(long, default_value = "1GiB", value_parser = parse::size, allow_negative_numbers = true, value_name = "SIZE")]
    pub(crate) cpu_budget: u64,
    /// Most memory on the graphics device, the picture included; where it does not suffice the model is drawn coarser [default:
    /// all there is]
    #[arg(long, value_parser = parse::size, allow_negative_numbers = true, value_name = "SIZE")]
    pub(crate) gpu_budget: Option<u64>,
}

/// Move along a camera path and measure every frame
///
/// Without --target-ms each pose of the path is drawn once, at the error that --error asks for. With it the path is played in real
/// time: the error follows the time that frames take, and when the path has ended, the picture is refined until it is as fine
/// as --error asks for.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  gigalod synth path walk --around statue.glod -o walk.json\n  \
    gigalod bench statue.glod --path walk.json\n  gigalod bench statue.glod --path walk.json --target-ms 100 --json")]
pub(crate) struct BenchArgs {
    /// Model: .glod, or a raw one; or a scene: .toml
    pub(crate) file: PathBuf,
    /// Camera path, as `gigalod synth path` makes them
    #[arg(long, value_name = "PATH.json")]
    pub(crate) path: PathBuf,
    /// Milliseconds that a frame should take
    #[arg(long, value_parser = parse::positive, allow_hyphen_values = true, value_name = "MS", conflicts_with = "full")]
    pub(crate) target_ms: Option<f64>,
    /// Field of view, in degrees [default: the path's]
    #[arg(long, value_parser = parse::fov, allow_hyphen_values = true, value_name = "DEG")]
    pub(crate) fov: Option<f64>,
    #[command(flatten)]
    pub(crate) draw: DrawArgs,
    #[command(flatten)]
    pub(crate) build: BuildOptions,
}

/// Open a window and move through models
///
/// FILE is a model (.glod, or a raw one, which is built into the cache first), a scene (.toml), a folder of models to choose from,
/// or a camera path (.json) to play. Several are shown together; more can be dropped onto the window. F1 tells what mouse and keys
/// do.
///
/// A scene names models and where they stand, everything else is optional; paths are relative to it:
///
///     up = "y"
///     background = "#202020"
///     [camera]   eye, target, up = [x,y,z]; fov = 40.0
///     [[model]]  file = "statue.glod"; position = [x,y,z]; rotation = [x,y,z,w]; scale = 1.0
///                instances = "trees.bin"    # instead: many (position, quaternion, scale) as f32
///     [[light]]  kind = "directional"; direction = [x,y,z]    # towards it
#[cfg(feature = "view")]
#[derive(Args, Debug)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples:\n  gigalod view statue.glod\n  gigalod view scan.ply.gz\n  \
    gigalod view left.glod right.glod --size 1920x1080 --target-ms 33"
)]
pub(crate) struct ViewArgs {
    /// Models, scenes, folders or camera paths
    #[arg(value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Milliseconds that a frame should take while the camera moves
    #[arg(long, default_value = "50", value_parser = parse::positive, allow_negative_numbers = true, value_name = "MS")]
    pub(crate) target_ms: f64,
    #[command(flatten)]
    pub(crate) draw: DrawArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) build: BuildOptions,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Where the eye is
    #[arg(long, value_parser = parse::vector, allow_hyphen_values = true, value_name = "X,Y,Z", requires = "target")]
    pub(crate) eye: Option<DVec3>,
    /// What it looks at
    #[arg(long, value_parser = parse::vector, allow_hyphen_values = true, value_name = "X,Y,Z", requires = "eye")]
    pub(crate) target: Option<DVec3>,
    /// Which way is up in the picture [default: the model's up]
    #[arg(long, value_parser = parse::direction, allow_hyphen_values = true, value_name = "X,Y,Z", requires = "eye")]
    pub(crate) up: Option<DVec3>,
    /// Vertical field of view, in degrees [default: 40]
    #[arg(long, value_parser = parse::fov, allow_hyphen_values = true, value_name = "DEG")]
    pub(crate) fov: Option<f64>,
    /// Around the model's middle: azimuth (0 is the front, growing to the right), elevation (growing upwards), both in degrees,
    /// and how many times nearer than a view of the whole [default: 0,0,1, or 0,35,1 for what lies flat, as terrain]
    #[arg(long, value_parser = parse::orbit, allow_hyphen_values = true, value_name = "AZ,EL[,ZOOM]",
        conflicts_with_all = ["eye", "path"])]
    pub(crate) orbit: Option<[f64; 3]>,
    /// Camera path to take a pose from
    #[arg(long, value_name = "PATH.json", conflicts_with = "eye", requires = "frame")]
    pub(crate) path: Option<PathBuf>,
    /// Which pose of the path, from 0
    #[arg(long, allow_negative_numbers = true, value_name = "N", requires = "path")]
    pub(crate) frame: Option<usize>,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KernelArg {
    /// The square around each ball's silhouette
    Square,
    /// Each ball's silhouette
    Round,
    /// Soft spots that blend: slower, least aliased
    Gauss,
    /// Squares foreshortened by the surface's slope; may leave holes
    SquareEllipse,
    /// Silhouettes foreshortened by the surface's slope; may leave holes
    RoundEllipse,
    /// Soft spots foreshortened by the surface's slope
    GaussEllipse,
}

impl From<KernelArg> for Kernel {
    fn from(kernel: KernelArg) -> Self {
        match kernel {
            KernelArg::Square => Self::Square,
            KernelArg::Round => Self::Round,
            KernelArg::Gauss => Self::Gauss,
            KernelArg::SquareEllipse => Self::SquareEllipse,
            KernelArg::RoundEllipse => Self::RoundEllipse,
            KernelArg::GaussEllipse => Self::GaussEllipse,
        }
    }
}

/// Tell what a .glod file holds
#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// File to look at
    pub(crate) file: PathBuf,
}

/// Check a .glod file: checksums, structure, and with the original its errors
#[derive(Args, Debug)]
pub(crate) struct VerifyArgs {
    /// File to check
    pub(crate) file: PathBuf,
    /// The model it was built from, files or folders: also measure how far what is drawn lies from the surface
    ///
    /// Of splats: that each decoded sphere encloses what it stands for. Of hybrid files: that no node is farther from the surface than
    /// its error, both ways; of more than 7.5 million triangles, of the top four levels and 2000 other nodes.
    #[arg(long, value_name = "ORIGINAL", num_args = 1..)]
    pub(crate) against: Vec<PathBuf>,
}

/// Write a .glod file as a model for other programs: PLY, OBJ or GLB
///
/// Of a hybrid file, the coarsest triangles and points within the error, each vertex once where several nodes share it. Of a
/// splat file, the centres of its balls, as points. Coordinates are those of the model that it was built from; in a GLB, which has
/// single precision, they are relative to a node that stands where the model begins, and its y is up. It is written piece by
/// piece: of splat files alone, the tree must fit into memory.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  gigalod export statue.glod -o statue.ply\n  \
    gigalod export statue.glod -o small.glb --error 0.01")]
pub(crate) struct ExportArgs {
    /// File to export
    pub(crate) file: PathBuf,
    /// File to write; replaced if it exists. Its ending says in which format
    #[arg(short, long, value_name = "OUT.(ply|obj|glb)")]
    pub(crate) output: PathBuf,
    /// How far it may be from the original, in model units; 0 for the finest there is
    #[arg(long, default_value = "0", value_parser = parse::not_negative, allow_hyphen_values = true, value_name = "UNITS")]
    pub(crate) error: f64,
}

/// Measure how different two pictures of the same size are: PSNR, SSIM, FLIP, largest difference
#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The picture to compare with
    #[arg(value_name = "A.png")]
    pub(crate) reference: PathBuf,
    /// The picture to judge
    #[arg(value_name = "B.png")]
    pub(crate) test: PathBuf,
}

/// Make a statue of 2 million triangles, build it, and draw four pictures of it
#[derive(Args, Debug)]
pub(crate) struct DemoArgs {
    /// Folder for everything that is made
    #[arg(short, long, default_value = "demo", value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// Number of triangles of the statue
    #[arg(long, value_parser = parse::count, default_value = "2M", allow_negative_numbers = true, value_name = "N")]
    pub(crate) triangles: u64,
}
