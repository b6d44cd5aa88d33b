//! The command line as other tools see it: exit statuses, what stands on which stream, the keys of all JSON objects.

mod cli_support;

use cli_support::{Part, Ran, can_draw, command, damaged, names_in, other_splat_statue, shape, splat_statue, statue};
use std::fs::File;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

const INPUT: &str = "input{points triangles vertices}";
const SYNTH: &str = "{bytes output points seconds triangles vertices}";

#[test]
fn build_and_info_report_exactly_the_keys_of_the_contract() {
    let folder = tempfile::tempdir().unwrap();
    let reductions = "reduction[{below_two inner_nodes level one_child original ratio shading shape}]";
    for (kind, model, options, reduction) in [
        ("splats", splat_statue(), serde_json::json!({ "as": "splats", "up": "y" }), "reduction"),
        (
            "hybrid",
            statue(),
            serde_json::json!({ "appearance": "on", "as": "hybrid", "res": "64", "tmax": "4096", "up": "y" }),
            reductions,
        ),
    ] {
        let ran = run!["build", model.ply, "-o", folder.path().join("a.glod"), "--as", kind, "--json"].done();
        assert_eq!(
            shape(&ran.json()),
            format!(
                "{{cpu_seconds {INPUT} kind leaves levels nodes options{{..}} output_bytes peak_memory_bytes \
                 phases[{{name seconds}}] repeated resumed_after seconds}}"
            )
        );
        assert_eq!((&ran.json()["kind"], &ran.json()["options"]), (&kind.into(), &options));
        let ran = run!["--json", "info", model.glod].done();
        assert_eq!(
            shape(&ran.json()),
            format!(
                "{{attributes[] bounds{{max[] min[]}} bytes closed dicing {INPUT} kind leaves levels nodes \
                 options{{..}} per_level[{{bytes level max_error nodes points triangles}}] raw_bytes \
                 {reduction} reference_system repeated units version}}"
            )
        );
        assert_eq!((&ran.json()["kind"], &ran.json()["options"]), (&kind.into(), &options));
    }
}

#[test]
fn render_reports_exactly_the_keys_of_the_contract() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (model, threshold_px) in [(splat_statue(), 1.0), (statue(), 0.5)] {
        let ran = run!["render", model.glod, "-o", folder.path().join("a.png"), "--size", "64x36", "--json"].done();
        assert_eq!(
            shape(&ran.json()),
            "{adapter bytes_read converged cpu_bytes culled{backface frustum} drawn{lines nodes points triangles} \
             frame_ms gpu_bytes height limited_by max_error_px problems[] select_ms threshold_px width}"
        );
        assert_eq!((ran.json()["threshold_px"].as_f64(), &*ran.stderr), (Some(threshold_px), ""));
    }
}

#[test]
fn bench_reports_exactly_the_keys_of_the_contract() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turn.json");
    const FRAMES: &str = "frames[{frame_ms max_error_px moved page_misses pixel_edge_px points select_ms t threshold_px triangles upload_bytes}]";
    for (model, threshold_px) in [(splat_statue(), 1.0), (statue(), 0.5)] {
        run!["synth", "path", "sudden-turn", "--around", model.glod, "-o", path, "--seconds", "0.5"].done();
        let ran = run!["bench", model.glod, "--path", path, "--size", "64x36", "--json"].done();
        let json = ran.json();
        assert_eq!(
            shape(&json),
            format!("{{adapter {FRAMES} problems[] summary{{frame_ms_max frame_ms_median frame_ms_p95 paced rest}}}}")
        );
        let frames = json["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 16, "each pose once");
        assert!(frames.iter().all(|frame| frame["threshold_px"] == threshold_px));
        let ran = run!["bench", model.glod, "--path", path, "--size", "64x36", "--target-ms", "20", "--json"].done();
        let json = ran.json();
        assert_eq!(
            shape(&json),
            format!(
                "{{adapter {FRAMES} problems[] summary{{frame_ms_max frame_ms_median frame_ms_p95 \
                 paced{{frame_ms_median frame_ms_p05 frame_ms_p95 frames}} \
                 rest{{frames seconds sign_changes threshold_px}}}}}}"
            )
        );
        assert_eq!(json["summary"]["rest"]["threshold_px"], threshold_px, "at rest all is drawn");
        assert_eq!(json["summary"]["rest"]["sign_changes"], 0);
    }
}

