//! What a model's coordinates mean on the Earth, as far as its file says.
//!
//! In: a description in well-known text (WKT 1 as of OGC 01-009, WKT 2 as of ISO 19162), or the keys of a GeoTIFF. Out: name,
//! number and text of the system of coordinates, and the unit of lengths. Nothing is looked up and nothing converted.
//!
//! What always holds: names and texts are bounded; what is not understood is left out and is no error.

use gigalod_geom::LengthUnit;

/// Longest text that is kept, in bytes.
const MOST_WKT_BYTES: usize = 1 << 16;
/// Longest name, in characters.
const MOST_NAME: usize = 256;

/// The system of coordinates that a model is in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReferenceSystem {
    /// As the file has it.
    pub name: Option<String>,
    /// Its number in the register of EPSG.
    pub epsg: Option<u32>,
    /// Its description in well-known text, as the file has it.
    pub wkt: Option<String>,
}

impl ReferenceSystem {
    /// None where nothing is known.
    pub(crate) fn known(self) -> Option<Self> {
        (self != Self::default()).then_some(self)
    }
}

/// A name as it is kept: one line, not too long; none where it is empty.
pub(crate) fn name(text: &str) -> Option<String> {
    let words: Vec<_> = text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|it| !it.is_empty()).collect();
    let name: String = words.join(" ").chars().take(MOST_NAME).collect();
    (!name.is_empty()).then_some(name)
}

/// Words that begin the description of a system of coordinates.
const SYSTEMS: [&str; 17] = [
    "PROJCS",
    "PROJCRS",
    "PROJECTEDCRS",
    "GEOGCS",
    "GEOGCRS",
    "GEOGRAPHICCRS",
    "GEOCCS",
    "GEODCRS",
    "GEODETICCRS",
    "LOCAL_CS",
    "ENGCRS",
    "ENGINEERINGCRS",
    "COMPD_CS",
    "COMPOUNDCRS",
    "BOUNDCRS",
    "FITTED_CS",
    "DERIVEDPROJCRS",
];
/// Those made of others, the horizontal one first.
const COMPOUND: [&str; 3] = ["COMPD_CS", "COMPOUNDCRS", "BOUNDCRS"];
/// Those whose horizontal coordinates are lengths.
const METRIC: [&str; 8] =
    ["PROJCS", "PROJCRS", "PROJECTEDCRS", "GEOCCS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS", "DERIVEDPROJCRS"];

/// What a text says, and the unit of the horizontal coordinates; nothing of a text that is not WKT.
pub(crate) fn of_wkt(text: &str) -> (Option<ReferenceSystem>, Option<LengthUnit>) {
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    if text.len() > MOST_WKT_BYTES {
        return (None, None);
    }
    let mut found = Found::default();
    let mut path: Vec<Node<'_>> = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        match first {
            '"' => {
                let end = rest[1..].find('"').map_or(rest.len(), |end| end + 1);
                found.value(&path, &rest[1..end], true);
                rest = rest.get(end + 1..).unwrap_or_default();
            }
            ']' | ')' => {
                if path.pop().is_none() {
                    return (None, None);
                }
                rest = &rest[1..];
            }
            ',' => {
                if let Some(node) = path.last_mut() {
                    node.argument += 1;
                }
                rest = &rest[1..];
            }
            _ if first.is_whitespace() => rest = rest.trim_start(),
            _ => {
                let end = rest.find(['[', '(', ']', ')', ',', '"']).unwrap_or(rest.len());
                if rest[end..].starts_with(['[', '(']) {
                    path.push(Node { word: rest[..end].trim(), argument: 0 });
                    rest = &rest[end + 1..];
                    if path.len() > 64 {
                        return (None, None);
                    }
                } else {
                    found.value(&path, rest[..end].trim(), false);
                    rest = &rest[end..];
                }
            }
        }
    }
    match found.name {
        Some(name) => {
            let system = ReferenceSystem {
                name: self::name(name),
                epsg: found.epsg.map(|(_, epsg)| epsg),
                wkt: Some(text.to_owned()),
            };
            (Some(system), found.unit)
        }
        None => (None, None),
    }
}

/// An open bracket: the word before it, and which of its arguments comes.
struct Node<'a> {
    word: &'a str,
    argument: usize,
}

#[derive(Default)]
struct Found<'a> {
    name: Option<&'a str>,
    /// How deep it stands, and the number.
    epsg: Option<(usize, u32)>,
    unit: Option<LengthUnit>,
    is_epsg: bool,
}

fn is_one_of(word: &str, words: &[&str]) -> bool {
    words.iter().any(|other| word.eq_ignore_ascii_case(other))
}

