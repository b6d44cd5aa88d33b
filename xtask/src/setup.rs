//! Finds out what is missing on this machine, and installs it on Debian and Ubuntu.

use crate::steps::run;
use anyhow::{Result, bail};
use std::path::Path;
use std::process::{Command, Stdio};

/// One thing that must be there.
struct Need {
    what: &'static str,
    /// Debian packages that bring it.
    packages: &'static [&'static str],
    is_there: fn() -> bool,
}

const NEEDS: [Need; 2] = [
    // The FLIP image metric, a judge in tests, is written in C++ by its authors.
    Need { what: "a C++ compiler", packages: &["g++"], is_there: || answers("c++", &["--version"]) },
    Need {
        what: "Vulkan with a driver (software is enough)",
        packages: &["libvulkan1", "mesa-vulkan-drivers"],
        is_there: has_vulkan,
    },
];

/// What tests of the viewer need besides.
const NEEDS_OF_TESTS: [Need; 2] = [
    Need {
        what: "a virtual X server and a hand for it",
        packages: &["xvfb", "xdotool"],
        is_there: || exists("Xvfb", "-help") && exists("xdotool", "version"),
    },
    Need {
        what: "libraries of X11",
        packages: &["libx11-6", "libx11-xcb1", "libxcursor1", "libxi6", "libxrandr2", "libxkbcommon-x11-0"],
        is_there: || {
            let libraries = libraries();
            ["libX11.so.6", "libX11-xcb.so.1", "libXcursor.so.1", "libXi.so.6", "libxkbcommon-x11.so.0"]
                .iter()
                .all(|name| libraries.contains(name))
        },
    },
];

/// Installs what drawing and testing need.
pub(crate) fn everything() -> Result<()> {
    install(NEEDS.iter().chain(&NEEDS_OF_TESTS))?;
    web_target()
}

/// Compiler and driver.
pub(crate) fn system() -> Result<()> {
    install(NEEDS.iter())
}

fn install<'a>(needs: impl Iterator<Item = &'a Need> + Clone) -> Result<()> {
    if !cfg!(target_os = "linux") {
        // Metal and Direct3D come with the system, and Rust's own requirements bring a C++ compiler.
        return Ok(());
    }
    let missing: Vec<&Need> = needs.clone().filter(|need| !(need.is_there)()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let names = missing.iter().map(|need| need.what).collect::<Vec<_>>().join(", ");
    let packages: Vec<&str> = missing.iter().flat_map(|need| need.packages).copied().collect();
    let by_hand = format!("missing: {names}. On Debian and Ubuntu: apt-get install {}", packages.join(" "));
    if !answers("apt-get", &["--version"]) {
        bail!("{by_hand}; elsewhere the packages of the same purpose");
    }
    let prefix: &[&str] = match (is_root(), answers("sudo", &["--version"])) {
        (true, _) => &[],
        (false, true) => &["sudo"],
        (false, false) => bail!("{by_hand}, as root"),
    };
    println!("Installing {} ({names})", packages.join(" "));
    let apt = |arguments: &[&str]| {
        let line: Vec<&str> =
            [prefix, &["env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-q", "-y"], arguments].concat();
        run(Command::new(line[0]).args(&line[1..]))
    };
    apt(&["update"])?;
    apt(&[&["install", "--no-install-recommends"], &packages[..]].concat())?;
    match needs.into_iter().find(|need| !(need.is_there)()) {
        Some(need) => bail!("still missing after installation: {}", need.what),
        None => Ok(()),
    }
}

/// The compiler's target for the browser.
pub(crate) fn web_target() -> Result<()> {
    const TARGET: &str = "wasm32-unknown-unknown";
    let installed = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    let is_there = installed.is_ok_and(|out| Path::new(String::from_utf8_lossy(&out.stdout).trim()).is_dir());
    if is_there {
        return Ok(());
    }
    if !answers("rustup", &["--version"]) {
        bail!("missing: Rust's target {TARGET}; with rustup: rustup target add {TARGET}");
    }
    run(Command::new("rustup").args(["target", "add", TARGET]))
}

fn has_vulkan() -> bool {
    let has_driver = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .any(|mut entries| entries.next().is_some())
        || std::env::var_os("VK_DRIVER_FILES").is_some()
        || std::env::var_os("VK_ICD_FILENAMES").is_some();
    has_driver && libraries().contains("libvulkan.so.1")
}

/// What the loader of libraries knows; empty where it does not tell.
fn libraries() -> String {
    let loader = Command::new("sh").args(["-c", "PATH=$PATH:/sbin:/usr/sbin ldconfig -p"]).output();
    loader.map(|out| String::from_utf8_lossy(&out.stdout).into_owned()).unwrap_or_default()
}

/// True when there is such a program, whatever it thinks of the argument.
fn exists(program: &str, argument: &str) -> bool {
    Command::new(program).arg(argument).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|out| out.stdout.trim_ascii() == b"0")
}

/// True when the program exists and is content.
pub(crate) fn answers(program: &str, arguments: &[&str]) -> bool {
    let status = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}
