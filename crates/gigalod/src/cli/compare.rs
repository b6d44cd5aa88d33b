//! `gigalod compare`.

use super::args::CompareArgs;
use super::error::{CliError, Outcome};
use super::files;
use super::progress::Console;
use gigalod_geom::ImageSize;
use gigalod_reference::{Picture, metrics};
use serde::Serialize;
use std::io::BufReader;
use std::path::Path;

/// The JSON object of `compare`.
#[derive(Serialize)]
struct CompareReport {
    /// Null when identical.
    psnr_db: Option<f64>,
    ssim: f64,
    flip_mean: f64,
    max_diff: u8,
}

pub(crate) fn run(args: &CompareArgs, _console: &Console) -> Result<Outcome, CliError> {
    let (a, b) = (read_png(&args.reference)?, read_png(&args.test)?);
    if a.size != b.size {
        let size = |picture: &Picture| format!("{}x{}", picture.size.width, picture.size.height);
        return Err(CliError::in_file(
            &args.test,
            format!("{} pixels, expected {} as {}", size(&b), size(&a), args.reference.display()),
        ));
    }
    let found = metrics::compare(&a, &b, None);
    let json = CompareReport {
        psnr_db: found.psnr_db,
        ssim: found.ssim,
        flip_mean: found.flip_mean,
        max_diff: found.max_diff,
    };
    let psnr = found.psnr_db.map_or("identical".to_string(), |db| format!("PSNR {db:.2} dB"));
    let text = format!(
        "{psnr}, SSIM {:.4}, mean FLIP {:.4}, largest difference {}\n",
        found.ssim, found.flip_mean, found.max_diff
    );
    Ok(Outcome::new(&json, text))
}

/// What `render` can write; a few bytes may claim to be far more.
const MOST_PIXELS: u32 = 16384;

/// Any PNG, as 8-bit sRGB; what is transparent is not seen through.
fn read_png(path: &Path) -> Result<Picture, CliError> {
    let wrong = |error: png::DecodingError| CliError::in_file(path, format!("not a PNG that can be read: {error}"));
    let mut decoder = png::Decoder::new(BufReader::new(files::open(path)?));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(wrong)?;
    let (width, height) = reader.info().size();
    if width.max(height) > MOST_PIXELS {
        let what = format!("a picture of {width}x{height} pixels, expected 1 to {MOST_PIXELS} each way");
        return Err(CliError::in_file(path, what));
    }
    let bytes = reader.output_buffer_size().ok_or_else(|| CliError::in_file(path, "too large a picture"))?;
    let mut buffer = vec![0; bytes];
    let frame = reader.next_frame(&mut buffer).map_err(wrong)?;
    let samples = &buffer[..frame.buffer_size()];
    let pixels = samples
        .chunks_exact(frame.color_type.samples())
        .map(|pixel| match *pixel {
            [gray] | [gray, _] => [gray; 3],
            [r, g, b] | [r, g, b, _] => [r, g, b],
            _ => [0; 3],
        })
        .collect();
    Ok(Picture { size: ImageSize { width: frame.width, height: frame.height }, pixels })
}
