//! Properties of hierarchies whose large triangles were diced. The judge knows nothing of how they were cut.

mod common;
mod painted;

use common::open;
use gigalod::build::{BuildError, Options, Progress, splats};
use gigalod::format::{Dicing, Metadata};
use gigalod::geom::color::srgb8_of_rgb565;
use gigalod::import::{Mapping, Material, Texture, Wrap};
use gigalod::verify::{self, Measured, Sampled, SplatTree};
use gigalod_reference::Bvh;
use gigalod_reference::delta_e::{delta_e, lab};
use gigalod_reference::shade::srgb8_of_linear;
use glam::DVec3;
use painted::Painted;
use proptest::prelude::*;
use std::path::Path;
use std::sync::Mutex;

/// Keeps notes.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn begin(&self, _phase: &'static str, _total: u64) {}
    fn at(&self, _done: u64) {}
    fn note(&self, text: &str) {
        self.0.lock().unwrap().push(text.to_string());
    }
}

fn build(model: &Painted, options: &Options, out: &Path) -> Result<Vec<String>, BuildError> {
    let notes = Notes::default();
    splats::build(Box::new(model.clone()), options, &notes, out)?;
    Ok(notes.0.into_inner().unwrap())
}

/// A built model, held against the original.
struct Built {
    tree: SplatTree,
    origin: DVec3,
    metadata: Metadata,
    measured: Measured,
}

fn builds_soundly(model: &Painted, options: &Options) -> Built {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    build(model, options, &out).unwrap();
    let file = open(&out);
    let (tree, problems) = verify::check(&file, &mut |_| {});
    assert_eq!(problems.told, Vec::<String>::new());
    let metadata = file.container().read_metadata().unwrap();
    let origin = file.skeleton().root().origin;
    let sampled = metadata.dicing.map(|dicing| Sampled::of(dicing.spacing, &model.batch(), &model.looks));
    let measured = verify::against(&tree, origin, &model.mesh(), sampled.as_ref(), &|_| ());
    assert_eq!(measured.violations, 0, "{measured:?}");
    Built { tree, origin, metadata, measured }
}

impl Built {
    /// Those that repeat others not counted.
    fn leaves_once(&self) -> u64 {
        self.metadata.leaves - self.metadata.repeated
    }

    fn dicing(&self) -> Dicing {
        self.metadata.dicing.expect("something was diced")
    }

    /// Leaves are half a diagonal of a square of the spacing, but for what the format makes of it: no child is smaller than a
    /// thirteenth of its parent.
    fn expect_radii(&self, spacing: f64) {
        let radii: Vec<f64> = self.leaves().map(|(_, radius, _)| radius).collect();
        let (mean, most) = (radii.iter().sum::<f64>() / radii.len() as f64, radii.iter().copied().fold(0.0, f64::max));
        assert!(mean < spacing && most < 4.0 * spacing, "{mean} {most} {spacing}");
    }

    /// Centres in model space, radii, colours in 8-bit sRGB.
    fn leaves(&self) -> impl Iterator<Item = (DVec3, f64, [u8; 3])> {
        let leaves = self.tree.nodes.iter().filter(|node| node.children == 0);
        leaves.map(|leaf| {
            let center = self.origin + leaf.sphere.center.as_dvec3();
            (center, f64::from(leaf.sphere.radius), leaf.color.map(srgb8_of_rgb565).unwrap_or_default())
        })
    }
}

fn spaced(spacing: f64) -> Options {
    Options { spacing: Some(spacing), ..Options::default() }
}

