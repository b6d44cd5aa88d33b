//! What each triangle gives to its vertices: the radius of its bounding ball, its normal, and its angles, which weight it.
//!
//! Edges go in, eight triangles at a time; [`Facet`]s come out. Everything is `f32`, relative to the triangle's own size, so that
//! neither tiny nor huge units underflow; the radius is rounded up by more than all roundings together.

use super::mesh::Corner;
use glam::{DVec3, Vec3};

/// Triangles that are measured side by side.
pub(super) const LANES: usize = 8;
type Lanes = [f32; LANES];

/// A triangle as its vertices need it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Facet {
    /// At least the radius of its smallest bounding ball, by a ten-thousandth at most too large.
    pub(super) radius: f32,
    /// Unit length; zero where the triangle has no area.
    pub(super) normal: Vec3,
    /// At its corners, radians.
    pub(super) angles: [f32; 3],
    /// Area as a share of the square of `radius`.
    pub(super) area_share: f32,
    /// Six times the volume of the tetrahedron with the anchor.
    pub(super) six_volumes: f32,
}

/// Measures triangles by their corners; `out` is overwritten.
pub(super) fn measure<C: Corner>(corners: &[[C; 3]], anchor: C, out: &mut Vec<Facet>) {
    out.clear();
    out.reserve(corners.len().next_multiple_of(LANES));
    for block in corners.chunks(LANES) {
        let mut input = Input::default();
        for (lane, [a, b, c]) in block.iter().enumerate() {
            let vectors = [b.minus(a), c.minus(a), a.minus(&anchor)];
            for (into, from) in input.vectors.iter_mut().zip(vectors) {
                for axis in 0..3 {
                    into[axis][lane] = from[axis];
                }
            }
        }
        let (mut facets, are_thin) = block_of(&input);
        for ((facet, is_thin), corners) in facets.iter_mut().zip(are_thin).zip(block) {
            if is_thin {
                facet.normal = exact_normal(corners.each_ref().map(C::exact));
            }
        }
        out.extend_from_slice(&facets[..block.len()]);
    }
}

/// First edge, second edge, and first corner from the anchor; x, y, z of each.
#[derive(Default)]
struct Input {
    vectors: [[Lanes; 3]; 3],
}

fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Unit normal; zero for a triangle without an area.
fn exact_normal([a, b, c]: [DVec3; 3]) -> Vec3 {
    (b - a).cross(c - a).try_normalize().map_or(Vec3::ZERO, |normal| normal.as_vec3())
}

/// The facets, and which of them are so thin that their normals are not right to 3e-5: those are wanted from `f64`.
fn block_of(input: &Input) -> ([Facet; LANES], [bool; LANES]) {
    let [[ux, uy, uz], [vx, vy, vz], [px, py, pz]] = &input.vectors;
    let mut radius = [0.0; LANES];
    let mut normal = [[0.0; LANES]; 3];
    let mut angles = [[0.0; LANES]; 3];
    let mut volume = [0.0; LANES];
    let mut area_share = [0.0; LANES];
    let mut are_thin = [false; LANES];
    for lane in 0..LANES {
        // In units of the largest coordinate of its edges, which are then between −1 and 1.
        let size = larger(
            larger(larger(ux[lane].abs(), uy[lane].abs()), larger(uz[lane].abs(), vx[lane].abs())),
            larger(vy[lane].abs(), vz[lane].abs()),
        );
        let has_size = size > 1e-37;
        let scale = if has_size { 1.0 / larger(size, 1e-37) } else { 0.0 };
        let (ux, uy, uz) = (ux[lane] * scale, uy[lane] * scale, uz[lane] * scale);
        let (vx, vy, vz) = (vx[lane] * scale, vy[lane] * scale, vz[lane] * scale);
        let (wx, wy, wz) = (vx - ux, vy - uy, vz - uz);
        let (uu, vv, ww) = (ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz);
        let (nx, ny, nz) = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
        let twice_area = (nx * nx + ny * ny + nz * nz).sqrt();

        let long = larger(larger(uu, vv), ww);
        let short = smaller(smaller(uu, vv), ww);
        let half = 0.5 * long.sqrt();
        // Right or obtuse, or a needle, which exceeds half its longest edge by less than a part in ten thousand; the others are so
        // well shaped that their area is right to a few parts in a hundred thousand.
        let is_half = uu + vv + ww <= 2.0 * long || short < 1e-4 * long || twice_area <= 0.0;
        let circumscribed = (uu * vv * ww).sqrt() / (2.0 * larger(twice_area, 1e-30));
        let bounded = if is_half { half } else { smaller(circumscribed, half * 1.154_701) };
        let rounded = if has_size { bounded * size * 1.0001 } else { size * 2.0 };
        // What is too wide for `f32` is not a number by now.
        radius[lane] = if rounded >= 0.0 { rounded } else { f32::INFINITY };

        area_share[lane] = 0.5 * twice_area / larger(bounded * bounded, 1e-30);

        let is_thin = twice_area <= 1e-2 * long || !has_size;
        are_thin[lane] = is_thin;
        let unit = 1.0 / larger(twice_area, 1e-30);
        normal[0][lane] = nx * unit;
        normal[1][lane] = ny * unit;
        normal[2][lane] = nz * unit;

        // The angles at the first and the second corner, the third is what is left.
        let (lu, lv, lw) = (uu.sqrt(), vv.sqrt(), ww.sqrt());
        let at_first = angle((ux * vx + uy * vy + uz * vz) / larger(lu * lv, 1e-30));
        let at_second = angle(-(ux * wx + uy * wy + uz * wz) / larger(lu * lw, 1e-30));
        angles[0][lane] = at_first;
        angles[1][lane] = at_second;
        angles[2][lane] = larger(std::f32::consts::PI - at_first - at_second, 0.0);
        volume[lane] = (px[lane] * nx + py[lane] * ny + pz[lane] * nz) * (size * size);
    }
    let facets = std::array::from_fn(|lane| Facet {
        radius: radius[lane],
        normal: Vec3::new(normal[0][lane], normal[1][lane], normal[2][lane]),
        angles: [angles[0][lane], angles[1][lane], angles[2][lane]],
        area_share: area_share[lane],
        six_volumes: volume[lane],
    });
    (facets, are_thin)
}

