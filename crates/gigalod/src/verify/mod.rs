//! The judge of finished files: shares nothing with the builders but `geom` and `format`, and walks a file its own slow way.
//!
//! [`structure::check`] reads every byte and every tree bit; [`measure::against`] holds the decoded spheres against the
//! original mesh, diced or not, [`cloud::against_points`] against the original point cloud. Hybrid files have [`hybrid`].

pub mod cloud;
pub mod hybrid;
pub mod measure;
mod nearest;
mod sampled;
mod skin;
pub mod structure;

pub use cloud::{against_points, steps_of_points};
pub use measure::{Measured, against, mesh_of, steps};
pub use sampled::Sampled;
pub use skin::skin_of;
pub use structure::{SplatTree, check};

/// Problems beyond this many are counted, not told.
pub const MOST_PROBLEMS: usize = 100;

/// A list of problems that does not grow without bound.
#[derive(Clone, Debug, Default)]
pub struct Problems {
    /// The first [`MOST_PROBLEMS`].
    pub told: Vec<String>,
    /// All of them.
    pub count: u64,
}

impl Problems {
    /// One more.
    pub fn add(&mut self, problem: impl FnOnce() -> String) {
        self.count += 1;
        if self.told.len() < MOST_PROBLEMS {
            self.told.push(problem());
        }
    }
}
