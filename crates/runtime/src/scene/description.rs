//! What a scene file says: models in their places, light, ground, a camera. Plain data; whoever parses it opens the files.
//!
//! What always holds is for the parser to see to: finite numbers, unit quaternions, scales above 0.

use crate::Similarity;
use gigalod_geom::camera::UpAxis;
use glam::DVec3;
use std::path::PathBuf;

/// A scene as written down. Everything is optional but one model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneDescription {
    /// Which way is up; `None`: as the first model has it.
    pub up: Option<UpAxis>,
    /// Colour where there is nothing, 8-bit sRGB.
    pub background: Option<[u8; 3]>,
    /// Where it is looked at from.
    pub camera: Option<SceneCamera>,
    /// An infinite plane across `up`.
    pub ground: Option<Ground>,
    /// At least one.
    pub models: Vec<SceneModel>,
    /// None: a lamp at the viewer's shoulder.
    pub lights: Vec<Light>,
}

/// A camera of a scene; what is missing is as in the view of the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneCamera {
    /// World space.
    pub eye: Option<DVec3>,
    /// World space; what the eye looks at.
    pub target: Option<DVec3>,
    /// Not zero.
    pub up: Option<DVec3>,
    /// Vertical field of view, in degrees.
    pub fov_deg: Option<f64>,
}

/// An infinite plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Along `up`, world units.
    pub height: f64,
    /// 8-bit sRGB.
    pub color: [u8; 3],
}

/// A file, and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneModel {
    /// Resolved against the scene's folder.
    pub file: PathBuf,
    /// Once, or each of many.
    pub places: Places,
}

/// Where a model stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Places {
    /// Once.
    One(Similarity),
    /// As often as this file says: position, quaternion (x, y, z, w) and scale as eight little-endian `f32` each; resolved against
    /// the scene's folder.
    Many(PathBuf),
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// What kind of source, and where.
    pub kind: LightKind,
    /// Degrees for a directional light, world units otherwise; 0 for a sharp one.
    pub size: f64,
    /// 8-bit sRGB.
    pub color: [u8; 3],
    /// A factor to the colour.
    pub intensity: f64,
}

/// Kinds of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// As far away as the sun.
    Directional {
        /// Towards it; not zero.
        towards: DVec3,
    },
    /// A small lamp.
    Point {
        /// World space.
        position: DVec3,
    },
    /// A large lamp.
    Area {
        /// World space; its middle.
        position: DVec3,
    },
}

impl SceneDescription {
    /// The direction towards the only kind of light that there is so far: the first directional one.
    pub fn towards_light(&self) -> Option<DVec3> {
        self.lights.iter().find_map(|light| match light.kind {
            LightKind::Directional { towards } => Some(towards),
            LightKind::Point { .. } | LightKind::Area { .. } => None,
        })
    }

    /// What the scene asks for and renderers do not draw yet, in words.
    pub fn not_drawn(&self) -> Vec<String> {
        let mut missing = Vec::new();
        if self.ground.is_some() {
            missing.push("the ground is not drawn yet".to_string());
        }
        let directional = |light: &&Light| matches!(light.kind, LightKind::Directional { .. });
        let others = self.lights.iter().filter(|light| !directional(light)).count();
        if others > 0 {
            missing.push(format!("{others} point and area lights do not shine yet"));
        }
        if let [first, rest @ ..] = &self.lights.iter().filter(directional).collect::<Vec<_>>()[..] {
            if !rest.is_empty() {
                missing.push(format!("{} more directional lights do not shine yet, only the first", rest.len()));
            }
            if first.size > 0.0 || first.color != [255; 3] || first.intensity != 1.0 {
                missing.push("a light is white, sharp and of intensity 1 as yet".to_string());
            }
        }
        missing
    }
}