impl<'a> Found<'a> {
    /// A value within the brackets of `path`.
    fn value(&mut self, path: &[Node<'_>], value: &'a str, is_text: bool) {
        let Some((node, above)) = path.split_last() else { return };
        let depth = above.len();
        // What belongs to the system itself, not to one that it is derived from.
        let is_of_one_of = |above: &[Node<'_>], words: &[&str]| match above.split_last() {
            Some((system, around)) => {
                is_one_of(system.word, words) && around.iter().all(|node| is_one_of(node.word, &COMPOUND))
            }
            None => false,
        };
        if is_text && node.argument == 0 && self.name.is_none() && is_one_of(node.word, &SYSTEMS) {
            self.name = Some(value);
        } else if is_one_of(node.word, &["AUTHORITY", "ID"]) && is_of_one_of(above, &SYSTEMS) {
            match node.argument {
                0 => self.is_epsg = value.eq_ignore_ascii_case("EPSG"),
                // Of the whole rather than of a part; of parts, of the first, which is the horizontal one.
                1 if self.is_epsg && self.epsg.is_none_or(|(other, _)| depth < other) => {
                    self.epsg = value.parse().ok().map(|number| (depth, number)).or(self.epsg);
                }
                _ => {}
            }
        } else if is_one_of(node.word, &["UNIT", "LENGTHUNIT"]) && node.argument == 1 && self.unit.is_none() {
            let of_axis = above.last().is_some_and(|above| is_one_of(above.word, &["AXIS"]));
            let above = &above[..above.len() - usize::from(of_axis)];
            if is_of_one_of(above, &METRIC) {
                self.unit = value.parse().ok().and_then(LengthUnit::of_metres);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_names_numbers_and_units_of_descriptions_are_found() {
        let geographic = r#"GEOGCS["NAD83",DATUM["D",SPHEROID["GRS 1980",6378137,298.25,AUTHORITY["EPSG","7019"]]],
            PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4269"]]"#;
        let projected = |unit: &str, authority: &str| {
            format!(
                r#"PROJCS["NAD83 / Oregon",{geographic},PROJECTION["Lambert"],PARAMETER["false_easting",1312335.958],
                UNIT[{unit}]{authority}]"#
            )
        };
        let of_2994 = r#",AUTHORITY["EPSG","2994"]"#;
        let compound = format!(
            r#"COMPD_CS["both",{},VERT_CS["NAVD88",VERT_DATUM["D",2005],UNIT["metre",1],AUTHORITY["EPSG","5703"]]]"#,
            projected(r#""foot",0.3048,AUTHORITY["EPSG","9002"]"#, of_2994)
        );
        let of_6349 = format!("{},AUTHORITY[\"EPSG\",\"6349\"]]", &compound[..compound.len() - 1]);
        let second = r#"PROJCRS["WGS 84 / UTM zone 32N",BASEGEOGCRS["WGS 84",DATUM["D",ELLIPSOID["WGS 84",6378137,298.25,
            LENGTHUNIT["metre",1]]],ID["EPSG",4326]],CONVERSION["UTM",PARAMETER["False easting",500,LENGTHUNIT["kilometre",1000]],
            ID["EPSG",16032]],CS[Cartesian,2],AXIS["(E)",east,ORDER[1],LENGTHUNIT["US survey foot",0.304800609601219]],ID["EPSG",32632]]"#;
        for (text, name, epsg, unit) in [
            (geographic.to_owned(), "NAD83", Some(4269), None),
            (projected(r#""metre",1"#, ""), "NAD83 / Oregon", None, Some(LengthUnit::Metre)),
            (projected(r#""foot",0.3048"#, of_2994), "NAD83 / Oregon", Some(2994), Some(LengthUnit::Foot)),
            (projected(r#""rod",5.0292"#, of_2994), "NAD83 / Oregon", Some(2994), None),
            (compound, "both", Some(2994), Some(LengthUnit::Foot)),
            (of_6349, "both", Some(6349), Some(LengthUnit::Foot)),
            (second.to_owned(), "WGS 84 / UTM zone 32N", Some(32632), Some(LengthUnit::UsSurveyFoot)),
            (r#"LOCAL_CS["site \n",UNIT["mm",0.001]]"#.to_owned(), "site \\n", None, Some(LengthUnit::Millimetre)),
        ] {
            let (system, found) = of_wkt(&format!("{text}\0"));
            let system = system.expect(name);
            assert_eq!((system.name.as_deref(), system.epsg, found), (Some(name), epsg, unit));
            assert_eq!(system.wkt, Some(text));
        }
        for text in ["", "4326", "PROJCS", "urn:ogc:def:crs:EPSG::4326", "]]]", "\"PROJCS[", "<wkt/>"] {
            assert_eq!(of_wkt(text), (None, None), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_taken(text in "(PROJCS|UNIT|AXIS|AUTHORITY|[\\[\\](),\" é1-9]|\"EPSG\"){0,60}") {
            let (system, _) = of_wkt(&text);
            prop_assert!(system.is_none_or(|system| system.wkt.is_some()));
        }
    }
}
