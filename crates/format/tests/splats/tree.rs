//! Trees to be written, and a slow, obvious writer: families in some order, then into pages.

use gigalod_format::splats::codec::{self, Encoder, Model, Statistics};
use gigalod_format::splats::page::{CODEC_ENTROPY, CODEC_RAW};
use gigalod_format::splats::{
    Children, FamilyPlace, Linker, Node, PageContents, PageId, PageRecord, Root, Skeleton, SplatFile,
};
use gigalod_format::{Bounds, Container, FormatError, InputCounts, Kind, MemoryStore, Metadata, Writer};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::quantise::{normal, sphere};
use gigalod_geom::{Aabb, Sphere};
use glam::{DVec3, Vec3};
use std::collections::{BTreeMap, VecDeque};
use std::io::Cursor;
use std::sync::Arc;

/// A node and, by index, its children.
#[derive(Clone, Debug, Default)]
pub(crate) struct TreeNode {
    pub(crate) children: Vec<usize>,
    pub(crate) sphere: u16,
    pub(crate) normal: u16,
    pub(crate) cone: u8,
    pub(crate) color: u16,
}

/// Node 0 is the root. Children may have any indices.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) nodes: Vec<TreeNode>,
    pub(crate) has_colors: bool,
}

/// SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % end as u64) as usize
    }
}

/// Which leaf gets children next: decides between even, ragged and chain-like trees.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Growth {
    Oldest,
    Random,
    Newest,
}

impl Tree {
    /// A tree of `inner` nodes with 2–4 children each.
    pub(crate) fn grow(inner: usize, growth: Growth, has_colors: bool, random: &mut Random) -> Self {
        let mut tree = Self { nodes: vec![marked(0)], has_colors };
        let mut leaves = VecDeque::from([0]);
        for _ in 0..inner {
            let at = match growth {
                Growth::Oldest => 0,
                Growth::Random => random.below(leaves.len()),
                Growth::Newest => leaves.len() - 1,
            };
            let parent = leaves.remove(at).expect("there is always a leaf");
            for _ in 0..2 + random.below(3) {
                let child = tree.nodes.len();
                tree.nodes[parent].children.push(child);
                leaves.push_back(child);
                tree.nodes.push(marked(child));
            }
        }
        tree
    }

    pub(crate) fn leaves(&self) -> usize {
        self.nodes.iter().filter(|node| node.children.is_empty()).count()
    }

    /// The node as it must come back.
    pub(crate) fn packed(&self, index: usize) -> Node {
        let node = &self.nodes[index];
        let all_leaves = !node.children.is_empty() && !self.has_grandchildren(index);
        let children = Children { count: node.children.len() as u8, all_leaves };
        Node::pack(node.sphere, node.normal, node.cone, children)
    }

    fn has_grandchildren(&self, index: usize) -> bool {
        self.nodes[index].children.iter().any(|child| !self.nodes[*child].children.is_empty())
    }

    /// The groups that hang from a group, if any does.
    fn family_of(&self, group: &[usize]) -> Vec<Vec<usize>> {
        group.iter().map(|index| self.nodes[*index].children.clone()).filter(|group| !group.is_empty()).collect()
    }

    fn levels(&self) -> u32 {
        let mut level = vec![0];
        for depth in 0.. {
            level = level.iter().flat_map(|index: &usize| self.nodes[*index].children.clone()).collect();
            if level.is_empty() {
                return depth + 1;
            }
        }
        unreachable!("a tree ends")
    }

    /// A file of raw pages that hold at most `page_nodes` nodes (at least 16: a family must fit), breadth first.
    pub(crate) fn write(&self, page_nodes: usize) -> Vec<u8> {
        self.write_with(Layout { page_nodes, ..Layout::default() }, &root(self), &metadata(self))
    }

    /// The same with another layout, a root and metadata of the caller's.
    pub(crate) fn write_with(&self, layout: Layout, root: &Root, metadata: &Metadata) -> Vec<u8> {
        let pages = self.pages(layout);
        let mut statistics = Statistics::default();
        pages.iter().for_each(|page| codec::count(page, &mut statistics));
        let model = layout.coded.then(|| Model::of(&statistics));
        let mut encoder = model.as_ref().map(Encoder::new);
        let encoded: Vec<Vec<u8>> = pages
            .iter()
            .map(|page| encoder.as_mut().map_or_else(|| page.encode(), |coder| coder.encode(page)))
            .collect();
        let record = |(page, bytes): (&PageContents, &Vec<u8>)| PageRecord {
            bytes: bytes.len() as u32,
            checksum: gigalod_format::checksum(bytes),
            nodes: page.nodes.len() as u16,
            words: page.words() as u16,
            families: page.family_groups.len() as u16,
            codec: if layout.coded { CODEC_ENTROPY } else { CODEC_RAW },
        };
        let records: Vec<PageRecord> = pages.iter().zip(&encoded).map(record).collect();
        let skeleton = Skeleton::encode(root, &records, model.as_ref());
        assert_eq!(skeleton.len() as u64, Skeleton::encoded_bytes(records.len() as u64, model.as_ref()));
        let mut writer = Writer::new(Cursor::new(Vec::new()), Kind::Splats, skeleton.len() as u64).unwrap();
        for page in &encoded {
            writer.page(page).unwrap();
        }
        let (out, file_bytes) = writer.finish(&skeleton, metadata).unwrap();
        assert_eq!(out.get_ref().len() as u64, file_bytes);
        out.into_inner()
    }

