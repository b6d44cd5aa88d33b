//! `verify`, `info` and `compare`: what they find, and what they do not.

mod cli_support;

use cli_support::{Part, crc32, damaged, larger_splat_statue, other_splat_statue, splat_statue as statue};
use std::fs::File;
use std::path::Path;

#[test]
fn verify_finds_good_files_good_and_measures_no_violations() {
    for model in [statue(), other_splat_statue(), larger_splat_statue()] {
        let info = run!["info", model.glod, "--json"].done().json();
        let found = run!["verify", model.glod, "--against", model.ply, "--json"].done().json();
        assert_eq!((&found["ok"], &found["problems"]), (&true.into(), &serde_json::json!([])));
        assert_eq!(found["nodes_checked"], info["nodes"], "all of them");
        let measured = |name: &str| found["measured"][name].as_f64().unwrap();
        assert_eq!(measured("violations"), 0.0);
        assert!(measured("worst_ratio") > 0.0 && measured("worst_ratio") <= 1.0, "{found}");
        assert!(measured("rms") > 0.0 && measured("rms") < measured("hausdorff"), "{found}");
    }
}

#[test]
fn verify_against_another_model_finds_violations() {
    let ran = run!["verify", statue().glod, "--against", other_splat_statue().ply, "--json"];
    let found = ran.json();
    assert_eq!((ran.status, &found["ok"]), (1, &false.into()));
    assert!(found["measured"]["violations"].as_u64().unwrap() > 0 && !found["problems"][0].is_null(), "{found}");
    assert!(found["measured"]["worst_ratio"].as_f64().unwrap() > 1.0, "{found}");
    let first = format!("warning: {}: built from another model than the one ", statue().glod.display());
    assert!(ran.stderr.starts_with(&first), "said before anything is measured: {ran:?}");
    assert_eq!(ran.stderr.matches("built from another model").count(), 1, "{ran:?}");
    let points = tempfile::Builder::new().suffix(".xyz").tempfile().unwrap();
    std::fs::write(&points, "0 0 0\n1 0 0\n0 1 0\n").unwrap();
    let ran = run!["verify", statue().glod, "--against", points.path(), "--json"];
    ran.failed(points.path());
    assert!(ran.stderr.contains("a cloud of points, expected a mesh"), "{ran:?}");
    let missing = Path::new("missing.ply");
    run!["verify", statue().glod, "--against", missing, "--json"].failed(missing);
}

#[test]
fn verify_names_damaged_pages() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.glod");
    for (part, page) in [(Part::FirstPage, "page 0 "), (Part::LastPage, "page ")] {
        damaged(&statue().glod, part, &bad);
        for against in [&[][..], &["--against", statue().ply.to_str().unwrap()]] {
            let ran = cli_support::gigalod(["verify", bad.to_str().unwrap(), "--json"].iter().chain(against));
            let found = ran.json();
            assert_eq!((ran.status, &found["ok"]), (1, &false.into()), "{part:?}");
            let problem = found["problems"][0].as_str().unwrap();
            assert!(problem.contains(page) && problem.contains("checksum"), "{part:?}: {problem}");
            assert!(ran.stderr.contains("warning: ") && ran.stderr.contains(problem), "{ran:?}");
        }
        let ran = run!["verify", bad];
        assert_eq!((ran.status, ran.stdout.lines().count()), (1, 1), "{ran:?}");
    }
}

#[test]
fn a_damaged_header_or_skeleton_is_an_error_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let (bad, out) = (folder.path().join("bad.glod"), folder.path().join("out"));
    let refused = |what: &str| {
        run!["info", bad, "--json"].failed(&bad);
        run!["verify", bad, "--json"].failed(&bad);
        run!["render", bad, "-o", out, "--json"].failed(&bad);
        run!["synth", "path", "orbit", "--around", bad, "-o", out, "--json"].failed(&bad);
        assert!(!out.exists(), "{what}");
    };
    for part in [Part::Header, Part::Skeleton] {
        damaged(&statue().glod, part, &bad);
        refused("a byte changed");
    }
    let good = std::fs::read(&statue().glod).unwrap();
    for end in [0, 4, 8, 100, 128, 200, good.len() - 1] {
        std::fs::write(&bad, &good[..end]).unwrap();
        refused("cut off");
    }
    std::fs::write(&bad, [&good[..], b"!"].concat()).unwrap();
    refused("one byte too many");
    damaged(&statue().glod, Part::Metadata, &bad);
    run!["info", bad, "--json"].failed(&bad);
    run!["verify", bad, "--json"].failed(&bad);
}

