//! Hybrid files from outside: written, read back, damaged, forged, and compared with `docs/format.md`.

mod hostile_pages;
mod hostile_skeleton;
mod made;
mod round_trip;
mod sample;
mod stranger;
mod stranger_front;
