//! Something to look at while a raw model is being built: points of it, as even as the file's order has them. Of each run of
//! vertices it is any one: where every so-manieth were taken, those of a grid or a scanner could be the same few columns of all rows.
//!
//! Goes in: a raw model, read once from front to back, a mesh no farther than its vertices. Comes out: a small model of its own, built
//! as a cloud of points, in memory. How far it is from the model is not known.

use super::args::BuildOptions;
use super::build;
use super::error::CliError;
use super::files;
use gigalod_build::NoProgress;
use gigalod_format::splats::SplatFile;
use gigalod_format::{Container, Kind, MemoryStore};
use gigalod_geom::LengthUnit;
use gigalod_geom::camera::UpAxis;
use gigalod_import::{Attributes, Batch, ImportError, ModelStream, VertexBatch};
use std::path::Path;
use std::sync::Arc;

/// Which models have previews, and of how many points.
#[derive(Clone, Copy, Debug)]
struct Extent {
    /// Of the model.
    least_vertices: u64,
    /// Of the preview; it has half as many at least.
    most_points: usize,
}

impl Extent {
    /// Of a model that is built as that: what has fewer vertices is built as soon as a preview would be.
    fn of(kind: Kind) -> Self {
        let least_vertices = if kind == Kind::Hybrid { 100_000 } else { 1_000_000 };
        Self { least_vertices, most_points: 200_000 }
    }
}

/// Memory of the build.
const MEMORY_BYTES: u64 = 128 << 20;

/// A preview, and of how many points it is; `None` for small models, and when `is_cancelled`.
pub(crate) fn of(
    path: &Path,
    options: &BuildOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Option<(SplatFile, u64)>, CliError> {
    let stream = files::open_model(path)?;
    let extent = Extent::of(build::representation(&*stream, options));
    with_extent(path, stream, extent, is_cancelled)
}

fn with_extent(
    path: &Path,
    stream: Box<dyn ModelStream>,
    extent: Extent,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Option<(SplatFile, u64)>, CliError> {
    let Some(points) = sample(stream, extent, is_cancelled).map_err(|error| CliError::import(path, &error))? else {
        return Ok(None);
    };
    let number = points.points.positions.len() as u64;
    let wrong = |error: std::io::Error| CliError::in_file(path, error);
    let folder = tempfile::tempdir().map_err(wrong)?;
    let built = folder.path().join("preview.glod");
    // One thread: the model itself is being built.
    let options = gigalod_build::Options { memory_bytes: MEMORY_BYTES, threads: 1, ..Default::default() };
    gigalod_build::splats::build(Box::new(points), &options, &NoProgress, &built)
        .map_err(|error| CliError::in_file(path, error))?;
    let store = MemoryStore::new(std::fs::read(&built).map_err(wrong)?);
    let file = Container::open(Arc::new(store)).and_then(SplatFile::open);
    Ok(Some((file.map_err(|error| CliError::format(path, &error))?, number)))
}

/// One vertex of each run of a stream.
struct Sample {
    points: VertexBatch,
    /// Whether they have been handed out.
    is_done: bool,
    attributes: Attributes,
    up: UpAxis,
    unit: Option<LengthUnit>,
}

fn sample(
    mut stream: Box<dyn ModelStream>,
    extent: Extent,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Option<Sample>, ImportError> {
    let declared = stream.declared_vertices().unwrap_or(u64::MAX);
    if declared < extent.least_vertices {
        return Ok(None);
    }
    let (mut points, mut batch) = (VertexBatch::default(), Batch::default());
    let (mut seen, mut every) = (0_u64, 1_u64);
    while seen < declared && stream.next(&mut batch)? {
        if is_cancelled() {
            return Ok(None);
        }
        let vertices = &batch.vertices;
        for at in 0..vertices.positions.len() {
            let number = seen + at as u64;
            if number % every == any_number(number / every, every) % every {
                points.positions.push(vertices.positions[at]);
                points.normals.extend(vertices.normals.get(at));
                points.colors.extend(vertices.colors.get(at));
            }
        }
        seen += vertices.positions.len() as u64;
        while points.positions.len() > extent.most_points {
            every *= 2;
            thin_out(&mut points.positions, every);
            thin_out(&mut points.normals, every);
            thin_out(&mut points.colors, every);
        }
    }
    let (attributes, up, unit) = (stream.attributes(), stream.up_axis(), stream.unit());
    Ok((seen >= extent.least_vertices).then_some(Sample { points, is_done: false, attributes, up, unit }))
}

/// Keeps one of each two: which, depends on their place and on `every`.
fn thin_out<T>(all: &mut Vec<T>, every: u64) {
    let mut places = 0_u64..;
    all.retain(|_| places.next().is_some_and(|at| at % 2 == any_number(at / 2, every) % 2));
}

/// A number that looks random, for the run of that place and length.
///
/// # Source
/// Steele, Lea & Flood, *Fast Splittable Pseudorandom Number Generators*, OOPSLA 2014, figure 16 (variant 13).
fn any_number(place: u64, length: u64) -> u64 {
    let mut mixed = place.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ length.wrapping_mul(0xD1B5_4A32_D192_ED03);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    mixed ^ (mixed >> 31)
}

impl ModelStream for Sample {
    fn attributes(&self) -> Attributes {
        self.attributes
    }

    fn up_axis(&self) -> UpAxis {
        self.up
    }

    fn unit(&self) -> Option<LengthUnit> {
        self.unit
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        if std::mem::replace(&mut self.is_done, true) {
            return Ok(false);
        }
        batch.vertices = std::mem::take(&mut self.points);
        Ok(true)
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        (u64::from(self.is_done), 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_synth::{Order, StatueOptions};

    #[test]
    fn a_preview_covers_the_model_with_few_points_and_small_models_have_none() {
        let folder = tempfile::tempdir().unwrap();
        let scan = folder.path().join("statue.ply");
        let write = |triangles: u64| {
            let options = StatueOptions { triangles, seed: 1, colors: false, order: Order::Coherent };
            let mut out = std::io::BufWriter::new(std::fs::File::create(&scan).unwrap());
            gigalod_synth::write_statue(options, &mut out, &mut |_, _| {}).unwrap();
        };
        let extent = Extent { least_vertices: 20_000, most_points: 8_000 };
        write(20_000);
        let previewed = |is_cancelled: &dyn Fn() -> bool| {
            with_extent(&scan, files::open_model(&scan).unwrap(), extent, is_cancelled).unwrap()
        };
        assert!(previewed(&|| false).is_none());
        write(60_000);
        assert!(previewed(&|| true).is_none());
        let (file, points) = previewed(&|| false).unwrap();
        assert!((4_000..=8_000).contains(&points), "{points}");
        let root = file.skeleton().root();
        let repeated = file.container().read_metadata().unwrap().repeated;
        assert_eq!(root.leaves - repeated, points);
        let whole = gigalod_import::read_all(&mut *files::open_model(&scan).unwrap(), &mut |_, _| {}).unwrap();
        let bounds = gigalod_geom::Aabb::of(whole.vertices.positions.iter().copied());
        let lost = (bounds.extent() - root.bounds.extent()).max_element() / bounds.diagonal();
        assert!(lost < 0.02, "{lost}");
    }
}