#[test]
fn verify_and_compare_report_exactly_the_keys_of_the_contract() {
    let ran = run!["verify", splat_statue().glod, "--json"].done();
    assert_eq!(shape(&ran.json()), "{measured nodes_checked ok problems[]}");
    assert!(ran.json()["measured"].is_null(), "nothing to measure against");
    let ran = run!["verify", splat_statue().glod, "--against", splat_statue().ply, "--json"].done();
    assert_eq!(shape(&ran.json()), "{measured{hausdorff rms violations worst_ratio} nodes_checked ok problems[]}");
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a.png");
    let mut encoder = png::Encoder::new(File::create(&picture).unwrap(), 32, 32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[77; 32 * 32 * 3]).unwrap();
    let ran = run!["compare", picture, picture, "--json"].done();
    assert_eq!(shape(&ran.json()), "{flip_mean max_diff psnr_db ssim}");
}

#[test]
fn synth_and_demo_report_exactly_the_keys_of_the_contract() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    assert_eq!(shape(&run!["synth", "statue", "--triangles", "1k", "-o", out, "--json"].done().json()), SYNTH);
    let ran = run!["synth", "replicate", statue().ply, "--triangles", "30k", "-o", out, "--json"].done();
    assert_eq!(shape(&ran.json()), SYNTH);
    let ran = run!["synth", "path", "walk", "--around", statue().glod, "-o", out, "--json"].done();
    assert_eq!(shape(&ran.json()), SYNTH);
    assert_eq!(ran.json()["output"].as_str(), out.to_str());
    if !can_draw() {
        return;
    }
    let demo = folder.path().join("demo");
    let ran = run!["demo", "--triangles", "5000", "-o", demo, "--json"].done();
    assert_eq!(shape(&ran.json()), SYNTH);
    let names = names_in(&demo);
    assert_eq!(names.iter().filter(|name| name.ends_with(".png")).count(), 4, "{names:?}");
    assert_eq!(names.iter().filter(|name| name.starts_with('.')).count(), 0, "{names:?}");
}

#[test]
fn what_cannot_be_done_ends_with_status_1_and_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (missing, broken, nowhere) = (path("missing.ply"), path("broken.ply"), path("no/such/a.glod"));
    std::fs::write(&broken, "ply\nformat ascii 1.0\nelement vertex many\n").unwrap();
    let cut = path("cut.ply");
    let scan = std::fs::read(&statue().ply).unwrap();
    std::fs::write(&cut, &scan[..scan.len() / 2]).unwrap();
    let bad = path("bad.glod");
    damaged(&statue().glod, Part::Header, &bad);
    let before = names_in(folder.path());

    let out = path("a.glod");
    run!["build", missing, "-o", out, "--json"].failed(&missing);
    assert!(run!["info", folder.path(), "--json"].failed(folder.path()).contains("a folder, expected a file"));
    run!["build", broken, "-o", out, "--json"].failed(&broken);
    let ran = run!["build", cut, "-o", out, "--json"];
    ran.failed(&cut);
    assert_eq!(ran.json()["error"]["where"], format!("byte {}", scan.len() / 2), "says where");
    let what = run!["build", statue().ply, "-o", nowhere, "--json"].failed(&nowhere);
    assert_eq!(what, "could not write: the folder does not exist", "no names of temporary files");
    run!["build", statue().ply, "-o", folder.path(), "--json"].failed(folder.path());
    for command in ["info", "verify"] {
        for file in [&missing, &broken, &bad] {
            run![command, file, "--json"].failed(file);
        }
        run![command, folder.path(), "--json"].failed(folder.path());
    }
    for file in [&missing, &broken, &bad] {
        run!["render", file, "-o", path("a.png"), "--json"].failed(file);
    }
    run!["compare", missing, statue().ply, "--json"].failed(&missing);
    run!["compare", statue().ply, missing, "--json"].failed(&statue().ply);
    run!["synth", "statue", "--triangles", "1k", "-o", nowhere, "--json"].failed(&nowhere);
    run!["synth", "replicate", broken, "--triangles", "1k", "-o", out, "--json"].failed(&broken);
    run!["synth", "path", "orbit", "--around", bad, "-o", out, "--json"].failed(&bad);
    run!["demo", "--triangles", "1k", "-o", broken, "--json"].failed(&broken);
    if can_draw() {
        let picture = path("a.png");
        run!["render", statue().glod, "--path", broken, "--frame", "0", "-o", picture, "--json"].failed(&broken);
        run!["render", statue().glod, "-o", nowhere, "--json"].failed(&nowhere);
    }
    assert_eq!(names_in(folder.path()), before, "nothing is left behind");
}

