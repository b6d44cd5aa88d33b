//! Makes PLY files: a random document, its bytes in each flavour, and the model that it means.
//!
//! [`Document::model`] is the oracle: it takes the meaning from the values before they are written, by lookups in plain
//! lists, and shares no line with the reader.

use crate::sources::Model;

/// A repeatable source of randomness (SplitMix64).
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Below `end`, which is not 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for index in (1..items.len()).rev() {
            items.swap(index, self.below(index + 1));
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Flavour {
    Ascii,
    Little,
    Big,
}

pub(crate) const FLAVOURS: [Flavour; 3] = [Flavour::Ascii, Flavour::Little, Flavour::Big];

pub(crate) const TYPES: [&str; 16] = [
    "char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint8", "int16", "uint16", "int32",
    "uint32", "float32", "float64",
];

#[derive(Clone, Debug)]
pub(crate) struct Document {
    pub elements: Vec<Element>,
}

#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub name: &'static str,
    pub properties: Vec<Property>,
    /// For each item, the values of each property: exactly one unless it is a list.
    pub items: Vec<Vec<Vec<f64>>>,
}

#[derive(Clone, Debug)]
pub(crate) struct Property {
    pub name: &'static str,
    /// Of the length, for a list.
    pub length: Option<&'static str>,
    pub scalar: &'static str,
}

impl Document {
    /// Up to six elements in any order, with properties of any types in any order.
    pub(crate) fn random(random: &mut Random, vertices: usize) -> Self {
        let mut names = vec!["x", "y", "z"];
        if random.below(2) == 0 {
            names.extend(["nx", "ny", "nz"]);
        }
        names.extend(random.pick(&[
            &[][..],
            &["red", "green", "blue"],
            &["diffuse_red", "diffuse_green", "diffuse_blue", "alpha"],
            &["r", "g", "b"],
            &["red", "green"],
        ]));
        let alike = random.pick(&TYPES);
        let mixed = random.below(3) == 0;
        let mut properties: Vec<_> = names
            .into_iter()
            .map(|name| Property { name, length: None, scalar: if mixed { random.pick(&TYPES) } else { alike } })
            .collect();
        properties.extend(extras(random));
        random.shuffle(&mut properties);
        let items = (0..vertices).map(|_| random_item(random, &properties)).collect();
        let mut elements = vec![Element { name: "vertex", properties, items }];
        if random.below(8) > 0 {
            elements.push(corner_element(random, "face", vertices));
        }
        if random.below(4) == 0 {
            elements.push(corner_element(random, "tristrips", vertices));
        }
        for name in ["camera", "edge", "nothing"].into_iter().take(random.below(4)) {
            let properties = if name == "nothing" { Vec::new() } else { extras(random) };
            let items = (0..random.below(4)).map(|_| random_item(random, &properties)).collect();
            elements.push(Element { name, properties, items });
        }
        random.shuffle(&mut elements);
        Self { elements }
    }

    pub(crate) fn bytes(&self, flavour: Flavour, line_end: &str) -> Vec<u8> {
        let format = match flavour {
            Flavour::Ascii => "ascii",
            Flavour::Little => "binary_little_endian",
            Flavour::Big => "binary_big_endian",
        };
        let mut lines = vec!["ply".to_owned(), format!("format {format} 1.0"), "comment a test".to_owned()];
        for Element { name, properties, items } in &self.elements {
            lines.push(format!("element {name} {}", items.len()));
            lines.extend(properties.iter().map(|Property { name, length, scalar }| match length {
                Some(length) => format!("property list {length} {scalar} {name}"),
                None => format!("property {scalar} {name}"),
            }));
        }
        lines.push("end_header".to_owned());
        let mut bytes: Vec<u8> = lines.iter().flat_map(|line| [line, line_end]).flat_map(str::bytes).collect();
        for element in &self.elements {
            for item in &element.items {
                let mut words = Vec::new();
                for (Property { length, scalar, .. }, values) in element.properties.iter().zip(item) {
                    words.extend(length.map(|length| (length, values.len() as f64)));
                    words.extend(values.iter().map(|&value| (*scalar, value)));
                }
                match flavour {
                    Flavour::Ascii => {
                        let text: Vec<_> = words.iter().map(|(_, value)| value.to_string()).collect();
                        bytes.extend((text.join(" ") + line_end).bytes());
                    }
                    _ => bytes.extend(words.iter().flat_map(|&(scalar, value)| encode(scalar, value, flavour))),
                }
            }
        }
        bytes
    }

    /// What a reader should make of it.
    pub(crate) fn model(&self) -> Model {
        let mut model = Model::default();
        for element in &self.elements {
            let column = |name: &str| element.properties.iter().position(|property| property.name == name);
            for item in &element.items {
                let triple = |names: [&str; 3]| {
                    let [a, b, c] = names.map(|name| column(name).map(|column| (item[column][0], column)));
                    Some([a?, b?, c?])
                };
                if element.name == "vertex" {
                    model.positions.extend(triple(["x", "y", "z"]).map(|triple| triple.map(|(value, _)| value)));
                    let normal = triple(["nx", "ny", "nz"]).map(|triple| triple.map(|(value, _)| value as f32));
                    let finite =
                        |normal: [f32; 3]| if normal.iter().all(|n| n.is_finite()) { normal } else { [0.0; 3] };
                    model.normals.extend(normal.map(finite));
                    let color = triple(["red", "green", "blue"])
                        .or_else(|| triple(["diffuse_red", "diffuse_green", "diffuse_blue"]))
                        .or_else(|| triple(["r", "g", "b"]));
                    model
                        .colors
                        .extend(color.map(|color| {
                            color.map(|(value, column)| color8(value, element.properties[column].scalar))
                        }));
                }
                let corners = || column("vertex_indices").or_else(|| column("vertex_index")).map(|at| &item[at]);
                match element.name {
                    "face" => model.triangles.extend(corners().into_iter().flat_map(|list| fan(list))),
                    "tristrips" => model.triangles.extend(corners().into_iter().flat_map(|list| strips(list))),
                    _ => {}
                }
            }
        }
        model
    }
}

