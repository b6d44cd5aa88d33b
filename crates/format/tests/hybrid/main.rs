//! Hybrid files from outside: written, read back, damaged and forged.

mod hostile_pages;
mod hostile_skeleton;
mod made;
mod round_trip;
mod sample;
