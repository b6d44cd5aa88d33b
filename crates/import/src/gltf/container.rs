//! The outside of a file: JSON alone, or GLB, JSON and a buffer in one file.

use crate::{ByteSource, ImportError, Place, error::Problem, error::shown, input::Input};
use std::io::SeekFrom;

/// Largest JSON text.
const MOST_JSON_BYTES: u64 = 64 << 20;

/// A file taken apart.
pub(super) struct Container {
    pub(super) json: Vec<u8>,
    /// Where the JSON begins.
    pub(super) json_offset: u64,
    /// The buffer inside: the source, and where in it.
    pub(super) chunk: Option<(Box<dyn ByteSource>, u64, u64)>,
    pub(super) total_bytes: u64,
}

/// True for GLB, and for text that begins as a JSON object does.
pub(crate) fn recognises(start: &[u8]) -> bool {
    let has_key = || KEYS.iter().any(|key| memchr::memmem::find(start, key.as_bytes()).is_some());
    start.starts_with(b"glTF") || start.trim_ascii_start().starts_with(b"{") && has_key()
}

/// Of JSON that is glTF, at least one; other JSON has none.
const KEYS: [&str; 7] =
    ["\"asset\"", "\"accessors\"", "\"bufferViews\"", "\"buffers\"", "\"meshes\"", "\"nodes\"", "\"scenes\""];

/// Takes a file apart that is [recognised](recognises).
pub(super) fn open(mut input: Input) -> Result<Container, ImportError> {
    let total_bytes = input.progress().1;
    if !input.window().starts_with(b"glTF") {
        let mut json = Vec::new();
        loop {
            json.extend_from_slice(input.window());
            let count = input.window().len();
            input.consume(count);
            if json.len() as u64 > MOST_JSON_BYTES {
                let expected = format!("JSON of at most {MOST_JSON_BYTES} bytes");
                return Err(ImportError::malformed(expected, "more", Place::byte(input.offset())));
            }
            if !input.fill()? {
                return Ok(Container { json, json_offset: 0, chunk: None, total_bytes });
            }
        }
    }
    let mut source = input.into_source("GLB")?;
    let failed = |source| ImportError::new(Problem::Io { source }, None);
    let mut read = |offset: u64, into: &mut [u8]| -> Result<(), ImportError> {
        source.seek(SeekFrom::Start(offset)).map_err(failed)?;
        source.read_exact(into).map_err(failed)
    };
    if total_bytes < 12 {
        return Err(ImportError::truncated("the header of GLB is complete", Place::byte(total_bytes)));
    }
    let mut head = [0; 12];
    read(0, &mut head)?;
    let [_, version, length] = words(head);
    if version != 2 {
        return Err(ImportError::malformed("GLB of version 2", format!("version {version}"), Place::byte(4)));
    }
    let length = u64::from(length);
    if length > total_bytes {
        let before = format!("its {length} bytes of GLB are complete");
        return Err(ImportError::truncated(before, Place::byte(total_bytes)));
    }
    let mut json = None;
    let mut chunk = None;
    let mut offset = 12;
    while offset + 8 <= length {
        let mut head = [0; 8];
        read(offset, &mut head)?;
        let [bytes, kind] = words(head);
        let (start, end) = (offset + 8, offset + 8 + u64::from(bytes));
        if end > length {
            let expected = format!("a chunk of at most {} bytes", length - start);
            return Err(ImportError::malformed(expected, bytes.to_string(), Place::byte(offset)));
        }
        match (&kind.to_le_bytes(), &json) {
            (b"JSON", None) => {
                if u64::from(bytes) > MOST_JSON_BYTES {
                    let expected = format!("JSON of at most {MOST_JSON_BYTES} bytes");
                    return Err(ImportError::malformed(expected, bytes.to_string(), Place::byte(offset)));
                }
                let mut text = vec![0; bytes as usize];
                read(start, &mut text)?;
                json = Some((text, start));
            }
            (found, None) => {
                let found = format!("`{}`", shown(&found[..]));
                return Err(ImportError::malformed("a first chunk `JSON`", found, Place::byte(offset + 4)));
            }
            (b"BIN\0", Some(_)) if chunk.is_none() => chunk = Some((start, u64::from(bytes))),
            _ => {}
        }
        offset = end.next_multiple_of(4);
    }
    let Some((json, json_offset)) = json else {
        return Err(ImportError::truncated("a chunk `JSON`", Place::byte(length)));
    };
    let chunk = chunk.map(|(start, bytes)| (source, start, bytes));
    Ok(Container { json, json_offset, chunk, total_bytes })
}

fn words<const N: usize, const W: usize>(bytes: [u8; N]) -> [u32; W] {
    std::array::from_fn(|word| u32::from_le_bytes(*bytes[4 * word..].first_chunk().expect("there are so many words")))
}