    /// All pages of a file.
    pub(crate) fn pages(&self, layout: Layout) -> Vec<PageContents> {
        // All families in the order of the file, and for each group the number of the family below it.
        let mut random = layout.shuffle.map(Random);
        let mut open = VecDeque::from([(vec![vec![0]], None)]);
        let (mut families, mut below) = (Vec::new(), BTreeMap::new());
        while !open.is_empty() {
            let at = random.as_mut().map_or(0, |random| random.below(open.len()));
            let (family, above) = open.remove(at).unwrap();
            let number = families.len() as u64;
            if let Some(above) = above {
                below.insert(above, number);
            }
            for (place, group) in family.iter().enumerate() {
                let family = self.family_of(group);
                if !family.is_empty() {
                    open.push_back((family, Some((number, place))));
                }
            }
            families.push(family);
        }
        // Pages and the families that their runs begin at.
        let (mut pages, mut places) = (Vec::<(PageContents, Vec<u64>)>::new(), Vec::new());
        let (mut page, mut linker) = (PageContents::default(), Linker::default());
        for (family, number) in families.iter().zip(0u64..) {
            let more: usize = family.iter().map(Vec::len).sum();
            let targets = (0..family.len()).filter_map(|place| below.get(&(number, place)).copied());
            let fits = page.nodes.len() + more <= layout.page_nodes;
            if !fits || !linker.push(targets.clone(), &mut page.links) {
                pages.push((std::mem::take(&mut page), linker.starts().to_vec()));
                linker.clear();
                assert!(linker.push(targets, &mut page.links), "a family fits an empty page");
            }
            places.push(FamilyPlace { page: PageId(pages.len() as u32), family: page.family_groups.len() as u16 });
            page.family_groups.push(family.len() as u8);
            for group in family {
                page.group_sizes.push(group.len() as u8);
                page.nodes.extend(group.iter().map(|index| self.packed(*index)));
                page.colors.extend(group.iter().filter(|_| self.has_colors).map(|index| self.nodes[*index].color));
            }
        }
        pages.push((page, linker.starts().to_vec()));
        let placed = |(mut page, starts): (PageContents, Vec<u64>)| {
            page.runs = starts.iter().map(|start| places[*start as usize]).collect();
            page
        };
        pages.into_iter().map(placed).collect()
    }
}

/// How a tree becomes pages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) page_nodes: usize,
    /// Families in any order that the format allows, by this seed; else breadth first.
    pub(crate) shuffle: Option<u64>,
    pub(crate) coded: bool,
}

impl Default for Layout {
    fn default() -> Self {
        Self { page_nodes: 16, shuffle: None, coded: false }
    }
}

/// A leaf that can hardly be taken for another by what is stored; normals move a little, and now and then to another face.
fn marked(index: usize) -> TreeNode {
    TreeNode {
        children: Vec::new(),
        sphere: (index * 4099 % sphere::CODES) as u16,
        normal: ((index * 37 + index / 7 % 6 * 2704) % normal::CODES) as u16,
        cone: (index % 4) as u8,
        color: (index * 40_503) as u16,
    }
}

pub(crate) fn root(tree: &Tree) -> Root {
    Root {
        origin: DVec3::new(1e6, -2e6, 0.1),
        sphere: Sphere { center: Vec3::new(0.25, -0.5, 0.3), radius: 10.7 },
        overhang: 1.75,
        bounds: Aabb {
            min: DVec3::new(999_990.0, -2_000_010.0, -9.9),
            max: DVec3::new(1_000_010.0, -1_999_990.0, 10.1),
        },
        nodes: tree.nodes.len() as u64,
        leaves: tree.leaves() as u64,
        levels: tree.levels(),
        has_colors: tree.has_colors,
        closed: true,
        up: UpAxis::Z,
    }
}

pub(crate) fn metadata(tree: &Tree) -> Metadata {
    let root = root(tree);
    Metadata {
        generator: "tests 1".into(),
        input: InputCounts { triangles: 7, vertices: root.leaves, points: 0 },
        options: BTreeMap::from([("as".into(), "splats".into())]),
        nodes: root.nodes,
        levels: root.levels,
        leaves: root.leaves,
        repeated: 0,
        raw_bytes: 1,
        closed: root.closed,
        bounds: Bounds { min: root.bounds.min.to_array(), max: root.bounds.max.to_array() },
        reference_system: None,
        attributes: vec!["normals".into()],
        dicing: None,
        per_level: Vec::new(),
    }
}

/// Opens a file in memory.
pub(crate) fn open(bytes: &[u8]) -> Result<SplatFile, FormatError> {
    SplatFile::open(Container::open(Arc::new(MemoryStore::new(bytes.to_vec())))?)
}

/// All page numbers of a file.
pub(crate) fn page_ids(file: &SplatFile) -> impl Iterator<Item = PageId> + use<> {
    (0..file.skeleton().pages().len() as u32).map(PageId)
}
