//! What a scene draws, and where: nodes, instances, primitives and materials, checked.

use super::{
    accessors::Data,
    buffers::{item, missing, percent_decoded},
    json,
};
use crate::{CornerBatch, ImportError, Mapping, Material, Place, Texture, Wrap};
use glam::{DAffine3, DMat2, DMat4, DQuat, DVec2, DVec3};
use std::collections::HashMap;

/// A mesh at a node.
pub(super) struct Draw {
    pub(super) mesh: u32,
    pub(super) node: u32,
    pub(super) matrix: DAffine3,
    pub(super) instances: u64,
}

/// How indices make triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Topology {
    Points,
    List,
    Strip,
    Fan,
}

/// A primitive that is drawn.
pub(super) struct Part {
    pub(super) mesh: usize,
    pub(super) primitive: usize,
    pub(super) topology: Topology,
    /// Vertices and indices as accessors say.
    pub(super) vertices: u64,
    pub(super) indices: u64,
    /// The accessor, or number in a packed mesh, of the texture coordinates that are used.
    pub(super) tex_coord: Option<usize>,
    /// What the material does to them.
    pub(super) transform: json::TextureTransform,
    /// Number, or [`CornerBatch::NONE`].
    pub(super) material: u32,
    /// Linear.
    pub(super) color: [f64; 3],
    pub(super) is_packed: bool,
    /// True where other primitives have the same vertices: this one may use a few of them.
    pub(super) is_shared: bool,
}

impl Part {
    /// Triangles that the indices make.
    pub(super) fn triangles(&self) -> u64 {
        match self.topology {
            Topology::Points => 0,
            Topology::List => self.indices / 3,
            Topology::Strip | Topology::Fan => self.indices.saturating_sub(2),
        }
    }
}

/// Goes through the nodes of the scene.
pub(super) fn draws(data: &Data) -> Result<Vec<Draw>, ImportError> {
    let root = &data.root;
    let mut draws = Vec::new();
    let mut is_seen = vec![false; root.nodes.len()];
    let roots: Vec<u32> = match (root.scene, root.scenes.first()) {
        (Some(number), _) => {
            let scene = root.scenes.get(number).ok_or_else(|| missing("scene", number, root.scenes.len()))?;
            scene.nodes.clone()
        }
        (None, Some(first)) => first.nodes.clone(),
        (None, None) => {
            // Without a scene, all nodes that are nobody's children.
            let mut is_child = is_seen.clone();
            for &child in root.nodes.iter().flat_map(|node| &node.children) {
                if let Some(is_child) = is_child.get_mut(child as usize) {
                    *is_child = true;
                }
            }
            (0..root.nodes.len() as u32).filter(|&node| !is_child[node as usize]).collect()
        }
    };
    let mut open: Vec<(u32, DAffine3)> = Vec::new();
    let mut found = 0;
    let mut add = |nodes: &[u32], matrix: DAffine3, open: &mut Vec<(u32, DAffine3)>| {
        found += nodes.len();
        // Each is at one place, so there are no more than in the list.
        if let Some(&node) = nodes.first()
            && found > root.nodes.len()
        {
            return Err(twice(node));
        }
        open.extend(nodes.iter().rev().map(|&node| (node, matrix)));
        Ok(())
    };
    add(&roots, DAffine3::IDENTITY, &mut open)?;
    while let Some((number, parent)) = open.pop() {
        let place = || item("node", number as usize);
        let node = root.nodes.get(number as usize).ok_or_else(|| missing("node", number as usize, root.nodes.len()))?;
        if std::mem::replace(&mut is_seen[number as usize], true) {
            return Err(twice(number));
        }
        let matrix = parent * local(node);
        if !matrix.is_finite() {
            return Err(ImportError::malformed("a finite transform", "another", place()));
        }
        if let Some(mesh) = node.mesh {
            if mesh as usize >= root.meshes.len() {
                return Err(missing("mesh", mesh as usize, root.meshes.len()));
            }
            let instances = match instancing(node) {
                Some(attributes) => instances(data, attributes, number as usize)?,
                None => 1,
            };
            draws.push(Draw { mesh, node: number, matrix, instances });
        }
        add(&node.children, matrix, &mut open)?;
    }
    Ok(draws)
}

fn twice(node: u32) -> ImportError {
    ImportError::malformed("each node at one place of a tree", "it at two", item("node", node as usize))
}

/// Where the instances of a node differ; otherwise there is one.
pub(super) fn instancing(node: &json::Node) -> Option<json::InstanceAttributes> {
    node.extensions.as_ref()?.instancing.as_ref().map(|instancing| instancing.attributes)
}

