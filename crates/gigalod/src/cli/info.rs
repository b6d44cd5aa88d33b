//! `gigalod info`.

use super::args::InfoArgs;
use super::error::{CliError, Outcome};
use super::files;
use super::parse::readable_bytes;
use super::progress::Console;
use super::reduction::{self, Reduction};
use gigalod_format::{Bounds, Dicing, InputCounts, LevelSummary, ReferenceSystem};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::{Display, Write};

/// The JSON object of `info`.
#[derive(Serialize)]
struct InfoReport<'a> {
    kind: &'a str,
    version: u32,
    input: InputCounts,
    options: &'a BTreeMap<String, String>,
    nodes: u64,
    levels: u32,
    leaves: u64,
    repeated: u64,
    bytes: u64,
    raw_bytes: u64,
    closed: bool,
    bounds: Bounds,
    dicing: Option<Dicing>,
    units: Option<&'a str>,
    reference_system: Option<&'a ReferenceSystem>,
    attributes: &'a [String],
    per_level: &'a [LevelSummary],
    /// Of hybrid files.
    reduction: Option<Vec<Reduction>>,
}

pub(crate) fn run(args: &InfoArgs, _console: &Console) -> Result<Outcome, CliError> {
    // The skeleton tells nothing here, but where it is damaged the file is no good.
    let model = files::open_built(&args.file)?;
    let container = model.container();
    let metadata = container.read_metadata().map_err(|error| CliError::format(&args.file, &error))?;
    let bytes = container.store().len();
    let json = InfoReport {
        kind: container.kind().name(),
        version: gigalod_format::VERSION,
        input: metadata.input,
        options: &metadata.options,
        nodes: metadata.nodes,
        levels: metadata.levels,
        leaves: metadata.leaves,
        repeated: metadata.repeated,
        bytes,
        raw_bytes: metadata.raw_bytes,
        closed: metadata.closed,
        bounds: metadata.bounds,
        dicing: metadata.dicing,
        units: metadata.options.get("units").map(String::as_str),
        reference_system: metadata.reference_system.as_ref(),
        attributes: &metadata.attributes,
        per_level: &metadata.per_level,
        reduction: model.hybrid().map(|file| reduction::of(file.skeleton())),
    };
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<12}{}", shown(&value));
    };
    line("kind", format!("{} (format version {})", container.kind().name(), gigalod_format::VERSION));
    line("built by", metadata.generator.clone());
    line(
        "input",
        match metadata.input {
            InputCounts { points, triangles: 0, .. } => format!("{points} points"),
            InputCounts { triangles, vertices, .. } => format!("{triangles} triangles, {vertices} vertices"),
        },
    );
    if let Some(Dicing { spacing, triangles, samples }) = metadata.dicing {
        line("diced", format!("{triangles} triangles into {samples} samples, each for at most a square of {spacing}"));
    }
    for (name, value) in &metadata.options {
        line("option", format!("{name} = {value}"));
    }
    let inner = metadata.nodes - metadata.leaves.min(metadata.nodes);
    let branching = if inner == 0 { 0.0 } else { (metadata.nodes - 1) as f64 / inner as f64 };
    line("nodes", format!("{} on {} levels, {branching:.2} children each", metadata.nodes, metadata.levels));
    let repeated = match metadata.repeated {
        0 => String::new(),
        repeated => format!(", {repeated} of them repeated: isolated ones, to be as small as they are"),
    };
    line("leaves", format!("{}{repeated}", metadata.leaves));
    // A leaf of splats is a vertex or point; one of a hybrid file holds thousands of triangles.
    let is_hybrid = model.hybrid().is_some();
    let (things, thing) =
        if is_hybrid { (metadata.input.triangles, "an input triangle") } else { (metadata.leaves, "a leaf") };
    let size =
        |bytes: u64| format!("{} ({:.2} bytes {thing})", readable_bytes(bytes), bytes as f64 / things.max(1) as f64);
    line("size", size(bytes));
    line("raw size", size(metadata.raw_bytes));
    line("attributes", metadata.attributes.join(", "));
    line("closed", if metadata.closed { "yes: backs are hidden" } else { "no: drawn from both sides" }.into());
    let unit = json.units.map(shown).unwrap_or_default();
    let [min, max] = [metadata.bounds.min, metadata.bounds.max].map(|corner| shown_corner(corner, &metadata.bounds));
    line("bounds", format!("{min} to {max} {unit}").trim_end().to_owned());
    if let Some(ReferenceSystem { name, epsg, wkt }) = &metadata.reference_system {
        let number = epsg.map(|epsg| format!("EPSG:{epsg}"));
        let text = wkt.as_ref().map(|wkt| format!("{} bytes of WKT, shown with --json", wkt.len()));
        line("system", [name.clone(), number, text].into_iter().flatten().collect::<Vec<_>>().join("; "));
    }
    let error = if unit.is_empty() { "max error".to_owned() } else { format!("max error/{unit}") };
    // Splats are points and nothing else, one a node.
    let payload = |triangles: &dyn Display, points: &dyn Display, ratio: &dyn Display| match is_hybrid {
        true => format!(" {triangles:>12} {points:>12} {ratio:>7}"),
        false => String::new(),
    };
    let names = payload(&"triangles", &"points", &"ratio");
    let _ = writeln!(text, "\n{:>5} {:>12}{names} {:>12} {error:>14}", "level", "nodes", "bytes");
    for LevelSummary { level, nodes, triangles, points, bytes, max_error } in &metadata.per_level {
        let of_level = |reduction: &&Reduction| reduction.level == *level;
        let reduction = json.reduction.as_deref().unwrap_or_default().iter().find(of_level);
        let ratio = reduction.map_or("-".into(), |reduction| format!("{:.2}", reduction.ratio));
        let payload = payload(triangles, points, &ratio);
        let _ = writeln!(text, "{level:>5} {nodes:>12}{payload} {bytes:>12} {max_error:>14.6e}");
    }
    if let Some(levels) = &json.reduction {
        text.push_str(&reduction::describe(levels));
    }
    Ok(Outcome::new(&json, text))
}

