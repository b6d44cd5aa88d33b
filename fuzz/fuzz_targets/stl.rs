#![no_main]

#[path = "../../crates/import/tests/fuzzing/mod.rs"]
mod fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::stl(bytes);
});