#[test]
fn info_tells_what_build_told_and_adds_up() {
    for model in [statue(), larger_splat_statue()] {
        let folder = tempfile::tempdir().unwrap();
        let built =
            run!["build", model.ply, "-o", folder.path().join("a.glod"), "--as", "splats", "--json"].done().json();
        let info = run!["info", model.glod, "--json"].done().json();
        for key in ["kind", "input", "options", "nodes", "levels", "leaves", "repeated"] {
            assert_eq!(info[key], built[key], "{key}");
        }
        assert_eq!(info["bytes"], built["output_bytes"]);
        assert_eq!((&info["version"], &info["closed"]), (&1.into(), &true.into()));
        let levels = info["per_level"].as_array().unwrap();
        assert_eq!(info["levels"], levels.len());
        let sum = |key: &str| levels.iter().map(|level| level[key].as_u64().unwrap()).sum::<u64>();
        assert_eq!(info["nodes"], sum("nodes"));
        assert!(sum("bytes") <= info["bytes"].as_u64().unwrap());
        for (at, pair) in levels.windows(2).enumerate() {
            assert_eq!(pair[0]["level"], at);
            assert!(pair[0]["max_error"].as_f64() >= pair[1]["max_error"].as_f64(), "finer below: {}", pair[1]);
        }
        for axis in 0..3 {
            assert!(info["bounds"]["min"][axis].as_f64() < info["bounds"]["max"][axis].as_f64());
        }
    }
    let ran = run!["info", statue().ply, "--json"];
    assert!(ran.failed(&statue().ply).contains("not a .glod file"), "a raw model is none");
}

/// A gray picture with one pixel of another value.
fn gray(path: &Path, size: [u32; 2], value: u8, first: u8) {
    let mut pixels = vec![value; (size[0] * size[1]) as usize];
    pixels[0] = first;
    let mut encoder = png::Encoder::new(File::create(path).unwrap(), size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
}

#[test]
fn compare_gives_the_figures_that_are_known_beforehand() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    let figures = || {
        let found = run!["compare", a, b, "--json"].done().json();
        let figure = |name: &str| found[name].as_f64();
        (figure("psnr_db"), figure("ssim").unwrap(), figure("flip_mean").unwrap(), found["max_diff"].as_u64().unwrap())
    };
    gray(&a, [40, 30], 100, 100);
    gray(&b, [40, 30], 100, 100);
    assert_eq!(figures(), (None, 1.0, 0.0, 0), "identical");

    gray(&b, [40, 30], 101, 101);
    let (psnr, ssim, flip, most) = figures();
    assert!((psnr.unwrap() - 20.0 * 255f64.log10()).abs() < 1e-6, "{psnr:?}: one level off everywhere");
    assert!(ssim > 0.99 && flip > 0.0 && flip < 0.05 && most == 1, "{ssim} {flip} {most}");

    gray(&b, [40, 30], 100, 200);
    let (psnr, ssim, flip, most) = figures();
    let expected = 10.0 * (255.0 * 255.0 / (100.0 * 100.0 / 1200.0_f64)).log10();
    assert!((psnr.unwrap() - expected).abs() < 1e-6, "{psnr:?}: one pixel off");
    assert!(ssim < 1.0 && flip > 0.0 && flip < 0.1 && most == 100, "{ssim} {flip} {most}");
}

#[test]
fn compare_refuses_pictures_of_different_sizes_and_what_is_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    gray(&a, [40, 30], 100, 100);
    gray(&b, [30, 40], 100, 100);
    let what = run!["compare", a, b, "--json"].failed(&b);
    assert!(what.contains("30x40") && what.contains("40x30"), "{what}");
    std::fs::write(&b, "no picture").unwrap();
    run!["compare", a, b, "--json"].failed(&b);
    let whole = std::fs::read(&a).unwrap();
    std::fs::write(&b, &whole[..whole.len() - 20]).unwrap();
    run!["compare", a, b, "--json"].failed(&b);
}

#[test]
fn a_few_bytes_that_claim_to_be_a_huge_picture_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let huge = folder.path().join("huge.png");
    for side in [1_000_000u32, 0x7fff_ffff] {
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        let header = [&side.to_be_bytes()[..], &side.to_be_bytes(), &[8, 6, 0, 0, 0]].concat();
        for (name, data) in [(b"IHDR", &header[..]), (b"IDAT", b"x"), (b"IEND", b"")] {
            let chunk = [name, data].concat();
            bytes.extend((data.len() as u32).to_be_bytes());
            bytes.extend(&chunk);
            bytes.extend(crc32(&chunk).to_be_bytes());
        }
        std::fs::write(&huge, &bytes).unwrap();
        run!["compare", huge, huge, "--json"].failed(&huge);
    }
}
