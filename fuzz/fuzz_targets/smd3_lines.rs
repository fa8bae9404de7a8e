//! Runs [`stepdrive_fuzz::smd3_lines`] under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| stepdrive_fuzz::smd3_lines(data));
