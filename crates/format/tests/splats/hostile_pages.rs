//! Pages that contradict themselves or their skeleton, each with its exact message.

use crate::forgery::Forgery;
use crate::stranger::Bytes;
use crate::tree::{Growth, Random, Tree, open, page_ids};
use gigalod_format::splats::{Page, PageContents};
use proptest::prelude::*;

/// What reading a page says, which must be an error.
fn refused(forgery: Forgery, page: u32) -> String {
    forgery.read_page(page).expect_err("a forged page").to_string()
}

#[test]
fn an_unknown_codec_is_refused_and_the_other_pages_are_read() {
    let record = Forgery::record(1);
    assert_eq!(refused(Forgery::new().put(record + 18, &[7]), 1), "page 1: codec 7, expected 0 or 1");
    for other in [0, 2] {
        Forgery::new().put(record + 18, &[7]).read_page(other).unwrap();
    }
}

#[test]
fn group_sizes_that_do_not_add_up_are_refused() {
    let good = Forgery::new();
    let at = good.page(1);
    let (groups, nodes) = (Bytes(&good.bytes).u32(at as u64), Bytes(&good.bytes).u16(256 + 34));
    let bytes = Bytes(&good.bytes).u32(276) - 4;
    for count in [0, groups + 8, u32::MAX] {
        let message = refused(Forgery::new().u32(at, count), 1);
        let expected = count.div_ceil(4) + 6 * u32::from(nodes);
        let expected = format!("page 1: {bytes} bytes for {nodes} nodes in {count} groups, expected {expected}");
        assert_eq!(message, expected);
    }
    let sizes = Forgery::new().bytes[at + 4];
    let first = sizes & 3;
    let other = if first == 3 { 1 } else { 3 };
    assert_eq!(
        refused(Forgery::new().put(at + 4, &[sizes & !3 | other]), 1),
        format!("page 1: groups of {} nodes in all, expected {nodes}", u16::from(other) + nodes - u16::from(first))
    );
}

#[test]
fn a_page_shorter_than_its_nodes_is_refused() {
    let nodes = Bytes(&Forgery::new().bytes).u16(256 + 14);
    assert_eq!(refused(Forgery::new().u32(256, 0), 0), "page 0: 0 bytes, expected at least 4");
    let message = refused(Forgery::new().u32(256, 10), 0);
    assert!(message.starts_with(&format!("page 0: 6 bytes for {nodes} nodes in ")), "{message}");
}

#[test]
fn pointers_backwards_or_into_their_own_group_are_refused() {
    // The root's group is word 0, its pointer word 1.
    for word in [0, 1] {
        assert_eq!(
            refused(Forgery::new().u16(Forgery::record(0) + 12, word), 0),
            format!("page 0: the family of word 0 lies at word {word} of page 0, expected a later one")
        );
    }
    let first = Forgery::record(1) + 8;
    assert_eq!(
        refused(Forgery::new().u32(first, 0).u16(first + 4, 5), 1),
        "page 1: the family of word 0 lies at word 5 of page 0, expected a later one"
    );
}

#[test]
fn families_across_the_end_of_a_page_are_refused() {
    let good = Forgery::new();
    let (words, last) = (Bytes(&good.bytes).u16(256 + 16), Bytes(&good.bytes).u16(256 + 56));
    // The root's family moved to the last word of page 0.
    assert_eq!(
        refused(Forgery::new().u16(Forgery::record(0) + 12, words - 1), 0),
        format!("page 0: a family ends at word {} of page 0, which has {words}", words + 3)
    );
    // Everything below page 1 moved to the very end of the last page, and beyond.
    let first = Forgery::record(1) + 8;
    for beyond in [0, 7] {
        assert_eq!(
            refused(Forgery::new().u32(first, 2).u16(first + 4, last + beyond), 1),
            format!("page 1: a family ends at word {} of page 2, which has {last}", last + beyond + 3)
        );
    }
}