/// The transform of a node to its parent.
fn local(node: &json::Node) -> DAffine3 {
    match &node.matrix {
        Some(columns) => DAffine3::from_mat4(DMat4::from_cols_array(columns)),
        None => transform(
            node.translation.as_deref().copied().unwrap_or([0.0; 3]),
            node.rotation.as_deref().copied().unwrap_or([0.0, 0.0, 0.0, 1.0]),
            node.scale.as_deref().copied().unwrap_or([1.0; 3]),
        ),
    }
}

/// From a translation, a rotation as a quaternion x y z w of any length but 0, and a scale.
pub(super) fn transform(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> DAffine3 {
    let rotation = DQuat::from_array(rotation);
    let length = rotation.length();
    let rotation = if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(DVec3::from_array(scale), rotation, DVec3::from_array(translation))
}

/// Number of instances: that of all accessors there are.
fn instances(data: &Data, attributes: json::InstanceAttributes, node: usize) -> Result<u64, ImportError> {
    let counts = [(attributes.translation, 3), (attributes.rotation, 4), (attributes.scale, 3)];
    let mut count = None;
    for (accessor, components) in counts {
        let Some(accessor) = accessor else { continue };
        let found = data.check(accessor, &[components])?;
        if data.root.accessors[accessor].buffer_view.is_none() {
            let place = item("accessor", accessor);
            return Err(ImportError::malformed("a view for attributes of instances", "none", place));
        }
        if count.is_some_and(|count| count != found) {
            let expected = "as many of each attribute of instances";
            return Err(ImportError::malformed(expected, "other numbers", item("node", node)));
        }
        count = Some(found);
    }
    Ok(count.unwrap_or(1))
}

/// Primitives of a mesh that make points or triangles, checked.
pub(super) fn parts(data: &Data, mesh: usize) -> Result<Vec<Part>, ImportError> {
    let primitives = &data.root.meshes[mesh].primitives;
    let mut users: HashMap<Option<usize>, usize> = HashMap::new();
    for primitive in primitives {
        *users.entry(primitive.attributes.position).or_default() += 1;
    }
    let mut parts = Vec::new();
    for (number, primitive) in primitives.iter().enumerate() {
        let topology = match primitive.mode {
            0 => Topology::Points,
            4 => Topology::List,
            5 => Topology::Strip,
            6 => Topology::Fan,
            1..=3 => continue, // Lines have no surface.
            mode => {
                return Err(ImportError::malformed("a mode from 0 to 6", mode.to_string(), item("mesh", mesh)));
            }
        };
        let Some(position) = primitive.attributes.position else { continue };
        let draco = primitive.extensions.as_ref().and_then(|it| it.draco.as_ref());
        let vertices = data.check(position, &[3])?;
        let indices = primitive.indices.map_or(Ok(vertices), |indices| data.check(indices, &[1]))?;
        if vertices == 0 || (indices == 0 && draco.is_none()) {
            continue;
        }
        let same = |accessor: Option<usize>, components: &[usize]| -> Result<(), ImportError> {
            match accessor {
                Some(accessor) if data.check(accessor, components)? != vertices => {
                    let expected = format!("{vertices} elements, as there are positions");
                    Err(ImportError::malformed(expected, "another number", item("accessor", accessor)))
                }
                _ => Ok(()),
            }
        };
        same(primitive.attributes.normal, &[3])?;
        same(primitive.attributes.color, &[3, 4])?;
        let material = match primitive.material {
            Some(number) => Some((number, material(&data.root, number)?)),
            None => None,
        };
        let semantics = draco.map_or(primitive.attributes, |draco| draco.attributes);
        let set = |attributes: &json::Semantics, set: usize| match set {
            0 => attributes.tex_coord_0,
            1 => attributes.tex_coord_1,
            _ => None,
        };
        let used = material.as_ref().and_then(|(_, material)| material.tex_coord_set);
        let tex_coord = used.and_then(|used| set(&semantics, used));
        if let Some(used) = used {
            same(set(&primitive.attributes, used), &[2])?;
        }
        parts.push(Part {
            mesh,
            primitive: number,
            topology,
            vertices,
            indices,
            tex_coord,
            transform: material.as_ref().map(|(_, material)| material.transform).unwrap_or_default(),
            material: material.as_ref().map_or(CornerBatch::NONE, |&(number, _)| number as u32),
            color: material.map_or([1.0; 3], |(_, material)| material.color),
            is_packed: draco.is_some(),
            is_shared: users[&Some(position)] > 1 && primitive.indices.is_some() && draco.is_none(),
        });
    }
    Ok(parts)
}

/// What a primitive needs to know of its material.
struct Look {
    /// Linear.
    color: [f64; 3],
    tex_coord_set: Option<usize>,
    transform: json::TextureTransform,
}

impl json::TextureTransform {
    /// From texture coordinates of the file, v downwards, to those of a stream, v upwards.
    pub(super) fn apply(&self, u: f64, v: f64) -> [f32; 2] {
        let (sin, cos) = (libm::sin(self.rotation), libm::cos(self.rotation));
        let rotation = DMat2::from_cols(DVec2::new(cos, -sin), DVec2::new(sin, cos));
        let scale = DVec2::from_array(self.scale.unwrap_or([1.0; 2]));
        let [u, v] = (DVec2::from_array(self.offset) + rotation * (scale * DVec2::new(u, v))).to_array();
        let coord = [u as f32, 1.0 - v as f32];
        if coord[0].is_finite() && coord[1].is_finite() { coord } else { [0.0; 2] }
    }
}

fn material(root: &json::Root, number: usize) -> Result<Look, ImportError> {
    let material = root.materials.get(number).ok_or_else(|| missing("material", number, root.materials.len()))?;
    let roughness = material.pbr_metallic_roughness.as_ref();
    let [red, green, blue, _] = roughness.and_then(|it| it.base_color_factor).unwrap_or([1.0; 4]);
    let texture = roughness.and_then(|it| it.base_color_texture.as_ref());
    let transform = texture.and_then(|texture| texture.extensions.as_ref()?.transform).unwrap_or_default();
    let tex_coord_set = texture.map(|texture| transform.tex_coord.unwrap_or(texture.tex_coord));
    Ok(Look { color: [red, green, blue], tex_coord_set, transform })
}

/// All materials, for triangles to name.
pub(super) fn materials(root: &json::Root) -> Vec<Material> {
    let look = |material: &json::Material| {
        let roughness = material.pbr_metallic_roughness.as_ref();
        let [red, green, blue, alpha] = roughness.and_then(|it| it.base_color_factor).unwrap_or([1.0; 4]);
        let used = roughness.and_then(|it| it.base_color_texture.as_ref());
        let used = used.and_then(|texture| root.textures.get(texture.index));
        let sampler = used.and_then(|texture| root.samplers.get(texture.sampler?));
        let texture = used
            .and_then(|texture| texture.source)
            .and_then(|image| Some((image, root.images.get(image)?)))
            .map(|(number, image)| match &image.uri {
                Some(uri) if !uri.starts_with("data:") => Texture::File(percent_decoded(uri)),
                _ => Texture::Embedded(number as u32),
            });
        let cutoff = (material.alpha_mode.as_deref() == Some("MASK")).then(|| material.alpha_cutoff.unwrap_or(0.5));
        Material {
            name: material.name.clone().unwrap_or_default(),
            color: [red, green, blue].map(srgb8),
            is_in_vertices: true,
            texture,
            mapping: Mapping {
                wrap: [sampler.and_then(|it| it.wrap_s), sampler.and_then(|it| it.wrap_t)].map(wrap),
                ..Mapping::default()
            },
            alpha_cutoff: cutoff.map(|cutoff| (cutoff * 255.0 / alpha.max(1e-3)) as u8),
        }
    };
    root.materials.iter().map(look).collect()
}

/// By the number that OpenGL has for it.
fn wrap(number: Option<u32>) -> Wrap {
    match number {
        Some(33_071) => Wrap::Clamp,
        Some(33_648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// 8-bit sRGB of a linear intensity.
pub(super) fn srgb8(linear: f64) -> u8 {
    let curved = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
    (curved * 255.0 + 0.5) as u8
}

/// Refuses files that ask for more than this reader does.
pub(super) fn check_version(root: &json::Root) -> Result<(), ImportError> {
    const KNOWN: [&str; 9] = [
        "EXT_meshopt_compression",
        "EXT_mesh_gpu_instancing",
        "KHR_draco_mesh_compression",
        "KHR_mesh_quantization",
        "KHR_lights_punctual",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "EXT_texture_webp",
        "KHR_xmp_json_ld",
    ];
    let Some(asset) = &root.asset else {
        return Err(ImportError::malformed("the property `asset` of glTF", "JSON without it", Place::byte(0)));
    };
    let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
    if !needed.starts_with("2.") {
        let found = format!("version {}", crate::error::said(needed));
        return Err(ImportError::malformed("glTF 2", found, Place::byte(0)));
    }
    let is_known = |name: &&String| KNOWN.contains(&name.as_str()) || name.starts_with("KHR_materials_");
    match root.extensions_required.iter().find(|name| !is_known(name)) {
        Some(name) => {
            let found = format!("`{}`, which is required", crate::error::said(name));
            Err(ImportError::malformed("extensions of glTF that are understood", found, Place::byte(0)))
        }
        None => Ok(()),
    }
}
