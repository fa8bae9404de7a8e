//! Runs [`stepdrive_fuzz::recording`] under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| stepdrive_fuzz::recording(data));
