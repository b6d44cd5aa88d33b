//! Bytes of buffers and their views: in the file, beside it, in its JSON, or packed by meshoptimizer.
//!
//! What always holds: a range is checked against what there really is before anything is allocated for it; unpacked views are
//! bounded, and few are kept.

use super::{json, meshopt};
use crate::{ByteSource, ImportError, Place, SideFiles, error::Problem, error::said};
use std::collections::HashMap;
use std::io::{self, SeekFrom};
use std::sync::Arc;

/// Largest packed view, unpacked, and most bytes of unpacked views that are kept.
const MOST_UNPACKED_BYTES: u64 = 256 << 20;
/// Largest piece that is read at once: a view that must be whole.
const MOST_WHOLE_BYTES: u64 = 256 << 20;

/// Where the bytes of a buffer are.
enum Content {
    /// A part of a file.
    File {
        source: usize,
        offset: u64,
        bytes: u64,
    },
    Memory(Vec<u8>),
    /// Only a stand-in, for readers that cannot unpack.
    Nothing,
}

pub(super) struct Buffers {
    sources: Vec<Box<dyn ByteSource>>,
    contents: Vec<Content>,
    /// Unpacked views by number.
    unpacked: HashMap<usize, Arc<Vec<u8>>>,
    unpacked_bytes: u64,
}

/// A place in messages: an item of a list of the JSON.
pub(super) fn item(list: &str, number: usize) -> Place {
    Place::byte(0).of_item(list, number as u64)
}

impl Buffers {
    /// Finds all buffers.
    pub(super) fn open(
        root: &json::Root,
        chunk: Option<(Box<dyn ByteSource>, u64, u64)>,
        side: &mut dyn SideFiles,
    ) -> Result<Self, ImportError> {
        let mut buffers =
            Self { sources: Vec::new(), contents: Vec::new(), unpacked: HashMap::new(), unpacked_bytes: 0 };
        let mut chunk = chunk;
        for (number, buffer) in root.buffers.iter().enumerate() {
            let is_fallback =
                buffer.extensions.as_ref().and_then(|it| it.meshopt.as_ref()).is_some_and(|it| it.fallback);
            let content = match &buffer.uri {
                Some(uri) if uri.starts_with("data:") => Content::Memory(
                    data_uri(uri)
                        .map_err(|found| ImportError::malformed("data in base64", found, item("buffer", number)))?,
                ),
                Some(uri) => {
                    let name = percent_decoded(uri);
                    let opened = side.open(&name).and_then(|mut source| {
                        let bytes = source.seek(SeekFrom::End(0))?;
                        Ok((source, bytes))
                    });
                    let (source, bytes) = opened.map_err(|error| {
                        let expected = format!("the file `{}` beside the model", said(&name));
                        ImportError::malformed(expected, said(error), item("buffer", number))
                    })?;
                    buffers.sources.push(source);
                    Content::File { source: buffers.sources.len() - 1, offset: 0, bytes }
                }
                None if is_fallback => Content::Nothing,
                None => match chunk.take().filter(|_| number == 0) {
                    Some((source, offset, bytes)) => {
                        buffers.sources.push(source);
                        Content::File { source: buffers.sources.len() - 1, offset, bytes }
                    }
                    None => Content::Nothing,
                },
            };
            let there = match &content {
                Content::File { bytes, .. } => Some(*bytes),
                Content::Memory(memory) => Some(memory.len() as u64),
                Content::Nothing => None,
            };
            if there.is_some_and(|there| there < buffer.byte_length) {
                let expected = format!("{} bytes", buffer.byte_length);
                let found = format!("{} of them", there.unwrap_or_default());
                return Err(ImportError::malformed(expected, found, item("buffer", number)));
            }
            buffers.contents.push(content);
        }
        Ok(buffers)
    }

    /// Reads a range of a buffer.
    fn read_buffer(&mut self, number: usize, offset: u64, into: &mut [u8]) -> Result<(), ImportError> {
        let outside = || {
            let expected = format!("{} bytes at byte {offset} of the buffer", into.len());
            ImportError::malformed(expected, "fewer", item("buffer", number))
        };
        let end = offset.checked_add(into.len() as u64).ok_or_else(outside)?;
        match self.contents.get(number) {
            Some(Content::Memory(memory)) if end <= memory.len() as u64 => {
                into.copy_from_slice(&memory[offset as usize..end as usize]);
                Ok(())
            }
            Some(&Content::File { source, offset: start, bytes }) if end <= bytes => {
                let source = &mut self.sources[source];
                let mut read = || -> io::Result<()> {
                    source.seek(SeekFrom::Start(start + offset))?;
                    source.read_exact(into)
                };
                read().map_err(|source| ImportError::new(Problem::Io { source }, Some(item("buffer", number))))
            }
            _ => Err(outside()),
        }
    }

    /// Bytes of a view, unpacked.
    pub(super) fn view_bytes(&self, root: &json::Root, number: usize) -> Result<u64, ImportError> {
        let view = view(root, number)?;
        match packing(view) {
            Some(packed) => {
                packed.count.checked_mul(packed.byte_stride).filter(|&bytes| bytes <= MOST_UNPACKED_BYTES).ok_or_else(
                    || {
                        let expected = format!("a packed view of at most {MOST_UNPACKED_BYTES} bytes");
                        ImportError::malformed(expected, "more", item("bufferView", number))
                    },
                )
            }
            None => {
                let there = self.content_bytes(view.buffer);
                let end = view.byte_offset.checked_add(view.byte_length);
                if end.is_none_or(|end| end > there) {
                    let expected = format!("a view within the {there} bytes of the buffer");
                    let found = format!("{} bytes at byte {}", view.byte_length, view.byte_offset);
                    return Err(ImportError::malformed(expected, found, item("bufferView", number)));
                }
                Ok(view.byte_length)
            }
        }
    }