/// A corner of the bounds in as many digits as say something: single precision has seven of the model's size.
fn shown_corner(corner: [f64; 3], bounds: &Bounds) -> String {
    let extent = (0..3).map(|axis| bounds.max[axis] - bounds.min[axis]).fold(0.0, f64::max);
    let decimals = if extent > 0.0 { (7.0 - extent.log10().ceil()).clamp(0.0, 17.0) as usize } else { 17 };
    let number = |value: f64| {
        let exact = value.to_string();
        let rounded = format!("{value:.decimals$}");
        let rounded =
            if rounded.contains('.') { rounded.trim_end_matches('0').trim_end_matches('.') } else { &rounded };
        let rounded = if rounded == "-0" { "0" } else { rounded };
        if rounded.len() < exact.len() { rounded.to_owned() } else { exact }
    };
    corner.map(number).join(" ")
}

/// A stranger's words: they shall not steer the terminal.
pub(crate) fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_have_as_many_digits_as_say_something() {
        let shown = |min: [f64; 3], max: [f64; 3]| shown_corner(min, &Bounds { min, max });
        assert_eq!(shown([0.1_f32.into(), -0.0, 0.25], [1.0; 3]), "0.1 0 0.25");
        let georeferenced = shown([635_577.790_000_000_1, 848_882.15, 406.14], [636_977.75, 850_282.1, 615.26]);
        assert_eq!(georeferenced, "635577.79 848882.15 406.14");
        assert_eq!(shown([1.0 + 1e-9, 2.0, 3.0], [1.0 + 2e-9, 2.0, 3.0]), "1.000000001 2 3");
        assert_eq!(shown([-3e20, 1e19, 5.0], [3e20; 3]), "-300000000000000000000 10000000000000000000 5");
        assert_eq!(shown([0.3, 5.0, 1e-30], [0.3, 5.0, 1e-30]), "0.3 5 0");
    }
}
