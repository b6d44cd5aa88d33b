//! What the tests of the command line share: running the program, small models, reading what it writes.
#![allow(dead_code, reason = "each test file uses its own part")]

#[cfg(unix)]
pub(crate) mod builds;

use serde_json::Value;
use std::ffi::OsStr;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// How a run of the program ended.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// The program, with a cache of its own and no messages of the graphics driver's.
pub(crate) fn command() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gigalod"));
    command.env("XDG_CACHE_HOME", folder().join("cache")).env("XDG_RUNTIME_DIR", folder()).stdin(Stdio::null());
    command
}

/// Runs the program.
pub(crate) fn gigalod<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Ran {
    Ran::of(command().args(arguments).output().expect("the program starts"))
}

/// What was said, but for how far a run had come: on a busy machine it takes long enough to say so.
pub(crate) fn without_progress(said: &str) -> String {
    said.split_inclusive('\n').filter(|line| !line.ends_with(" s left\n")).collect()
}

/// `run!["build", path, "-o", out]`: arguments of any kind.
#[macro_export]
macro_rules! run {
    ($($argument:expr),+ $(,)?) => {
        $crate::cli_support::gigalod([$(std::ffi::OsStr::new(&$argument)),+])
    };
}

impl Ran {
    pub(crate) fn of(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("output is UTF-8");
        let status = output.status.code().expect("no signal ended the program");
        Self { status, stdout: text(output.stdout), stderr: without_progress(&text(output.stderr)) }
    }

    /// It did what it was asked to.
    #[track_caller]
    pub(crate) fn done(self) -> Self {
        assert_eq!(self.status, 0, "{self:?}");
        self
    }

    /// The only thing on standard output: one object, on one line.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        assert!(self.stdout.ends_with('\n') && self.stdout.lines().count() == 1, "one line: {self:?}");
        let value: Value = serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:?}"));
        assert!(value.is_object(), "{self:?}");
        value
    }

    /// It could not (status 1): the JSON object and the line on standard error say the same. Returns what is wrong.
    #[track_caller]
    pub(crate) fn failed(&self, file: &Path) -> String {
        assert_eq!(self.status, 1, "{self:?}");
        let error = &self.json()["error"];
        assert_eq!(shape(&self.json()), "{error{file what where}}");
        let what = error["what"].as_str().expect("what is wrong");
        assert_eq!(error["file"].as_str(), file.to_str(), "{self:?}");
        let place = error["where"].as_str().map(|place| format!(" ({place})")).unwrap_or_default();
        let mut lines = self.stderr.lines();
        assert_eq!(lines.next(), Some(&*format!("error: {}: {what}{place}", file.display())));
        assert!(lines.all(|hint| hint.starts_with("hint: ")), "{self:?}");
        what.to_string()
    }
}

/// The keys of an object, nested, sorted: `{error{file what where}}`. Options differ from one representation to the next.
pub(crate) fn shape(value: &Value) -> String {
    match value {
        Value::Object(object) => {
            let mut keys: Vec<String> = object
                .iter()
                .map(|(key, value)| format!("{key}{}", if key == "options" { "{..}".into() } else { shape(value) }))
                .collect();
            keys.sort();
            format!("{{{}}}", keys.join(" "))
        }
        Value::Array(items) => {
            let mut shapes: Vec<String> = items.iter().map(shape).collect();
            shapes.dedup();
            format!("[{}]", shapes.join(" "))
        }
        _ => String::new(),
    }
}

/// Where a test file's models and cache lie, from one run to the next. All of it is written atomically and the same
/// each time, so runs side by side do each other no harm.
pub(crate) fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME"));
        std::fs::create_dir_all(&folder).expect("a folder for the tests");
        folder
    })
}

/// A statue: the scan, and what it builds into.
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) ply: PathBuf,
    pub(crate) glod: PathBuf,
}

impl Model {
    /// Built as what suits it, which is hybrid, or as `kind`.
    fn make(name: &str, triangles: &str, seed: &str, kind: &str) -> Self {
        let (ply, glod) = (folder().join(name).with_extension("ply"), folder().join(name).with_extension("glod"));
        run!["synth", "statue", "--triangles", triangles, "--seed", seed, "-o", ply].done();
        run!["build", ply, "-o", glod, "--as", kind].done();
        Self { ply, glod }
    }
}