fn soups() -> impl Strategy<Value = (Painted, f64)> {
    // Few distinct coordinates make coinciding vertices and degenerate triangles; scales and offsets make rounding hurt; sizes range
    // over four powers of ten.
    let coordinate = prop_oneof![(-4i32..4).prop_map(f64::from), -1.0f64..1.0, -1e-3f64..1e-3];
    (
        prop::collection::vec(prop::array::uniform3(coordinate), 1..40),
        prop_oneof![Just(1.0), Just(1e-9), Just(1e9)],
        prop_oneof![Just(0.0), Just(1e6)],
        0.1f64..2.0,
        0u8..3,
    )
        .prop_flat_map(|(positions, scale, offset, spacing, kind)| {
            let positions: Vec<DVec3> =
                positions.into_iter().map(|p| (DVec3::from_array(p) + offset) * scale).collect();
            let count = positions.len() as u32;
            let triangles = prop::collection::vec(prop::array::uniform3(0..count), 1..30);
            triangles.prop_map(move |triangles| {
                let mut model = Painted { positions: positions.clone(), triangles, ..Painted::default() };
                if kind > 0 {
                    model.normals = positions.iter().map(|at| at.as_vec3()).collect();
                }
                if kind > 1 {
                    model.colors = vec![[9, 200, 30]; positions.len()];
                    model.materials = (0..model.triangles.len() as u32).map(|at| at % 2).collect();
                    model.looks = vec![Material { color: [255, 0, 0], ..Material::plain("red".into()) }; 2];
                }
                (model, spacing * scale)
            })
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_soups_are_covered_at_any_spacing((model, spacing) in soups()) {
        let built = builds_soundly(&model, &spaced(spacing));
        prop_assert!(built.metadata.dicing.is_some() || model.materials.is_empty());
    }
}

/// A picture in which colours change slowly, and how often it repeats.
fn waves(model: &mut Painted, size: u32) -> u32 {
    let wave = |at: u32| (128.0 + 100.0 * (f64::from(at) / f64::from(size) * std::f64::consts::TAU).sin()) as u8;
    model.picture(size, |x, y| [wave(x), wave(y), wave(x + 2 * y), 255])
}

#[test]
fn leaves_have_the_colours_of_textures_however_they_are_mapped() {
    let mut model = Painted::default();
    let picture = waves(&mut model, 256);
    let mapped = |wrap: [Wrap; 2], scale, offset| Material {
        mapping: Mapping { wrap, scale, offset },
        ..model.looks[picture as usize].clone()
    };
    let looks = [
        mapped([Wrap::Repeat; 2], [1.0; 2], [0.0; 2]),
        mapped([Wrap::Repeat, Wrap::Mirror], [2.0, 3.0], [-0.3, 0.1]),
        mapped([Wrap::Mirror, Wrap::Clamp], [-2.0, 1.4], [0.5, -0.2]),
        mapped([Wrap::Clamp, Wrap::Repeat], [1.5, -1.0], [-0.25, 0.0]),
        Material { color: [255, 128, 60], ..mapped([Wrap::Repeat; 2], [1.0; 2], [0.0; 2]) },
        Material { color: [40, 80, 250], ..Material::plain("blue".into()) },
        Material { color: [0, 0, 0], is_in_vertices: true, ..Material::plain("as vertices".into()) },
    ];
    model.looks = looks.to_vec();
    let directions = [DVec3::X * 3.0, DVec3::Y * 2.0, DVec3::Z * 2.5, DVec3::new(2.0, 1.0, 0.5)];
    for number in 0..7 {
        let sides = [directions[number % 4], directions[(number + 1) % 4]];
        model.wall(DVec3::splat(10.0 * number as f64), sides, number as u32);
    }
    // No look at all is white.
    model.wall(DVec3::splat(80.0), [DVec3::X, DVec3::Y], u32::MAX);
    for colored in [false, true] {
        if colored {
            model.colors = (0..model.positions.len()).map(|at| [255, 255 - (at % 4 * 40) as u8, 200]).collect();
        }
        let built = builds_soundly(&model, &spaced(0.05));
        let Dicing { spacing, triangles, samples } = built.dicing();
        assert_eq!((spacing, triangles, samples), (0.05, 16, built.leaves_once()));
        let mesh = model.mesh();
        let bvh = Bvh::build(&mesh);
        let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0.0);
        built.expect_radii(0.05);
        for (center, _, color) in built.leaves() {
            let nearest = bvh.nearest_point(center).unwrap();
            let expected = srgb8_of_linear(mesh.linear_color(nearest.triangle, nearest.barycentrics).unwrap());
            let off = delta_e(lab(color), lab(expected));
            (worst, sum, count) = (worst.max(off), sum + off, count + 1.0);
        }
        println!("{count} leaves, ΔE of their colours {:.2} on average, {worst:.2} at most", sum / count);
        // 5-6-5 bits, the step of a cell, and where the format puts it: the waves are a few cells long.
        assert!(sum / count < 1.5 && worst < 25.0, "{worst}");
    }
}

#[test]
fn a_leaf_has_the_mean_of_all_texels_that_it_covers() {
    // Texels so small that a leaf covers thousands: none, or their own, would be black or white.
    for (bits, expected) in [(1, 188), (2, 188)] {
        let mut model = Painted::default();
        let checker =
            model.picture(1024, |x, y| if (x / bits + y / bits) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
        model.wall(DVec3::ZERO, [DVec3::X, DVec3::Y], checker);
        let built = builds_soundly(&model, &spaced(0.06));
        // Half the light is 188 in sRGB.
        for (_, _, color) in built.leaves() {
            assert!(color.iter().all(|value: &u8| value.abs_diff(expected) < 16), "{color:?}");
        }
    }
}

#[test]
fn what_a_mask_leaves_out_is_no_leaf() {
    let mut model = Painted::default();
    // A disc in a clear square.
    let is_in = |x: f64, y: f64, radius: f64| (x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5) < radius * radius;
    let disc = model.picture(256, |x, y| {
        let inside = is_in((f64::from(x) + 0.5) / 256.0, (f64::from(y) + 0.5) / 256.0, 0.3);
        if inside { [200, 30, 10, 255] } else { [0, 255, 0, 0] }
    });
    model.looks[disc as usize].alpha_cutoff = Some(128);
    model.wall(DVec3::ZERO, [DVec3::X, DVec3::Y], disc);
    let built = builds_soundly(&model, &spaced(0.02));
    let mut area = 0.0;
    for (center, radius, color) in built.leaves() {
        assert!(is_in(center.x, center.y, 0.3 + 0.03), "{center}");
        assert!(color[0] > 180 && color[1] < 60, "the colour of what is clear does not count: {color:?}");
        area += 2.0 * radius * radius;
    }
    assert!(area > 0.28, "as large as the disc: {area}");
    assert!(built.leaves().any(|(center, ..)| !is_in(center.x, center.y, 0.28)));
    // All of it clear: nothing to show.
    model.looks[disc as usize].mapping = Mapping { scale: [0.05; 2], ..Mapping::default() };
    let folder = tempfile::tempdir().unwrap();
    let error = build(&model, &spaced(0.02), &folder.path().join("a.glod")).unwrap_err();
    assert_eq!(error.to_string(), "no triangles and no points, expected at least one");
}

/// A wavy grid of so many vertices along a side, 1 apart.
fn grid(side: u32) -> Painted {
    let mut model = Painted::default();
    model.positions.extend((0..side * side).map(|at| {
        let (x, y) = (f64::from(at % side), f64::from(at / side));
        DVec3::new(x, y, (x * 0.31).sin() * (y * 0.17).cos() * 5.0)
    }));
    model.triangles.extend((0..(side - 1) * (side - 1)).flat_map(|at| {
        let a = at / (side - 1) * side + at % (side - 1);
        [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]
    }));
    model
}

#[test]
fn of_a_scan_only_what_is_out_of_scale_is_diced() {
    let mut scan = grid(120);
    let built = builds_soundly(&scan, &Options::default());
    assert!(built.metadata.dicing.is_none() && built.leaves_once() == 14_400);
    assert!(!built.metadata.options.contains_key("spacing"));
    let before: f64 = built.leaves().map(|(_, radius, _)| radius).fold(0.0, f64::max);
    // A base below it, which shares the scan's corners.
    let first = scan.positions.len() as u32;
    scan.positions
        .extend([[0.0, 0.0], [119.0, 0.0], [119.0, 119.0], [0.0, 119.0]].map(|[x, y]| DVec3::new(x, y, -20.0)));
    scan.triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2], [0, first, 119]]);
    let built = builds_soundly(&scan, &Options::default());
    let Dicing { spacing, triangles, samples } = built.dicing();
    assert_eq!((triangles, built.leaves_once()), (3, 14_400 + samples), "the base has no vertices of its own");
    assert!((0.9..2.0).contains(&spacing), "as fine as the scan: {spacing}");
    assert_eq!(built.metadata.options["spacing"], spacing.to_string());
    let after = built.leaves().map(|(_, radius, _)| radius).fold(0.0, f64::max);
    assert!(after <= before.max(spacing) * 3.0, "not as large as the base: {after} {before}");
    assert!(built.measured.hausdorff < 6.0);
}

