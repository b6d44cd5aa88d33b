//! Textures and materials on a mesh.
//!
//! In: pictures, materials, and which part of a picture each corner of a triangle shows. Out: the linear colour of any point of a
//! triangle, and whether there is anything. Pictures are looked at in full, bilinearly: whoever wants a mean takes many samples.

use crate::mesh::{MeshError, linear_of_srgb8};
use glam::Vec3;

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width and height in texels; neither is 0.
    pub size: [u32; 2],
    /// 8-bit sRGB and opacity, row by row from the top left.
    pub texels: Vec<[u8; 4]>,
}

/// What is outside a picture, along one of its axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture again, every other time mirrored.
    Mirror,
    /// The picture's border.
    Clamp,
}

/// How triangles look.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// 8-bit sRGB; a factor to vertex colours and the picture.
    pub color: [u8; 3],
    /// Number of a picture.
    pub texture: Option<u32>,
    /// A factor to texture coordinates, and what is added after that.
    pub scale: [f32; 2],
    /// See `scale`.
    pub offset: [f32; 2],
    /// Along u and v.
    pub wrap: [Wrap; 2],
    /// What is less opaque is not there.
    pub alpha_cutoff: Option<u8>,
}

/// What covers a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Pictures.
    pub textures: Vec<Texture>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Texture coordinates: u to the right, v upwards, from a picture's lower left corner.
    pub tex_coords: Vec<[f32; 2]>,
    /// For each triangle, texture coordinates of its corners; one without has no picture.
    pub corners: Vec<Option<[u32; 3]>>,
    /// For each triangle, its material; one without is white.
    pub of_triangle: Vec<Option<u32>>,
}

impl Skin {
    /// All numbers name something.
    pub(crate) fn check(&self, triangles: usize) -> Result<(), MeshError> {
        for (attribute, found) in [("texture corners", self.corners.len()), ("materials", self.of_triangle.len())] {
            if found != triangles {
                return Err(MeshError::AttributeCount { attribute, found, vertex_count: triangles });
            }
        }
        let within = |number: u32, count: usize| (number as usize) < count;
        let is_sound = self.corners.iter().flatten().flatten().all(|coord| within(*coord, self.tex_coords.len()))
            && self.of_triangle.iter().flatten().all(|material| within(*material, self.materials.len()))
            && self.materials.iter().filter_map(|it| it.texture).all(|texture| within(texture, self.textures.len()))
            && self
                .textures
                .iter()
                .all(|it| it.texels.len() == it.size[0] as usize * it.size[1] as usize && it.size[0] > 0)
            && self.textures.iter().all(|it| it.size[1] > 0);
        if is_sound { Ok(()) } else { Err(MeshError::Skin) }
    }

    /// Linear colour and opacity, 0 to 1, of a point of a triangle.
    pub fn look(&self, triangle: u32, barycentrics: [f64; 3]) -> (Vec3, f32) {
        let Some(material) = self.material(triangle) else { return (Vec3::ONE, 1.0) };
        let own = linear_of_srgb8(material.color);
        let (Some(texture), Some(corners)) = (material.texture, self.corners[triangle as usize]) else {
            return (own, 1.0);
        };
        let [u, v]: [f64; 2] = std::array::from_fn(|axis| {
            let coord = |corner: usize| f64::from(self.tex_coords[corners[corner] as usize][axis]);
            let mixed: f64 = (0..3).map(|corner| coord(corner) * barycentrics[corner]).sum();
            mixed * f64::from(material.scale[axis]) + f64::from(material.offset[axis])
        });
        let (color, alpha) = self.textures[texture as usize].bilinear(u, 1.0 - v, material.wrap);
        (own * color, alpha)
    }

    /// False where an alpha mask leaves a point of a triangle out.
    pub fn is_there(&self, triangle: u32, barycentrics: [f64; 3]) -> bool {
        match self.material(triangle).and_then(|material| material.alpha_cutoff) {
            Some(cutoff) => self.look(triangle, barycentrics).1 * 255.0 >= f32::from(cutoff),
            None => true,
        }
    }

    fn material(&self, triangle: u32) -> Option<&Material> {
        self.of_triangle[triangle as usize].map(|material| &self.materials[material as usize])
    }
}

