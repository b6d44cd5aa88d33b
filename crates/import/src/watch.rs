//! A file that changes while it is read would become a model that never was.
//!
//! In: a stream, and a way to ask for its source's [`Stamp`]. Out: the same stream, whose end, or first error, is an error
//! of its own if the stamp is no longer what it was when the source was opened: a file that got shorter is not blamed for it.

use crate::{
    Attributes, Batch, ByteSource, ImportError, Material, ModelStream, ReferenceSystem, SideFiles, Texture,
    error::Problem, open_with,
};
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use std::time::{Duration, SystemTime};
use std::{fmt, io};

/// What changes with a file's contents, and can be told without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Its length.
    pub bytes: u64,
    /// When it was last written to.
    pub modified: SystemTime,
}

/// Asks for the stamp as it is now.
pub type AskStamp = Box<dyn FnMut() -> io::Result<Stamp> + Send>;

/// As [`open_with`], for a source that others might write to.
///
/// # Errors
/// As there; and from the stream, that the source has changed.
pub fn open_watched(
    source: Box<dyn ByteSource>,
    side: Box<dyn SideFiles>,
    mut ask: AskStamp,
) -> Result<Box<dyn ModelStream>, ImportError> {
    let opened = ask().map_err(|source| ImportError::new(Problem::Io { source }, None))?;
    Watch { opened, ask }.open(source, side)
}

/// As [`open_watched`], for a source that had the stamp `opened` when it was first looked at.
///
/// # Errors
/// As there; also where it has changed already.
pub fn open_watched_since(
    source: Box<dyn ByteSource>,
    side: Box<dyn SideFiles>,
    opened: Stamp,
    ask: AskStamp,
) -> Result<Box<dyn ModelStream>, ImportError> {
    let mut watch = Watch { opened, ask };
    watch.check()?;
    watch.open(source, side)
}

struct Watch {
    opened: Stamp,
    ask: AskStamp,
}

impl Watch {
    fn open(
        mut self,
        source: Box<dyn ByteSource>,
        side: Box<dyn SideFiles>,
    ) -> Result<Box<dyn ModelStream>, ImportError> {
        let stream = open_with(source, side).map_err(|error| self.explain(error))?;
        Ok(Box::new(Watched { stream, watch: self }))
    }

    fn check(&mut self) -> Result<(), ImportError> {
        let now = (self.ask)().map_err(|source| ImportError::new(Problem::Io { source }, None))?;
        if now == self.opened {
            return Ok(());
        }
        Err(ImportError::new(Problem::Changed { expected: self.opened, found: now }, None))
    }

    /// Whatever is wrong with a file that has changed, that is why.
    fn explain(&mut self, error: ImportError) -> ImportError {
        self.check().err().unwrap_or(error)
    }
}

struct Watched {
    stream: Box<dyn ModelStream>,
    watch: Watch,
}

impl ModelStream for Watched {
    fn attributes(&self) -> Attributes {
        self.stream.attributes()
    }

    fn up_axis(&self) -> UpAxis {
        self.stream.up_axis()
    }

    fn unit(&self) -> Option<LengthUnit> {
        self.stream.unit()
    }

    fn reference_system(&self) -> Option<&ReferenceSystem> {
        self.stream.reference_system()
    }

    fn materials(&self) -> &[Material] {
        self.stream.materials()
    }

    fn open_picture(&mut self, material: u32, texture: &Texture) -> Result<Box<dyn ByteSource>, ImportError> {
        self.stream.open_picture(material, texture)
    }

    fn declared_vertices(&self) -> Option<u64> {
        self.stream.declared_vertices()
    }

    fn declared_faces(&self) -> Option<u64> {
        self.stream.declared_faces()
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        let more = self.stream.next(batch).map_err(|error| self.watch.explain(error))?;
        if !more {
            self.watch.check()?;
        }
        Ok(more)
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        self.stream.bytes_consumed()
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes written {}", self.bytes, utc(self.modified))
    }
}

