//! Where a build takes place: its threads, its work folder, its output, and what of the options its bytes depend on.
//!
//! The same for all representations.

use crate::input::InputIdentity;
use crate::journal::Header;
use crate::output::{behind_links, expect_no_folder, folder_of};
use crate::spool::Place;
use crate::work::Work;
use crate::{BuildError, Options, Output, Progress};
use gigalod_format::{Kind, ReferenceSystem};
use gigalod_geom::camera::UpAxis;
use gigalod_import::ModelStream;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Program, version and revision of the builder, in files and in journals; what was built by another is not gone on with.
///
/// The revision goes up with each change of what is built of the same input, as the test `bytes_are_pinned` finds it.
pub const GENERATOR: &str = concat!("gigalod ", env!("CARGO_PKG_VERSION"), " r3");

/// All that is decided before the first byte is read.
pub(crate) struct Site {
    pub(crate) out: PathBuf,
    pub(crate) workers: rayon::ThreadPool,
    pub(crate) up: UpAxis,
    /// Options by their names, those that the bytes depend on.
    pub(crate) influential: BTreeMap<String, String>,
    pub(crate) reference_system: Option<ReferenceSystem>,
    pub(crate) work: Option<Work>,
    pub(crate) output: Output,
    in_memory: bool,
}

impl Site {
    /// `own` are options that only this representation has.
    pub(crate) fn open(
        input: &dyn ModelStream,
        options: &Options,
        (kind, own): (Kind, BTreeMap<String, String>),
        (threads, in_memory): (usize, bool),
        progress: &dyn Progress,
        out: &Path,
    ) -> Result<Self, BuildError> {
        expect_no_folder(out).map_err(BuildError::Output)?;
        let out = behind_links(out);
        let workers = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| BuildError::Threads(error.to_string()))?;
        let up = options.up.unwrap_or(input.up_axis());
        let unit = options.unit.or(input.unit());
        let mut influential = own;
        influential.extend([("as".into(), kind.name().into()), ("up".into(), format!("{up:?}").to_lowercase())]);
        influential.extend(unit.map(|unit| ("units".into(), unit.symbol().into())));
        let reference_system = input.reference_system().map(|system| ReferenceSystem {
            name: system.name.clone(),
            epsg: system.epsg,
            wkt: system.wkt.clone(),
        });
        let work = match &options.input {
            Some(identity) => Self::work(identity, options, &influential, in_memory, progress, &out)?,
            None => None,
        };
        let output = match &work {
            Some(work) => Output::create_in(work, &out),
            None => Output::create(&out),
        };
        let output = output.map_err(BuildError::Output)?;
        Ok(Self { out, workers, up, influential, reference_system, work, output, in_memory })
    }

    fn work(
        identity: &InputIdentity,
        options: &Options,
        influential: &BTreeMap<String, String>,
        in_memory: bool,
        progress: &dyn Progress,
        out: &Path,
    ) -> Result<Option<Work>, BuildError> {
        let header = Header { program: GENERATOR.into(), input: identity.clone(), options: influential.clone() };
        Work::open(out, header, options.side.clone(), options.resume, !in_memory, |text| progress.note(text))
    }

    /// For what grows with the model.
    pub(crate) fn place(&self) -> Place<'_> {
        match &self.work {
            Some(work) => Place::Work(work),
            None if self.in_memory => Place::Memory,
            None => Place::Folder(folder_of(&self.out)),
        }
    }

    /// Gives the output its name; nothing else is needed any more.
    pub(crate) fn finish(self) -> Result<(), BuildError> {
        self.output.publish().map_err(BuildError::Output)?;
        if let Some(work) = self.work {
            work.done();
        }
        Ok(())
    }
}
