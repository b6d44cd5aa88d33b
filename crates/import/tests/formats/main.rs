//! The readers of all formats but PLY from outside: bytes in, batches or an error out.

#[path = "../ply/sources.rs"]
mod sources;

mod gltf;
mod make;
mod obj;
mod off;
mod points;
mod real_files;
mod stl;
