//! Every page, every group, every tree bit of a splat file, in breadth-first order.
//!
//! Takes an open file; returns the problems and, if there are none, the tree with its decoded spheres. Memory: a
//! [`TreeNode`] for each node, for the tree is what the measurements need.

use super::Problems;
use gigalod_format::splats::page::FamilyStart;
use gigalod_format::splats::{Children, Node, PageContents, PageId, SplatFile, WordIndex};
use gigalod_geom::Sphere;
use gigalod_geom::quantise::{cone, normal, sphere};
use std::collections::VecDeque;

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
}

/// A whole tree, breadth first: the root is node 0.
#[derive(Clone, Debug, Default)]
pub struct SplatTree {
    /// Parents before children.
    pub nodes: Vec<TreeNode>,
}

/// What the breadth-first order says must come next.
struct ExpectedGroup {
    /// Index of the parent in the tree; none for the root's group.
    parent: Option<u32>,
    children: Children,
    /// Number of the family it belongs to.
    family: u64,
}

/// Reads all of `file` and checks checksums, sizes, tree bits, page links and cones. `progress` is told the pages done.
pub fn check(file: &SplatFile, progress: &mut dyn FnMut(u64)) -> (SplatTree, Problems) {
    let mut walk = Walk {
        file,
        tree: SplatTree::default(),
        problems: Problems::default(),
        expected: VecDeque::from([ExpectedGroup {
            parent: None,
            children: Children { count: 1, all_leaves: file.skeleton().root().nodes == 1 },
            family: 0,
        }]),
        families: 1,
        begun_families: 0,
        claims: VecDeque::new(),
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
    expected: VecDeque<ExpectedGroup>,
    /// Families announced and begun so far.
    families: u64,
    begun_families: u64,
    /// Pages whose record says where a family begins that is still to come.
    claims: VecDeque<(u64, PageId, FamilyStart)>,
}

impl Walk<'_> {
    /// False where nothing after this page can be understood.
    fn page(&mut self, page: PageId) -> bool {
        // Checksum, sizes and links as every reader checks them; then the contents once more by themselves.
        if let Err(error) = self.file.read_page(page) {
            self.problems.add(|| error.to_string());
            return false;
        }
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
        let (mut at, mut word, mut has_family) = (0, 0u32, false);
        for size in &contents.group_sizes {
            let nodes = &contents.nodes[at..at + usize::from(*size)];
            at += usize::from(*size);
            let Some(group) = self.expected.pop_front() else {
                self.problems.add(|| format!("page {page}: a group of {size} nodes that no parent announced"));
                return false;
            };
            if group.children.count != *size {
                let expected = group.children.count;
                self.problems.add(|| format!("page {page}: a group of {size} nodes, its parent announced {expected}"));
                return false;
            }
            if group.family == self.begun_families {
                self.begin_family(page, word);
            }
            let has_children = nodes.iter().any(|node| !node.is_leaf());
            if has_children == group.children.all_leaves {
                self.problems
                    .add(|| format!("page {page}, word {word}: the parent says all are leaves: {}", !has_children));
            }
            if has_children && !has_family {
                has_family = true;
                let start = FamilyStart { page: record.first_child_page, word: record.first_child_word };
                self.claims.push_back((self.families, page, start));
            }
            self.group(nodes, &group, page);
            self.families += u64::from(has_children);
            word += u32::from(*size) + u32::from(has_children);
        }
        true
    }

    /// Checks that a family begins where the page above it says. (That it ends in the same page, `read_page` has checked.)
    fn begin_family(&mut self, page: PageId, word: u32) {
        let number = self.begun_families;
        self.begun_families += 1;
        let here = FamilyStart { page, word: WordIndex(word as u16) };
        while let Some((_, from, claimed)) = self.claims.pop_front_if(|(claimed, _, _)| *claimed == number) {
            if claimed != here {
                self.problems.add(|| {
                    format!("page {from}: its first family is said to begin at {claimed:?}, but does at {here:?}")
                });
            }
        }
    }

    fn group(&mut self, nodes: &[Node], group: &ExpectedGroup, page: PageId) {
        let first = self.tree.nodes.len() as u32;
        let parent = group.parent.map(|parent| {
            self.tree.nodes[parent as usize].first_child = first;
            self.tree.nodes[parent as usize]
        });
        for node in nodes {
            if usize::from(node.sphere()) >= sphere::CODES || usize::from(node.normal()) >= normal::CODES {
                self.problems
                    .add(|| format!("page {page}: sphere code {}, normal code {}", node.sphere(), node.normal()));
            }
            let ball = match &parent {
                Some(parent) => sphere::decode(&parent.sphere, node.sphere()),
                None => self.file.skeleton().root().sphere,
            };
            if let Some(parent) = &parent {
                self.check_cone(parent.node, *node, page);
            }
            let children = node.children();
            let index = self.tree.nodes.len() as u32;
            if children.count > 0 {
                self.expected.push_back(ExpectedGroup { parent: Some(index), children, family: self.families });
            }
            self.tree.nodes.push(TreeNode { sphere: ball, first_child: 0, children: children.count, node: *node });
        }
    }

    /// A child's cone must lie within its parent's, or culling by the parent's would hide what can be seen.
    fn check_cone(&mut self, parent: Node, child: Node, page: PageId) {
        if parent.cone() == 3 {
            return;
        }
        let angle = |cos: f32| f64::from(cos.clamp(-1.0, 1.0)).acos();
        let between =
            normal::decode(parent.normal()).as_dvec3().angle_between(normal::decode(child.normal()).as_dvec3());
        let excess = between + angle(cone::cosine(child.cone())) - angle(cone::cosine(parent.cone()));
        if excess > 1e-3 {
            self.problems.add(|| format!("page {page}: a normal cone sticks out of its parent's by {excess} radian"));
        }
    }

    fn finish(mut self) -> (SplatTree, Problems) {
        let root = self.file.skeleton().root();
        if self.problems.count == 0 {
            if !self.expected.is_empty() {
                let missing = self.expected.len();
                self.problems.add(|| format!("{missing} groups of nodes are announced but not there"));
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
