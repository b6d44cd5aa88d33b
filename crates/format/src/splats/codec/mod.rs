//! Codec 1: a page's fields under a model of how they depend on each other.
//!
//! A field is coded after what it depends on: the tree bits and the cone first, then the normal relative to its siblings',
//! then the sphere, whose place across the surface follows from the normal and its places along it. The same walk serves
//! counting, coding and decoding (`Coder`), so they cannot disagree about a context.
//!
//! What always holds: any page decodes to itself; any bytes decode to a page or to an error.

mod model;
mod rans;
mod walk;

pub use model::{Model, Statistics};

use super::page::PageContents;
use super::skeleton::{PageId, PageRecord};
use crate::FormatError;
use rans::Decoder;
use walk::{Coder, walk};

impl Coder for Decoder<'_> {
    #[inline(always)]
    fn symbol(&mut self, context: usize, _given: impl FnOnce() -> u8) -> Option<u8> {
        Decoder::symbol(self, context)
    }
}

/// Counts the symbols of a page.
pub fn count(contents: &PageContents, statistics: &mut Statistics) {
    struct Counting<'a>(&'a mut Statistics);
    impl Coder for Counting<'_> {
        fn symbol(&mut self, context: usize, given: impl FnOnce() -> u8) -> Option<u8> {
            let symbol = given();
            self.0.count(context, symbol);
            Some(symbol)
        }
    }
    code(contents, &mut Counting(statistics));
}

/// The bytes of a page. `model` must have been made from statistics that include the page.
pub fn encode(contents: &PageContents, model: &Model) -> Vec<u8> {
    struct Listing(Vec<(u16, u8)>);
    impl Coder for Listing {
        fn symbol(&mut self, context: usize, given: impl FnOnce() -> u8) -> Option<u8> {
            let symbol = given();
            self.0.push((context as u16, symbol));
            Some(symbol)
        }
    }
    let mut listing = Listing(Vec::with_capacity(contents.nodes.len() * 9));
    code(contents, &mut listing);
    let mut out = Vec::with_capacity(contents.nodes.len() * 4);
    rans::encode(&listing.0, model.tables(), &mut out);
    out
}

fn code(contents: &PageContents, coder: &mut impl Coder) {
    let mut same = PageContents::default();
    let done = walk(coder, Some(contents), contents.nodes.len(), !contents.colors.is_empty(), &mut same);
    debug_assert!(done.is_some() && same == *contents, "a page walks to itself");
}

/// Undoes [`encode`].
///
/// # Errors
/// [`FormatError::Invalid`] where the bytes are no page of as many nodes as the record says.
pub fn decode(
    bytes: &[u8],
    model: &Model,
    record: &PageRecord,
    has_colors: bool,
    page: PageId,
) -> Result<PageContents, FormatError> {
    let mut contents = PageContents::default();
    let whole = Decoder::new(bytes, model.slots()).is_some_and(|mut decoder| {
        walk(&mut decoder, None, usize::from(record.nodes), has_colors, &mut contents).is_some() && decoder.is_at_end()
    });
    if whole { Ok(contents) } else { Err(FormatError::invalid(format!("page {page}"), "its code makes no sense")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::{Children, Node, WordIndex};
    use proptest::prelude::*;

    fn record(nodes: usize) -> PageRecord {
        let (first_child_page, first_child_word) = (PageId(0), WordIndex(0));
        PageRecord {
            bytes: 0,
            checksum: 0,
            first_child_page,
            first_child_word,
            nodes: nodes as u16,
            words: 0,
            codec: 1,
        }
    }

    fn pages() -> impl Strategy<Value = PageContents> {
        let node = (0u16..7621, 0u16..16_224, 0u8..4, prop_oneof![Just(0u8), 2u8..5], any::<bool>()).prop_map(
            |(sphere, normal, cone, count, all)| {
                Node::pack(sphere, normal, cone, Children { count, all_leaves: all && count > 0 })
            },
        );
        let groups = prop::collection::vec(prop::collection::vec((node, any::<u16>()), 1..5), 1..40);
        (groups, any::<bool>()).prop_map(|(groups, has_colors)| PageContents {
            group_sizes: groups.iter().map(|group| group.len() as u8).collect(),
            nodes: groups.iter().flatten().map(|(node, _)| *node).collect(),
            colors: groups.iter().flatten().filter(|_| has_colors).map(|(_, color)| *color).collect(),
        })
    }

    proptest! {
        #[test]
        fn every_page_comes_back(page in pages()) {
            let mut statistics = Statistics::default();
            count(&page, &mut statistics);
            let model = Model::parse(&Model::of(&statistics).to_bytes()).unwrap();
            let bytes = encode(&page, &model);
            let again = decode(&bytes, &model, &record(page.nodes.len()), !page.colors.is_empty(), PageId(0));
            prop_assert_eq!(again.unwrap(), page);
        }

        #[test]
        fn any_bytes_are_a_page_or_an_error(
            page in pages(), flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        ) {
            let mut statistics = Statistics::default();
            count(&page, &mut statistics);
            let model = Model::of(&statistics);
            let mut bytes = encode(&page, &model);
            for (at, value) in flips {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            let _ = decode(&bytes, &model, &record(page.nodes.len()), !page.colors.is_empty(), PageId(0));
            let _ = decode(&bytes[..bytes.len() / 2], &model, &record(8192), true, PageId(0));
        }

        #[test]
        fn any_bytes_are_a_model_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..3000)) {
            if let Ok(model) = Model::parse(&bytes) {
                prop_assert_eq!(Model::parse(&model.to_bytes()).unwrap(), model);
            }
        }
    }
}
