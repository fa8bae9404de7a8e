//! Runs [`stepdrive_fuzz::modbus_server_bytes`] under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| stepdrive_fuzz::modbus_server_bytes(data));
