//! The PLY reader from outside: bytes in, batches or an error out.

mod damage;
mod document;
mod errors;
mod gzip;
mod header;
#[path = "../nasty/mod.rs"]
mod nasty;
mod real_files;
mod round_trip;
mod sources;
mod text;
mod values;
