//! What was written comes back: root, metadata, every node, and by the pointers every parent and child.

use crate::stranger;
use crate::tree::{Growth, Layout, Random, Tree, metadata, open, page_ids, root};
use gigalod_format::splats::page::MAX_NODES;
use gigalod_format::splats::{
    Children, FamilyPlace, Link, Node, Page, PageContents, PageId, PageRecord, SplatFile, WordIndex,
};
use gigalod_format::{Bounds, Container, FileStore, MemoryStore, Metadata, PageStore, ReferenceSystem};
use proptest::prelude::*;
use std::sync::Arc;

/// Follows the decoded pointers from the root and compares with the tree; returns the number of families that lie in
/// another page than their group.
fn follow(file: &SplatFile, tree: &Tree) -> usize {
    let pages: Vec<Page> = page_ids(file).map(|page| file.read_page(page).unwrap()).collect();
    let mut stack = vec![(vec![0], PageId(0), WordIndex(0))];
    let (mut visited, mut crossing) = (0, 0);
    while let Some((group, page, word)) = stack.pop() {
        let words = pages[page.0 as usize].words();
        let colors = pages[page.0 as usize].colors();
        let (start, end) = (usize::from(word.0), usize::from(word.0) + group.len());
        let found: Vec<Node> = words[start..end].iter().map(|word| Node(*word)).collect();
        let expected: Vec<Node> = group.iter().map(|index| tree.packed(*index)).collect();
        assert_eq!(found, expected, "word {start} of page {page}");
        if tree.has_colors {
            let expected: Vec<u16> = group.iter().map(|index| tree.nodes[*index].color).collect();
            assert_eq!(colors[start..end], expected);
        } else {
            assert!(colors.is_empty());
        }
        visited += group.len();
        if found.iter().all(|node| node.is_leaf()) {
            continue;
        }
        let family = pages[page.0 as usize].family(words[end]);
        crossing += usize::from(family.page != page);
        let mut word = pages[family.page.0 as usize].family_word(family.family).unwrap();
        for (index, node) in group.iter().zip(found) {
            if !node.is_leaf() {
                stack.push((tree.nodes[*index].children.clone(), family.page, word));
            }
            word.0 += node.children().words() as u16;
        }
    }
    assert_eq!(visited, tree.nodes.len());
    assert_eq!(pages.iter().map(Page::node_count).sum::<usize>(), visited);
    crossing
}

fn trees() -> impl Strategy<Value = Tree> {
    let growth = prop_oneof![Just(Growth::Oldest), Just(Growth::Random), Just(Growth::Newest)];
    (0usize..300, growth, any::<bool>(), any::<u64>())
        .prop_map(|(inner, growth, has_colors, seed)| Tree::grow(inner, growth, has_colors, &mut Random(seed)))
}

fn layouts() -> impl Strategy<Value = Layout> {
    (16usize..200, prop::option::of(any::<u64>()), any::<bool>()).prop_map(|(page_nodes, shuffle, coded)| Layout {
        page_nodes,
        shuffle,
        coded,
    })
}

