//! Pages that contradict themselves or their skeleton, each with its exact message.

use crate::forgery::Forgery;
use crate::stranger::Bytes;
use crate::tree::{Growth, Layout, Random, Tree, metadata, open, page_ids, root};
use gigalod_format::splats::{FamilyPlace, Node, Page, PageContents, PageId, SplatFile};
use proptest::prelude::*;

/// What reading a page says, which must be an error.
fn refused(forgery: Forgery, page: u32) -> String {
    forgery.read_page(page).expect_err("a forged page").to_string()
}

/// Nodes, words and families of a page, by its record.
fn counts(page: usize) -> [u16; 3] {
    [8, 10, 12].map(|at| Bytes(&Forgery::new().bytes).u16((Forgery::record(page) + at) as u64))
}

#[test]
fn an_unknown_codec_is_refused_and_the_other_pages_are_read() {
    let record = Forgery::record(1);
    assert_eq!(refused(Forgery::new().put(record + 14, &[7]), 1), "page 1: codec 7, expected 0 or 1");
    assert_eq!(refused(Forgery::new().put(record + 14, &[1]), 1), "page 1: codec 1, but the file has no model");
    for other in [0, 2] {
        Forgery::new().put(record + 14, &[7]).read_page(other).unwrap();
    }
}

#[test]
fn sizes_that_do_not_add_up_are_refused() {
    let good = Forgery::new();
    let at = good.page(1);
    let [nodes, words, families] = counts(1);
    let groups = Bytes(&good.bytes).u16(at as u64);
    let runs = good.bytes[at + 2];
    let found = good.page(2) - at - 4;
    let message = |groups: u16, runs: u8| {
        let quarters = u32::from(groups.div_ceil(4) + families.div_ceil(4));
        let expected = quarters + 6 * u32::from(runs) + 6 * u32::from(nodes) + 2 * u32::from(words - nodes);
        format!("page 1: {found} bytes for {nodes} nodes in {groups} groups with {runs} runs, expected {expected}")
    };
    for count in [0, groups + 8, u16::MAX] {
        assert_eq!(refused(Forgery::new().u16(at, count), 1), message(count, runs));
    }
    for count in [runs + 1, 17, 255] {
        assert_eq!(refused(Forgery::new().put(at + 2, &[count]), 1), message(groups, count));
    }
    // The size of the first group, then of the first family.
    let sizes_at = at + 4 + 6 * usize::from(runs);
    for (at, what, sum) in [
        (sizes_at, "groups", (nodes, "nodes")),
        (sizes_at + usize::from(groups.div_ceil(4)), "families", (groups, "groups")),
    ] {
        let sizes = good.bytes[at];
        let first = sizes & 3;
        let other = if first == 3 { 1 } else { 3 };
        let found = u16::from(other) + sum.0 - u16::from(first);
        assert_eq!(
            refused(Forgery::new().put(at, &[sizes & !3 | other]), 1),
            format!("page 1: {what} of {found} {} in all, expected {}", sum.1, sum.0)
        );
    }
}

#[test]
fn a_page_shorter_than_its_nodes_is_refused() {
    let [nodes, ..] = counts(0);
    assert_eq!(refused(Forgery::new().u32(256, 0), 0), "page 0: 0 bytes, expected at least 4");
    let message = refused(Forgery::new().u32(256, 10), 0);
    assert!(message.starts_with(&format!("page 0: 6 bytes for {nodes} nodes in ")), "{message}");
}

#[test]
fn links_backwards_or_into_their_own_family_are_refused() {
    let good = Forgery::new();
    let [page_0, page_1] = [0, 1].map(|page| good.run(page, 0));
    assert_eq!(
        refused(Forgery::new().u16(page_0 + 4, 0), 0),
        "page 0: the family below family 0, by run 0 and skip 0, is family 0 of page 0, expected a later one"
    );
    // Everything below page 1 moved to page 0, and to its own first family.
    for (page, family) in [(0, 2), (1, 0)] {
        let message = refused(Forgery::new().u32(page_1, page).u16(page_1 + 4, family), 1);
        assert!(message.starts_with("page 1: the family below family "), "{message}");
        let place = format!(" by run 0 and skip 0, is family {family} of page {page}, expected a later one");
        assert!(message.ends_with(&place), "{message}");
    }
}

