//! The desktop viewer: a window in which a person moves through models of any size.
//!
//! ```text
//!  window's thread                     stage's thread             picker's thread
//!  events ─▶ viewer (egui) ─ wishes ─▶ select, upload, draw       page reads along
//!  picture + interface  ◀─ pictures ── figures                    the cursor's ray
//! ```
//! [`run`] opens the window. What it needs of files is behind [`Host`]. What always holds: the window's thread never selects,
//! uploads a model, reads a file or waits for one who does; the camera never loses the model ([`navigation`]); a rested picture is
//! that of `gigalod render` for the same pose, bit for bit; what goes wrong is told in the window, and the window stays.
#![forbid(unsafe_code)]

mod clock;
mod forced;
pub mod host;
mod jobs;
mod mailbox;
mod measure;
pub mod navigation;
mod overlay;
mod panel;
pub mod pick;
pub mod pick_nodes;
mod picker;
pub mod recorder;
mod report;
mod settings;
mod stage;
#[cfg(test)]
mod stage_tests;
mod viewer;
#[cfg(test)]
mod viewer_tests;
mod viewport;
mod window;

pub use host::{Entry, Folder, Host, Kind, Model, Opened, OpenedScene, Preview, Progress, Work};
pub use mailbox::Figures;
pub use report::{Measured, Report, Tally, percentile};
pub use settings::{FirstLook, Options, SAMPLES, Settings};
pub use viewer::next_name;
pub use window::{ViewError, run};