proptest! {
    #[test]
    fn pointers_lead_from_every_parent_to_its_children(tree in trees(), layout in layouts()) {
        let file = open(&tree.write_with(layout, &root(&tree), &metadata(&tree))).unwrap();
        prop_assert_eq!(*file.skeleton().root(), root(&tree));
        prop_assert_eq!(file.container().read_metadata().unwrap(), metadata(&tree));
        follow(&file, &tree);
    }

    #[test]
    fn a_reader_made_from_the_document_alone_sees_the_same(tree in trees(), layout in layouts()) {
        let bytes = tree.write_with(layout, &root(&tree), &metadata(&tree));
        prop_assert_eq!(stranger::read(&bytes), stranger::expected(&tree, root(&tree).sphere));
    }

    #[test]
    fn every_finite_bound_survives_the_metadata(bounds in prop::array::uniform6(prop::num::f64::NORMAL | prop::num::f64::ZERO)) {
        let tree = Tree::grow(1, Growth::Oldest, false, &mut Random(1));
        let [a, b, c, d, e, f] = bounds;
        let metadata = Metadata { bounds: Bounds { min: [a, b, c], max: [d, e, f] }, ..metadata(&tree) };
        let file = open(&tree.write_with(Layout::default(), &root(&tree), &metadata)).unwrap();
        prop_assert_eq!(file.container().read_metadata().unwrap(), metadata);
    }

    #[test]
    fn a_reference_system_survives_the_metadata_and_may_be_missing(
        name in prop::option::of(any::<String>()), epsg in prop::option::of(any::<u32>()), wkt in prop::option::of(any::<String>()),
    ) {
        let tree = Tree::grow(1, Growth::Oldest, false, &mut Random(1));
        let metadata = Metadata { reference_system: Some(ReferenceSystem { name, epsg, wkt }), ..metadata(&tree) };
        let file = open(&tree.write_with(Layout::default(), &root(&tree), &metadata)).unwrap();
        prop_assert_eq!(file.container().read_metadata().unwrap(), metadata);
    }

    #[test]
    fn page_contents_come_back(sizes in prop::collection::vec(1u8..=4, 0..500), has_colors: bool, seed: u64) {
        let mut random = Random(seed);
        let count: usize = sizes.iter().map(|size| usize::from(*size)).sum();
        let nodes: Vec<Node> = (0..count).map(|_| Node(random.below(1 << 32) as u32)).collect();
        let mut contents = PageContents {
            colors: if has_colors { nodes.iter().map(|node| node.0 as u16).collect() } else { Vec::new() },
            family_groups: sizes.chunks(1 + random.below(4)).map(|family| family.len() as u8).collect(),
            group_sizes: sizes,
            nodes,
            ..PageContents::default()
        };
        for _ in 0..random.below(17) {
            contents.runs.push(FamilyPlace { page: PageId(random.below(1 << 32) as u32), family: random.below(1 << 16) as u16 });
        }
        for _ in 0..random.below(count + 1) {
            contents.links.push(Link { run: random.below(16) as u8, skip: random.below(4096) as u16 });
        }
        let record = PageRecord {
            bytes: 0, checksum: 0, nodes: count as u16, words: contents.words() as u16,
            families: contents.family_groups.len() as u16, codec: 0,
        };
        prop_assert_eq!(contents.encode().len(), contents.raw_bytes());
        let decoded = PageContents::decode_raw(&contents.encode(), &record, has_colors, PageId(0)).unwrap();
        prop_assert_eq!(decoded, contents);
    }
}

#[test]
fn large_trees_take_several_full_pages_and_families_cross_them() {
    for (growth, has_colors) in [(Growth::Random, true), (Growth::Oldest, false), (Growth::Newest, true)] {
        let tree = Tree::grow(8_000, growth, has_colors, &mut Random(3));
        assert!(tree.nodes.len() > 20_000);
        let layout = Layout { page_nodes: MAX_NODES, coded: matches!(growth, Growth::Oldest), ..Layout::default() };
        let bytes = tree.write_with(layout, &root(&tree), &metadata(&tree));
        let file = open(&bytes).unwrap();
        assert_eq!(file.skeleton().pages().len(), tree.nodes.len().div_ceil(MAX_NODES));
        assert!(file.skeleton().pages()[0].nodes > 8192 - 16, "pages are as full as families allow");
        // A chain hardly crosses; a broad tree has most of its families in a later page.
        let least = if matches!(growth, Growth::Newest) { 1 } else { 1000 };
        assert!(follow(&file, &tree) >= least, "{growth:?}");
        assert_eq!(stranger::read(&bytes), stranger::expected(&tree, root(&tree).sphere));
    }
}

#[test]
fn a_single_leaf_is_a_file() {
    let tree = Tree::grow(0, Growth::Oldest, true, &mut Random(0));
    let file = open(&tree.write(16)).unwrap();
    assert_eq!(follow(&file, &tree), 0);
    let page = file.read_page(PageId(0)).unwrap();
    assert_eq!((page.words().len(), Node(page.words()[0]).children()), (1, Children::NONE));
}

#[test]
fn the_same_tree_gives_the_same_bytes_and_a_file_on_disk_reads_like_one_in_memory() {
    let tree = Tree::grow(100, Growth::Random, true, &mut Random(9));
    let bytes = tree.write(64);
    assert_eq!(bytes, tree.write(64));
    let path = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(path.path(), &bytes).unwrap();
    let store = Arc::new(FileStore::open(path.path()).unwrap());
    follow(&SplatFile::open(Container::open(store).unwrap()).unwrap(), &tree);
}

#[test]
fn opening_reads_header_and_skeleton_and_nothing_else() {
    let bytes = Tree::grow(500, Growth::Random, true, &mut Random(5)).write(64);
    let store = Arc::new(MemoryStore::new(bytes));
    let file = SplatFile::open(Container::open(store.clone()).unwrap()).unwrap();
    let pages = file.skeleton().pages().len() as u64;
    assert_eq!(store.bytes_read(), 128 + 128 + 16 * pages);
    file.read_page(PageId(0)).unwrap();
    assert_eq!(store.bytes_read(), 256 + 16 * pages + u64::from(file.skeleton().pages()[0].bytes));
}
