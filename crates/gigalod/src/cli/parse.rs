//! Values of options.

use gigalod_build::Options;
use gigalod_geom::{ImageSize, LengthUnit};
use glam::DVec3;

/// Bytes: `4096`, `512MiB`, `2GB`; binary and decimal units, whole or decimal numbers.
pub(crate) fn size(text: &str) -> Result<u64, String> {
    let digits = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let wrong = || format!("'{text}', expected a size such as 512MiB");
    let (number, unit) = text.split_at(digits);
    let number: f64 = number.parse().map_err(|_| wrong())?;
    let factor: f64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kib" | "k" => 1024.0,
        "mib" | "m" => 1024.0 * 1024.0,
        "gib" | "g" => 1024.0 * 1024.0 * 1024.0,
        "tib" | "t" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        other => return Err(format!("unit '{other}', expected B, KiB, MiB, GiB, TiB, kB, MB, GB or TB")),
    };
    Ok((number * factor) as u64)
}

/// A builder's budget.
pub(crate) fn memory(text: &str) -> Result<u64, String> {
    let bytes = size(text)?;
    if bytes < Options::LEAST_MEMORY_BYTES { Err("expected at least 64MiB".into()) } else { Ok(bytes) }
}

/// A number of things: `2000000`, `2M`, `1.5G`, `10k`.
pub(crate) fn count(text: &str) -> Result<u64, String> {
    let digits = text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '_'))).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let number: f64 = number.replace('_', "").parse().map_err(|_| format!("'{text}', expected a number such as 2M"))?;
    let factor = match unit.to_ascii_lowercase().as_str() {
        "" => 1.0,
        "k" => 1e3,
        "m" => 1e6,
        "g" => 1e9,
        other => return Err(format!("unit '{other}', expected k, M or G")),
    };
    match (number * factor).round() {
        count if count >= 1.0 => Ok(count as u64),
        _ => Err("expected at least 1".into()),
    }
}

pub(crate) fn image_size(text: &str) -> Result<ImageSize, String> {
    let wrong = || format!("'{text}', expected WIDTHxHEIGHT such as 1280x720");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let size = ImageSize {
        width: width.trim().parse().map_err(|_| wrong())?,
        height: height.trim().parse().map_err(|_| wrong())?,
    };
    if size.width == 0 || size.height == 0 {
        return Err(wrong());
    }
    if size.width.max(size.height) > MOST_PIXELS_ACROSS {
        return Err(format!("'{text}', expected at most {MOST_PIXELS_ACROSS} pixels across"));
    }
    Ok(size)
}

/// What no graphics device goes beyond; most have less, and say so when it comes to drawing.
const MOST_PIXELS_ACROSS: u32 = 1 << 15;

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split(',')
        .map(|number| match number.trim().parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("'{number}', expected a number")),
        })
        .collect()
}

pub(crate) fn vector(text: &str) -> Result<DVec3, String> {
    match numbers(text)?[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        ref other => Err(format!("{} numbers, expected three: X,Y,Z", other.len())),
    }
}

pub(crate) fn direction(text: &str) -> Result<DVec3, String> {
    let direction = vector(text)?;
    if direction == DVec3::ZERO { Err("a direction of length 0".into()) } else { Ok(direction) }
}

pub(crate) fn orbit(text: &str) -> Result<[f64; 3], String> {
    match numbers(text)?[..] {
        [azimuth, elevation] => Ok([azimuth, elevation, 1.0]),
        [azimuth, elevation, zoom] if zoom > 0.0 => Ok([azimuth, elevation, zoom]),
        [_, _, zoom] => Err(format!("a zoom of {zoom}, expected more than 0")),
        ref other => Err(format!("{} numbers, expected two or three: AZ,EL[,ZOOM]", other.len())),
    }
}

pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err(format!("'{text}', expected a number greater than 0")),
    }
}

pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok(number),
        _ => Err(format!("'{text}', expected a number of at least 0")),
    }
}

/// Length of a camera path.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match positive(text)? {
        seconds if seconds <= 3600.0 => Ok(seconds),
        _ => Err("expected at most an hour, 3600".into()),
    }
}

/// A number of threads; 0 is one for each core.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(threads) if threads <= 1024 => Ok(threads),
        _ => Err(format!("'{text}', expected a whole number, at most 1024")),
    }
}

pub(crate) fn fov(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        // Narrower than this single precision cannot tell pixels apart; wider, a picture is all smear.
        Ok(degrees) if (0.01..=170.0).contains(&degrees) => Ok(degrees),
        _ => Err(format!("'{text}', expected degrees from 0.01 to 170")),
    }
}

pub(crate) fn color(text: &str) -> Result<[u8; 3], String> {
    let wrong = || format!("'{text}', expected #RRGGBB in hexadecimal");
    let digits = text.strip_prefix('#').unwrap_or(text);
    if digits.len() != 6 || !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return Err(wrong());
    }
    let value = u32::from_str_radix(digits, 16).map_err(|_| wrong())?;
    Ok([(value >> 16) as u8, (value >> 8) as u8, value as u8])
}

/// A unit of length, by its symbol.
pub(crate) fn unit(text: &str) -> Result<LengthUnit, String> {
    LengthUnit::ALL
        .into_iter()
        .find(|unit| unit.symbol() == text)
        .ok_or_else(|| format!("'{text}', expected {}", LengthUnit::ALL.map(LengthUnit::symbol).join(", ")))
}

/// Bytes for people.
pub(crate) fn readable_bytes(bytes: u64) -> String {
    indicatif::BinaryBytes(bytes).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_counts_have_units() {
        assert_eq!(size("64MiB"), Ok(64 << 20));
        assert_eq!((size("1.5 GiB"), size("2GB"), size("4096")), (Ok(3 << 29), Ok(2_000_000_000), Ok(4096)));
        assert!(size("3 apples").is_err() && size("").is_err() && memory("63MiB").is_err());
        assert_eq!((count("2M"), count("1_000"), count("0.5k")), (Ok(2_000_000), Ok(1000), Ok(500)));
        assert!(count("0").is_err() && count("-3").is_err());
        assert_eq!((unit("us-ft"), unit("mm")), (Ok(LengthUnit::UsSurveyFoot), Ok(LengthUnit::Millimetre)));
        assert!(unit("M").is_err() && unit("").is_err() && unit("feet").is_err());
    }

    #[test]
    fn vectors_may_be_negative_and_must_be_complete() {
        assert_eq!(vector("-1,2.5,-3e2"), Ok(DVec3::new(-1.0, 2.5, -300.0)));
        assert!(vector("1,2").is_err() && vector("1,2,inf").is_err() && direction("0,0,0").is_err());
        assert_eq!((orbit("30,-10"), orbit("30,-10,4")), (Ok([30.0, -10.0, 1.0]), Ok([30.0, -10.0, 4.0])));
        assert!(orbit("1,2,0").is_err());
    }

    #[test]
    fn pictures_have_a_size_and_colours_six_digits() {
        assert_eq!(image_size("640x480"), Ok(ImageSize { width: 640, height: 480 }));
        assert!(image_size("640").is_err() && image_size("0x4").is_err() && image_size("100000x100000").is_err());
        assert_eq!(color("#ff8000"), Ok([255, 128, 0]));
        assert!(color("#ff80").is_err() && color("#+f8000").is_err());
        assert!(fov("0.001").is_err() && fov("180").is_err() && fov("40") == Ok(40.0));
    }
}