#[test]
fn families_that_run_out_of_pages_are_refused() {
    // The first family below page 1, of three words, ends with the last page; there is none for the next.
    let first = Forgery::record(1) + 8;
    let last = Bytes(&Forgery::new().bytes).u16(256 + 56);
    assert_eq!(
        refused(Forgery::new().u32(first, 2).u16(first + 4, last - 3), 1),
        "page 1: a family ends at word 4 of page 3, which has 0"
    );
    // Children announced where there is nothing left: every node of the last page claims four that have children.
    let mut forgery = Forgery::new();
    let (at, groups) = (forgery.page(2), Bytes(&forgery.bytes).u32(forgery.page(2) as u64));
    let nodes = usize::from(Bytes(&forgery.bytes).u16(256 + 54));
    for node in 0..nodes {
        let at = at + 4 + groups.div_ceil(4) as usize + 4 * node;
        let bits = Bytes(&forgery.bytes).u32(at as u64);
        forgery = forgery.u32(at, bits & !7 | 6);
    }
    assert_eq!(refused(forgery, 2), "page 2: a family ends at word 27 of page 2, which has 15");
}

#[test]
fn words_that_the_tree_bits_do_not_give_are_refused() {
    let words = Bytes(&Forgery::new().bytes).u16(256 + 56);
    assert_eq!(
        refused(Forgery::new().u16(Forgery::record(2) + 16, words + 1), 2),
        format!("page 2: {words} nodes and pointers, expected {}", words + 1)
    );
}

/// Pointers of a page that decoded, each with the word after its group: they lead forwards and to whole families.
fn check_pointers(bytes: &[u8], page: &Page, id: gigalod_format::splats::PageId) {
    let file = open(bytes).unwrap();
    let record = *file.skeleton().record(id);
    let start = file.skeleton().page_offset(id) as usize;
    let raw = &bytes[start..start + record.bytes as usize];
    let contents = PageContents::decode(raw, file.skeleton(), id).unwrap();
    let (mut node, mut word) = (0, 0);
    for size in contents.group_sizes {
        let group = &contents.nodes[node..node + usize::from(size)];
        (node, word) = (node + group.len(), word + group.len());
        let below: u32 = group.iter().map(|node| node.children().words()).sum();
        if below > 0 {
            let family = page.family(page.words()[word]);
            assert!((family.page, usize::from(family.word.0)) > (id, word), "backwards");
            let room = file.skeleton().record(family.page).words;
            assert!(u32::from(family.word.0) + below <= u32::from(room), "beyond the page");
            word += 1;
        }
    }
    assert_eq!(word, page.words().len());
}

proptest! {
    #[test]
    fn whatever_is_forged_pages_decode_to_forward_pointers_or_not_at_all(
        seed: u64, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        in_records: bool,
    ) {
        let mut forgery = Forgery { bytes: Tree::grow(60, Growth::Random, true, &mut Random(seed)).write(40) };
        let pages = forgery.page(0)..forgery.page(forgery.page_count());
        let range = if in_records { 256..pages.start } else { pages };
        for (at, value) in &changes {
            let at = range.start + at.index(range.len());
            forgery = forgery.put(at, &[*value]);
        }
        let bytes = forgery.seal();
        if let Ok(file) = open(&bytes) {
            for id in page_ids(&file) {
                match file.read_page(id) {
                    Ok(page) => check_pointers(&bytes, &page, id),
                    Err(error) => prop_assert!(!error.to_string().contains('\n')),
                }
            }
        }
    }

    #[test]
    fn no_bytes_make_a_page_panic(page in prop::collection::vec(any::<u8>(), 0..300), groups in 0u32..40, pick: u64) {
        let file = open(&Forgery::new().seal()).unwrap();
        let id = page_ids(&file).nth((pick % 3) as usize).unwrap();
        let _ = Page::decode(&page, file.skeleton(), id);
        // The same with a count that can be right, and as many bytes as it asks for.
        let nodes = usize::from(file.skeleton().record(id).nodes);
        let length = groups.div_ceil(4) as usize + nodes * 6;
        let rest = page.iter().copied().cycle().take(if page.is_empty() { 0 } else { length });
        let bytes: Vec<u8> = groups.to_le_bytes().into_iter().chain(rest).collect();
        let _ = Page::decode(&bytes, file.skeleton(), id);
    }
}
