//! The outer layer of a `.glod` file: a fixed header that says where skeleton, pages and metadata lie.
//!
//! ```text
//! 0        128            …                …             file_bytes
//! │ header │ skeleton     │ pages          │ metadata    │
//! ```
//! Everything that is needed to draw comes first; pages stand in the order in which they are first needed.

use crate::bytes::Fields;
use crate::{FormatError, Metadata, PageStore};
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;

/// First bytes of every file: not text (high bit), and a transfer that mends line ends breaks it visibly.
pub const MAGIC: [u8; 8] = *b"\x89GLOD\r\n\x1a";
/// The only version there is.
pub const VERSION: u32 = 1;
/// Bytes before the skeleton.
pub const HEADER_BYTES: u64 = 128;
/// Feature bits that this program knows; none is defined yet.
const KNOWN_FEATURES: u64 = 0;
/// Bounds what a hostile (sparse) file can make a reader allocate. 13 million page records: 110 billion splats.
const MAX_SKELETON_BYTES: u64 = 256 << 20;
/// The same for the metadata, a few kilobytes in truth.
const MAX_METADATA_BYTES: u64 = 16 << 20;

/// Which representation a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Bounding spheres: [`crate::splats`].
    Splats,
    /// An octree of triangles and points: [`crate::hybrid`].
    Hybrid,
}

impl Kind {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Splats => "splats",
            Self::Hybrid => "hybrid",
        }
    }

    fn code(self) -> u32 {
        match self {
            Self::Splats => 1,
            Self::Hybrid => 2,
        }
    }
}

/// A checksummed range of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Section {
    /// First byte.
    pub offset: u64,
    /// Length.
    pub bytes: u64,
    /// CRC-32C of its bytes.
    pub checksum: u32,
}

/// An open file: header checked, nothing else read.
#[derive(Clone)]
pub struct Container {
    store: Arc<dyn PageStore>,
    kind: Kind,
    skeleton: Section,
    metadata: Section,
    pages_offset: u64,
}

impl std::fmt::Debug for Container {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Container").field("kind", &self.kind).field("bytes", &self.store.len()).finish_non_exhaustive()
    }
}

impl Container {
    /// Reads and checks the header.
    ///
    /// # Errors
    /// Anything but [`FormatError::Invalid`] of a page: this is the first look at untrusted bytes.
    pub fn open(store: Arc<dyn PageStore>) -> Result<Self, FormatError> {
        let mut header = [0; HEADER_BYTES as usize];
        let present = store.len().min(HEADER_BYTES) as usize;
        store
            .read_at(0, &mut header[..present])
            .map_err(|source| FormatError::Io { what: "the header".into(), source })?;
        let magic = &header[..present.min(MAGIC.len())];
        if magic != MAGIC {
            return Err(FormatError::Magic {
                found: if magic.is_empty() { "nothing".into() } else { format!("\"{}\"", magic.escape_ascii()) },
                expected: format!("\"{}\"", MAGIC.escape_ascii()),
            });
        }
        if present < HEADER_BYTES as usize {
            return Err(truncated("the header", HEADER_BYTES, store.len()));
        }
        let mut fields = Fields(&header[MAGIC.len()..]);
        // The version first: a later one may define everything after it anew.
        let version = fields.u32();
        if version != VERSION {
            return Err(FormatError::Version { found: version, expected: VERSION });
        }
        let expected = u32::from_le_bytes(*header.last_chunk().expect("the header has 128 bytes"));
        check("the header", &header[..header.len() - 4], expected)?;
        let kind_code = fields.u32();
        let features = fields.u64();
        let file_bytes = fields.u64();
        let skeleton = Section { offset: fields.u64(), bytes: fields.u64(), checksum: fields.u32() };
        let metadata_checksum = fields.u32();
        let metadata = Section { offset: fields.u64(), bytes: fields.u64(), checksum: metadata_checksum };
        let pages_offset = fields.u64();
        let unknown = features & !KNOWN_FEATURES;
        if unknown != 0 {
            return Err(FormatError::Feature { name: format!("feature bit {}", unknown.trailing_zeros()) });
        }
        let Some(kind) = [Kind::Splats, Kind::Hybrid].into_iter().find(|kind| kind.code() == kind_code) else {
            let found = format!("representation {kind_code}");
            return Err(FormatError::Kind { found, expected: "1 (splats) or 2 (hybrid)".into() });
        };
        if file_bytes != store.len() {
            return Err(truncated("the file, by its header,", file_bytes, store.len()));
        }
        for (what, section) in [("the skeleton", skeleton), ("the metadata", metadata)] {
            let end = section.offset.saturating_add(section.bytes);
            if end > file_bytes {
                return Err(truncated(what, end, file_bytes));
            }
        }
        if pages_offset > file_bytes {
            return Err(truncated("the first page", pages_offset, file_bytes));
        }
        Ok(Self { store, kind, skeleton, metadata, pages_offset })
    }

    /// Which representation it holds.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Refuses a file of another representation.
    pub(crate) fn expect_kind(&self, expected: Kind) -> Result<(), FormatError> {
        if self.kind == expected {
            return Ok(());
        }
        Err(FormatError::Kind { found: self.kind.name().into(), expected: expected.name().into() })
    }