#[test]
fn wrong_usage_ends_with_status_2_and_says_what_is_wrong() {
    let (glod, ply) = (statue().glod.to_str().unwrap(), statue().ply.to_str().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let render = |options: &str| {
        let words = ["render", glod, "-o", out].into_iter().chain(options.split_whitespace());
        words.map(String::from).collect::<Vec<_>>()
    };
    let words = |words: &[&str]| words.iter().map(|word| word.to_string()).collect::<Vec<_>>();
    for (arguments, mentioned) in [
        (words(&["frobnicate"]), "frobnicate"),
        (words(&["build", ply]), "--output"),
        (words(&["build", "-o", out]), "INPUT"),
        (words(&["build", ply, "-o", out, "--units", "feet"]), "us-ft"),
        (words(&["build", ply, "-o", out, "--memory", "63MiB"]), "64MiB"),
        (words(&["build", ply, "-o", out, "--memory", "lots"]), "lots"),
        (words(&["build", ply, "-o", out, "--threads", "100000"]), "1024"),
        (words(&["build", ply, "-o", out, "--as", "voxels"]), "voxels"),
        (words(&["info"]), "FILE"),
        (words(&["compare", "a.png"]), "B.png"),
        (words(&["synth", "statue", "-o", out, "--triangles", "0"]), "at least 1"),
        (words(&["synth", "path", "orbit", "--around", glod, "-o", out, "--seconds", "3601"]), "an hour"),
        (words(&["synth", "path", "spiral", "--around", glod, "-o", out]), "spiral"),
        (render("--sausages"), "--sausages"),
        (render("--size 640"), "640"),
        (render("--size 0x480"), "0x480"),
        (render("--full --error 2"), "--full"),
        (render("--error 0"), "greater than 0"),
        (render("--error NaN"), "NaN"),
        (render("--eye -1,2 --target 0,0,0"), "2 numbers"),
        (render("--eye 1,2,x --target 0,0,0"), "'x'"),
        (render("--eye 1,2,3"), "--target"),
        (render("--eye 1,2,3 --target 0,0,0 --up 0,0,0"), "length 0"),
        (render("--eye 1,2,3 --target 0,0,0 --orbit 0,0"), "--orbit"),
        (render("--orbit 1"), "1 numbers"),
        (render("--orbit 1,2,0"), "zoom"),
        (render("--fov 180"), "180"),
        (render("--light 0,0,0"), "length 0"),
        (render("--background red"), "red"),
        (render("--kernel hexagon"), "hexagon"),
        (render("--cpu-budget 3bananas"), "bananas"),
        (render("--path p.json"), "--frame"),
        (render("--frame 3"), "--path"),
        (render(&format!("--depth {out}")), "two"),
    ] {
        let ran = cli_support::gigalod(arguments.iter().map(String::as_str).chain(["--json"]));
        assert_eq!(ran.status, 2, "{arguments:?}: {ran:?}");
        assert_eq!(shape(&ran.json()), "{error{file what where}}", "{arguments:?}");
        let what = ran.json()["error"]["what"].as_str().unwrap().to_string();
        assert!(what.contains(mentioned), "{arguments:?}: {what:?} mentions {mentioned:?}");
        let others: Vec<&str> = ran.stderr.lines().skip(1).collect();
        assert!(ran.stderr.starts_with("error: "), "{arguments:?}: {ran:?}");
        assert!(others.iter().all(|line| line.starts_with("hint: ")), "{arguments:?}: {ran:?}");
        let plain = cli_support::gigalod(&arguments);
        assert_eq!((plain.status, &*plain.stdout), (2, ""), "{arguments:?}");
    }
    assert_eq!(names_in(folder.path()), [""; 0], "nothing is made");
}

#[test]
fn help_and_version_are_asked_for_and_not_wrong_usage() {
    for arguments in [&["--help"][..], &["--version"], &["help", "render"], &["build", "-h"], &["synth", "--help"]] {
        let ran = cli_support::gigalod(arguments).done();
        assert!(!ran.stdout.is_empty() && ran.stderr.is_empty(), "{arguments:?}: {ran:?}");
    }
    let empty: [&str; 0] = [];
    assert_eq!(cli_support::gigalod(empty).status, 2, "no command at all");
}

#[test]
fn without_json_results_are_for_people_and_errors_are_on_standard_error() {
    let ran = run!["info", statue().glod].done();
    assert!(serde_json::from_str::<serde_json::Value>(&ran.stdout).is_err() && ran.stdout.contains("hybrid"));
    let ran = run!["info", "nowhere.glod"];
    assert_eq!((ran.status, &*ran.stdout), (1, ""));
    assert_eq!(ran.stderr.lines().count(), 1, "{ran:?}");
    assert!(ran.stderr.starts_with("error: nowhere.glod: "), "{ran:?}");
}

#[test]
fn more_is_said_on_standard_error_only() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.glod");
    let ran = run!["-v", "build", statue().ply, "-o", out, "--json"].done();
    ran.json();
    assert!(ran.stderr.contains("statue.ply: read"), "{ran:?}");
    assert!(!ran.stderr.contains(['\r', '\x1b']), "no bars where there is no terminal: {ran:?}");
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = command()
        .args(["verify", "--json"])
        .arg(&other_splat_statue().glod)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let ran = Ran::of(child.wait_with_output().unwrap());
    assert_eq!((ran.status, &*ran.stderr), (0, ""));
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_behind_standard_output_is_an_error_and_not_a_panic() {
    let full = || Stdio::from(File::options().write(true).open("/dev/full").unwrap());
    let ran = Ran::of(command().arg("info").arg(&statue().glod).stdout(full()).output().unwrap());
    assert_eq!(ran.status, 1);
    assert!(ran.stderr.starts_with("error: standard output: could not write: No space left"), "{ran:?}");
    let ran = Ran::of(command().args(["info", "nowhere"]).stdout(full()).stderr(full()).output().unwrap());
    assert_eq!(ran.status, 1);
}

#[test]
#[cfg(unix)]
fn a_pipe_is_refused_and_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.ply");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for arguments in [&["info"][..], &["verify"], &["build", "-o", "never.glod"], &["compare", "pipe.ply"]] {
        let mut child = command();
        let child = child.current_dir(&folder).args(arguments).arg("--json").arg("pipe.ply");
        let mut child = child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let begun = Instant::now();
        while child.try_wait().unwrap().is_none() {
            if begun.elapsed() > Duration::from_secs(20) {
                child.kill().unwrap();
                panic!("{arguments:?} waits for the pipe");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let ran = Ran::of(child.wait_with_output().unwrap());
        assert_eq!(ran.failed(Path::new("pipe.ply")), "not a regular file");
    }
    let ran = run!["build", statue().ply, "-o", pipe, "--json"];
    assert!(ran.failed(&pipe).contains("not a regular file"), "it is not replaced");
    assert!(!pipe.is_file() && pipe.exists());
}
