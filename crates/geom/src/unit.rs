//! Units of length that models come in.
//!
//! In: a symbol, or a length in metres. Out: one of the units known here, or none. Coordinates are never converted: a unit says
//! what they mean.

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    /// Of the SI.
    Metre,
    /// 0.001 m.
    Millimetre,
    /// 0.01 m.
    Centimetre,
    /// 1000 m.
    Kilometre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The foot of surveys in the United States, 1200/3937 m.
    UsSurveyFoot,
    /// The international inch, 0.0254 m.
    Inch,
}

impl LengthUnit {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Metre, Self::Millimetre, Self::Centimetre, Self::Kilometre, Self::Foot, Self::UsSurveyFoot, Self::Inch];

    /// `m`, `mm`, `cm`, `km`, `ft`, `us-ft` or `in`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Kilometre => "km",
            Self::Foot => "ft",
            Self::UsSurveyFoot => "us-ft",
            Self::Inch => "in",
        }
    }

    /// Its length in metres.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
            Self::Kilometre => 1e3,
            Self::Foot => 0.3048,
            Self::UsSurveyFoot => 1200.0 / 3937.0,
            Self::Inch => 0.0254,
        }
    }

    /// The unit of a length in metres, which is right to eight digits at least: the two feet differ in the sixth.
    pub fn of_metres(metres: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| (metres / unit.metres() - 1.0).abs() < 1e-8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_that_of_one_unit_or_of_none() {
        for unit in LengthUnit::ALL {
            assert_eq!(LengthUnit::of_metres(unit.metres()), Some(unit));
            let named = LengthUnit::ALL.into_iter().filter(|other| other.symbol() == unit.symbol());
            assert_eq!(named.count(), 1);
        }
        assert_eq!(LengthUnit::of_metres(0.304_800_61), Some(LengthUnit::UsSurveyFoot), "as some files have it");
        for metres in [0.9144, 0.304_799, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(LengthUnit::of_metres(metres), None, "{metres}");
        }
    }
}
