#![no_main]

#[path = "../targets.rs"]
#[allow(dead_code, reason = "each target runs one entry point")]
mod targets;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    targets::deep_store(data);
});