    /// Reads a range of a view.
    pub(super) fn read(
        &mut self,
        root: &json::Root,
        number: usize,
        offset: u64,
        into: &mut [u8],
    ) -> Result<(), ImportError> {
        let bytes = self.view_bytes(root, number)?;
        if offset.checked_add(into.len() as u64).is_none_or(|end| end > bytes) {
            let expected = format!("{} bytes at byte {offset} of a view", into.len());
            return Err(ImportError::malformed(expected, format!("{bytes} in all"), item("bufferView", number)));
        }
        let view = view(root, number)?;
        if packing(view).is_some() {
            let unpacked = self.unpacked(root, number)?;
            let start = offset as usize;
            into.copy_from_slice(&unpacked[start..start + into.len()]);
            return Ok(());
        }
        let offset = view.byte_offset.saturating_add(offset);
        self.read_buffer(view.buffer, offset, into)
    }

    /// All of a view, as it is in its buffer.
    pub(super) fn whole(&mut self, root: &json::Root, number: usize) -> Result<Vec<u8>, ImportError> {
        let bytes = self.view_bytes(root, number)?;
        let there = view(root, number).map(|view| self.content_bytes(view.buffer))?;
        if bytes > MOST_WHOLE_BYTES.min(there) {
            let expected = format!("a view of at most {} bytes", MOST_WHOLE_BYTES.min(there));
            return Err(ImportError::malformed(expected, bytes.to_string(), item("bufferView", number)));
        }
        let mut whole = vec![0; bytes as usize];
        self.read(root, number, 0, &mut whole)?;
        Ok(whole)
    }

    /// The file of a picture that lies in the model.
    pub(super) fn picture(&mut self, root: &json::Root, number: usize) -> Result<Vec<u8>, ImportError> {
        let image = root.images.get(number).ok_or_else(|| missing("image", number, root.images.len()))?;
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                data_uri(uri).map_err(|found| ImportError::malformed("data in base64", found, item("image", number)))
            }
            (None, Some(view)) => self.whole(root, view),
            (None, None) => Err(ImportError::malformed("a picture", "neither data nor a view", item("image", number))),
        }
    }

    fn content_bytes(&self, number: usize) -> u64 {
        match self.contents.get(number) {
            Some(Content::File { bytes, .. }) => *bytes,
            Some(Content::Memory(memory)) => memory.len() as u64,
            _ => 0,
        }
    }

    /// A packed view, unpacked.
    fn unpacked(&mut self, root: &json::Root, number: usize) -> Result<Arc<Vec<u8>>, ImportError> {
        if let Some(unpacked) = self.unpacked.get(&number) {
            return Ok(unpacked.clone());
        }
        let packed = packing(view(root, number)?).expect("it was asked for");
        if packed.byte_length > MOST_WHOLE_BYTES.min(self.content_bytes(packed.buffer)) {
            let expected = "as many bytes of packed data as there are";
            return Err(ImportError::malformed(expected, packed.byte_length.to_string(), item("bufferView", number)));
        }
        let mut bytes = vec![0; packed.byte_length as usize];
        self.read_buffer(packed.buffer, packed.byte_offset, &mut bytes)?;
        let unpacked = meshopt::unpack(packed, &bytes).map_err(|found| {
            ImportError::malformed("sound EXT_meshopt_compression", found, item("bufferView", number))
        })?;
        if self.unpacked_bytes + unpacked.len() as u64 > MOST_UNPACKED_BYTES {
            self.unpacked.clear();
            self.unpacked_bytes = 0;
        }
        self.unpacked_bytes += unpacked.len() as u64;
        let unpacked = Arc::new(unpacked);
        self.unpacked.insert(number, unpacked.clone());
        Ok(unpacked)
    }
}

fn view(root: &json::Root, number: usize) -> Result<&json::BufferView, ImportError> {
    root.buffer_views.get(number).ok_or_else(|| missing("bufferView", number, root.buffer_views.len()))
}

/// The error of a number that names nothing.
pub(super) fn missing(list: &str, number: usize, count: usize) -> ImportError {
    ImportError::malformed(format!("a number of `{list}` below {count}"), number.to_string(), Place::byte(0))
}

fn packing(view: &json::BufferView) -> Option<&json::Meshopt> {
    view.extensions.as_ref()?.meshopt.as_ref()
}

/// The bytes of `data:…;base64,…`; the error says what is there instead.
fn data_uri(uri: &str) -> Result<Vec<u8>, String> {
    let (head, digits) = uri.split_once(',').ok_or("no comma after `data:`")?;
    if !head.ends_with(";base64") {
        return Err("data that is not in base64".to_owned());
    }
    let digits = digits.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 3);
    let (mut bits, mut count) = (0u32, 0);
    for &digit in digits {
        let value = match digit {
            b'A'..=b'Z' => digit - b'A',
            b'a'..=b'z' => digit - b'a' + 26,
            b'0'..=b'9' => digit - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'%' => return Err("escaped characters".to_owned()),
            _ => return Err(format!("the character `{}`", digit.escape_ascii())),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    if count == 6 { Err("a digit too many".to_owned()) } else { Ok(bytes) }
}

/// A name without its escapes, such as `%20`.
pub(super) fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let hex = |at: usize| after.get(at).and_then(|&digit| char::from(digit).to_digit(16));
        match (first, hex(0), hex(1)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push((high * 16 + low) as u8);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