#[test]
fn runs_that_begin_nowhere_are_refused() {
    let good = Forgery::new();
    let (run, [_, _, families]) = (good.run(1, 0), counts(2));
    let message = format!("page 1: {} runs, expected at most 16 that begin at families", good.bytes[good.page(1) + 2]);
    for (page, family) in [(2, families), (2, u16::MAX), (3, 0), (u32::MAX, 0)] {
        assert_eq!(refused(Forgery::new().u32(run, page).u16(run + 4, family), 1), message);
    }
    Forgery::new().u32(run, 2).u16(run + 4, 0).read_page(1).unwrap();
}

#[test]
fn links_that_run_out_of_families_or_runs_are_refused() {
    let good = Forgery::new();
    let link = good.links(1);
    let runs = u16::from(good.bytes[good.page(1) + 2]);
    for (run, skip) in [(0, 4095), (runs, 0), (15, 0), (15, 4095)] {
        let message = refused(Forgery::new().u16(link, run << 12 | skip), 1);
        let end = format!(" by run {run} and skip {skip}, is none, expected a later one");
        assert!(message.starts_with("page 1: the family below family ") && message.ends_with(&end), "{message}");
    }
    // Fewer and more groups that announce children than there are links: every node of the last page is a leaf, or inner.
    let [nodes, words, families] = counts(2).map(usize::from);
    for (tree, message) in [
        (0, format!("page 2: {} links, expected {} fewer", words - nodes, words - nodes)),
        (6, format!("page 2: {} links, expected more", words - nodes)),
    ] {
        let mut forgery = Forgery::new();
        let (at, groups) = (forgery.page(2), usize::from(Bytes(&forgery.bytes).u16(forgery.page(2) as u64)));
        let runs = usize::from(forgery.bytes[at + 2]);
        let first = at + 4 + 6 * runs + groups.div_ceil(4) + families.div_ceil(4);
        for node in 0..nodes {
            let bits = Bytes(&forgery.bytes).u32((first + 4 * node) as u64);
            forgery = forgery.u32(first + 4 * node, bits & !7 | tree);
        }
        if words > nodes || tree > 0 {
            assert_eq!(refused(forgery, 2), message);
        }
    }
}

#[test]
fn counts_that_are_not_the_records_are_refused() {
    // A page with room for one more word or family in its record, and the bytes that this asks for.
    let record = Forgery::record(2);
    let [nodes, words, families] = counts(2);
    let message = refused(Forgery::new().u16(record + 10, words + 1), 2);
    assert!(message.starts_with("page 2: ") && message.contains(" bytes for "), "{message}");
    let file = open(&Forgery::new().bytes).unwrap();
    let start = file.skeleton().page_offset(PageId(2)) as usize;
    let bytes = &Forgery::new().bytes[start..start + file.skeleton().record(PageId(2)).bytes as usize];
    let mut contents = PageContents::decode(bytes, file.skeleton(), PageId(2)).unwrap();
    contents.links.push(Default::default());
    assert_eq!(
        Page::link(&contents, file.skeleton(), PageId(2)).unwrap_err().to_string(),
        format!("page 2: {} nodes and pointers, expected {words}", words + 1)
    );
    contents.links.pop();
    contents.family_groups.push(0);
    assert_eq!(
        Page::link(&contents, file.skeleton(), PageId(2)).unwrap_err().to_string(),
        format!("page 2: {} families, expected {families}", families + 1)
    );
    contents.family_groups.pop();
    contents.nodes.push(Node::default());
    contents.group_sizes.push(1);
    contents.family_groups[0] += 1;
    assert_eq!(
        Page::link(&contents, file.skeleton(), PageId(2)).unwrap_err().to_string(),
        format!("page 2: {} nodes, expected {nodes}", nodes + 1)
    );
}

