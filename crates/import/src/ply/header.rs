//! The header: which elements follow, how many of each, and what each consists of.
//!
//! In: an [`Input`] at the start of a PLY file. Out: a [`Header`], with the input at the first byte of the body. Nothing here
//! gives names a meaning; `plan` does.
//!
//! What always holds: memory is bounded by the limits below, whatever the header says; counts are only believed later, one
//! item at a time.

use super::scalar::Scalar;
use crate::{ImportError, Place, error::shown, input::Input};

/// Longest line, in bytes. Comments hold at most a path or a command line.
const MAX_LINE_BYTES: usize = 16 << 10;
/// Longest header, in bytes; it bounds the number of lines.
const MAX_HEADER_BYTES: usize = 1 << 20;
/// Most elements; names are looked up one by one.
const MAX_ELEMENTS: usize = 256;
/// Most properties of an element, so that an item without lists fits the input's window. Gaussian splats have 62.
const MAX_PROPERTIES: usize = 1024;

pub(super) struct Header {
    pub(super) encoding: Encoding,
    /// In the order in which their items follow.
    pub(super) elements: Vec<Element>,
    /// CR where lines end in a lone CR, else LF.
    pub(super) line_end: u8,
    /// Number of the line `end_header`, from 1.
    pub(super) last_line: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryLittleEndian,
    BinaryBigEndian,
}

pub(super) struct Element {
    pub(super) name: String,
    /// Declared; perhaps a lie.
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// Where it is declared.
    pub(super) line: u64,
}

pub(super) struct Property {
    pub(super) name: String,
    pub(super) shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Single(Scalar),
    /// A length, then that many values.
    List {
        length: Scalar,
        value: Scalar,
    },
}

impl Element {
    /// The single number called `name`: which property, and its type.
    pub(super) fn single(&self, name: &str) -> Option<(usize, Scalar)> {
        self.properties.iter().enumerate().find_map(|(index, property)| match property.shape {
            Shape::Single(scalar) if property.name == name => Some((index, scalar)),
            _ => None,
        })
    }

    /// Names of all properties, for messages.
    pub(super) fn property_names(&self) -> String {
        let names: Vec<_> = self.properties.iter().map(|property| property.name.as_str()).collect();
        if names.is_empty() { "no properties".to_owned() } else { format!("`{}`", shown(names.join(" ").as_bytes())) }
    }
}

/// Reads a header, its first line included.
pub(super) fn read(input: &mut Input) -> Result<Header, ImportError> {
    let mut lines = Lines::start(input);
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let line = lines.next()?;
        let (number, found) = (lines.number, || format!("`{}`", shown(line.as_bytes())));
        let malformed = |expected: &str| ImportError::malformed(expected, found(), Place::line(number));
        let words: Vec<_> = line.split_ascii_whitespace().take(8).collect();
        match words[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", ..] if encoding.is_some() => return Err(malformed("one `format` line")),
            ["format", name, "1.0"] if Encoding::named(name).is_some() => encoding = Encoding::named(name),
            ["format", ..] => {
                return Err(malformed("`format`, then ascii, binary_little_endian or binary_big_endian, then 1.0"));
            }
            ["element", name, count] => {
                if elements.iter().any(|element| element.name == name) {
                    return Err(malformed("each element once"));
                }
                if elements.len() == MAX_ELEMENTS {
                    return Err(malformed("at most 256 elements"));
                }
                let count = count.parse().map_err(|_| malformed("`element NAME COUNT`"))?;
                let properties = Vec::new();
                elements.push(Element { name: name.to_owned(), count, properties, line: lines.number });
            }
            ["element", ..] => return Err(malformed("`element NAME COUNT`")),
            ["property", ref words @ ..] => {
                let Some(element) = elements.last_mut() else {
                    return Err(malformed("an `element` line before the first `property`"));
                };
                if element.properties.len() == MAX_PROPERTIES {
                    return Err(malformed("at most 1024 properties in an element"));
                }
                let property = Property::parse(words).ok_or_else(|| {
                    malformed(
                        "`property TYPE NAME` or `property list TYPE TYPE NAME`, \
                         with types among char uchar short ushort int uint float double",
                    )
                })?;
                element.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| malformed("a `format` line before the end of the header"))?;
                return Ok(Header { encoding, elements, line_end: lines.end, last_line: lines.number });
            }
            _ => {
                return Err(malformed("a line with `element`, `property`, `comment`, `obj_info` or `end_header`"));
            }
        }
    }
}

