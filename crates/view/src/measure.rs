//! The distance between two points that a person picks.

use crate::picker::Found;

/// Up to two points.
#[derive(Clone, Debug, Default)]
pub(crate) struct Measuring {
    /// Clicks pick points.
    pub(crate) is_on: bool,
    asked: u64,
    points: Vec<(u64, Option<Found>)>,
}

impl Measuring {
    /// A point is being looked for: the first, the second, or the first of the next measurement. Returns its number.
    pub(crate) fn begin(&mut self) -> u64 {
        if self.points.len() >= 2 {
            self.points.clear();
        }
        self.asked += 1;
        self.points.push((self.asked, None));
        self.asked
    }

    /// What was found, or nothing, or better than before.
    pub(crate) fn found(&mut self, number: u64, found: Option<Found>) {
        match found {
            None => self.points.retain(|(asked, _)| *asked != number),
            Some(_) => self.points.iter_mut().filter(|(asked, _)| *asked == number).for_each(|(_, at)| *at = found),
        }
    }

    /// Forgets the points.
    pub(crate) fn clear(&mut self) {
        self.points.clear();
    }

    /// Points that were found.
    pub(crate) fn points(&self) -> impl Iterator<Item = Found> {
        self.points.iter().filter_map(|(_, found)| *found)
    }

    /// Distance in world units, how uncertain it is, and whether something better is to come.
    pub(crate) fn distance(&self) -> Option<(f64, f64, bool)> {
        let [a, b] = self.points().collect::<Vec<_>>()[..] else { return None };
        Some(((a.point - b.point).length(), a.uncertain + b.uncertain, a.to_come || b.to_come))
    }
}

/// With as many digits as are true, and at most 15: doubles have no more.
pub(crate) fn digits(value: f64, uncertain: f64) -> String {
    let magnitude = value.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
    let true_digits = if uncertain > 0.0 { magnitude - uncertain.log10().floor() as i32 + 1 } else { 9 };
    let decimals = (true_digits.clamp(2, 15) - 1 - magnitude).clamp(0, 15);
    format!("{value:.*}", decimals as usize)
}

/// A length as it is told: `316 ± 48 ft`.
pub(crate) fn length(value: f64, uncertain: f64, unit: Option<&str>) -> String {
    let around = if uncertain > 0.0 { format!(" ± {}", digits(uncertain, uncertain)) } else { String::new() };
    let unit = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
    format!("{}{around}{unit}", digits(value, uncertain))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn found(x: f64, uncertain: f64, to_come: bool) -> Option<Found> {
        Some(Found { point: DVec3::X * x, uncertain, detail: uncertain, to_come })
    }

    #[test]
    fn two_points_make_a_distance_and_a_third_begins_anew() {
        let mut measuring = Measuring::default();
        let (a, b) = (measuring.begin(), measuring.begin());
        measuring.found(b, found(5.0, 0.1, true));
        assert_eq!(measuring.distance(), None);
        measuring.found(a, found(2.0, 0.1, false));
        assert_eq!(measuring.distance(), Some((3.0, 0.2, true)));
        measuring.found(b, found(5.5, 0.0, false));
        assert_eq!(measuring.distance(), Some((3.5, 0.1, false)));
        measuring.begin();
        assert_eq!(measuring.points().count(), 0);
        // A late answer to a question that nobody asks any more.
        measuring.found(a, found(2.0, 0.0, false));
        assert_eq!(measuring.points().count(), 0);
    }

    #[test]
    fn numbers_have_the_digits_that_are_true() {
        assert_eq!(digits(123.456_789, 0.01), "123.46");
        assert_eq!(digits(0.001_234_567, 1e-6), "0.001235");
        assert_eq!(length(316.2, 48.2, Some("ft")), "316 ± 48 ft");
        assert_eq!(length(1.666_364_83, 0.0, None), "1.66636483");
        assert_eq!(digits(12.345_678_912_3, 0.0), "12.3456789");
        assert_eq!(digits(98_765.0, 500.0), "98765");
    }
}
