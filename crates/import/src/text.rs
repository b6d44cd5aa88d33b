//! Text files, line by line and word by word.
//!
//! In: an [`Input`]. Out: lines as slices of its window, nothing copied; numbers and words from a line.
//!
//! What always holds: a line, with those that continue it, fits the input's window, or is an error.

use crate::{
    ImportError, Place,
    error::shown,
    input::Input,
    number::{self, is_blank},
};
use memchr::memchr;

/// Walks through the lines of a file.
pub(crate) struct Lines {
    /// CR where lines end in a lone CR, else LF.
    end: u8,
    /// True where a backslash at the end of a line joins it with the next.
    continued: bool,
    /// Of the line returned last, its first part; from 1.
    number: u64,
    /// Of the next one.
    next: u64,
    /// Bytes of the line returned last, with its end.
    pending: usize,
}

impl Lines {
    /// For an input at the start of a line; looks at its window to find out how lines end.
    pub(crate) fn new(input: &Input) -> Self {
        let window = input.window();
        let end = match memchr(b'\n', window) {
            None if window.contains(&b'\r') => b'\r',
            _ => b'\n',
        };
        Self { end, continued: false, number: 0, next: 1, pending: 0 }
    }

    /// The same with lines joined by backslashes at their ends.
    pub(crate) fn continued(input: &Input) -> Self {
        Self { continued: true, ..Self::new(input) }
    }

    /// Where the line returned last begins.
    pub(crate) fn place(&self) -> Place {
        Place::line(self.number)
    }

    /// Number of the line returned last.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// Last byte of a line.
    pub(crate) fn line_end(&self) -> u8 {
        self.end
    }

    /// Steps over the line returned last: the input is then where the next begins.
    pub(crate) fn finish_line(&mut self, input: &mut Input) {
        input.consume(std::mem::take(&mut self.pending));
    }

    /// The line returned last, without its end.
    pub(crate) fn current<'a>(&self, input: &'a Input) -> &'a [u8] {
        let line = &input.window()[..self.pending];
        line.strip_suffix(&[self.end]).unwrap_or(line)
    }

    /// The next line without its end; none after the last.
    #[inline]
    pub(crate) fn next<'a>(&mut self, input: &'a mut Input) -> Result<Option<&'a [u8]>, ImportError> {
        input.consume(self.pending);
        self.pending = 0;
        self.number = self.next;
        let mut searched = 0;
        loop {
            match memchr(self.end, &input.window()[searched..]) {
                Some(at) => {
                    let length = searched + at;
                    self.next += 1;
                    if self.continued && ends_in_backslash(&input.window()[..length]) {
                        searched = length + 1;
                        continue;
                    }
                    self.pending = length + 1;
                    return Ok(Some(&input.window()[..length]));
                }
                None => {
                    let length = input.window().len();
                    if length == Input::CAPACITY {
                        return Err(ImportError::malformed(
                            format!("lines of less than {} bytes", Input::CAPACITY),
                            format!("a longer one, `{}`", shown(&input.window()[..length])),
                            self.place(),
                        ));
                    }
                    searched = length;
                    if !input.fill()? {
                        self.pending = length;
                        return Ok(if length == 0 { None } else { Some(input.window()) });
                    }
                }
            }
        }
    }
}

/// True for a line that the next one continues.
pub(crate) fn ends_in_backslash(line: &[u8]) -> bool {
    matches!(line, [.., b'\\'] | [.., b'\\', b'\r'])
}

/// Steps to the next word of a line and returns it with the rest; none at the end of the line or before a `#`. A backslash
/// that ends a part of a joined line is a blank.
#[inline]
pub(crate) fn word(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let mut start = 0;
    loop {
        match *line.get(start)? {
            byte if is_blank(byte) => start += 1,
            b'\\' if line[start + 1..].first().is_none_or(|&byte| byte == b'\n' || byte == b'\r') => start += 1,
            b'#' => return None,
            _ => break,
        }
    }
    let rest = &line[start..];
    let length = rest.iter().position(|&byte| is_blank(byte)).unwrap_or(rest.len());
    Some(rest.split_at(length))
}

/// The words of a line, as [`word`] finds them.
pub(crate) fn words(mut line: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let (word, rest) = word(line)?;
        line = rest;
        Some(word)
    })
}

/// The next `N` numbers of a line, and its rest.
///
/// # Errors
/// What is missing, or no number: as a word to be shown.
#[inline]
pub(crate) fn numbers<const N: usize>(mut line: &[u8]) -> Result<([f64; N], &[u8]), Wrong> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        let (word, rest) = word(line).ok_or(Wrong::Missing)?;
        *number = number::parse(word).ok_or_else(|| Wrong::Word(shown(word)))?;
        line = rest;
    }
    Ok((numbers, line))
}

/// Why there is no number.
#[derive(Debug)]
pub(crate) enum Wrong {
    Missing,
    Word(String),
}

impl Wrong {
    /// The error of a line that should have had `expected`.
    pub(crate) fn error(self, expected: &str, place: Place) -> ImportError {
        let found = match self {
            Self::Missing => "fewer".to_owned(),
            Self::Word(word) => format!("`{word}`"),
        };
        ImportError::malformed(expected, found, place)
    }
}

/// The rest of a line after its keyword, without blanks at its ends.
pub(crate) fn name(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}
