//! Cuts: complete, independent of culling, honest about their error.

mod common;

use common::{camera, open, scene, statue, statue_bytes};
use gigalod_format::splats::page::CODEC_RAW;
use gigalod_format::splats::{PageContents, PageId, PageRecord, Skeleton, SplatFile, WordIndex};
use gigalod_runtime::splats::Cutting;
use gigalod_runtime::splats::plain::{Culled, CutSink, VisitedNode, Work, cut};
use gigalod_runtime::{
    CutReport, FileId, Fineness, Interrupt, Limit, ModelView, Scene, SelectInput, Similarity, ViewId,
};
use std::collections::BTreeMap;

/// Where a node is stored.
type Place = (PageId, WordIndex);

#[derive(Default)]
struct Record {
    drawn: BTreeMap<Place, VisitedNode>,
    culled: BTreeMap<Place, Culled>,
    misses: usize,
}

impl CutSink for Record {
    fn draw(&mut self, node: &VisitedNode) {
        assert!(self.drawn.insert(node.place, *node).is_none(), "drawn twice");
    }

    fn cull(&mut self, node: &VisitedNode, why: Culled) {
        assert!(self.culled.insert(node.place, why).is_none(), "culled twice");
    }

    fn miss(&mut self, _page: PageId, _error_px: f32) {
        self.misses += 1;
    }
}

fn record(scene: &Scene, azimuth: f64, zoom: f64, threshold_px: f32, cutting: Cutting) -> (CutReport, Record) {
    let view = ModelView::new(&camera(scene, azimuth, zoom), &Similarity::IDENTITY);
    let interrupt = Interrupt::default();
    let input = SelectInput::px(FileId(0), view, threshold_px, &interrupt, scene.residency());
    let mut record = Record::default();
    let report = cut(&input, &cutting, &mut Work::default(), &mut record);
    (report, record)
}

fn everything_resident() -> Scene {
    let mut scene = scene(statue(), 1 << 30);
    let camera = camera(&scene, 0.0, 0.3);
    scene.select_converged(ViewId(9), &camera, &Fineness::px(0.0));
    // From inside its bounds nothing is hidden, so the far side is loaded too.
    for azimuth in [0.0, 90.0, 180.0, 270.0] {
        let camera = common::camera(&scene, azimuth, 0.3);
        scene.select_converged(ViewId(9), &camera, &Fineness::px(0.0));
    }
    scene
}

/// All leaves below each node, by following the file's own pointers.
fn leaves_below(file: &SplatFile) -> BTreeMap<Place, Vec<Place>> {
    let pages: Vec<_> = (0..file.skeleton().pages().len() as u32).map(|p| file.read_page(PageId(p)).unwrap()).collect();
    fn walk(
        pages: &[gigalod_format::splats::Page],
        group: Place,
        count: u8,
        out: &mut BTreeMap<Place, Vec<Place>>,
    ) -> Vec<Place> {
        let page = &pages[group.0.0 as usize];
        let start = usize::from(group.1.0);
        let mut below_all = Vec::new();
        let family = page.words().get(start + usize::from(count)).map(|word| page.family(*word));
        let mut before = 0;
        for at in start..start + usize::from(count) {
            let place = (group.0, WordIndex(at as u16));
            let children = gigalod_format::splats::Node(page.words()[at]).children();
            let below = if children.count == 0 {
                vec![place]
            } else {
                let family = family.expect("inner nodes have a pointer");
                let first = pages[family.page.0 as usize].family_word(family.family).expect("the family is there");
                let start = WordIndex(first.0 + before);
                before += children.words() as u16;
                walk(pages, (family.page, start), children.count, out)
            };
            below_all.extend(&below);
            out.insert(place, below);
        }
        below_all
    }
    let mut out = BTreeMap::new();
    walk(&pages, (PageId(0), WordIndex(0)), 1, &mut out);
    out
}

#[test]
fn every_leaf_lies_below_exactly_one_node_that_is_drawn_or_culled() {
    let scene = everything_resident();
    let below = leaves_below(scene.residency().file(FileId(0)).splats().unwrap());
    let leaves = below.values().filter(|leaves| leaves.len() == 1).flatten().collect::<std::collections::BTreeSet<_>>();
    for (zoom, threshold_px) in [(1.0, 1.0), (1.0, 8.0), (6.0, 2.0), (40.0, 1.0), (0.02, 1.0)] {
        let (report, record) = record(&scene, 35.0, zoom, threshold_px, Cutting::default());
        let mut reached: Vec<Place> =
            record.drawn.keys().chain(record.culled.keys()).flat_map(|place| below[place].clone()).collect();
        assert_eq!(reached.len(), leaves.len(), "zoom {zoom}");
        reached.sort();
        reached.dedup();
        assert_eq!(reached.len(), leaves.len(), "no leaf is reached twice");
        assert_eq!(report.drawn, record.drawn.len() as u64);
        assert_eq!(report.culled_frustum + report.culled_backface, record.culled.len() as u64);
        assert_eq!(record.misses, 0);
    }
}

