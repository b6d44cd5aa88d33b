//! Pages that come back, bytes that do not, and the coder's arithmetic.

use super::model::{STORED, legal};
use super::rans::{Coder, Entries, ROW, SCALE, SYMBOLS, Slots, State, Table, Words, entry_of_bits};
use super::*;
use crate::splats::{Children, FamilyPlace, Link, Node};
use proptest::prelude::*;

fn record(page: &PageContents) -> PageRecord {
    PageRecord {
        bytes: 0,
        checksum: 0,
        nodes: page.nodes.len() as u16,
        words: page.words() as u16,
        families: page.family_groups.len() as u16,
        codec: 1,
    }
}

/// Any groups of any nodes, in any families, with any links.
fn pages() -> impl Strategy<Value = PageContents> {
    let node = (0u16..7621, 0u16..16_224, 0u8..4, prop_oneof![Just(0u8), 2u8..5], any::<bool>()).prop_map(
        |(sphere, normal, cone, count, all)| {
            Node::pack(sphere, normal, cone, Children { count, all_leaves: all && count > 0 })
        },
    );
    // Neighbours are alike now and then, as in truth.
    let node = (node, any::<bool>(), 0u32..40);
    let groups = prop::collection::vec(prop::collection::vec((node, any::<u16>()), 1..5), 1..60);
    let runs = prop::collection::vec((any::<u32>(), any::<u16>()), 0..=16);
    let links = prop::collection::vec((0u8..16, prop_oneof![4 => 0u16..3, 1 => 0u16..4096]), 60);
    (groups, any::<bool>(), prop::collection::vec(1u8..5, 60), runs, links).prop_map(
        |(groups, has_colors, families, runs, links)| {
            let mut page = PageContents::default();
            let mut before = Node::pack(7620, 0, 0, Children::NONE);
            for group in &groups {
                page.group_sizes.push(group.len() as u8);
                for ((node, alike, step), color) in group {
                    let normal =
                        if *alike { (u32::from(before.normal()) + step) % 16_224 } else { node.normal().into() };
                    before = Node(node.0 & !(0x3FFF << 5) | normal << 5);
                    page.nodes.push(before);
                    page.colors.extend(has_colors.then_some(*color));
                }
                if group.iter().any(|((node, ..), _)| !node.is_leaf()) {
                    let (run, skip) = links[page.links.len()];
                    page.links.push(Link { run, skip });
                }
            }
            let mut left = groups.len();
            for groups in families {
                let groups = usize::from(groups).min(left);
                left -= groups;
                page.family_groups.extend((groups > 0).then_some(groups as u8));
            }
            let place = |(page, family)| FamilyPlace { page: PageId(page), family };
            page.runs = runs.into_iter().map(place).collect();
            page
        },
    )
}

fn model_of(page: &PageContents) -> Model {
    let mut statistics = Statistics::default();
    count(page, &mut statistics);
    Model::of(&statistics)
}

