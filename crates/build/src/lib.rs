//! Builders: a model stream goes in, a complete `.glod` file comes out, or an error and no file at all.
//!
//! One module for each representation: [`splats::build`], [`hybrid::build`]. What always holds: the bytes depend on the input and
//! the options alone, not on threads, machines or the clock; nothing appears under the output's name until it is complete.
#![forbid(unsafe_code)]

mod error;
pub mod hybrid;
mod input;
mod journal;
mod output;
mod progress;
mod site;
pub mod splats;
mod spool;
mod unfinished;
mod work;

pub use error::BuildError;
pub use input::{FileIdentity, InputIdentity, SideLog};
pub use output::{Output, folder_of};
pub use progress::{NoProgress, PhaseTime, Progress, Report};
pub use site::GENERATOR;
pub use unfinished::abandon;
pub use work::{can_continue, work_folder};

use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;

/// What the user may choose; the same for all representations.
#[derive(Clone, Debug)]
pub struct Options {
    /// Most bytes that the builder may allocate.
    pub memory_bytes: u64,
    /// Worker threads; 0 for one a core.
    pub threads: usize,
    /// Overrides the format's convention.
    pub up: Option<UpAxis>,
    /// Triangles whose bounding circle is larger than this, in model units, are diced into samples that far apart. `None`: what
    /// suits the model, as [`splats`] says.
    pub spacing: Option<f64>,
    /// Of hybrid models, `--res`: a node's error is at most the edge of its cell divided by this. `None`: [`hybrid::RESOLUTION`].
    pub resolution: Option<u32>,
    /// Of hybrid models, `--tmax`: most triangles of a leaf. `None`: [`hybrid::MOST_TRIANGLES`].
    pub most_triangles: Option<u32>,
    /// Of hybrid models, `--appearance`: whether errors of shading and colour are bounded too, or geometry alone.
    pub keeps_looks: bool,
    /// Of hybrid models: refuse what materials colour, for the caller to build as splats, instead of leaving the colours out.
    pub only_suited: bool,
    /// What a length of 1 is; overrides what the input says. Coordinates stay as they are.
    pub unit: Option<LengthUnit>,
    /// What is built. Where it is given, a build that does not fit into memory can be continued by another process: what it
    /// has lies in [`work_folder`].
    pub input: Option<InputIdentity>,
    /// Files that the input names. Whoever opens them notes them here, so that a build is not continued with others.
    pub side: SideLog,
    /// Continue what an interrupted build has left, if anything.
    pub resume: bool,
}

impl Options {
    /// Smallest budget that is accepted: 64 MiB.
    pub const LEAST_MEMORY_BYTES: u64 = 64 << 20;
}

impl Default for Options {
    fn default() -> Self {
        Self {
            memory_bytes: 2 << 30,
            threads: 0,
            up: None,
            spacing: None,
            resolution: None,
            most_triangles: None,
            keeps_looks: true,
            only_suited: false,
            unit: None,
            input: None,
            side: SideLog::default(),
            resume: false,
        }
    }
}
