//! Splat files from outside: written, read back, damaged, forged, and compared with `docs/format.md`.

mod damage;
mod forgery;
mod hostile_header;
mod hostile_pages;
mod hostile_skeleton;
mod round_trip;
mod sample;
mod stranger;
mod stranger_pages;
mod tree;
