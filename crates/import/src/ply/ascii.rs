//! Text bodies: numbers between blanks.
//!
//! In: an [`Input`] in the body of a text file. Out: [`Values`]. The rules about lines are in the documentation of
//! [`ply`](super).
//!
//! What always holds: a value is looked at as a whole, in the input's window, so nothing is copied; a word longer than
//! [`MAX_WORD_BYTES`] is an error.

use super::{
    scalar::Scalar,
    values::{At, Values},
};
use crate::{
    ImportError, Place,
    error::shown,
    input::Input,
    number::{is_blank, parse},
};

/// The longest number that means something, `f64::MIN_POSITIVE` in full without exponent, has some 1,100 characters.
const MAX_WORD_BYTES: usize = 4096;

pub(super) struct Ascii {
    line_end: u8,
    /// Where the input is: after a value, the line of that value. From 1.
    line: u64,
    /// Line of the first value of the item; none before it.
    item_line: Option<u64>,
}

impl Ascii {
    /// For a body that starts at the beginning of `line`; each line ends in `line_end`, perhaps after a CR.
    pub(super) fn new(line_end: u8, line: u64) -> Self {
        Self { line_end, line, item_line: None }
    }

    /// Steps to the next word and returns its length; it is then at the start of the window.
    #[inline]
    fn word(&mut self, input: &mut Input, at: At<'_>) -> Result<usize, ImportError> {
        loop {
            let window = input.window();
            let mut blanks = 0;
            for &byte in window {
                if !is_blank(byte) {
                    break;
                }
                self.line += u64::from(byte == self.line_end);
                blanks += 1;
            }
            let more = blanks < window.len();
            input.consume(blanks);
            if more {
                break;
            }
            if !input.fill()? {
                return Err(at.truncated(self.place()));
            }
        }
        self.item_line.get_or_insert(self.line);
        loop {
            let window = input.window();
            match window.iter().position(|&byte| is_blank(byte)) {
                Some(length) => return Ok(length),
                None if window.len() > MAX_WORD_BYTES => {
                    return Err(self.malformed(input, MAX_WORD_BYTES, "a number of at most 4096 characters", at));
                }
                None if input.fill()? => {}
                None => return Ok(input.window().len()),
            }
        }
    }

    fn malformed(&self, input: &Input, word_bytes: usize, expected: &str, at: At<'_>) -> ImportError {
        let found = format!("`{}`", shown(&input.window()[..word_bytes]));
        ImportError::malformed(expected, found, at.place(self.place()))
    }
}

impl Values for Ascii {
    fn begin_item(&mut self, _input: &Input) {
        self.item_line = None;
    }

    /// Steps over what the line still has. An item that has used more than one line must end where the last one does, or
    /// else its first line was a value short.
    fn end_item(&mut self, input: &mut Input, at: At<'_>) -> Result<(), ImportError> {
        let item_line = self.item_line.unwrap_or(self.line);
        loop {
            let window = input.window();
            let line_end = window.iter().position(|&byte| byte == self.line_end);
            let rest = line_end.unwrap_or(window.len());
            if self.line != item_line
                && let Some(blanks) = window[..rest].iter().position(|&byte| !is_blank(byte))
            {
                input.consume(blanks);
                let expected = format!("a line end after the values that line {item_line} lacks");
                input.has(MAX_WORD_BYTES)?;
                let window = input.window();
                let word_bytes = window.iter().position(|&byte| is_blank(byte)).unwrap_or(window.len());
                return Err(self.malformed(input, word_bytes, &expected, at));
            }
            input.consume(rest); // The line end itself is counted as a blank before the next word.
            if line_end.is_some() || !input.fill()? {
                return Ok(());
            }
        }
    }

    #[inline]
    fn number(&mut self, input: &mut Input, _scalar: Scalar, at: At<'_>) -> Result<f64, ImportError> {
        let length = self.word(input, at)?;
        match parse(&input.window()[..length]) {
            Some(number) => {
                input.consume(length);
                Ok(number)
            }
            None => {
                let expected = format!("a number for the property `{}`", shown(at.property.name.as_bytes()));
                Err(self.malformed(input, length, &expected, at))
            }
        }
    }

    /// What is skipped need not be numbers.
    fn skip(&mut self, input: &mut Input, _scalar: Scalar, count: u64, at: At<'_>) -> Result<(), ImportError> {
        for _ in 0..count {
            let length = self.word(input, at)?;
            input.consume(length);
        }
        Ok(())
    }

    fn place(&self) -> Place {
        Place::line(self.line)
    }
}
