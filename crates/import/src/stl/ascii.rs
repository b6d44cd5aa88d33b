//! Text files: `solid`, then `facet normal … outer loop vertex … vertex … vertex … endloop endfacet`, then `endsolid`.

use super::{Attributes, Batch, ImportError, ModelStream, Soup, UpAxis, stream};
use crate::{
    error::shown,
    input::Input,
    text::{Lines, Wrong, numbers, word},
};

pub(super) struct AsciiStl {
    input: Input,
    lines: Lines,
    soup: Soup,
    /// Corners of the facet being read.
    corners: [[f32; 3]; 3],
    corner_count: usize,
    state: State,
}

/// Where in the file the reader is.
#[derive(Clone, Copy, PartialEq)]
enum State {
    Outside,
    Solid,
    Facet,
    Loop,
}

/// True for a file that begins with `solid` and goes on like one.
pub(super) fn recognises(start: &[u8]) -> bool {
    let text = start.trim_ascii_start();
    let begins = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let after = text.get(5).is_none_or(|byte| byte.is_ascii_whitespace());
    let next = |name: &[u8]| text.windows(name.len()).any(|word| word.eq_ignore_ascii_case(name));
    begins && after && (next(b"facet") || next(b"endsolid"))
}

impl AsciiStl {
    pub(super) fn new(input: Input) -> Self {
        let lines = Lines::new(&input);
        Self { input, lines, soup: Soup::new(), corners: [[0.0; 3]; 3], corner_count: 0, state: State::Outside }
    }

    /// Takes a line; false after the last.
    fn read(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        let Self { input, lines, .. } = self;
        let Some(mut line) = lines.next(input)? else {
            return match self.state {
                State::Outside => Ok(false),
                _ => Err(ImportError::truncated("the line `endsolid`", lines.place())),
            };
        };
        while let Some((found, rest)) = word(line) {
            let is = |name: &[u8]| found.eq_ignore_ascii_case(name);
            let expected = match self.state {
                State::Outside => {
                    if is(b"solid") {
                        self.state = State::Solid;
                        break; // The rest of the line is a name.
                    }
                    "`solid`, or the end of the file"
                }
                State::Solid => {
                    if is(b"facet") {
                        // The normal, which may be missing, is on the same line.
                        (self.state, self.corner_count) = (State::Facet, 0);
                        let outer = rest.windows(5).position(|word| word.eq_ignore_ascii_case(b"outer"));
                        line = outer.map_or(&[], |at| &rest[at..]);
                        continue;
                    }
                    if is(b"endsolid") {
                        self.state = State::Outside;
                        break;
                    }
                    if is(b"color") {
                        break;
                    }
                    "`facet` or `endsolid`"
                }
                State::Facet => {
                    if is(b"outer") {
                        self.state = State::Loop;
                        line =
                            word(rest).filter(|(word, _)| word.eq_ignore_ascii_case(b"loop")).map_or(rest, |it| it.1);
                        continue;
                    }
                    if is(b"endfacet") {
                        if self.corner_count != 3 {
                            let found = format!("{} of them", self.corner_count);
                            return Err(ImportError::malformed("three vertices in a facet", found, lines.place()));
                        }
                        self.soup.push(self.corners, batch, |facet| lines.place().of_item("facet", facet))?;
                        self.state = State::Solid;
                        line = rest;
                        continue;
                    }
                    "`outer loop` or `endfacet`"
                }
                State::Loop => {
                    if is(b"vertex") {
                        let wrong = |wrong: Wrong| wrong.error("three numbers after `vertex`", lines.place());
                        let (corner, rest) = numbers::<3>(rest).map_err(wrong)?;
                        if self.corner_count == 3 {
                            return Err(ImportError::malformed("three vertices in a facet", "more", lines.place()));
                        }
                        self.corners[self.corner_count] = corner.map(|value| value as f32);
                        self.corner_count += 1;
                        line = rest;
                        continue;
                    }
                    if is(b"endloop") {
                        self.state = State::Facet;
                        line = rest;
                        continue;
                    }
                    "`vertex` or `endloop`"
                }
            };
            return Err(ImportError::malformed(expected, format!("`{}`", shown(found)), lines.place()));
        }
        Ok(true)
    }
}

stream!(AsciiStl, |_| None);