    /// Where its bytes lie.
    pub fn store(&self) -> &Arc<dyn PageStore> {
        &self.store
    }

    /// Where the first page begins.
    pub fn pages_offset(&self) -> u64 {
        self.pages_offset
    }

    /// The bytes of the skeleton, checked.
    ///
    /// # Errors
    /// [`FormatError::Checksum`], [`FormatError::Io`], and [`FormatError::Invalid`] where it is larger than any.
    pub fn read_skeleton(&self) -> Result<Vec<u8>, FormatError> {
        self.read("the skeleton", self.skeleton, MAX_SKELETON_BYTES)
    }

    /// What `info` shows.
    ///
    /// # Errors
    /// As for the skeleton, and [`FormatError::Invalid`] where it is not the JSON it should be.
    pub fn read_metadata(&self) -> Result<Metadata, FormatError> {
        let what = "the metadata";
        let bytes = self.read(what, self.metadata, MAX_METADATA_BYTES)?;
        serde_json::from_slice(&bytes).map_err(|error| FormatError::invalid(what, error.to_string()))
    }

    fn read(&self, what: &str, section: Section, most_bytes: u64) -> Result<Vec<u8>, FormatError> {
        if section.bytes > most_bytes {
            let problem = format!("{} bytes, expected at most {most_bytes}", section.bytes);
            return Err(FormatError::invalid(what, problem));
        }
        read_checked(&*self.store, what, section)
    }
}

/// Reads a range whose length and end were checked, and checks its checksum. Want of memory is an error, not an abort.
pub(crate) fn read_checked(store: &dyn PageStore, what: &str, section: Section) -> Result<Vec<u8>, FormatError> {
    let failed = |source: io::Error| FormatError::Io { what: what.into(), source };
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(section.bytes as usize).map_err(|_| failed(io::ErrorKind::OutOfMemory.into()))?;
    bytes.resize(section.bytes as usize, 0);
    store.read_at(section.offset, &mut bytes).map_err(failed)?;
    check(what, &bytes, section.checksum)?;
    Ok(bytes)
}

/// CRC-32C, as it stands beside each section and page.
pub fn checksum(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes)
}

fn check(what: &str, bytes: &[u8], expected: u32) -> Result<(), FormatError> {
    let found = checksum(bytes);
    if found == expected { Ok(()) } else { Err(FormatError::Checksum { what: what.into(), expected, found }) }
}

fn truncated(what: &str, end: u64, file_bytes: u64) -> FormatError {
    FormatError::Truncated { what: what.into(), end, file_bytes }
}

/// Writes a container: pages as they come, then [`Writer::finish`] puts skeleton, metadata and header in their places.
///
/// Until then the header is zero, so a file that was left half-written is no container.
pub struct Writer<W> {
    out: W,
    kind: Kind,
    skeleton_bytes: u64,
    position: u64,
}

impl<W: Write + Seek> Writer<W> {
    /// Leaves room for the header and a skeleton of exactly `skeleton_bytes`.
    ///
    /// # Errors
    /// What the system says.
    pub fn new(mut out: W, kind: Kind, skeleton_bytes: u64) -> io::Result<Self> {
        out.seek(SeekFrom::Start(0))?;
        io::copy(&mut io::Read::take(io::repeat(0), HEADER_BYTES + skeleton_bytes), &mut out)?;
        Ok(Self { out, kind, skeleton_bytes, position: HEADER_BYTES + skeleton_bytes })
    }

    /// Appends a page.
    ///
    /// # Errors
    /// What the system says.
    pub fn page(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    /// Completes the file; returns what was written to, and the number of bytes.
    ///
    /// # Errors
    /// What the system says.
    ///
    /// # Panics
    /// When the skeleton is not as long as announced.
    pub fn finish(mut self, skeleton: &[u8], metadata: &Metadata) -> io::Result<(W, u64)> {
        assert_eq!(skeleton.len() as u64, self.skeleton_bytes, "the skeleton has the announced size");
        let metadata_offset = self.position;
        let metadata = serde_json::to_vec(metadata)?;
        self.out.write_all(&metadata)?;
        let file_bytes = metadata_offset + metadata.len() as u64;

        let mut header = Vec::with_capacity(HEADER_BYTES as usize);
        header.extend(MAGIC);
        header.extend(VERSION.to_le_bytes());
        header.extend(self.kind.code().to_le_bytes());
        for field in [0, file_bytes, HEADER_BYTES, self.skeleton_bytes] {
            header.extend(u64::to_le_bytes(field));
        }
        header.extend(checksum(skeleton).to_le_bytes());
        header.extend(checksum(&metadata).to_le_bytes());
        for field in [metadata_offset, metadata.len() as u64, HEADER_BYTES + self.skeleton_bytes] {
            header.extend(field.to_le_bytes());
        }
        header.resize(HEADER_BYTES as usize - 4, 0);
        header.extend(checksum(&header).to_le_bytes());

        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&header)?;
        self.out.write_all(skeleton)?;
        self.out.flush()?;
        Ok((self.out, file_bytes))
    }
}