/// A time as `2026-11-22T13:44:05.123456789Z`; one before 1970 or after the year 9999 as the nearest within.
pub fn utc(time: SystemTime) -> impl fmt::Display {
    const LAST: Duration = Duration::from_secs(253_402_300_799);
    let since = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    humantime::format_rfc3339_nanos(SystemTime::UNIX_EPOCH + since.min(LAST))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NoSideFiles, read_all};
    use std::io::{Read, Seek, SeekFrom};
    use std::sync::{Arc, Mutex};

    /// A file that others write to: its bytes, and when they did.
    #[derive(Clone)]
    struct Shared(Arc<Mutex<(Vec<u8>, Stamp)>>);

    impl Shared {
        fn change(&self, change: impl FnOnce(&mut Vec<u8>)) {
            let (bytes, stamp) = &mut *self.0.lock().unwrap();
            change(bytes);
            *stamp = Stamp { bytes: bytes.len() as u64, modified: stamp.modified + Duration::from_nanos(1) };
        }

        fn open(&self) -> Result<Box<dyn ModelStream>, ImportError> {
            let asked = self.clone();
            let ask = Box::new(move || Ok(asked.0.lock().unwrap().1));
            open_watched(Box::new(Source { file: self.clone(), at: 0 }), Box::new(NoSideFiles), ask)
        }
    }

    struct Source {
        file: Shared,
        at: u64,
    }

    impl Read for Source {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let file = self.file.0.lock().unwrap();
            let mut rest = file.0.get(self.at as usize..).unwrap_or_default();
            let count = rest.read(into)?;
            self.at += count as u64;
            Ok(count)
        }
    }

    impl Seek for Source {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.at = match to {
                SeekFrom::Start(at) => at,
                SeekFrom::End(from) => (self.file.0.lock().unwrap().0.len() as i64 + from) as u64,
                SeekFrom::Current(from) => (self.at as i64 + from) as u64,
            };
            Ok(self.at)
        }
    }

    /// Many batches of triangles.
    fn file() -> Shared {
        let mut text =
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 200000\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
                .to_string();
        text.push_str(&"3 0 1 2\n".repeat(200_000));
        let stamp = Stamp { bytes: text.len() as u64, modified: SystemTime::UNIX_EPOCH };
        Shared(Arc::new(Mutex::new((text.into_bytes(), stamp))))
    }

    /// What becomes of a file that is changed after its first batch was read.
    fn changed(change: impl FnOnce(&mut Vec<u8>)) -> String {
        let file = file();
        let mut stream = file.open().unwrap();
        assert!(stream.next(&mut Batch::default()).unwrap());
        file.change(change);
        read_all(&mut *stream, &mut |_, _| {}).unwrap_err().to_string()
    }

    #[test]
    fn a_file_that_stays_as_it_is_gives_what_it_has() {
        let mut stream = file().open().unwrap();
        assert_eq!(read_all(&mut *stream, &mut |_, _| {}).unwrap().triangles.len(), 200_000);
    }

    #[test]
    fn a_file_that_changes_while_it_is_read_is_refused_for_that() {
        let bytes = file().0.lock().unwrap().0.len();
        let message = |after: usize| {
            format!(
                "changed while it was read (expected {bytes} bytes written 1970-01-01T00:00:00.000000000Z, \
                 found {after} bytes written 1970-01-01T00:00:00.000000001Z)"
            )
        };
        assert_eq!(changed(|bytes| bytes.truncate(bytes.len() / 2)), message(bytes / 2), "not: the file ends before");
        assert_eq!(changed(Vec::clear), message(0));
        assert_eq!(changed(|bytes| bytes.extend(b"3 0 1 2\n")), message(bytes + 8), "what follows would be ignored");
        assert_eq!(changed(|bytes| *bytes.last_mut().unwrap() = b' '), message(bytes));
        assert_eq!(changed(|bytes| bytes[1_000_000..].fill(b'x')), message(bytes), "not: expected a number");
    }

    #[test]
    fn a_file_that_changed_since_it_was_first_looked_at_is_refused_for_that() {
        let file = file();
        let [first, asked] = [file.0.lock().unwrap().1, Stamp { bytes: 7, modified: SystemTime::UNIX_EPOCH }];
        let source = Box::new(Source { file, at: 0 });
        let opened = open_watched_since(source, Box::new(NoSideFiles), first, Box::new(move || Ok(asked)));
        let error = opened.err().unwrap().to_string();
        assert!(
            error.starts_with("changed while it was read (expected ") && error.contains("found 7 bytes"),
            "{error}"
        );
    }

    #[test]
    fn a_header_that_is_being_written_is_refused_for_that() {
        let file = file();
        file.change(|bytes| bytes.truncate(30));
        let mut asked = 0;
        let stamps = [file.0.lock().unwrap().1, Stamp { bytes: 31, modified: SystemTime::UNIX_EPOCH }];
        let ask = Box::new(move || {
            asked += 1;
            Ok(stamps[asked - 1])
        });
        let error =
            open_watched(Box::new(Source { file, at: 0 }), Box::new(NoSideFiles), ask).err().unwrap().to_string();
        assert!(error.starts_with("changed while it was read (expected 30 bytes"), "{error}");
    }
}