proptest! {
    #[test]
    fn every_page_comes_back_under_any_model(page in pages(), other in pages()) {
        for model in [model_of(&page), model_of(&other), Model::of(&Statistics::default())] {
            let model = Model::parse(&model.to_bytes()).unwrap();
            let mut encoder = Encoder::new(&model);
            // What it coded before does not matter.
            encoder.encode(&other);
            let bytes = encoder.encode(&page);
            let again = decode(&bytes, &model, &record(&page), !page.colors.is_empty(), PageId(0));
            prop_assert_eq!(again.unwrap(), page.clone());
        }
    }

    #[test]
    fn any_bytes_are_a_page_or_an_error(
        page in pages(), flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        other in pages(), cut in any::<prop::sample::Index>(),
    ) {
        let model = model_of(&page);
        let mut bytes = Encoder::new(&model).encode(&page);
        for (at, value) in flips {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        for record in [record(&page), record(&other), PageRecord { nodes: 8192, words: 16_384, families: 4096, ..record(&page) }] {
            for bytes in [&bytes[..], &bytes[..cut.index(bytes.len())]] {
                for has_colors in [false, true] {
                    if let Ok(found) = decode(bytes, &model, &record, has_colors, PageId(0)) {
                        prop_assert_eq!(found.nodes.len(), usize::from(record.nodes));
                        prop_assert_eq!(found.words(), usize::from(record.words));
                        prop_assert_eq!(found.family_groups.len(), usize::from(record.families));
                        prop_assert_eq!(found.colors.len(), if has_colors { found.nodes.len() } else { 0 });
                    }
                }
            }
        }
    }

    #[test]
    fn any_bytes_are_a_model_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..6000)) {
        if let Ok(model) = Model::parse(&bytes) {
            prop_assert_eq!(Model::parse(&model.to_bytes()).unwrap(), model);
        }
    }

    #[test]
    fn frequencies_sum_to_the_whole_and_each_legal_symbol_has_one(
        counts in prop::collection::vec(prop_oneof![Just(0), 0u64..9, 0u64..1 << 40], SYMBOLS), context in 0..STORED,
    ) {
        let counts: &[u64; SYMBOLS] = counts.as_slice().try_into().unwrap();
        let legal = legal(context);
        let frequencies = Table::of_counts(counts, legal).frequencies();
        let sum: u32 = frequencies.iter().map(|f| u32::from(*f)).sum();
        prop_assert_eq!(sum, if legal == 0 { 0 } else { SCALE });
        prop_assert!((0..SYMBOLS).all(|symbol| (frequencies[symbol] > 0) == (legal >> symbol & 1 != 0)));
    }

    #[test]
    fn symbols_and_bits_come_back_in_order_and_nothing_is_left(
        given in prop::collection::vec((0usize..2, 0u32..16, 0u32..11, any::<u32>()), 0..400), skew in 0u64..40,
    ) {
        let table = |context: u64| {
            let counts = std::array::from_fn(|symbol| 1 + skew * skew * context * (symbol as u64 % 7));
            Table::of_counts(&counts, 0xFFFF)
        };
        let tables = [table(0), table(1), table(2)];
        let entries = Entries::of(&tables);
        let mut words = vec![0; 2 * given.len()];
        let mut coder = Coder::new(&entries, &mut words);
        let mut states = [State::END; 2];
        for (lane, symbol, bits, value) in given.iter().rev() {
            coder.put(&mut states[*lane], entry_of_bits(*bits, value & ((1 << bits) - 1)));
            coder.put(&mut states[*lane], (symbol % 3 * ROW as u32 + symbol) as u16);
        }
        let bytes: Vec<u8> = coder.words().iter().rev().flat_map(|word| word.to_le_bytes()).collect();
        let (slots, words) = (Slots::of(&tables), Words::new(&bytes).unwrap());
        let mut reader = words.reader();
        for (lane, symbol, bits, value) in &given {
            prop_assert_eq!(states[*lane].symbol(&slots, &mut reader, symbol % 3), *symbol);
            prop_assert_eq!(states[*lane].bits(&mut reader, *bits), value & ((1 << bits) - 1));
        }
        prop_assert!(reader.is_at_end() && states == [State::END; 2]);
    }
}

#[test]
fn a_symbol_that_is_nearly_certain_costs_nearly_nothing() {
    let nodes = vec![Node::pack(7620, 5, 0, Children::NONE); 8192];
    let page = PageContents { group_sizes: vec![4; 2048], nodes, ..PageContents::default() };
    let bytes = Encoder::new(&model_of(&page)).encode(&page);
    assert!(bytes.len() < 600, "{} bytes", bytes.len());
}

#[test]
fn too_many_words_are_no_page() {
    assert!(Words::new(&[0; 2 * rans::MOST_WORDS]).is_none() && Words::new(&[0; 3]).is_none());
    assert!(Words::new(&vec![0; 2 * rans::MOST_WORDS - 2]).is_some());
}