/// acos within 0.0001 radian, without any platform's `libm`: it only weights.
/// acos(|x|) ≈ √(1 − |x|) · (1.5707288 − 0.2121144 |x| + 0.0742610 x² − 0.0187293 |x|³); Abramowitz & Stegun 4.4.45.
#[inline(always)]
fn angle(cos: f32) -> f32 {
    let x = smaller(cos.abs(), 1.0);
    let acute = (1.0 - x).sqrt() * (1.570_728_8 + x * (-0.212_114_4 + x * (0.074_261 - 0.018_729_3 * x)));
    if cos < 0.0 { std::f32::consts::PI - acute } else { acute }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::sphere::triangle_bounding_radius;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_facet_is_what_the_slow_way_finds(
            corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1f64..1.0)), 1..20),
            thin in 0i32..8, exponent in -12i32..12, offset in -1e3f64..1e3,
        ) {
            // From plain triangles to slivers, in all units.
            let unit = libm::exp10(f64::from(exponent));
            let thin = libm::exp10(-f64::from(thin));
            let corners: Vec<[[f64; 3]; 3]> = corners
                .iter()
                // Along no axis, so that small numbers are differences of large ones.
                .map(|corners| {
                    corners.map(|[x, y, z]| {
                        [(x + offset) * unit, (0.7 * x + y * thin) * unit, (z * thin - 0.4 * x) * unit]
                    })
                })
                .collect();
            let mut facets = Vec::new();
            measure(&corners, corners[0][0], &mut facets);
            prop_assert_eq!(facets.len(), corners.len());
            for (facet, corners) in facets.iter().zip(&corners) {
                let [a, b, c] = corners.map(DVec3::from_array);
                let exact = triangle_bounding_radius([a, b, c]);
                let found = f64::from(facet.radius);
                prop_assert!(found >= exact && found <= exact * 1.0003, "{} {}", found, exact);
                let cross = (b - a).cross(c - a);
                let area = f64::from(facet.area_share) * found * found;
                prop_assert!((area - cross.length() * 0.5).abs() <= 1e-3 * found * found, "{area}");
                let long = (b - a).length_squared().max((c - a).length_squared());
                // However thin: a cone must hold it.
                if let Some(normal) = cross.try_normalize() {
                    let off = facet.normal.as_dvec3().cross(normal).length();
                    prop_assert!(off < 3e-5 && facet.normal.as_dvec3().dot(normal) > 0.0, "{off}");
                }
                if cross.length() > 1e-3 * long {
                    for (corner, [at, to, and]) in [[a, b, c], [b, c, a], [c, a, b]].into_iter().enumerate() {
                        let angle = (to - at).angle_between(and - at);
                        prop_assert!((f64::from(facet.angles[corner]) - angle).abs() < 0.01, "{:?} {}", facet, angle);
                    }
                }
            }
        }
    }

    #[test]
    fn degenerate_triangles_have_no_normal_and_the_radius_of_their_longest_edge() {
        let (o, x, y) = ([0.0f32; 3], [1.0f32, 0.0, 0.0], [3.0f32, 0.0, 0.0]);
        let mut facets = Vec::new();
        measure(&[[o, o, o], [o, o, x], [o, x, y]], o, &mut facets);
        assert_eq!(facets.iter().map(|facet| facet.normal).collect::<Vec<_>>(), [Vec3::ZERO; 3]);
        let radii: Vec<f32> = facets.iter().map(|facet| facet.radius).collect();
        assert!(
            radii[0] == 0.0 && radii[1] >= 0.5 && radii[1] < 0.501 && radii[2] >= 1.5 && radii[2] < 1.501,
            "{radii:?}"
        );
    }
}
