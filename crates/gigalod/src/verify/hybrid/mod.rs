//! Hybrid files: is every byte and every record as it should be, and is each node as near to the original as it says?
//!
//! In: an open file, and the model that it was built from. Out: problems and figures. Shares nothing with the builder.
//!
//! Start at [`check`] for what needs no original, and at [`against`] for what does. `cut` is what is drawn at a level as one mesh,
//! `sample` where triangles are measured, `choice` which nodes are where they are too many.

mod backward;
mod cells;
mod choice;
mod cut;
mod forward;
mod measure;
mod sample;
mod structure;
mod tally;

pub use measure::{Measured, against, steps};
pub use structure::{Structure, check};
pub use tally::{Violation, Way};
