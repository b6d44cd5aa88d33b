//! Materials: numbers for the names that `usemtl` gives, and what libraries say about them.

use crate::{
    Mapping, Material, SideFiles, Texture, Wrap,
    input::Input,
    text::{self, Lines, name, numbers},
};
use std::collections::HashMap;

/// Most materials of a model, so that hostile names take bounded memory.
const MOST: usize = 1 << 16;
/// Most libraries that are looked for.
const MOST_LIBRARIES: u32 = 256;
/// What is less opaque is not there: half of 255, as where glTF says nothing else.
const HALF_OPAQUE: u8 = 127;
/// Longest name in bytes.
const MAX_NAME_BYTES: usize = 1024;

/// The materials of a file.
#[derive(Default)]
pub(super) struct Materials {
    /// Those used so far.
    pub(super) used: Vec<Material>,
    numbers: HashMap<String, u32>,
    /// What libraries say, by name.
    library: HashMap<String, Material>,
    /// Libraries that were looked for.
    libraries: u32,
}

impl Materials {
    /// The number of the material that `usemtl` names; none where there are too many.
    pub(super) fn number(&mut self, rest: &[u8]) -> Option<u32> {
        let name = name(&rest[..rest.len().min(MAX_NAME_BYTES)]);
        if let Some(&number) = self.numbers.get(&name) {
            return Some(number);
        }
        let number = u32::try_from(self.used.len()).ok().filter(|_| self.used.len() < MOST)?;
        let material = self.library.get(&name).cloned().unwrap_or_else(|| Material::plain(name.clone()));
        self.used.push(material);
        self.numbers.insert(name, number);
        Some(number)
    }

    /// Reads a library; one that cannot be had, or is none, as far as it goes.
    pub(super) fn read_library(&mut self, rest: &[u8], side: &mut dyn SideFiles) {
        // The rest of the line is one name, perhaps with blanks, or several.
        let whole = name(rest);
        if !self.read_file(&whole, side) {
            for name in whole.split_ascii_whitespace() {
                self.read_file(name, side);
            }
        }
    }

    /// Reads a library if it can be had.
    fn read_file(&mut self, name: &str, side: &mut dyn SideFiles) -> bool {
        if self.libraries == MOST_LIBRARIES {
            return false;
        }
        self.libraries += 1;
        // What is wrong with it is no error of the model.
        side.open(name).map(|source| self.read(source)).is_ok()
    }

    fn read(&mut self, source: Box<dyn crate::ByteSource>) -> Result<(), crate::ImportError> {
        let mut input = Input::new(source)?;
        input.has(1)?;
        let mut lines = Lines::continued(&input);
        let mut material: Option<Material> = None;
        let mut mask = None;
        while let Some(line) = lines.next(&mut input)? {
            let Some((word, rest)) = text::word(line) else { continue };
            match (word, &mut material) {
                (b"newmtl", _) => {
                    let next = Material::plain(name(&rest[..rest.len().min(MAX_NAME_BYTES)]));
                    self.insert(material.replace(next), mask.take());
                }
                (b"Kd", Some(material)) => {
                    if let Ok((color, _)) = numbers::<3>(rest) {
                        material.color = color.map(|value| (value * 255.0 + 0.5) as u8);
                    }
                }
                (b"map_Kd", Some(material)) => (material.texture, material.mapping) = texture(rest),
                (b"map_d", Some(_)) => mask = texture(rest).0,
                _ => {}
            }
        }
        self.insert(material, mask);
        Ok(())
    }

    /// `mask` is the picture that `map_d` names: leaves are cut out of the picture that also has their colours.
    fn insert(&mut self, material: Option<Material>, mask: Option<Texture>) {
        if let Some(mut material) = material
            && self.library.len() < MOST
        {
            if mask.is_some() && mask == material.texture {
                material.alpha_cutoff = Some(HALF_OPAQUE);
            }
            self.library.entry(material.name.clone()).or_insert(material);
        }
    }
}

/// What a `map_Kd` says: options, each of which has a known number of arguments, and the file's name.
fn texture(mut rest: &[u8]) -> (Option<Texture>, Mapping) {
    let mut mapping = Mapping::default();
    while let Some((word, after)) = text::word(rest)
        && word.starts_with(b"-")
    {
        let most = match word {
            b"-o" | b"-s" | b"-t" => 3,
            b"-mm" => 2,
            b"-blendu" | b"-blendv" | b"-boost" | b"-bm" | b"-cc" | b"-clamp" | b"-imfchan" | b"-texres" | b"-type" => {
                1
            }
            _ => break, // A name that begins with a minus.
        };
        rest = after;
        for argument in 0..most {
            match text::word(rest) {
                // Of three numbers, the last two may be missing.
                Some((value, after)) if argument == 0 || crate::number::parse(value).is_some() => {
                    take_argument(&mut mapping, word, argument, value);
                    rest = after;
                }
                _ => break,
            }
        }
    }
    let name = name(&rest[..rest.len().min(MAX_NAME_BYTES)]);
    ((!name.is_empty()).then_some(Texture::File(name)), mapping)
}

/// Takes the argument of an option of a `map_Kd`, if it says where the picture is.
fn take_argument(mapping: &mut Mapping, option: &[u8], argument: usize, value: &[u8]) {
    let number = crate::number::parse(value).map(|value| value as f32).filter(|value| value.is_finite());
    match (option, number) {
        (b"-o", Some(number)) if argument < 2 => mapping.offset[argument] = number,
        (b"-s", Some(number)) if argument < 2 => mapping.scale[argument] = number,
        (b"-clamp", _) if value == b"on" => mapping.wrap = [Wrap::Clamp; 2],
        _ => {}
    }
}
