//! What covers a mesh, for the judge: all pictures in memory, decoded here anew.

use gigalod_import::{Batch, CornerBatch, Material, ModelStream, Texture, Wrap};
use gigalod_reference::skin::{self, Skin};
use image::ImageReader;
use std::collections::HashMap;
use std::io::BufReader;

/// The skin of a whole model that was read from `stream`; `None` where its materials have no colours that its vertices have not. A
/// picture that is missing or damaged leaves its material's colour. Memory grows with the pictures.
pub fn skin_of(stream: &mut dyn ModelStream, model: &Batch) -> Option<Skin> {
    let materials = stream.materials().to_vec();
    let shows = |it: &Material| it.texture.is_some() || (!it.is_in_vertices && it.color != [255; 3]);
    if !materials.iter().any(shows) {
        return None;
    }
    let mut skin = Skin { tex_coords: model.tex_coords.clone(), ..Skin::default() };
    let mut known: HashMap<Texture, Option<u32>> = HashMap::new();
    for (number, material) in (0..).zip(&materials) {
        let texture = material.texture.as_ref().and_then(|texture| {
            *known.entry(texture.clone()).or_insert_with(|| {
                skin.textures.push(picture(stream, number, texture)?);
                Some(skin.textures.len() as u32 - 1)
            })
        });
        skin.materials.push(skin::Material {
            color: if material.is_in_vertices { [255; 3] } else { material.color },
            texture,
            scale: material.mapping.scale,
            offset: material.mapping.offset,
            wrap: material.mapping.wrap.map(|wrap| match wrap {
                Wrap::Repeat => skin::Wrap::Repeat,
                Wrap::Mirror => skin::Wrap::Mirror,
                Wrap::Clamp => skin::Wrap::Clamp,
            }),
            alpha_cutoff: material.alpha_cutoff,
        });
    }
    let some = |number: u32| (number != CornerBatch::NONE).then_some(number);
    for triangle in 0..model.triangles.len() {
        let corners = model.corners.tex_coords.get(triangle).filter(|corners| !corners.contains(&CornerBatch::NONE));
        skin.corners.push(corners.copied());
        skin.of_triangle.push(model.corners.materials.get(triangle).copied().and_then(some));
    }
    Some(skin)
}

fn picture(stream: &mut dyn ModelStream, material: u32, texture: &Texture) -> Option<skin::Texture> {
    let source = stream.open_picture(material, texture).ok()?;
    let reader = ImageReader::new(BufReader::new(source)).with_guessed_format().ok()?;
    let rgba = reader.decode().ok()?.into_rgba8();
    let size = [rgba.width(), rgba.height()];
    Some(skin::Texture { size, texels: rgba.into_raw().as_chunks().0.to_vec() })
}