/// A small statue, as the command builds it where nobody says otherwise: hybrid.
pub(crate) fn statue() -> &'static Model {
    static STATUE: OnceLock<Model> = OnceLock::new();
    STATUE.get_or_init(|| Model::make("statue", "20k", "1", "auto"))
}

/// The same, as splats.
pub(crate) fn splat_statue() -> &'static Model {
    static STATUE: OnceLock<Model> = OnceLock::new();
    STATUE.get_or_init(|| Model::make("splats", "20k", "1", "splats"))
}

/// Another one, as splats.
pub(crate) fn other_splat_statue() -> &'static Model {
    static STATUE: OnceLock<Model> = OnceLock::new();
    STATUE.get_or_init(|| Model::make("other", "20k", "2", "splats"))
}

/// A statue of many pages, as splats.
pub(crate) fn larger_splat_statue() -> &'static Model {
    static STATUE: OnceLock<Model> = OnceLock::new();
    STATUE.get_or_init(|| Model::make("larger", "200k", "1", "splats"))
}

/// True where there is a graphics adapter. Where there is none, says so; with `REQUIRE_GPU` set that is a failure.
#[track_caller]
pub(crate) fn can_draw() -> bool {
    static TRIED: OnceLock<Ran> = OnceLock::new();
    let tried = TRIED.get_or_init(|| {
        let picture = tempfile::NamedTempFile::new().expect("a temporary file");
        run!["render", statue().glod, "-o", picture.path(), "--size", "8x8"]
    });
    let adapter = !(tried.stderr.contains("graphics adapter") || tried.stderr.contains("graphics device"));
    assert!(adapter || std::env::var_os("REQUIRE_GPU").is_none(), "REQUIRE_GPU is set, but {}", tried.stderr);
    if !adapter {
        println!("skipped: no graphics adapter");
    }
    adapter
}

/// Width, height and pixels of an RGBA picture.
pub(crate) fn read_png(path: &Path) -> (u32, u32, Vec<[u8; 4]>) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut buffer).unwrap();
    assert_eq!((frame.color_type, frame.bit_depth), (png::ColorType::Rgba, png::BitDepth::Eight));
    (frame.width, frame.height, buffer.as_chunks().0.to_vec())
}

/// Names of all that lies in a folder.
pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Parts of a `.glod` file; offsets of the fields of its header that say where they begin.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    Header,
    Skeleton,
    FirstPage,
    LastPage,
    Metadata,
}

/// A copy of a `.glod` file with one byte changed in the middle or at an end of `part`.
pub(crate) fn damaged(glod: &Path, part: Part, copy: &Path) {
    let mut bytes = std::fs::read(glod).unwrap();
    let field = |offset: usize| u64::from_le_bytes(bytes[offset..offset + 8].try_into().unwrap()) as usize;
    let (skeleton, metadata, pages) = (field(32), field(56), field(72));
    assert!(skeleton < pages && pages < metadata && metadata < bytes.len(), "the header is as it is specified");
    let place = match part {
        Part::Header => 100,
        Part::Skeleton => skeleton + 2,
        Part::FirstPage => pages + 40,
        Part::LastPage => metadata - 40,
        Part::Metadata => metadata + 2,
    };
    bytes[place] ^= 0x20;
    std::fs::write(copy, bytes).unwrap();
}

/// CRC-32, as in PNG and gzip.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// A text PLY of strips over a wavy grid: as nobody declares how many triangles they are, it is always built out of core.
pub(crate) fn strips(side: usize) -> String {
    use std::fmt::Write;
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element tristrips {}\nproperty list int int vertex_indices\nend_header\n",
        side * side,
        side - 1
    );
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        writeln!(text, "{column} {row} 0.{}", (row * row + 3 * column) % 7).unwrap();
    }
    for row in 0..side - 1 {
        write!(text, "{}", 2 * side).unwrap();
        for column in 0..side {
            write!(text, " {} {}", row * side + column, (row + 1) * side + column).unwrap();
        }
        text.push('\n');
    }
    text
}