#[test]
fn backface_culling_changes_nothing_that_is_drawn() {
    let scene = everything_resident();
    assert!(scene.residency().file(FileId(0)).splats().unwrap().skeleton().root().closed, "the statue is closed");
    for (azimuth, zoom, threshold_px) in [(0.0, 1.0, 1.0), (120.0, 1.0, 6.0), (200.0, 2.5, 2.0)] {
        let cutting = |backface_culling| Cutting { backface_culling, ..Cutting::default() };
        let (with, drawn_with) = record(&scene, azimuth, zoom, threshold_px, cutting(true));
        let (without, drawn_without) = record(&scene, azimuth, zoom, threshold_px, cutting(false));
        let places = |record: &Record| record.drawn.keys().copied().collect::<Vec<_>>();
        assert!(places(&drawn_with) == places(&drawn_without), "from {azimuth}");
        assert!(with.visited < without.visited, "culling saves work: {} of {}", with.visited, without.visited);
        assert!(with.culled_backface > 0);
    }
}

#[test]
fn no_drawn_node_is_coarser_than_asked_for_unless_the_report_says_so() {
    let scene = everything_resident();
    for threshold_px in [0.5, 1.0, 4.0, 30.0] {
        let (report, record) = record(&scene, 60.0, 3.0, threshold_px, Cutting::default());
        let view = ModelView::new(&camera(&scene, 60.0, 3.0), &Similarity::IDENTITY);
        let mut worst = 0.0f32;
        for node in record.drawn.values() {
            let depth = node.center_in_eye.dot(view.forward);
            let squared = node.center_in_eye.length_squared();
            let px = gigalod_geom::projected::diameter_px(depth, squared, node.radius, view.focal_px);
            assert!(px <= threshold_px * 1.0001 || node.node.is_leaf(), "{px}");
            worst = worst.max(px);
        }
        assert_eq!(report.max_error_px, worst);
        let data = worst > threshold_px;
        assert_eq!(report.limited_by, data.then_some(Limit::Data), "{threshold_px}: {worst}");
    }
}

#[test]
fn a_page_that_is_damaged_is_told_and_its_parents_are_drawn() {
    let mut bytes = statue_bytes().to_vec();
    let intact = statue();
    let last = PageId(intact.skeleton().pages().len() as u32 - 1);
    bytes[intact.skeleton().page_offset(last) as usize + 40] ^= 0x10;
    let mut scene = scene(open(bytes), 1 << 30);
    let camera = camera(&scene, 0.0, 0.5);
    let report = scene.select_converged(ViewId(0), &camera, &Fineness::px(0.0));
    let damaged: Vec<_> = scene.residency().damaged().map(|(key, why)| (key.page, why.to_string())).collect();
    assert_eq!(damaged.len(), 1);
    assert_eq!(damaged[0].0, last.into());
    assert!(damaged[0].1.starts_with(&format!("page {last} has checksum")), "{}", damaged[0].1);
    assert_eq!(report.limited_by, Some(Limit::Residency));
    assert!(!report.inconsistent && report.drawn > 10_000);
}

#[test]
fn tree_bits_that_lie_end_the_traversal_instead_of_running_on() {
    // Every node of the last page claims four children: sizes and checksums are made right, the tree is not.
    let file = statue();
    let mut records = file.skeleton().pages().to_vec();
    let mut pages = Vec::new();
    for (number, record) in records.iter_mut().enumerate() {
        let page = PageId(number as u32);
        let start = file.skeleton().page_offset(page) as usize;
        let coded = &statue_bytes()[start..start + record.bytes as usize];
        let mut contents = PageContents::decode(coded, file.skeleton(), page).unwrap();
        if number + 1 == file.skeleton().pages().len() {
            contents.nodes.iter_mut().for_each(|node| node.0 |= 6);
        }
        let bytes = contents.encode();
        *record = PageRecord {
            bytes: bytes.len() as u32,
            checksum: gigalod_format::checksum(&bytes),
            codec: CODEC_RAW,
            ..*record
        };
        pages.push(bytes);
    }
    let skeleton = Skeleton::encode(file.skeleton().root(), &records, None);
    let metadata = file.container().read_metadata().unwrap();
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer =
        gigalod_format::Writer::new(&mut out, gigalod_format::Kind::Splats, skeleton.len() as u64).unwrap();
    pages.iter().for_each(|page| writer.page(page).unwrap());
    writer.finish(&skeleton, &metadata).unwrap();
    let mut scene = scene(open(out.into_inner()), 1 << 30);
    let camera = camera(&scene, 0.0, 0.5);
    let report = scene.select_converged(ViewId(0), &camera, &Fineness::px(0.0));
    // Found when the page is decoded, or during the traversal; either way it is told, and the rest is drawn.
    assert!(report.inconsistent || scene.residency().damaged().count() == 1);
    assert!(report.drawn > 1000);
}
