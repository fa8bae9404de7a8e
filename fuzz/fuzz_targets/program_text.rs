//! Runs [`stepdrive_fuzz::program_text`] under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| stepdrive_fuzz::program_text(data));
