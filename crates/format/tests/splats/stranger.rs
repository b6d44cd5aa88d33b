//! A reader made from `docs/format.md` alone: no line of it calls the crate. It trusts its input.
//!
//! The oracle of the round trips: it shares no table, no checksum and no arithmetic with what it checks.

use crate::stranger_pages::{Counts, Model, coded, raw};
use crate::tree::Tree;
use gigalod_geom::Sphere;
use std::collections::{HashMap, VecDeque};

/// A node as the document defines it: its sphere is compared bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seen {
    pub(crate) center: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) normal: u32,
    pub(crate) cone: u32,
    pub(crate) color: Option<u16>,
    pub(crate) children: u32,
}

/// A file's bytes, to be read at any offset.
pub(crate) struct Bytes<'a>(pub(crate) &'a [u8]);

impl Bytes<'_> {
    fn field<const N: usize>(&self, at: u64) -> [u8; N] {
        self.0[at as usize..][..N].try_into().unwrap()
    }
    pub(crate) fn u16(&self, at: u64) -> u16 {
        u16::from_le_bytes(self.field(at))
    }
    pub(crate) fn u32(&self, at: u64) -> u32 {
        u32::from_le_bytes(self.field(at))
    }
    pub(crate) fn u64(&self, at: u64) -> u64 {
        u64::from_le_bytes(self.field(at))
    }
    pub(crate) fn f32(&self, at: u64) -> f32 {
        f32::from_le_bytes(self.field(at))
    }
    fn check(&self, start: u64, bytes: u64, checksum: u32) {
        assert_eq!(crc32c(&self.0[start as usize..][..bytes as usize]), checksum, "{bytes} bytes at {start}");
    }
}

/// Bit by bit: polynomial 0x1EDC6F41, reflected, first and last inverted.
pub(crate) fn crc32c(bytes: &[u8]) -> u32 {
    let mut crc = !0u32;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0x82F6_3B78 } else { 0 };
        }
    }
    !crc
}

/// Edge and corner of each sub-cube, by code.
pub(crate) fn sphere_codes() -> Vec<(i64, [i64; 3])> {
    let mut codes = Vec::new();
    for s in 1..=13 {
        for x in 0..=13 - s {
            for y in 0..=13 - s {
                for z in 0..=13 - s {
                    let c: i64 = [x, y, z].iter().map(|at| (2 * at + s - 13) * (2 * at + s - 13)).sum();
                    let d = c - 169 - 3 * s * s;
                    if d <= 0 || d * d <= 2028 * s * s {
                        codes.push((s, [x, y, z]));
                    }
                }
            }
        }
    }
    codes
}

/// The child ball, by the document's arithmetic: each operation rounds to `f32`.
pub(crate) fn child_ball(center: [f32; 3], radius: f32, (s, corner): (i64, [i64; 3])) -> ([f32; 3], f32) {
    let mut child = [0.0; 3];
    for axis in 0..3 {
        let offset = (2 * corner[axis] + s - 13) as f32 / 13.0;
        let step = offset * radius;
        child[axis] = center[axis] + step;
    }
    (child, radius * (s as f32 / 13.0))
}