impl Texture {
    /// From the top left corner, 1 at the opposite one.
    fn bilinear(&self, across: f64, down: f64, wrap: [Wrap; 2]) -> (Vec3, f32) {
        let (x, y) = (across * f64::from(self.size[0]) - 0.5, down * f64::from(self.size[1]) - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (mut color, mut alpha) = (Vec3::ZERO, 0.0);
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let weight = ((1.0 - (left + dx - x).abs()) * (1.0 - (top + dy - y).abs())) as f32;
            let column = wrapped(left + dx, self.size[0], wrap[0]);
            let row = wrapped(top + dy, self.size[1], wrap[1]);
            let [r, g, b, a] = self.texels[row * self.size[0] as usize + column];
            color += linear_of_srgb8([r, g, b]) * weight;
            alpha += f32::from(a) / 255.0 * weight;
        }
        (color, alpha)
    }
}

fn wrapped(at: f64, count: u32, wrap: Wrap) -> usize {
    let count = f64::from(count);
    let at = match wrap {
        Wrap::Repeat => at - (at / count).floor() * count,
        Wrap::Mirror => {
            let twice = at - (at / (2.0 * count)).floor() * 2.0 * count;
            if twice >= count { 2.0 * count - 1.0 - twice } else { twice }
        }
        Wrap::Clamp => at,
    };
    // NaN casts to 0.
    at.clamp(0.0, count - 1.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Bvh, Mesh, triangle::Ray};
    use glam::DVec3;

    /// A square of two triangles with a picture of two texels beside each other, the right one of which is clear.
    fn square(material: Material) -> Mesh {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let texels = vec![[255, 0, 0, 255], [0, 0, 255, 0]];
        let skin = Skin {
            textures: vec![Texture { size: [2, 1], texels }],
            materials: vec![material],
            tex_coords: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            corners: vec![Some([0, 1, 2]), Some([0, 2, 3])],
            of_triangle: vec![Some(0); 2],
        };
        Mesh::new(positions, None, None, vec![[0, 1, 2], [0, 2, 3]]).unwrap().with_skin(skin).unwrap()
    }

    fn material() -> Material {
        let (color, scale, offset) = ([255; 3], [1.0; 2], [0.0; 2]);
        Material { color, texture: Some(0), scale, offset, wrap: [Wrap::Clamp; 2], alpha_cutoff: None }
    }

    fn seen(mesh: &Mesh, x: f64, y: f64) -> Option<Vec3> {
        let hit = Bvh::build(mesh).first_hit(&Ray { origin: DVec3::new(x, y, 1.0), direction: -DVec3::Z })?;
        mesh.linear_color(hit.triangle, hit.barycentrics)
    }

    #[test]
    fn a_picture_lies_where_its_coordinates_say() {
        let plain = square(material());
        let near = |seen: Option<Vec3>, expected: Vec3| assert!((seen.unwrap() - expected).length() < 1e-5, "{seen:?}");
        for y in [0.1, 0.9] {
            near(seen(&plain, 0.1, y), Vec3::X);
            near(seen(&plain, 0.9, y), Vec3::Z);
            near(seen(&plain, 0.5, y), Vec3::new(0.5, 0.0, 0.5));
        }
        let turned = square(Material { scale: [-1.0, 1.0], offset: [1.0, 0.0], ..material() });
        near(seen(&turned, 0.1, 0.5), Vec3::Z);
        let repeated = square(Material { scale: [4.0, 1.0], wrap: [Wrap::Repeat; 2], ..material() });
        near(seen(&repeated, 0.0625 + 0.75, 0.5), Vec3::X);
        let mirrored = square(Material { scale: [2.0, 1.0], wrap: [Wrap::Mirror; 2], ..material() });
        near(seen(&mirrored, 0.95, 0.5), Vec3::X);
        let tinted = square(Material { color: [0, 255, 255], ..material() });
        near(seen(&tinted, 0.1, 0.5), Vec3::ZERO);
    }

    #[test]
    fn rays_go_through_what_a_mask_leaves_out() {
        let masked = square(Material { alpha_cutoff: Some(128), ..material() });
        assert!(seen(&masked, 0.4, 0.5).is_some() && seen(&masked, 0.6, 0.5).is_none());
    }

    #[test]
    fn numbers_that_name_nothing_are_refused() {
        let mesh = || Mesh::new(vec![DVec3::ZERO; 3], None, None, vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh().with_skin(Skin::default()).unwrap_err().to_string(), "0 texture corners for 1 triangles");
        let skin = Skin { corners: vec![Some([0; 3])], of_triangle: vec![None], ..Skin::default() };
        assert_eq!(mesh().with_skin(skin).unwrap_err(), MeshError::Skin);
    }
}
