//! What of the graphics device is used, by environment: the picture is the same at every level, and through
//! every interface.

mod cli_support;

use cli_support::{Ran, command};
use std::path::{Path, PathBuf};

/// Draws with `environment`; picture and depth, or `None` where there is no such adapter.
fn draw(folder: &Path, model: &Path, kernel: &str, environment: &[(&str, &str)]) -> Option<(Vec<u8>, Vec<u8>)> {
    let (png, exr) = (folder.join("p.png"), folder.join("p.exr"));
    let mut command = command();
    command.arg("render").arg(model).arg("-o").arg(&png).arg("--depth").arg(&exr).arg("--json");
    command.args(["--size", "320x240", "--orbit", "30,10,1.5", "--error", "3", "--kernel", kernel]);
    // As it is where nobody has set anything, but for what is asked for.
    command.env_remove("WGPU_BACKEND").env_remove("GIGALOD_GPU_LEVEL").envs(environment.iter().copied());
    let ran = Ran::of(command.output().unwrap());
    if ran.status != 0 && ran.stderr.contains("no graphics adapter") && std::env::var_os("REQUIRE_GPU").is_none() {
        println!("skipped: {}", ran.stderr);
        return None;
    }
    ran.done();
    Some((std::fs::read(png).unwrap(), std::fs::read(exr).unwrap()))
}

fn statue(folder: &Path) -> PathBuf {
    let (ply, glod) = (folder.join("statue.ply"), folder.join("statue.glod"));
    let mut synth = command();
    synth.args(["synth", "statue", "--triangles", "60k", "--seed", "3", "--colors", "-o"]).arg(&ply);
    Ran::of(synth.output().unwrap()).done();
    let mut build = command();
    build.arg("build").arg(&ply).arg("-o").arg(&glod).args(["--as", "splats"]);
    Ran::of(build.output().unwrap()).done();
    glod
}

#[test]
fn vulkan_opengl_and_the_baseline_show_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let model = statue(folder.path());
    for kernel in ["square", "round", "gauss", "square-ellipse", "round-ellipse", "gauss-ellipse"] {
        let Some(expected) = draw(folder.path(), &model, kernel, &[]) else { return };
        for environment in [[("WGPU_BACKEND", "vulkan")], [("WGPU_BACKEND", "gl")], [("GIGALOD_GPU_LEVEL", "webgpu")]] {
            if let Some((picture, depth)) = draw(folder.path(), &model, kernel, &environment) {
                assert!(picture == expected.0 && depth == expected.1, "{kernel}, {environment:?}");
            }
        }
    }
}

#[test]
fn a_level_that_does_not_exist_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let model = statue(folder.path());
    let mut command = command();
    command.arg("render").arg(&model).arg("-o").arg(folder.path().join("p.png"));
    let ran = Ran::of(command.env("GIGALOD_GPU_LEVEL", "high").output().unwrap());
    assert_eq!(ran.status, 1);
    assert!(ran.stderr.contains("GIGALOD_GPU_LEVEL is \"high\", expected webgl, webgpu or native"), "{ran:?}");
    // The lowest cannot blend.
    let draw = |kernel| {
        let mut command = cli_support::command();
        command.arg("render").arg(&model).arg("-o").arg(folder.path().join("p.png")).args(["--kernel", kernel]);
        Ran::of(command.env("GIGALOD_GPU_LEVEL", "webgl").output().unwrap())
    };
    let refused = draw("gauss");
    if refused.stderr.contains("no graphics adapter") && std::env::var_os("REQUIRE_GPU").is_none() {
        return;
    }
    assert!(refused.status == 1 && refused.stderr.contains("cannot blend"), "{refused:?}");
    draw("round").done();
}
