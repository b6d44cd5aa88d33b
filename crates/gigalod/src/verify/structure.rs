//! Every page, every group, every tree bit of a splat file, in the order of the file.
//!
//! Takes an open file; returns the problems and, if there are none, the tree with its decoded spheres. Memory: a
//! [`TreeNode`] for each node, for the tree is what the measurements need.

use super::Problems;
use gigalod_format::splats::{Children, FamilyPlace, Node, PageContents, PageId, SplatFile, WordIndex};
use gigalod_geom::Sphere;
use gigalod_geom::quantise::{normal, sphere};
use std::collections::HashMap;

/// A node of a checked tree.
#[derive(Clone, Copy, Debug)]
pub struct TreeNode {
    /// Decoded; local space.
    pub sphere: Sphere,
    /// Index of the first child; children follow each other.
    pub first_child: u32,
    /// Number of children.
    pub children: u8,
    /// As stored.
    pub node: Node,
    /// As stored, 5-6-5, if the file has colours.
    pub color: Option<u16>,
}

/// A whole tree: the root is node 0.
#[derive(Clone, Debug, Default)]
pub struct SplatTree {
    /// Parents before children.
    pub nodes: Vec<TreeNode>,
}

impl SplatTree {
    /// Nodes with two children that are alike. A leaf that is repeated, so that it is not drawn too large, is one of them.
    pub fn twins(&self) -> u64 {
        let looks = |it: &TreeNode| (it.node.sphere(), it.node.normal(), it.node.cone(), it.color);
        let is_twins = |parent: &&TreeNode| {
            let children = parent.first_child as usize..parent.first_child as usize + usize::from(parent.children);
            match &self.nodes[children] {
                [one, other] => looks(one) == looks(other),
                _ => false,
            }
        };
        self.nodes.iter().filter(is_twins).count() as u64
    }
}

/// A family that some group points to: its groups' parents, by their index in the tree.
type Parents = [Option<u32>; 4];

/// Reads all of `file` and checks checksums, sizes, tree bits and page links. `progress` is told the pages done.
pub fn check(file: &SplatFile, progress: &mut dyn FnMut(u64)) -> (SplatTree, Problems) {
    let root = FamilyPlace { page: PageId(0), family: 0 };
    let mut walk = Walk {
        file,
        tree: SplatTree::default(),
        problems: Problems::default(),
        announced: HashMap::from([(root, Parents::default())]),
    };
    for number in 0..file.skeleton().pages().len() as u32 {
        if !walk.page(PageId(number)) {
            break;
        }
        progress(u64::from(number) + 1);
    }
    walk.finish()
}

struct Walk<'a> {
    file: &'a SplatFile,
    tree: SplatTree,
    problems: Problems,
    /// Families that are still to come.
    announced: HashMap<FamilyPlace, Parents>,
}

