//! The readers of all formats but PLY from outside: bytes in, batches or an error out.

#[path = "../nasty/mod.rs"]
mod nasty;
#[path = "../ply/sources.rs"]
mod sources;

mod georeference;
mod gltf;
mod gltf_packed;
mod make;
mod many;
mod obj;
mod off;
mod points;
mod real_files;
mod stl;