/// All nodes, breadth first from the root: by the links, as the document resolves them.
pub(crate) fn read(bytes: &[u8]) -> Vec<Seen> {
    let file = Bytes(bytes);
    assert_eq!(&bytes[..8], [0x89, b'G', b'L', b'O', b'D', 0x0D, 0x0A, 0x1A]);
    assert_eq!((file.u32(8), file.u32(12), file.u64(16), file.u64(24)), (1, 1, 0, bytes.len() as u64));
    file.check(0, 124, file.u32(124));
    let skeleton = file.u64(32);
    file.check(skeleton, file.u64(40), file.u32(48));
    file.check(file.u64(56), file.u64(64), file.u32(52));
    let page_count = file.u64(skeleton + 108);
    let records = skeleton + 128;
    let model_bytes = u64::from(file.u32(skeleton + 124));
    assert_eq!(file.u64(40), 128 + 16 * page_count + model_bytes);
    let model = &bytes[(records + 16 * page_count) as usize..][..model_bytes as usize];
    let model = (model_bytes > 0).then(|| Model::read(model));

    let has_colors = file.u32(skeleton + 120) & 1 != 0;
    let mut page = file.u64(72);
    let mut pages = Vec::new();
    for record in (0..page_count).map(|number| records + 16 * number) {
        let page_bytes = u64::from(file.u32(record));
        file.check(page, page_bytes, file.u32(record + 4));
        let [nodes, words, families] = [8, 10, 12].map(|at| usize::from(file.u16(record + at)));
        let counts = Counts { nodes, words, families, has_colors };
        let bytes = &bytes[page as usize..][..page_bytes as usize];
        pages.push(match file.0[record as usize + 14] {
            0 => raw(bytes, counts),
            1 => coded(bytes, counts, model.as_ref().unwrap()),
            codec => panic!("codec {codec}"),
        });
        page += page_bytes;
    }
    // Where the family below each group lies that has one.
    let mut below = HashMap::new();
    for (number, page) in pages.iter().enumerate() {
        let mut cursors: Vec<(usize, usize)> =
            page.runs.iter().map(|(page, family)| (*page as usize, usize::from(*family))).collect();
        let mut links = page.links.iter();
        for (family, groups) in page.families.iter().enumerate() {
            for (group, nodes) in groups.iter().enumerate() {
                if nodes.iter().any(|(bits, _)| bits & 6 != 0) {
                    let (run, skip) = links.next().unwrap();
                    let cursor = &mut cursors[usize::from(*run)];
                    cursor.1 += usize::from(*skip);
                    while cursor.1 >= pages[cursor.0].families.len() {
                        *cursor = (cursor.0 + 1, cursor.1 - pages[cursor.0].families.len());
                    }
                    assert!(*cursor > (number, family), "forwards");
                    assert!(below.insert((number, family, group), *cursor).is_none());
                    cursor.1 += 1;
                }
            }
        }
        assert_eq!(links.next(), None);
    }

    let codes = sphere_codes();
    let root = ([24, 28, 32].map(|at| file.f32(skeleton + at)), file.f32(skeleton + 36));
    // The groups to come: where they are, and the decoded ball and number of children of their parents.
    let mut next = VecDeque::from([((0, 0, 0), None)]);
    let mut seen = Vec::new();
    while let Some(((page, family, group), parent)) = next.pop_front() {
        let nodes = &pages[page].families[family][group];
        let mut child_group = 0;
        for (bits, color) in nodes {
            let ball = match parent {
                None => root,
                Some(((center, radius), announced)) => {
                    assert_eq!(announced, nodes.len());
                    child_ball(center, radius, codes[(bits >> 19) as usize])
                }
            };
            let children = if bits >> 1 & 3 == 0 { 0 } else { (bits >> 1 & 3) + 1 };
            if children > 0 {
                let (page, family) = below[&(page, family, group)];
                next.push_back(((page, family, child_group), Some((ball, children as usize))));
                child_group += 1;
            }
            let (normal, cone) = (bits >> 5 & 0x3FFF, bits >> 3 & 3);
            seen.push(Seen { center: ball.0, radius: ball.1, normal, cone, color: *color, children });
        }
    }
    assert_eq!(seen.len() as u64, file.u64(skeleton + 92), "groups are missing, or appear twice");
    seen
}

/// What [`read`] should see of a tree, with spheres as the engine decodes them.
pub(crate) fn expected(tree: &Tree, root: Sphere) -> Vec<Seen> {
    let mut queue = VecDeque::from([(0, root)]);
    let mut seen = Vec::new();
    while let Some((index, ball)) = queue.pop_front() {
        let node = &tree.nodes[index];
        seen.push(Seen {
            center: ball.center.to_array(),
            radius: ball.radius,
            normal: u32::from(node.normal),
            cone: u32::from(node.cone),
            color: tree.has_colors.then_some(node.color),
            children: node.children.len() as u32,
        });
        queue.extend(
            node.children
                .iter()
                .map(|child| (*child, gigalod_geom::quantise::sphere::decode(&ball, tree.nodes[*child].sphere))),
        );
    }
    seen
}

#[test]
fn the_documents_sphere_codes_and_checksum_are_the_engines() {
    let codes = sphere_codes();
    assert_eq!(codes.len(), gigalod_geom::quantise::sphere::CODES);
    for (code, relative) in codes.iter().zip(gigalod_geom::quantise::sphere::table()) {
        assert_eq!(child_ball([0.0; 3], 1.0, *code), (relative.offset.to_array(), relative.scale));
    }
    // RFC 3720, appendix B.4.
    assert_eq!((crc32c(&[0; 32]), gigalod_format::checksum(&[0; 32])), (0x8A91_36AA, 0x8A91_36AA));
}

#[test]
fn the_documents_normals_are_the_engines() {
    for (code, normal) in gigalod_geom::quantise::normal::table().iter().enumerate() {
        let (face, row, column) = (code / 2704, code / 52 % 52, code % 52);
        let slope = |cell: usize| (std::f64::consts::FRAC_PI_4 * ((2 * cell + 1) as f64 / 52.0 - 1.0)).tan();
        let mut n = [0.0; 3];
        n[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
        n[(face / 2 + 1) % 3] = slope(column);
        n[(face / 2 + 2) % 3] = slope(row);
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        for axis in 0..3 {
            assert!((n[axis] / length - f64::from(normal[axis])).abs() < 1e-7, "code {code}");
        }
    }
}