/// Pointers of a page that decoded, each with the family that its group is in: they lead forwards, to families that there are.
fn check_pointers(file: &SplatFile, bytes: &[u8], page: &Page, id: PageId) {
    let record = *file.skeleton().record(id);
    let start = file.skeleton().page_offset(id) as usize;
    let contents = PageContents::decode(&bytes[start..start + record.bytes as usize], file.skeleton(), id).unwrap();
    let (mut node, mut word) = (0, 0);
    let mut sizes = contents.group_sizes.iter();
    for (family, groups) in contents.family_groups.iter().enumerate() {
        assert_eq!(page.family_word(family as u16).map(|word| usize::from(word.0)), Some(word));
        for size in sizes.by_ref().take(usize::from(*groups)) {
            let group = &contents.nodes[node..node + usize::from(*size)];
            (node, word) = (node + group.len(), word + group.len());
            if group.iter().any(|node| !node.is_leaf()) {
                let place = page.family(page.words()[word]);
                assert!(place > FamilyPlace { page: id, family: family as u16 }, "backwards");
                assert!(place.family < file.skeleton().record(place.page).families, "beyond the page");
                word += 1;
            }
        }
    }
    assert_eq!((word, node), (page.words().len(), page.node_count()));
    assert_eq!(page.family_word(record.families), None);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]
    #[test]
    fn whatever_is_forged_pages_decode_to_forward_pointers_or_not_at_all(
        seed: u64, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        in_records: bool, coded: bool, shuffle: Option<u64>,
    ) {
        let tree = Tree::grow(60, Growth::Random, true, &mut Random(seed));
        let layout = Layout { page_nodes: 40, shuffle, coded };
        let mut forgery = Forgery { bytes: tree.write_with(layout, &root(&tree), &metadata(&tree)) };
        // Behind the records comes the model.
        let pages = forgery.page(0)..forgery.bytes.len() - 300;
        let range = if in_records { 256..pages.start } else { pages };
        for (at, value) in &changes {
            let at = range.start + at.index(range.len());
            forgery = forgery.put(at, &[*value]);
        }
        let bytes = forgery.seal();
        if let Ok(file) = open(&bytes) {
            for id in page_ids(&file) {
                match file.read_page(id) {
                    Ok(page) => check_pointers(&file, &bytes, &page, id),
                    Err(error) => prop_assert!(!error.to_string().contains('\n')),
                }
            }
        }
    }

    #[test]
    fn no_bytes_make_a_page_panic(page in prop::collection::vec(any::<u8>(), 0..300), groups in 0u16..40, pick: u64) {
        let file = open(&Forgery::new().seal()).unwrap();
        let id = page_ids(&file).nth((pick % 3) as usize).unwrap();
        let _ = Page::decode(&page, file.skeleton(), id);
        // The same with counts that can be right, and as many bytes as they ask for.
        let record = file.skeleton().record(id);
        let runs = pick as u8 % 4;
        let length = usize::from(groups.div_ceil(4) + record.families.div_ceil(4) + 6 * record.nodes)
            + 2 * usize::from(record.words - record.nodes) + 6 * usize::from(runs);
        let rest = page.iter().copied().cycle().take(if page.is_empty() { 0 } else { length });
        let bytes: Vec<u8> = groups.to_le_bytes().into_iter().chain([runs, 0]).chain(rest).collect();
        let _ = Page::decode(&bytes, file.skeleton(), id);
    }

    #[test]
    fn any_word_may_be_taken_for_a_pointer(word: u32, family: u16) {
        let page = Forgery::new().read_page(0).unwrap();
        let place = page.family(word);
        prop_assert!(place.family < 4096);
        prop_assert_eq!(page.family_word(family).is_some(), usize::from(family) < page.family_count());
    }
}
