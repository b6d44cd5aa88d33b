//! Scenes as TOML; the form is in `gigalod help view`. Paths are relative to the scene's own folder.
//!
//! Errors name the line. What always holds of a scene that was read: numbers are finite, rotations unit quaternions, scales above 0.

use super::error::CliError;
use super::files;
use super::parse;
use gigalod_geom::camera::UpAxis;
use gigalod_runtime::Similarity;
use gigalod_runtime::scene::description::{
    Ground, Light, LightKind, Places, SceneCamera, SceneDescription, SceneModel,
};
use glam::{DQuat, DVec3};
use serde::Deserialize;
use std::fmt::Write;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A scene names models; what is larger is one.
const MOST_BYTES: u64 = 16 << 20;

/// Bytes of an instance: position, quaternion and scale as `f32`.
const INSTANCE_BYTES: usize = 32;

/// Most instances of one file.
const MOST_INSTANCES: u64 = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneTable {
    up: Option<Spanned<String>>,
    background: Option<Spanned<String>>,
    camera: Option<CameraTable>,
    ground: Option<GroundTable>,
    #[serde(default)]
    model: Vec<Spanned<ModelTable>>,
    #[serde(default)]
    light: Vec<Spanned<LightTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraTable {
    eye: Option<Spanned<[f64; 3]>>,
    target: Option<Spanned<[f64; 3]>>,
    up: Option<Spanned<[f64; 3]>>,
    fov: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GroundTable {
    height: Option<Spanned<f64>>,
    color: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelTable {
    file: PathBuf,
    position: Option<Spanned<[f64; 3]>>,
    rotation: Option<Spanned<[f64; 4]>>,
    scale: Option<Spanned<f64>>,
    instances: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightTable {
    kind: Spanned<String>,
    direction: Option<Spanned<[f64; 3]>>,
    position: Option<Spanned<[f64; 3]>>,
    size: Option<Spanned<f64>>,
    color: Option<Spanned<String>>,
    intensity: Option<Spanned<f64>>,
}

/// True of a file that is to be read as a scene.
pub(crate) fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Reads a scene.
pub(crate) fn read(path: &Path) -> Result<SceneDescription, CliError> {
    let mut text = String::new();
    files::open(path)?.take(MOST_BYTES).read_to_string(&mut text).map_err(|error| CliError::in_file(path, error))?;
    let reader = Reader { path, text: &text };
    let table: SceneTable =
        toml::from_str(&text).map_err(|error| reader.wrong(error.span().unwrap_or(0..0), error.message()))?;
    reader.scene(table)
}

/// Says where something is wrong.
struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Reader<'_> {
    fn wrong(&self, span: Range<usize>, what: &str) -> CliError {
        let line = self.text[..span.start.min(self.text.len())].matches('\n').count() + 1;
        CliError::in_file(self.path, what).at(format!("line {line}"))
    }

    fn scene(&self, table: SceneTable) -> Result<SceneDescription, CliError> {
        if table.model.is_empty() {
            return Err(CliError::in_file(self.path, "no [[model]], expected at least one"));
        }
        let up = table.up.map(|up| match up.get_ref().as_str() {
            "y" => Ok(UpAxis::Y),
            "z" => Ok(UpAxis::Z),
            other => Err(self.wrong(up.span(), &format!("up is \"{other}\", expected \"y\" or \"z\""))),
        });
        let camera = table.camera.map(|camera| -> Result<SceneCamera, CliError> {
            Ok(SceneCamera {
                eye: self.vector(camera.eye)?,
                target: self.vector(camera.target)?,
                up: self.direction(camera.up)?,
                fov_deg: self.number(camera.fov, "degrees from 0.01 to 170", |fov| (0.01..=170.0).contains(&fov))?,
            })
        });
        let ground = table.ground.map(|ground| -> Result<Ground, CliError> {
            let height = self.number(ground.height, "a finite number", |_| true)?.unwrap_or(0.0);
            Ok(Ground { height, color: self.color(ground.color)?.unwrap_or([0xb0; 3]) })
        });
        Ok(SceneDescription {
            up: up.transpose()?,
            background: self.color(table.background)?,
            camera: camera.transpose()?,
            ground: ground.transpose()?,
            models: table.model.into_iter().map(|model| self.model(model)).collect::<Result<_, _>>()?,
            lights: table.light.into_iter().map(|light| self.light(light)).collect::<Result<_, _>>()?,
        })
    }

    fn model(&self, model: Spanned<ModelTable>) -> Result<SceneModel, CliError> {
        let span = model.span();
        let ModelTable { file, position, rotation, scale, instances } = model.into_inner();
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let file = folder.join(file);
        if let Some(instances) = instances {
            if position.is_some() || rotation.is_some() || scale.is_some() {
                return Err(self.wrong(span, "instances and a place of its own, expected one of them"));
            }
            return Ok(SceneModel { file, places: Places::Many(folder.join(instances)) });
        }
        let at = rotation.as_ref().map(Spanned::span);
        let rotation = match (rotation.map(Spanned::into_inner), at) {
            (Some(rotation), Some(at)) => {
                let quaternion = DQuat::from_array(rotation);
                let is_unit = quaternion.is_finite() && (quaternion.length() - 1.0).abs() < 1e-3;
                if !is_unit {
                    return Err(self.wrong(at, "a rotation that is no unit quaternion [x, y, z, w]"));
                }
                quaternion.normalize()
            }
            _ => DQuat::IDENTITY,
        };
        let scale = self.number(scale, "a number greater than 0", |scale| scale > 0.0)?.unwrap_or(1.0);
        let position = self.vector(position)?.unwrap_or(DVec3::ZERO);
        Ok(SceneModel { file, places: Places::One(Similarity { position, rotation, scale }) })
    }

    fn light(&self, light: Spanned<LightTable>) -> Result<Light, CliError> {
        let span = light.span();
        let LightTable { kind, direction, position, size, color, intensity } = light.into_inner();
        let (towards, position) = (self.direction(direction)?, self.vector(position)?);
        let kind = match (kind.get_ref().as_str(), towards, position) {
            ("directional", Some(towards), None) => LightKind::Directional { towards },
            ("point", None, Some(position)) => LightKind::Point { position },
            ("area", None, Some(position)) => LightKind::Area { position },
            ("directional", ..) => return Err(self.wrong(span, "a directional light has a direction and no position")),
            ("point" | "area", ..) => return Err(self.wrong(span, "this light has a position and no direction")),
            (other, ..) => {
                let what = format!("a light of kind \"{other}\", expected \"directional\", \"point\" or \"area\"");
                return Err(self.wrong(kind.span(), &what));
            }
        };
        let positive = "a number of at least 0";
        Ok(Light {
            kind,
            size: self.number(size, positive, |size| size >= 0.0)?.unwrap_or(0.0),
            color: self.color(color)?.unwrap_or([255; 3]),
            intensity: self.number(intensity, positive, |intensity| intensity >= 0.0)?.unwrap_or(1.0),
        })
    }

    fn vector(&self, vector: Option<Spanned<[f64; 3]>>) -> Result<Option<DVec3>, CliError> {
        let Some(vector) = vector else { return Ok(None) };
        let found = DVec3::from_array(*vector.get_ref());
        if found.is_finite() { Ok(Some(found)) } else { Err(self.wrong(vector.span(), "expected finite numbers")) }
    }

    fn direction(&self, direction: Option<Spanned<[f64; 3]>>) -> Result<Option<DVec3>, CliError> {
        let span = direction.as_ref().map_or(0..0, Spanned::span);
        match self.vector(direction)? {
            Some(DVec3::ZERO) => Err(self.wrong(span, "a direction of length 0")),
            other => Ok(other),
        }
    }

    fn number(
        &self,
        number: Option<Spanned<f64>>,
        expected: &str,
        is_good: impl Fn(f64) -> bool,
    ) -> Result<Option<f64>, CliError> {
        match number {
            Some(number) if !number.get_ref().is_finite() || !is_good(*number.get_ref()) => {
                Err(self.wrong(number.span(), &format!("{}, expected {expected}", number.get_ref())))
            }
            other => Ok(other.map(Spanned::into_inner)),
        }
    }

    fn color(&self, color: Option<Spanned<String>>) -> Result<Option<[u8; 3]>, CliError> {
        let Some(color) = color else { return Ok(None) };
        parse::color(color.get_ref()).map(Some).map_err(|what| self.wrong(color.span(), &what))
    }
}

/// The places of a model.
pub(crate) fn places(places: &Places) -> Result<Vec<Similarity>, CliError> {
    let path = match places {
        Places::One(place) => return Ok(vec![*place]),
        Places::Many(path) => path,
    };
    let mut bytes = Vec::new();
    let most = MOST_INSTANCES * INSTANCE_BYTES as u64;
    files::open(path)?.take(most + 1).read_to_end(&mut bytes).map_err(|error| CliError::in_file(path, error))?;
    if bytes.is_empty() || !bytes.len().is_multiple_of(INSTANCE_BYTES) || bytes.len() as u64 > most {
        let what = format!("{} bytes, expected 1 to {MOST_INSTANCES} instances of {INSTANCE_BYTES} bytes", bytes.len());
        return Err(CliError::in_file(path, what));
    }
    let (instances, _) = bytes.as_chunks::<INSTANCE_BYTES>();
    let read = |(number, bytes): (usize, &[u8; INSTANCE_BYTES])| {
        let value = |at: usize| {
            f64::from(f32::from_le_bytes([bytes[4 * at], bytes[4 * at + 1], bytes[4 * at + 2], bytes[4 * at + 3]]))
        };
        let position = DVec3::new(value(0), value(1), value(2));
        let (rotation, scale) = (DQuat::from_xyzw(value(3), value(4), value(5), value(6)), value(7));
        let is_good = position.is_finite()
            && rotation.is_finite()
            && (rotation.length() - 1.0).abs() < 1e-3
            && scale.is_finite()
            && scale > 0.0;
        if is_good {
            Ok(Similarity { position, rotation: rotation.normalize(), scale })
        } else {
            let what = "expected finite numbers, a unit quaternion and a scale greater than 0";
            Err(CliError::in_file(path, what).at(format!("instance {number}")))
        }
    };
    instances.iter().enumerate().map(read).collect()
}

/// Writes a scene; files below its folder by their relative names, others by their absolute ones.
#[cfg_attr(not(feature = "view"), allow(dead_code, reason = "it is the viewer that saves scenes"))]
pub(crate) fn write(path: &Path, scene: &SceneDescription) -> Result<(), CliError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().map_err(|error| CliError::write(path, &error))?;
    let name = |file: &Path| -> Result<String, CliError> {
        // A link keeps its own name: that is the one which goes where the folder goes.
        let found = file.canonicalize().map_err(|error| CliError::in_file(file, error))?;
        let beside = file.parent().filter(|above| !above.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = match (beside.canonicalize(), file.file_name()) {
            (Ok(beside), Some(name)) => beside.join(name),
            _ => found,
        };
        let name = file.strip_prefix(&folder).unwrap_or(&file);
        let name = name.to_str().ok_or_else(|| CliError::in_file(&file, "a name that is not UTF-8"))?;
        Ok(toml::Value::from(name).to_string())
    };
    let color = |[r, g, b]: [u8; 3]| format!("\"#{r:02x}{g:02x}{b:02x}\"");
    let vector = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let mut text = String::new();
    let mut line = |key: &str, value: Option<String>| {
        if let Some(value) = value {
            let _ = writeln!(text, "{key} = {value}");
        }
    };
    line("up", scene.up.map(|up| if up == UpAxis::Y { "\"y\"" } else { "\"z\"" }.to_string()));
    line("background", scene.background.map(color));
    if let Some(SceneCamera { eye, target, up, fov_deg }) = scene.camera {
        line("\n[camera]\neye", eye.map(vector));
        line("target", target.map(vector));
        line("up", up.map(vector));
        line("fov", fov_deg.map(|fov| format!("{fov:?}")));
    }
    if let Some(Ground { height, color: ground }) = scene.ground {
        line("\n[ground]\nheight", Some(format!("{height:?}")));
        line("color", Some(color(ground)));
    }
    for SceneModel { file, places } in &scene.models {
        line("\n[[model]]\nfile", Some(name(file)?));
        match places {
            Places::Many(instances) => line("instances", Some(name(instances)?)),
            Places::One(Similarity { position, rotation, scale }) => {
                line("position", (*position != DVec3::ZERO).then(|| vector(*position)));
                let [x, y, z, w] = rotation.to_array();
                line("rotation", (*rotation != DQuat::IDENTITY).then(|| format!("[{x:?}, {y:?}, {z:?}, {w:?}]")));
                line("scale", (*scale != 1.0).then(|| format!("{scale:?}")));
            }
        }
    }
    for Light { kind, size, color: light, intensity } in &scene.lights {
        let (kind, key, place) = match kind {
            LightKind::Directional { towards } => ("directional", "direction", towards),
            LightKind::Point { position } => ("point", "position", position),
            LightKind::Area { position } => ("area", "position", position),
        };
        line("\n[[light]]\nkind", Some(format!("\"{kind}\"")));
        line(key, Some(vector(*place)));
        line("size", (*size != 0.0).then(|| format!("{size:?}")));
        line("color", (*light != [255; 3]).then(|| color(*light)));
        line("intensity", (*intensity != 1.0).then(|| format!("{intensity:?}")));
    }
    files::write_atomically(path, |out| out.write_all(text.as_bytes()).map_err(|error| CliError::write(path, &error)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read_text(text: &str) -> Result<SceneDescription, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text).unwrap();
        let folder = folder.path().display().to_string() + "/";
        read(&path).map_err(|error| error.to_string().replace(&folder, ""))
    }

    #[test]
    fn everything_but_a_model_is_optional() {
        let scene = read_text("[[model]]\nfile = \"a.glod\"\n").unwrap();
        assert_eq!(scene.models[0].places, Places::One(Similarity::IDENTITY));
        assert!(scene.models[0].file.is_absolute() && scene.models[0].file.ends_with("a.glod"));
        assert_eq!(SceneDescription { models: Vec::new(), ..scene }, SceneDescription::default());
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let model = "[[model]]\nfile = \"a.glod\"\n";
        for (text, expected) in [
            ("up = \"y\"\n", "error: scene.toml: no [[model]], expected at least one"),
            ("up = \"x\"\n", "error: scene.toml: up is \"x\", expected \"y\" or \"z\" (line 1)"),
            ("\nbackground = \"red\"\n", "(line 2)"),
            ("[camera]\nfov = 200.0\n", "error: scene.toml: 200, expected degrees from 0.01 to 170 (line 2)"),
            ("[camera]\nlens = 3\n", "(line 2)"),
            ("[[light]]\nkind = \"spot\"\n", "a light of kind \"spot\""),
            ("[[light]]\nkind = \"point\"\n", "this light has a position and no direction (line 1)"),
            ("[[light]]\nkind = \"directional\"\ndirection = [0, 0, 0]\n", "length 0 (line 3)"),
            ("[ground]\nheight = nan\n", "(line 2)"),
            ("= 4\n", "(line 1)"),
        ] {
            let text = if text.starts_with("up = \"y") { text.to_string() } else { format!("{text}{model}") };
            let error = read_text(&text).unwrap_err();
            assert!(error.contains(expected), "{error}, expected {expected}");
        }
        for place in ["rotation = [0, 0, 0, 2]", "scale = 0.0", "scale = -1", "position = [1, 2]"] {
            let error = read_text(&format!("{model}{place}\n")).unwrap_err();
            assert!(error.contains("(line 3)"), "{error}");
        }
    }

    #[test]
    fn instances_are_read_and_checked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trees.bin");
        let instance = |values: [f32; 8]| values.map(f32::to_le_bytes).concat();
        let good = instance([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.5]);
        std::fs::write(&path, [good.clone(), good.clone()].concat()).unwrap();
        let found = places(&Places::Many(path.clone())).unwrap();
        assert_eq!((found.len(), found[1].position, found[1].scale), (2, DVec3::new(1.0, 2.0, 3.0), 0.5));
        for (bytes, expected) in [
            ([good.clone(), instance([0.0; 8])].concat(), "(instance 1)"),
            (good[..31].to_vec(), "31 bytes"),
            (Vec::new(), "0 bytes"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = places(&Places::Many(path.clone())).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_its_folder_is_named_as_it_is_called_there() {
        let [folder, other] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let (file, link) = (other.path().join("model.glod"), folder.path().join("link.glod"));
        std::fs::write(&file, "").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        let model = |file| SceneModel { file, places: Places::One(Similarity::IDENTITY) };
        let path = folder.path().join("scene.toml");
        write(&path, &SceneDescription { models: vec![model(link), model(file)], ..Default::default() }).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("file = \"link.glod\"") && text.contains("/model.glod\""), "{text}");
    }

    fn any_vector() -> impl Strategy<Value = DVec3> {
        [-1e6..1e6, -1.0..1.0, -1e-6..1e-6].prop_map(|[x, y, z]: [f64; 3]| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            up in proptest::option::of(any::<bool>()),
            background in proptest::option::of(any::<[u8; 3]>()),
            camera in proptest::option::of((any_vector(), proptest::option::of(any_vector()), 1.0..100.0)),
            places in proptest::collection::vec((any_vector(), any_vector(), 1e-3..1e3), 1..4),
            lights in proptest::collection::vec((0..3, any_vector(), 0.0..2.0, any::<[u8; 3]>()), 0..3),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().canonicalize().unwrap().join("the \"model\".glod");
            std::fs::write(&file, "").unwrap();
            let scene = SceneDescription {
                up: up.map(|is_y| if is_y { UpAxis::Y } else { UpAxis::Z }),
                background,
                camera: camera.map(|(eye, target, fov)| SceneCamera {
                    eye: Some(eye), target, up: None, fov_deg: Some(fov),
                }),
                ground: up.map(|_| Ground { height: 0.25, color: [1, 2, 3] }),
                models: places.iter().map(|(position, turn, scale)| SceneModel {
                    file: file.clone(),
                    places: Places::One(Similarity {
                        position: *position,
                        rotation: DQuat::from_scaled_axis(*turn).normalize(),
                        scale: *scale,
                    }),
                }).collect(),
                lights: lights.iter().map(|(kind, place, size, color)| Light {
                    kind: match kind {
                        0 => LightKind::Directional { towards: place + DVec3::X * 2e6 },
                        1 => LightKind::Point { position: *place },
                        _ => LightKind::Area { position: *place },
                    },
                    size: *size,
                    color: *color,
                    intensity: 1.5,
                }).collect(),
            };
            let path = folder.path().canonicalize().unwrap().join("scene.toml");
            write(&path, &scene).unwrap();
            let again = read(&path).unwrap();
            let (before, after) = (&scene.models, &again.models);
            for (before, after) in before.iter().zip(after) {
                let (Places::One(a), Places::One(b)) = (&before.places, &after.places) else { panic!("places of another kind") };
                prop_assert!(a.rotation.dot(b.rotation) > 1.0 - 1e-12);
                prop_assert_eq!((a.position, a.scale, &before.file), (b.position, b.scale, &after.file));
            }
            prop_assert_eq!(
                SceneDescription { models: Vec::new(), ..scene },
                SceneDescription { models: Vec::new(), ..again }
            );
        }
    }
}
