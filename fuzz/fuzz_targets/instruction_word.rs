//! Runs [`stepdrive_fuzz::instruction_word`] under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| stepdrive_fuzz::instruction_word(data));