#[test]
fn a_house_becomes_a_quarter_of_a_million_small_leaves() {
    let mut house = Painted::default();
    for (corner, sides) in [
        (DVec3::ZERO, [DVec3::X * 10.0, DVec3::Y * 6.0]),
        (DVec3::ZERO, [DVec3::Y * 6.0, DVec3::Z * 8.0]),
        (DVec3::new(10.0, 6.0, 8.0), [DVec3::X * -10.0, DVec3::Z * -8.0]),
        (DVec3::new(4.0, 6.0, 4.0), [DVec3::Y * 0.01, DVec3::X * 0.01]),
    ] {
        house.wall(corner, sides, 0);
    }
    (house.corners, house.materials) = (vec![], vec![]);
    let built = builds_soundly(&house, &Options::default());
    let Dicing { spacing, triangles, samples } = built.dicing();
    assert_eq!((triangles, built.leaves_once()), (6, samples + 4), "the tiny one stays as it is");
    assert!((200_000..270_000).contains(&samples), "{samples}");
    built.expect_radii(spacing);
}

/// Walls with all that can be carried, and many small triangles.
fn town() -> Painted {
    let mut model = grid(60);
    model.corners = vec![[u32::MAX; 3]; model.triangles.len()];
    model.materials = vec![u32::MAX; model.triangles.len()];
    let pictures = [waves(&mut model, 200), waves(&mut model, 70)];
    for at in 0..40u32 {
        let corner = DVec3::new(f64::from(at % 7) * 9.0, f64::from(at / 7) * 9.0, f64::from(at % 5));
        let sides = [DVec3::new(f64::from(at % 3) * 0.1, 0.0, 5.0), DVec3::new(3.0, f64::from(at % 4), 0.0)];
        model.wall(corner, sides, pictures[at as usize % 2]);
    }
    model.normals = model.positions.iter().map(|at| at.as_vec3()).collect();
    model.colors = (0..model.positions.len()).map(|at| [(at % 256) as u8, 200, (at / 7 % 256) as u8]).collect();
    model
}

