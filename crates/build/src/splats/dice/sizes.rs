//! How large the triangles of a mesh are, and from that how finely large ones are cut.
//!
//! In: each triangle's bounding radius and its area as a share of the radius' square, in any order. Out: areas and numbers by
//! size, in integers, so that no order shows; and a [`Dicing`].

/// What is to be cut, and how finely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dicing {
    /// Cells are no larger than squares of this size; model units.
    pub(crate) spacing: f64,
    /// Triangles with a larger bounding radius are cut.
    pub(crate) threshold: f64,
}

impl Dicing {
    /// Says so of a triangle by its bounding radius.
    pub(crate) fn is_diced(&self, radius: f32) -> bool {
        f64::from(radius) > self.threshold
    }
}

/// Eight sizes an octave.
const SHIFT: u32 = 20;
const SIZES: usize = 1 << (31 - SHIFT);
/// Areas are counted in this part of a square of the size.
const AREA_UNIT: f64 = 1.0 / (1 << 20) as f64;

/// Triangles by size.
#[derive(Clone)]
pub(crate) struct Sizes {
    areas: Vec<u64>,
    counts: Vec<u64>,
    largest: f32,
    triangles: u64,
}

impl Default for Sizes {
    fn default() -> Self {
        Self { areas: vec![0; SIZES], counts: vec![0; SIZES], largest: 0.0, triangles: 0 }
    }
}

/// A model whose vertices are mostly inside a smooth surface, and has so many triangles, is a scan.
const LEAST_OF_A_SCAN: u64 = 512;
/// Of a scan, what is larger than so many times the mean spacing of its vertices is no sample any more.
const OUT_OF_SCALE: f64 = 8.0;

/// Samples of a model that has few triangles, and that each triangle may ask for.
const LEAST_SAMPLES: u64 = 1 << 18;
const SAMPLES_PER_TRIANGLE: u64 = 512;
/// Of a model that has many, unless it has more triangles.
const MOST_SAMPLES: u64 = 1 << 21;

/// What is known of a mesh besides sizes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    /// Share of the vertices that lie inside a smooth surface.
    pub(crate) smooth_share: f64,
    /// Colours belong to triangles: each is a sample at least.
    pub(crate) is_painted: bool,
    /// Texels that are shown.
    pub(crate) texels: u64,
}

impl Sizes {
    /// Adds a triangle: its bounding radius, and its area as a share of the radius' square.
    pub(crate) fn add(&mut self, radius: f32, area_share: f32) {
        self.triangles += 1;
        self.largest = self.largest.max(radius);
        let size = (radius.to_bits() >> SHIFT) as usize;
        let low = f32::from_bits((size as u32) << SHIFT);
        if low > 0.0 && radius.is_finite() {
            let ratio = radius / low;
            self.counts[size] += 1;
            self.areas[size] += (f64::from(area_share * ratio * ratio) / AREA_UNIT) as u64;
        }
    }

    /// Adds what another has counted.
    pub(crate) fn merge(&mut self, other: &Self) {
        for (sum, more) in self.areas.iter_mut().zip(&other.areas).chain(self.counts.iter_mut().zip(&other.counts)) {
            *sum += more;
        }
        self.largest = self.largest.max(other.largest);
        self.triangles += other.triangles;
    }

    /// The largest bounding radius.
    pub(crate) fn largest(&self) -> f64 {
        f64::from(self.largest)
    }

    /// Upper end of each size, area and number of its triangles.
    fn classes(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        self.areas.iter().zip(&self.counts).enumerate().filter(|(_, (_, count))| **count > 0).map(
            |(size, (area, count))| {
                let end = |size: usize| f64::from(f32::from_bits((size as u32) << SHIFT));
                let (low, high) = (end(size), end(size + 1).min(f64::from(f32::MAX)));
                (high, *area as f64 * AREA_UNIT * low * low, *count as f64)
            },
        )
    }

    /// About as many samples as a mesh is cut into.
    pub(crate) fn samples(&self, dicing: Dicing) -> f64 {
        self.cells(dicing.spacing, dicing.threshold)
    }

    fn area(&self) -> f64 {
        self.classes().map(|(_, area, _)| area).sum()
    }

    /// About as many cells as the triangles beyond a radius are cut into: a square for each, and what rounding up to whole
    /// rows and strips costs, which goes with their size.
    fn cells(&self, spacing: f64, beyond: f64) -> f64 {
        let of = |(radius, area, count): (f64, f64, f64)| area / spacing / spacing + 1.5 * radius * count / spacing;
        self.classes().filter(|(radius, ..)| *radius > beyond).map(of).sum()
    }

    /// The finest spacing that needs no more cells than that.
    fn spacing_for(&self, cells: f64, beyond: impl Fn(f64) -> f64) -> f64 {
        let mut low = 0.0;
        let mut high = self.largest().max(f64::from(f32::MIN_POSITIVE));
        while self.cells(high, beyond(high)) > cells {
            (low, high) = (high, high * 2.0);
        }
        for _ in 0..40 {
            let middle = (low + high) * 0.5;
            if self.cells(middle, beyond(middle)) > cells { low = middle } else { high = middle }
        }
        high
    }

