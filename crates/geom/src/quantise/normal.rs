//! Unit normals in 14 bits: a 52 × 52 grid on each of the 6 faces of a cube, 16,224 codes.
//!
//! The grid is warped by the tangent, so that cells subtend nearly equal angles (the paper asks for a warp and leaves it
//! open; its mean error of about 0.01 radian is met). Code = (face · 52 + row) · 52 + column; faces in the order
//! +x −x +y −y +z −z; column and row run along the next two axes in cyclic order.

use glam::Vec3;
use std::f64::consts::FRAC_PI_4;
use std::sync::LazyLock;

/// Cells along an edge of a face.
pub const GRID: usize = 52;
/// Number of codes.
pub const CODES: usize = 6 * GRID * GRID;

/// Slope at position `at` (in cells, 0–52) across a face.
fn slope(at: f64) -> f64 {
    libm::tan(FRAC_PI_4 * (2.0 * at / GRID as f64 - 1.0))
}

static DECODED: LazyLock<Vec<Vec3>> = LazyLock::new(|| {
    (0..CODES)
        .map(|code| {
            let (face, row, column) = (code / (GRID * GRID), code / GRID % GRID, code % GRID);
            let axis = face / 2;
            let mut normal = [0.0; 3];
            normal[axis] = if face % 2 == 0 { 1.0 } else { -1.0 };
            normal[(axis + 1) % 3] = slope(column as f64 + 0.5);
            normal[(axis + 2) % 3] = slope(row as f64 + 0.5);
            glam::DVec3::from_array(normal).normalize().as_vec3()
        })
        .collect()
});

/// For each of 1024 intervals of slope, the cell at its lower end; cells are wider, so at most one step is missing.
static FIRST_CELL: LazyLock<Vec<u8>> = LazyLock::new(|| {
    (0..1024)
        .map(|bin| {
            let low = f64::from(bin) / 512.0 - 1.0;
            (1..GRID).take_while(|cell| slope(*cell as f64) <= low).count() as u8
        })
        .collect()
});

/// Lower border of each cell, as slope.
static BORDERS: LazyLock<Vec<f32>> = LazyLock::new(|| (0..=GRID).map(|cell| slope(cell as f64) as f32).collect());

fn cell(slope: f32) -> usize {
    let bin = ((slope + 1.0) * 512.0).clamp(0.0, 1023.0) as usize;
    let cell = usize::from(FIRST_CELL[bin]);
    if cell + 1 < GRID && slope >= BORDERS[cell + 1] { cell + 1 } else { cell }
}

/// Code of the grid direction whose cell holds `normal`; any length will do, and zero or NaN give some valid code.
pub fn encode(normal: Vec3) -> u16 {
    let n = normal.to_array();
    let size = n.map(f32::abs);
    let axis = if size[0] >= size[1] && size[0] >= size[2] {
        0
    } else if size[1] >= size[2] {
        1
    } else {
        2
    };
    let face = axis * 2 + usize::from(n[axis] < 0.0);
    let column = cell(n[(axis + 1) % 3] / size[axis]);
    let row = cell(n[(axis + 2) % 3] / size[axis]);
    ((face * GRID + row) * GRID + column) as u16
}

/// Unit vector of a code; codes beyond the last give the last.
pub fn decode(code: u16) -> Vec3 {
    DECODED[usize::from(code).min(CODES - 1)]
}

/// All unit vectors in code order, for uploading to a GPU.
pub fn table() -> &'static [Vec3] {
    &DECODED
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn each_code_survives_decoding() {
        assert_eq!(CODES, 16_224);
        for code in 0..CODES as u16 {
            assert_eq!(encode(decode(code)), code);
        }
    }

    #[test]
    fn mean_error_is_about_a_hundredth_of_a_radian() {
        let (mut sum, mut worst, mut count) = (0.0, 0.0f64, 0);
        for i in 0..40_000 {
            // Fibonacci sphere.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 40_000.0;
            let angle = f64::from(i) * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            let normal = glam::DVec3::new(r * angle.cos(), r * angle.sin(), z);
            let error = normal.cross(decode(encode(normal.as_vec3())).as_dvec3()).length();
            (sum, worst, count) = (sum + error, worst.max(error), count + 1);
        }
        let mean = sum / f64::from(count);
        assert!(mean < 0.0125 && worst < 0.03, "mean {mean}, worst {worst}");
    }

    proptest! {
        #[test]
        fn any_three_numbers_have_a_code(x in any::<f32>(), y in any::<f32>(), z in any::<f32>()) {
            prop_assert!(usize::from(encode(Vec3::new(x, y, z))) < CODES);
        }
    }
}