impl Encoding {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "ascii" => Self::Ascii,
            "binary_little_endian" => Self::BinaryLittleEndian,
            "binary_big_endian" => Self::BinaryBigEndian,
            _ => return None,
        })
    }
}

impl Property {
    /// Bytes in a binary file, the values of a list apart.
    pub(super) fn least_bytes(&self) -> usize {
        match self.shape {
            Shape::Single(scalar) | Shape::List { length: scalar, .. } => scalar.size(),
        }
    }

    /// From the words after `property`.
    fn parse(words: &[&str]) -> Option<Self> {
        let (shape, name) = match *words {
            ["list", length, value, name] => {
                (Shape::List { length: Scalar::named(length)?, value: Scalar::named(value)? }, name)
            }
            [scalar, name] => (Shape::Single(Scalar::named(scalar)?), name),
            _ => return None,
        };
        Some(Self { name: name.to_owned(), shape })
    }
}

/// The lines of the header after the first.
struct Lines<'a> {
    input: &'a mut Input,
    /// Last byte of a line.
    end: u8,
    /// Of the line read last, from 1.
    number: u64,
    bytes: usize,
}

impl<'a> Lines<'a> {
    /// Finds out how lines end, and reads the line `ply` with any blank ones before it: all in the window, as the file was
    /// recognised by them.
    fn start(input: &'a mut Input) -> Self {
        let window = input.window();
        let blank = window.len() - window.trim_ascii_start().len();
        let magic_end = window.len().min(blank + b"ply".len());
        let end = match window[magic_end..].iter().position(|&byte| byte == b'\r' || byte == b'\n') {
            Some(at) if window[magic_end + at] == b'\r' && window.get(magic_end + at + 1) != Some(&b'\n') => b'\r',
            _ => b'\n',
        };
        let number = 1 + window[..blank].iter().filter(|&&byte| byte == end).count() as u64;
        let line_end = window[magic_end..].iter().position(|&byte| byte == end);
        input.consume(line_end.map_or(magic_end, |at| magic_end + at + 1));
        Self { input, end, number, bytes: 0 }
    }

    /// The next line, without blanks at its ends. Text that is not UTF-8, perhaps in a comment, is replaced.
    fn next(&mut self) -> Result<String, ImportError> {
        self.number += 1;
        let limit = MAX_LINE_BYTES.min(MAX_HEADER_BYTES.saturating_sub(self.bytes));
        let mut searched = 0;
        loop {
            let window = &self.input.window()[..self.input.window().len().min(limit + 1)];
            let found = window[searched..].iter().position(|&byte| byte == self.end).map(|at| searched + at);
            searched = window.len();
            let length = match found {
                Some(length) => length,
                None if searched > limit => return Err(self.too_long()),
                None if self.input.fill()? => continue,
                None if searched == 0 => return Err(self.ends_early()),
                None => searched,
            };
            let line = String::from_utf8_lossy(&self.input.window()[..length]).trim().to_owned();
            let with_end = if found.is_some() { length + 1 } else { length };
            self.input.consume(with_end);
            self.bytes += with_end;
            return Ok(line);
        }
    }

    fn ends_early(&self) -> ImportError {
        ImportError::truncated("the line `end_header`", Place::line(self.number))
    }

    fn too_long(&self) -> ImportError {
        ImportError::malformed(
            format!("a header of at most {MAX_HEADER_BYTES} bytes in lines of at most {MAX_LINE_BYTES}"),
            "more",
            Place::line(self.number),
        )
    }
}
