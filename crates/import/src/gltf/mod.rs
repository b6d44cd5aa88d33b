//! glTF 2: JSON with buffers beside it or inside, and GLB.
//!
//! Files come in through [`open_with`](crate::open_with). What this reader makes of them:
//!
//! * **The scene**: that which the file names, or its first, or without any all nodes. Meshes come where their nodes are, each
//!   instance by itself (`EXT_mesh_gpu_instancing`, too); a transform that mirrors turns triangles around. A node at two places
//!   is an error, so there are no cycles. Skins and morph targets stay as they are at rest.
//! * **Primitives**: points, triangles, strips and fans, with indices or without; lines are skipped. Strips drop triangles with a
//!   repeated corner. Where several primitives share vertices, each brings those between the first and the last it names.
//! * **Accessors** of all component types, normalised or not, with strides, sparse, or without a view. They are read a range at
//!   a time, wherever they are.
//! * **Packed data**: `EXT_meshopt_compression` (a view must fit 256 MiB), `KHR_draco_mesh_compression` (a primitive must fit
//!   512 MiB), `KHR_mesh_quantization`. Other extensions that a file *requires* are refused, but those of materials and lights.
//! * **Colours**, if any primitive has them: `COLOR_0` times the base colour, in linear light, as sRGB.
//! * **Texture coordinates** and materials are streamed where a base colour has a texture; pictures are read when
//!   they are asked for. `KHR_texture_transform` is in the coordinates already. What an alpha mask leaves out is told; what is
//!   blended is taken for opaque.
//! * **Buffers** in other files come through [`SideFiles`]; names may have escapes (`%20`). GLB is not read from gzip.

mod accessors;
mod buffers;
mod container;
mod draco;
mod json;
mod meshopt;
mod scene;
mod stream;

pub(crate) use container::recognises;

use crate::{ImportError, ModelStream, Place, SideFiles, error::said, input::Input};
use accessors::Data;
use buffers::Buffers;

/// Most objects in the JSON, braces in strings among them: each may take a hundred bytes and more.
const MOST_OBJECTS: usize = 1 << 21;

/// Reads the JSON of a file that is [recognised](recognises), and checks what it says.
pub(crate) fn open(input: Input, mut side: Box<dyn SideFiles>) -> Result<Box<dyn ModelStream>, ImportError> {
    let container = container::open(input)?;
    let objects = memchr::memchr_iter(b'{', &container.json).count();
    if objects > MOST_OBJECTS {
        let expected = format!("JSON of at most {MOST_OBJECTS} objects");
        return Err(ImportError::malformed(expected, objects.to_string(), Place::byte(container.json_offset)));
    }
    let root: json::Root = serde_json::from_slice(&container.json).map_err(|error| {
        let place = match container.json_offset {
            0 => Place::line(error.line() as u64),
            offset => Place::byte(offset),
        };
        ImportError::malformed("JSON of glTF", said(error), place)
    })?;
    drop(container.json);
    scene::check_version(&root)?;
    let buffers = Buffers::open(&root, container.chunk, &mut *side)?;
    let stream = stream::GltfStream::new(Data::new(root, buffers), side, container.total_bytes)?;
    Ok(Box::new(stream))
}