#[test]
fn bytes_do_not_depend_on_threads_memory_or_order() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let mut plain = town();
    (plain.corners, plain.materials, plain.tex_coords) = (vec![], vec![], vec![]);
    for (name, mut model) in [("painted", town()), ("plain", plain)] {
        let bytes = |model: &Painted, threads: usize, memory_bytes: u64| {
            build(model, &Options { threads, memory_bytes, ..spaced(0.11) }, &out).unwrap();
            std::fs::read(&out).unwrap()
        };
        let first = bytes(&model, 1, 2 << 30);
        assert!(first == bytes(&model, 2, 2 << 30) && first == bytes(&model, 5, 2 << 30), "{name}: threads");
        assert!(first == bytes(&model, 2, 64 << 20) && first == bytes(&model, 5, 8 << 20), "{name}: memory");
        let shuffled = model.shuffled();
        assert!(first == bytes(&shuffled, 2, 2 << 30) && first == bytes(&shuffled, 2, 8 << 20), "{name}: order");
        // Where the model is in memory, and where its samples are not.
        model.is_declared = true;
        assert!(first == bytes(&model, 2, 2 << 30) && first == bytes(&model, 2, 16 << 20), "{name}: in memory");
        assert!(first == bytes(&Painted { is_declared: true, ..shuffled }, 2, 2 << 30), "{name}: order in memory");
    }
}

#[test]
fn a_picture_that_is_missing_or_damaged_leaves_the_materials_colour_and_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let mut model = Painted::default();
    let picture = waves(&mut model, 64);
    model.looks[picture as usize].color = [200, 40, 40];
    model.wall(DVec3::ZERO, [DVec3::X, DVec3::Y], picture);
    let whole = model.pictures[0].to_vec();
    assert_eq!(build(&model, &spaced(0.1), &out).unwrap(), Vec::<String>::new());
    let mut odd = vec![vec![], b"no picture".to_vec(), whole[..40].to_vec(), whole[..whole.len() / 2].to_vec()];
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 0x55;
    odd.push(flipped);
    // A header that promises 4 billion texels on a side.
    let mut huge = whole.clone();
    huge[16..24].fill(0x7f);
    odd.push(huge);
    for file in odd {
        model.pictures[0] = file.into();
        let notes = build(&model, &spaced(0.1), &out).unwrap();
        assert!(notes.len() == 1 && notes[0].starts_with("picture 0: "), "{notes:?}");
        assert!(notes[0].ends_with("; its material's colour is shown instead"), "{notes:?}");
        let built = builds_soundly(&model, &spaced(0.1));
        assert!(
            built.leaves().all(|(_, _, [r, g, b])| r.abs_diff(200) < 9 && g.abs_diff(40) < 9 && b.abs_diff(40) < 9)
        );
    }
    model.pictures.clear();
    model.looks[picture as usize].texture = Some(Texture::File("a\nb.png".into()));
    let notes = build(&model, &spaced(0.1), &out).unwrap();
    assert!(notes[0].starts_with("picture a\\nb.png: ") && notes[0].lines().count() == 1, "{notes:?}");
}

#[test]
fn a_picture_that_memory_has_no_room_for_is_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let mut model = Painted::default();
    let picture = model.picture(1024, |x, y| [x as u8, y as u8, 0, 255]);
    model.wall(DVec3::ZERO, [DVec3::X, DVec3::Y], picture);
    let options = |memory_bytes| Options { memory_bytes, ..spaced(0.1) };
    let error = build(&model, &options(4 << 20), &out).unwrap_err().to_string();
    let rest = "bytes to be decoded, expected at most 2097152 within this budget";
    assert!(error.starts_with("picture 0 needs 6") && error.ends_with(rest), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
    build(&model, &options(64 << 20), &out).unwrap();
}

#[test]
fn a_spacing_that_no_file_could_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glod");
    let error = build(&grid(30), &spaced(1e-9), &out).unwrap_err().to_string();
    assert!(
        error.starts_with("about ") && error.ends_with("at a spacing of 0.000000001, expected fewer than 2^31"),
        "{error}"
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}
