//! Gathers what triangles show while a stream is read, then reads the pictures.

use super::pictures::{self, Failure};
use super::{Look, NONE, Paint, Texel};
use crate::BuildError;
use crate::progress::Phases;
use crate::splats::plan::MemoryPlan;
use crate::spool::{Place, Spool};
use gigalod_import::{Batch, ModelStream, Texture};
use std::collections::HashMap;
use std::io;

/// What a stream has brought so far. Nothing is kept of a stream that brings no materials.
pub(in super::super) struct Reading<'a> {
    place: Place<'a>,
    triangles: u64,
    spools: Option<Spools>,
    /// By number: named by a triangle.
    used: Vec<bool>,
}

struct Spools {
    tex_coords: Spool<[f32; 2]>,
    corners: Spool<[u32; 3]>,
    materials: Spool<u32>,
}

impl<'a> Reading<'a> {
    pub(in super::super) fn new(place: Place<'a>) -> Self {
        Self { place, triangles: 0, spools: None, used: Vec::new() }
    }

    pub(in super::super) fn push(&mut self, batch: &Batch) -> io::Result<()> {
        let (corners, materials) = (&batch.corners.tex_coords, &batch.corners.materials);
        if self.spools.is_none() {
            // Materials come no later than texture coordinates are used; those that came before are nobody's.
            if batch.tex_coords.is_empty() && materials.is_empty() {
                self.triangles += batch.triangles.len() as u64;
                return Ok(());
            }
            let mut spools = Spools {
                tex_coords: Spool::named(&self.place, "tex_coords")?,
                corners: Spool::named(&self.place, "tex_corners")?,
                materials: Spool::named(&self.place, "materials")?,
            };
            let mut left = self.triangles;
            while left > 0 {
                let now = left.min(MemoryPlan::PIECE as u64);
                spools.push_none(now as usize)?;
                left -= now;
            }
            self.spools = Some(spools);
        }
        let Some(spools) = &mut self.spools else { return Ok(()) };
        self.triangles += batch.triangles.len() as u64;
        spools.tex_coords.push(&batch.tex_coords)?;
        match corners.is_empty() {
            true => spools.corners.push(&vec![[NONE; 3]; batch.triangles.len()])?,
            false => spools.corners.push(corners)?,
        }
        match materials.is_empty() {
            true => spools.materials.push(&vec![NONE; batch.triangles.len()])?,
            false => spools.materials.push(materials)?,
        }
        for &material in materials.iter().filter(|material| **material != NONE) {
            let number = material as usize;
            if number >= self.used.len() {
                self.used.resize(number + 1, false);
            }
            self.used[number] = true;
        }
        Ok(())
    }

    /// All batches have come: what the model shows, if any of its materials shows more than its vertices do.
    pub(in super::super) fn finish(
        self,
        input: &mut dyn ModelStream,
        plan: &MemoryPlan<'_>,
        phases: &Phases<'_>,
    ) -> Result<Option<Paint>, BuildError> {
        let Some(Spools { tex_coords, corners, materials }) = self.spools else { return Ok(None) };
        let used: Vec<u32> = (0..self.used.len() as u32).filter(|number| self.used[*number as usize]).collect();
        let all = input.materials().to_vec();
        let has_paint = used
            .iter()
            .filter_map(|number| all.get(*number as usize))
            .any(|material| material.texture.is_some() || (!material.is_in_vertices && material.color != [255; 3]));
        if !has_paint {
            return Ok(None);
        }
        phases.begin("textures", used.len() as u64);
        let mut texels = Spool::named(&plan.place_in_files(), "texels").map_err(BuildError::Scratch)?;
        let mut pictures = Vec::new();
        let mut looks: Vec<Look> = all.iter().map(|material| Look::of(material, None)).collect();
        // A picture whose opacity counts for one material and not for another is two.
        let mut known: HashMap<(Texture, bool), Option<u32>> = HashMap::new();
        for (done, number) in (0..).zip(&used) {
            phases.at(done);
            let Some(material) = all.get(*number as usize) else { continue };
            let Some(texture) = &material.texture else { continue };
            let key = (texture.clone(), material.alpha_cutoff.is_some());
            let picture = match known.get(&key) {
                Some(picture) => *picture,
                None => {
                    let picture = read_picture(input, *number, &key, &mut texels, plan, phases)?;
                    let number = picture.map(|picture| {
                        pictures.push(picture);
                        pictures.len() as u32 - 1
                    });
                    known.insert(key, number);
                    number
                }
            };
            looks[*number as usize].picture = picture;
        }
        Ok(Some(Paint { looks, pictures, texels, tex_coords, corners, materials }))
    }
}

/// None, with a note, where there is no sound picture.
fn read_picture(
    input: &mut dyn ModelStream,
    material: u32,
    (texture, has_alpha): &(Texture, bool),
    texels: &mut Spool<Texel>,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> Result<Option<pictures::Picture>, BuildError> {
    let name = match texture {
        Texture::File(name) => format!("picture {}", name.escape_debug()),
        Texture::Embedded(number) => format!("picture {number}"),
    };
    let skip = |why: &str| {
        let why: String = why.chars().map(|c| if c.is_control() { ' ' } else { c }).take(200).collect();
        phases.note(&format!("{name}: {why}; its material's colour is shown instead"));
        Ok(None)
    };
    let source = match input.open_picture(material, texture) {
        Ok(source) => source,
        Err(error) => return skip(&error.to_string()),
    };
    match pictures::read(source, *has_alpha, plan.picture_bytes(), texels) {
        Ok(picture) => Ok(Some(picture)),
        Err(Failure::Damaged(why)) => skip(&why),
        Err(Failure::TooLarge(needed)) => {
            Err(BuildError::LargePicture { picture: name, needed, most: plan.picture_bytes() })
        }
        Err(Failure::Scratch(error)) => Err(BuildError::Scratch(error)),
    }
}

impl Spools {
    fn push_none(&mut self, triangles: usize) -> io::Result<()> {
        self.corners.push(&vec![[NONE; 3]; triangles])?;
        self.materials.push(&vec![NONE; triangles])
    }
}
