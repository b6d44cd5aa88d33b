//! Codec 1: a page's fields under a model of how they depend on each other.
//!
//! A field is coded after what it depends on: the tree bits and the cone first, then the normal relative to its siblings',
//! then the sphere, whose place across the surface follows from the normal and its places along it. The nodes of a page are
//! dealt to four lanes that know nothing of each other, so a processor can decode four nodes at once. Coder and decoder
//! share `context`, so they cannot disagree about what depends on what.
//!
//! What always holds: any page decodes to itself under any model; any bytes decode to a page or to an error.

mod context;
mod decoder;
mod links;
mod lister;
mod model;
mod rans;
mod tables;
#[cfg(test)]
mod tests;

pub use model::{Model, Statistics};

use super::contents::{PageContents, RUN_BYTES, put_runs};
use super::skeleton::{PageId, PageRecord};
use crate::FormatError;
use lister::{OF_COLOR, OF_NODE, Symbol};
use rans::{Coder, State};

/// Lanes of a page.
const LANES: usize = 4;
/// Bytes of a coded page before its runs: states, nodes of all lanes but the last, number of runs, nothing.
const HEAD_BYTES: usize = 4 * LANES + 2 * (LANES - 1) + 2;

/// Counts the symbols of a page.
pub fn count(contents: &PageContents, statistics: &mut Statistics) {
    lister::list_nodes(contents, |symbol| statistics.count(symbol));
    lister::list_links(contents, |_, symbol| statistics.count(symbol));
}

/// Codes pages under one model, with buffers that it keeps.
#[derive(Clone, Debug)]
pub struct Encoder {
    entries: rans::Entries,
    symbols: Vec<Symbol>,
    links: Vec<(usize, Symbol)>,
    words: Vec<u16>,
}

impl Encoder {
    /// For any pages: a model made from some codes all.
    pub fn new(model: &Model) -> Self {
        let entries = rans::Entries::of(model.tables());
        Self { entries, symbols: Vec::new(), links: Vec::new(), words: Vec::new() }
    }

    /// The bytes of a page. They decode where they are no more than the raw page's; else it is the raw page that should be
    /// written.
    pub fn encode(&mut self, contents: &PageContents) -> Vec<u8> {
        let of_node = OF_NODE + if contents.colors.is_empty() { 0 } else { OF_COLOR };
        self.symbols.clear();
        self.symbols.reserve(contents.nodes.len() * of_node);
        self.links.clear();
        let lengths = lister::list_nodes(contents, |symbol| self.symbols.push(symbol));
        lister::list_links(contents, |lane, symbol| self.links.push((lane, symbol)));
        self.words.resize(self.symbols.len() + self.links.len(), 0);
        let mut coder = Coder::new(&self.entries, &mut self.words);
        let mut states = [State::END; LANES];
        for (lane, symbol) in self.links.iter().rev() {
            coder.put(&mut states[*lane], symbol.0);
        }
        // Lane by lane what not all have, then what all have in step: backwards, all of it.
        let mut rest = &self.symbols[..];
        let lanes = lengths.map(|nodes| rest.split_off(..nodes * of_node).unwrap_or_default());
        let in_step = lanes.iter().map(|lane| lane.len()).min().unwrap_or(0);
        for (state, lane) in states.iter_mut().zip(&lanes).rev() {
            for symbol in lane[in_step..].iter().rev() {
                coder.put(state, symbol.0);
            }
        }
        let [a, b, c, d] = lanes.map(|lane| &lane[..in_step]);
        for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d).rev() {
            coder.put(&mut states[3], d.0);
            coder.put(&mut states[2], c.0);
            coder.put(&mut states[1], b.0);
            coder.put(&mut states[0], a.0);
        }
        let words = coder.words();
        let mut out = Vec::with_capacity(HEAD_BYTES + contents.runs.len() * RUN_BYTES + 2 * words.len());
        out.extend(states.iter().flat_map(|state| state.0.to_le_bytes()));
        out.extend(lengths[..LANES - 1].iter().flat_map(|nodes| (*nodes as u16).to_le_bytes()));
        out.extend([contents.runs.len() as u8, 0]);
        put_runs(&contents.runs, &mut out);
        out.extend(words.iter().rev().flat_map(|word| word.to_le_bytes()));
        out
    }
}

/// Undoes [`Encoder::encode`].
///
/// # Errors
/// [`FormatError::Invalid`] where the bytes are no page of as many nodes, words and families as the record says.
pub fn decode(
    bytes: &[u8],
    model: &Model,
    record: &PageRecord,
    has_colors: bool,
    page: PageId,
) -> Result<PageContents, FormatError> {
    let contents = decoder::decode(bytes, model.slots(), record, has_colors)
        .ok_or_else(|| FormatError::invalid(format!("page {page}"), "its code makes no sense"))?;
    contents.check_sums(page)?;
    Ok(contents)
}
