//! What a scene draws, and where: nodes, instances, primitives and materials, checked.

use super::{
    accessors::Data,
    buffers::{item, missing, percent_decoded},
    json,
};
use crate::{CornerBatch, ImportError, Material, Place, Texture};
use glam::{DMat4, DQuat, DVec3};

/// A mesh at a node.
pub(super) struct Draw {
    pub(super) mesh: usize,
    pub(super) matrix: DMat4,
    /// Where its instances differ; otherwise there is one.
    pub(super) instancing: Option<json::InstanceAttributes>,
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
    let mut open: Vec<(usize, DMat4)> = match (root.scene, root.scenes.first()) {
        (Some(number), _) => {
            let scene = root.scenes.get(number).ok_or_else(|| missing("scene", number, root.scenes.len()))?;
            scene.nodes.iter().map(|&node| (node, DMat4::IDENTITY)).collect()
        }
        (None, Some(first)) => first.nodes.iter().map(|&node| (node, DMat4::IDENTITY)).collect(),
        (None, None) => {
            // Without a scene, all nodes that are nobody's children.
            let mut is_child = is_seen.clone();
            for &child in root.nodes.iter().flat_map(|node| &node.children) {
                is_child.get_mut(child).map(|is_child| *is_child = true);
            }
            (0..root.nodes.len()).filter(|&node| !is_child[node]).map(|node| (node, DMat4::IDENTITY)).collect()
        }
    };
    open.reverse();
    while let Some((number, parent)) = open.pop() {
        let node = root.nodes.get(number).ok_or_else(|| missing("node", number, root.nodes.len()))?;
        if std::mem::replace(&mut is_seen[number], true) {
            let place = item("node", number);
            return Err(ImportError::malformed("each node at one place of a tree", "it at two", place));
        }
        let matrix = parent * local(node);
        if !matrix.is_finite() {
            return Err(ImportError::malformed("a finite transform", "another", item("node", number)));
        }
        if let Some(mesh) = node.mesh {
            if mesh >= root.meshes.len() {
                return Err(missing("mesh", mesh, root.meshes.len()));
            }
            let instancing = node.extensions.as_ref().and_then(|it| it.instancing.as_ref()).map(|it| it.attributes);
            let instances = match instancing {
                Some(attributes) => instances(data, attributes, number)?,
                None => 1,
            };
            draws.push(Draw { mesh, matrix, instancing, instances });
        }
        open.extend(node.children.iter().rev().map(|&child| (child, matrix)));
    }
    Ok(draws)
}

/// The transform of a node to its parent.
fn local(node: &json::Node) -> DMat4 {
    match &node.matrix {
        Some(columns) => DMat4::from_cols_array(columns),
        None => transform(
            node.translation.as_deref().copied().unwrap_or([0.0; 3]),
            node.rotation.as_deref().copied().unwrap_or([0.0, 0.0, 0.0, 1.0]),
            node.scale.as_deref().copied().unwrap_or([1.0; 3]),
        ),
    }
}

/// From a translation, a rotation as a quaternion x y z w of any length but 0, and a scale.
pub(super) fn transform(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> DMat4 {
    let rotation = DQuat::from_array(rotation);
    let length = rotation.length();
    let rotation = if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(DVec3::from_array(scale), rotation, DVec3::from_array(translation))
}

/// Number of instances: that of all accessors there are.
fn instances(data: &Data, attributes: json::InstanceAttributes, node: usize) -> Result<u64, ImportError> {
    let counts = [(attributes.translation, 3), (attributes.rotation, 4), (attributes.scale, 3)];
    let mut count = None;
    for (accessor, components) in counts {
        let Some(accessor) = accessor else { continue };
        let found = data.check(accessor, &[components])?;
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
        let users = primitives.iter().filter(|other| other.attributes.position == Some(position)).count();
        parts.push(Part {
            mesh,
            primitive: number,
            topology,
            vertices,
            indices,
            tex_coord,
            material: material.as_ref().map_or(CornerBatch::NONE, |&(number, _)| number as u32),
            color: material.map_or([1.0; 3], |(_, material)| material.color),
            is_packed: draco.is_some(),
            is_shared: users > 1 && primitive.indices.is_some() && draco.is_none(),
        });
    }
    Ok(parts)
}

/// What a primitive needs to know of its material.
struct Look {
    /// Linear.
    color: [f64; 3],
    tex_coord_set: Option<usize>,
}

fn material(root: &json::Root, number: usize) -> Result<Look, ImportError> {
    let material = root.materials.get(number).ok_or_else(|| missing("material", number, root.materials.len()))?;
    let roughness = material.pbr_metallic_roughness.as_ref();
    let [red, green, blue, _] = roughness.and_then(|it| it.base_color_factor).unwrap_or([1.0; 4]);
    let tex_coord_set = roughness.and_then(|it| it.base_color_texture.as_ref()).map(|texture| texture.tex_coord);
    Ok(Look { color: [red, green, blue], tex_coord_set })
}

/// All materials, for triangles to name.
pub(super) fn materials(root: &json::Root) -> Vec<Material> {
    let look = |material: &json::Material| {
        let roughness = material.pbr_metallic_roughness.as_ref();
        let [red, green, blue, _] = roughness.and_then(|it| it.base_color_factor).unwrap_or([1.0; 4]);
        let texture = roughness
            .and_then(|it| it.base_color_texture.as_ref())
            .and_then(|texture| root.textures.get(texture.index)?.source)
            .and_then(|image| Some((image, root.images.get(image)?)))
            .map(|(number, image)| match &image.uri {
                Some(uri) if !uri.starts_with("data:") => Texture::File(percent_decoded(uri)),
                _ => Texture::Embedded(number as u32),
            });
        Material { name: material.name.clone().unwrap_or_default(), color: [red, green, blue].map(srgb8), texture }
    };
    root.materials.iter().map(look).collect()
}

/// 8-bit sRGB of a linear intensity.
pub(super) fn srgb8(linear: f64) -> u8 {
    let curved = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
    (curved * 255.0 + 0.5) as u8
}

/// Refuses files that ask for more than this reader does.
pub(super) fn check_version(root: &json::Root) -> Result<(), ImportError> {
    const KNOWN: [&str; 8] = [
        "EXT_meshopt_compression",
        "EXT_mesh_gpu_instancing",
        "KHR_draco_mesh_compression",
        "KHR_mesh_quantization",
        "KHR_lights_punctual",
        "KHR_texture_basisu",
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
