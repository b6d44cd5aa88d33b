//! What is resident and what is drawn. Knows no GPU API, opens no file, never waits.
//!
//! One frame: [`Scene::select`] asks each instance's [`Selector`] for a *cut* through its hierarchy, which yields a
//! [`DrawSource`] to draw now and page requests for later; [`Scene::serve`] hands the union of all requests to residency,
//! which loads in the background, in order of benefit, within its budget. What is not resident is drawn coarser, by its
//! nearest resident ancestor.
//!
//! All selector state is keyed by [`Target`], an instance in a view, so that the camera, each light and a prefetcher look at
//! one model without disturbing each other. A selector may run on the device: then its draw source stays there, and its
//! requests come back through a [`RequestRing`], frames later. Residency never asks who made a request.
#![forbid(unsafe_code)]

pub mod controller;
pub mod fineness;
pub mod hybrid;
pub mod magnified;
pub mod report;
pub mod residency;
pub mod scene;
pub mod selection;
pub mod splats;
pub mod view;

pub use controller::FrameRate;
pub use fineness::{Fineness, Interrupt};
pub use hybrid::{HybridList, HybridNode, HybridSelector};
pub use magnified::Magnified;
pub use report::{CutReport, Limit};
pub use residency::{FileId, Loader, ModelFile, PageKey, PageNumber, PageRequest, Residency};
pub use scene::{Instance, Scene};
pub use selection::{DeviceDraw, DrawSource, Outcome, RequestRing, SelectInput, Selection, Selector, Target};
pub use splats::{SplatBall, SplatList, SplatSelector};
pub use view::{InstanceId, ModelView, Similarity, ViewId};