fn fan(corners: &[f64]) -> Vec<[u32; 3]> {
    (2..corners.len()).map(|last| [corners[0], corners[last - 1], corners[last]].map(|corner| corner as u32)).collect()
}

fn strips(corners: &[f64]) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for strip in corners.split(|&corner| corner == -1.0 || corner == 4_294_967_295.0) {
        for (number, window) in strip.windows(3).enumerate() {
            let [a, b, c] = [window[0], window[1], window[2]].map(|corner| corner as u32);
            if a != b && b != c && a != c {
                triangles.push(if number % 2 == 0 { [a, b, c] } else { [b, a, c] });
            }
        }
    }
    triangles
}

fn color8(value: f64, scalar: &str) -> u8 {
    let full = match scalar {
        "float" | "float32" | "double" | "float64" => 1.0,
        "char" | "int8" | "uchar" | "uint8" => 255.0,
        other => bounds(other).1,
    };
    (value / full * 255.0).clamp(0.0, 255.0).round() as u8
}

/// Properties that mean nothing to the reader.
fn extras(random: &mut Random) -> Vec<Property> {
    let names = ["quality", "flags", "vertex_indices_of_neighbours", "s", "label"];
    let mut properties = Vec::new();
    for name in names.into_iter().take(random.below(4)) {
        let length = (random.below(3) == 0).then(|| random.pick(&TYPES));
        properties.push(Property { name, length, scalar: random.pick(&TYPES) });
    }
    properties
}

fn corner_element(random: &mut Random, name: &'static str, vertices: usize) -> Element {
    let common = random.below(2) == 0;
    let length = if common { "uchar" } else { random.pick(&TYPES) };
    let scalar = if common { random.pick(&["int", "uint"]) } else { random.pick(&TYPES) };
    let list = random.pick(&["vertex_indices", "vertex_index"]);
    let mut properties = if random.below(2) == 0 { extras(random) } else { Vec::new() };
    properties.insert(random.below(properties.len() + 1), Property { name: list, length: Some(length), scalar });
    let items = (0..random.below(40))
        .map(|_| {
            let mut item = random_item(random, &properties);
            let at = properties.iter().position(|property| property.name == list).expect("it was inserted");
            let length = if random.below(2) == 0 { 3 } else { random.below(9) };
            item[at] = (0..length).map(|_| random.below(vertices) as f64).collect();
            if name == "tristrips" && bounds(scalar).0 < 0.0 || scalar == "uint" {
                let restart = if scalar == "uint" { 4_294_967_295.0 } else { -1.0 };
                let is_strip = name == "tristrips";
                item[at].iter_mut().filter(|_| is_strip && random.below(6) == 0).for_each(|corner| *corner = restart);
            }
            item
        })
        .collect();
    Element { name, properties, items }
}

fn random_item(random: &mut Random, properties: &[Property]) -> Vec<Vec<f64>> {
    properties
        .iter()
        .map(|Property { length, scalar, .. }| {
            let count = if length.is_some() { random.below(5) } else { 1 };
            (0..count).map(|_| random_value(random, scalar)).collect()
        })
        .collect()
}

/// Any value of the type, small ones more often; exactly representable.
fn random_value(random: &mut Random, scalar: &str) -> f64 {
    let (least, most) = bounds(scalar);
    let unit = (random.next() >> 11) as f64 / (1_u64 << 53) as f64;
    match scalar {
        "float" | "float32" => f64::from((unit * 2.0 - 0.5) as f32),
        "double" | "float64" => (unit - 0.5) * 10_f64.powi(random.below(600) as i32 - 300),
        _ if random.below(2) == 0 => (unit * 200.0).floor().min(most),
        _ => (least + unit * (most - least)).round(),
    }
}

fn bounds(scalar: &str) -> (f64, f64) {
    match scalar {
        "char" | "int8" => (-128.0, 127.0),
        "uchar" | "uint8" => (0.0, 255.0),
        "short" | "int16" => (-32768.0, 32767.0),
        "ushort" | "uint16" => (0.0, 65535.0),
        "int" | "int32" => (-2_147_483_648.0, 2_147_483_647.0),
        "uint" | "uint32" => (0.0, 4_294_967_295.0),
        _ => (-1.0, 1.0),
    }
}

fn encode(scalar: &str, value: f64, flavour: Flavour) -> Vec<u8> {
    let mut bytes = match scalar {
        "char" | "int8" => (value as i8).to_be_bytes().to_vec(),
        "uchar" | "uint8" => vec![value as u8],
        "short" | "int16" => (value as i16).to_be_bytes().to_vec(),
        "ushort" | "uint16" => (value as u16).to_be_bytes().to_vec(),
        "int" | "int32" => (value as i32).to_be_bytes().to_vec(),
        "uint" | "uint32" => (value as u32).to_be_bytes().to_vec(),
        "float" | "float32" => (value as f32).to_be_bytes().to_vec(),
        _ => value.to_be_bytes().to_vec(),
    };
    if flavour == Flavour::Little {
        bytes.reverse();
    }
    bytes
}