    /// How a mesh is cut; `None` where nothing of it is. `asked` is the spacing that the user asks for, if any.
    ///
    /// * **A scan** — most vertices lie inside a smooth surface — is sampled already, by its vertices. Only triangles out of all
    ///   proportion are cut, such as those that close the base of a statue: beyond eight times the mean spacing of its vertices
    ///   (that of an even mesh of as much area and as many triangles), as finely as that.
    /// * **Any other mesh**, such as a building, is sampled evenly with about as many samples as it has triangles, but at least
    ///   2¹⁸, and up to 2²¹ where it has 512 for each triangle or as many texels.
    /// * **A painted mesh** is never left to its vertices, which have no colours: each triangle is a sample at least.
    pub(crate) fn dicing(&self, kind: Kind, asked: Option<f64>) -> Option<Dicing> {
        let wanted = self.triangles.saturating_mul(SAMPLES_PER_TRIANGLE).max(kind.texels);
        let samples = self.triangles.max(wanted.clamp(LEAST_SAMPLES, MOST_SAMPLES)) as f64;
        let dicing = if let Some(spacing) = asked {
            Dicing { spacing, threshold: spacing }
        } else if kind.is_painted {
            Dicing { spacing: self.spacing_for(samples, |_| 0.0), threshold: 0.0 }
        } else if kind.smooth_share >= 0.5 && self.triangles >= LEAST_OF_A_SCAN {
            let own = (2.0 * self.area() / self.triangles as f64).sqrt();
            let threshold = own * OUT_OF_SCALE;
            Dicing { spacing: self.spacing_for(samples, |_| threshold).max(own), threshold }
        } else {
            let spacing = self.spacing_for(samples, |spacing| spacing);
            Dicing { spacing, threshold: spacing }
        };
        if kind.is_painted {
            return Some(Dicing { threshold: -1.0, ..dicing });
        }
        (self.largest() > dicing.threshold).then_some(dicing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Kind = Kind { smooth_share: 0.0, is_painted: false, texels: 0 };
    const SCAN: Kind = Kind { smooth_share: 1.0, is_painted: false, texels: 0 };

    /// Right-angled ones with legs of these lengths.
    fn sizes(legs: impl IntoIterator<Item = f32>) -> Sizes {
        let mut sizes = Sizes::default();
        for leg in legs {
            sizes.add(leg * std::f32::consts::FRAC_1_SQRT_2, 1.0);
        }
        sizes
    }

    #[test]
    fn areas_do_not_depend_on_the_order() {
        let legs = || (0..5000u32).map(|i| (1.0 + (i * 7919 % 5000) as f32) * 0.013);
        let mut turned: Vec<f32> = legs().collect();
        turned.reverse();
        let (a, b) = (sizes(legs()), sizes(turned));
        let exact: f64 = legs().map(|leg| f64::from(leg) * f64::from(leg) / 2.0).sum();
        assert!((a.area() - exact).abs() < 1e-5 * exact && a.area() == b.area(), "{} {exact}", a.area());
        assert_eq!(a.dicing(PLAIN, None), b.dicing(PLAIN, None));
    }

    #[test]
    fn a_scan_is_left_alone_but_for_what_is_out_of_scale() {
        let even = || (0..10_000).map(|i| 1.0 + (i % 3) as f32);
        assert_eq!(sizes(even()).dicing(SCAN, None), None);
        let dicing = sizes(even().chain([500.0; 2])).dicing(SCAN, None).unwrap();
        assert!(dicing.threshold > 16.0 && dicing.threshold < 60.0 && dicing.spacing < 8.0, "{dicing:?}");
        // The same triangles, but not of a smooth surface.
        assert!(sizes(even()).dicing(PLAIN, None).unwrap().threshold < 1.0);
    }

    #[test]
    fn a_few_large_triangles_become_a_quarter_of_a_million_samples_and_many_two_millions() {
        for (count, most) in [(2, 1 << 18), (12, 1 << 18), (100_000, 1 << 21)] {
            let all = sizes(std::iter::repeat_n(30.0, count));
            let Dicing { spacing, threshold } = all.dicing(PLAIN, None).unwrap();
            let samples = 450.0 * count as f64 / spacing / spacing;
            assert!(threshold == spacing && samples <= f64::from(most), "{samples}");
            assert!(samples > f64::from(most) * if count < 20 { 0.9 } else { 0.3 }, "{samples} of {most}");
        }
        // As many as that are samples already.
        assert_eq!(sizes(std::iter::repeat_n(30.0, 3_000_000)).dicing(PLAIN, None), None);
        let texels = Kind { texels: 1 << 20, is_painted: true, ..PLAIN };
        let Dicing { spacing, threshold } = sizes([30.0; 2]).dicing(texels, None).unwrap();
        assert!(threshold < 0.0 && 900.0 / spacing / spacing > 0.9 * f64::from(1 << 20));
    }

    #[test]
    fn what_has_no_size_can_be_asked_for() {
        let nothing = sizes([0.0; 10]);
        assert_eq!(nothing.dicing(PLAIN, None), None);
        assert!(nothing.dicing(Kind { is_painted: true, ..PLAIN }, None).unwrap().spacing > 0.0);
        assert_eq!(sizes([1.0]).dicing(PLAIN, Some(5.0)), None, "smaller than asked for");
    }
}
