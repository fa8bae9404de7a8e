//! Runs [`stepdrive_fuzz::smsd_packets`] under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| stepdrive_fuzz::smsd_packets(data));
