#![no_main]

#[path = "../../crates/gigalod/tests/fuzzing/mod.rs"]
mod fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::glod(bytes);
    fuzzing::glod(&fuzzing::mended(bytes));
});
