//! Scenes within the schema, made of bytes.

#![no_main]

#[path = "../../tests/fuzz/entry/mod.rs"]
mod entry;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    entry::random_scene(data);
});
