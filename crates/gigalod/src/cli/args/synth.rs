//! Options of `gigalod synth`.

use super::super::parse;
use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Make test models and camera paths, deterministic, at any size
#[derive(Args, Debug)]
pub(crate) struct SynthArgs {
    #[command(subcommand)]
    pub(crate) what: SynthWhat,
}

#[derive(Subcommand, Debug)]
pub(crate) enum SynthWhat {
    /// A sculpted head with detail down to the sample spacing, as binary PLY
    Statue(StatueArgs),
    /// Many displaced, cut and re-sampled copies of a real scan, as binary PLY
    Replicate(ReplicateArgs),
    /// A camera path around a model, as JSON
    Path(PathArgs),
}

#[derive(Args, Debug)]
pub(crate) struct StatueArgs {
    /// Number of triangles, met within 1 %
    #[arg(long, value_parser = parse::count, default_value = "2M", allow_negative_numbers = true, value_name = "N")]
    pub(crate) triangles: u64,
    /// Another seed, another statue
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_name = "S")]
    pub(crate) seed: u64,
    /// Give each vertex a colour
    #[arg(long)]
    pub(crate) colors: bool,
    /// Order of vertices and triangles in the file
    #[arg(long, value_enum, default_value_t = OrderArg::Coherent)]
    pub(crate) order: OrderArg,
    /// File to write
    #[arg(short, long, value_name = "F.ply")]
    pub(crate) output: PathBuf,
}

#[derive(Args, Debug)]
pub(crate) struct ReplicateArgs {
    /// The scan to copy
    pub(crate) scan: PathBuf,
    /// Number of triangles, met within 1 %
    #[arg(long, value_parser = parse::count, allow_negative_numbers = true, value_name = "N")]
    pub(crate) triangles: u64,
    /// Another seed, another heap
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_name = "S")]
    pub(crate) seed: u64,
    /// Order of vertices and triangles in the file
    #[arg(long, value_enum, default_value_t = OrderArg::Coherent)]
    pub(crate) order: OrderArg,
    /// File to write
    #[arg(short, long, value_name = "F.ply")]
    pub(crate) output: PathBuf,
}

#[derive(Args, Debug)]
pub(crate) struct PathArgs {
    /// Which movement
    #[arg(value_enum)]
    pub(crate) kind: PathKindArg,
    /// The .glod file to move around
    #[arg(long, value_name = "FILE")]
    pub(crate) around: PathBuf,
    /// Length in seconds, 30 poses each
    #[arg(long, default_value = "10", value_parser = parse::seconds, allow_negative_numbers = true, value_name = "SECONDS")]
    pub(crate) seconds: f64,
    /// Another seed, another path
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_name = "S")]
    pub(crate) seed: u64,
    /// File to write
    #[arg(short, long, value_name = "PATH.json")]
    pub(crate) output: PathBuf,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OrderArg {
    /// Neighbours close together, as a scanner's software writes them
    Coherent,
    /// In a random order: the worst case
    Shuffled,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathKindArg {
    /// Once around
    Orbit,
    /// From afar up to the surface
    Approach,
    /// Along the model, looking at it
    Walk,
    /// Stand, turn, stand, turn back
    SuddenTurn,
}