impl Walk<'_> {
    /// False where nothing after this page can be understood.
    fn page(&mut self, page: PageId) -> bool {
        // Checksum, sizes and links as every reader checks them; then the contents once more by themselves.
        let decoded = match self.file.read_page(page) {
            Ok(decoded) => decoded,
            Err(error) => {
                self.problems.add(|| error.to_string());
                return false;
            }
        };
        let record = *self.file.skeleton().record(page);
        let mut bytes = vec![0; record.bytes as usize];
        let read = self.file.container().store().read_at(self.file.skeleton().page_offset(page), &mut bytes);
        let contents = match read {
            Ok(()) => PageContents::decode(&bytes, self.file.skeleton(), page),
            Err(source) => {
                self.problems.add(|| format!("page {page}: {source}"));
                return false;
            }
        };
        let contents = match contents {
            Ok(contents) => contents,
            Err(error) => {
                self.problems.add(|| error.to_string());
                return false;
            }
        };
        let (mut at, mut word) = (0, 0);
        let mut groups = contents.group_sizes.iter();
        for (family, group_count) in contents.family_groups.iter().enumerate() {
            let here = FamilyPlace { page, family: family as u16 };
            let Some(parents) = self.announced.remove(&here) else {
                self.problems.add(|| format!("page {page}: no group before it, or two, lead to family {family}"));
                return false;
            };
            if decoded.family_word(here.family) != Some(WordIndex(word as u16)) {
                self.problems.add(|| format!("page {page}: family {family} does not begin at word {word}"));
            }
            let expected = if at + word == 0 && page.0 == 0 { 1 } else { parents.iter().flatten().count() };
            if expected != usize::from(*group_count) {
                self.problems
                    .add(|| format!("page {page}: family {family} has {group_count} groups, expected {expected}"));
                return false;
            }
            for parent in parents.iter().take(expected) {
                let size = usize::from(*groups.next().expect("sizes add up, as decoding has checked"));
                let nodes = &contents.nodes[at..at + size];
                let colors = contents.colors.get(at..at + size).unwrap_or_default();
                (at, word) = (at + size, word + size);
                let pointer = decoded.words().get(word).copied();
                let has_pointer = nodes.iter().any(|node| !node.is_leaf());
                let below = pointer.filter(|_| has_pointer).map(|word| decoded.family(word));
                if !self.group((nodes, colors), *parent, below, page) {
                    return false;
                }
                word += usize::from(has_pointer);
            }
        }
        true
    }

    /// A group and the family below it, if any; false where it is not what its parent announced.
    fn group(
        &mut self,
        (nodes, colors): (&[Node], &[u16]),
        parent: Option<u32>,
        below: Option<FamilyPlace>,
        page: PageId,
    ) -> bool {
        let first = self.tree.nodes.len() as u32;
        let size = nodes.len() as u8;
        let announced = match parent {
            Some(parent) => self.tree.nodes[parent as usize].node.children(),
            None => Children { count: 1, all_leaves: self.file.skeleton().root().nodes == 1 },
        };
        if announced.count != size {
            let expected = announced.count;
            self.problems.add(|| format!("page {page}: a group of {size} nodes, its parent announced {expected}"));
            return false;
        }
        if below.is_some() == announced.all_leaves {
            self.problems.add(|| format!("page {page}: the parent says all are leaves: {}", announced.all_leaves));
        }
        let parent = parent.map(|parent| {
            self.tree.nodes[parent as usize].first_child = first;
            self.tree.nodes[parent as usize]
        });
        let (mut parents, mut groups) = (Parents::default(), 0);
        for (at, node) in nodes.iter().enumerate() {
            if usize::from(node.sphere()) >= sphere::CODES || usize::from(node.normal()) >= normal::CODES {
                self.problems
                    .add(|| format!("page {page}: sphere code {}, normal code {}", node.sphere(), node.normal()));
            }
            let sphere = match &parent {
                Some(parent) => sphere::decode(&parent.sphere, node.sphere()),
                None => self.file.skeleton().root().sphere,
            };
            let children = node.children().count;
            if children > 0 {
                parents[groups] = Some(self.tree.nodes.len() as u32);
                groups += 1;
            }
            self.tree.nodes.push(TreeNode {
                sphere,
                first_child: 0,
                children,
                node: *node,
                color: colors.get(at).copied(),
            });
        }
        if let Some(below) = below
            && self.announced.insert(below, parents).is_some()
        {
            self.problems
                .add(|| format!("page {page}: a second group leads to family {} of page {}", below.family, below.page));
            return false;
        }
        true
    }

    fn finish(mut self) -> (SplatTree, Problems) {
        let root = self.file.skeleton().root();
        if self.problems.count == 0 {
            if !self.announced.is_empty() {
                let missing = self.announced.len();
                self.problems.add(|| format!("{missing} families of nodes are announced but not there"));
            }
            let leaves = self.tree.nodes.iter().filter(|node| node.children == 0).count() as u64;
            let found = (self.tree.nodes.len() as u64, leaves);
            if found != (root.nodes, root.leaves) {
                let expected = (root.nodes, root.leaves);
                self.problems.add(|| format!("nodes and leaves are {found:?}, expected {expected:?}"));
            }
            self.check_overhang();
        }
        (self.tree, self.problems)
    }

    /// No decoded descendant may reach farther than the skeleton says: frustum culling relies on it.
    fn check_overhang(&mut self) {
        let overhang = f64::from(self.file.skeleton().root().overhang);
        let nodes = &self.tree.nodes;
        let mut parents = vec![0u32; nodes.len()];
        let mut worst = 0.0_f64;
        for (index, node) in nodes.iter().enumerate() {
            for child in 0..u32::from(node.children) {
                parents[(node.first_child + child) as usize] = index as u32;
            }
            // Parents come before children, so the way up is known.
            let mut below = index as u32;
            while below != 0 {
                below = parents[below as usize];
                let above = &nodes[below as usize].sphere;
                let reach =
                    (above.center.as_dvec3() - node.sphere.center.as_dvec3()).length() + f64::from(node.sphere.radius);
                if above.radius > 0.0 {
                    worst = worst.max(reach / f64::from(above.radius));
                }
            }
        }
        if worst > overhang {
            self.problems
                .add(|| format!("a node reaches {worst} radii from an ancestor, the skeleton says at most {overhang}"));
        }
    }
}
