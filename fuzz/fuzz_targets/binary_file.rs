//! Arrays of VTU files, and states of checkpoints.

#![no_main]

#[path = "../../tests/fuzz/entry/mod.rs"]
mod entry;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    entry::binary_file(data);
});
