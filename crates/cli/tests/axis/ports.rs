//! `stepdrive ports`.

use crate::bench::{Bench, keys};
use crate::rig::{Bench as Rig, Ran};
use crate::up::{Place, Up};
use serde_json::Value;

#[test]
fn the_drives_of_a_rig_that_answers_are_listed_with_their_targets() {
    let bench = Bench::start();
    let told = bench.json(&format!("ports --api {}", bench.rig.api()));
    assert_eq!(keys(&told), ["rigs", "serial_ports"]);
    let rig = &told["rigs"][0];
    assert_eq!(rig["api"], bench.rig.api());
    let stage = bench.address(0);
    assert_eq!(rig["drives"][0]["targets"][0], format!("smsd+tcp://{stage}?unit=1"));
    let targets = rig["drives"][1]["targets"].as_array().expect("two").clone();
    let [serial, tcp] = targets.as_slice() else { panic!("two: {targets:?}") };
    assert_eq!(tcp, &format!("smd3+tcp://{}", bench.address(1)));
    assert!(serial.as_str().is_some_and(|text| text.starts_with("smd3+serial://")), "{serial}");
    // What is told to stand behind -a does.
    for target in [&rig["drives"][0]["targets"][0], tcp] {
        let target = target.as_str().expect("text");
        bench.run(&format!("status -a {target}")).done();
    }
}

#[test]
fn a_virtual_port_in_the_state_folder_is_found_and_leads_to_its_drive() {
    let place = Place::with("[[drive]]\nname = \"u\"\nmodel = \"SMD3\"\nserial = \"pty\"\n");
    let _up = Up::start(place.command().args(["up", "rig.toml", "--json"]));
    let ran = Ran(place.run("ports --json --api 127.0.0.1:1"));
    let told: Value = serde_json::from_str(ran.done()).expect("JSON");
    let ports = told["serial_ports"].as_array().expect("a list");
    let port = ports.iter().find(|port| port["kind"] == "virtual").unwrap_or_else(|| panic!("{told}"));
    assert_eq!(keys(port), ["about", "kind", "path", "target"]);
    assert!(port["about"].as_str().is_some_and(|about| about.starts_with("u of the rig rig-")), "{port}");
    let target = port["target"].as_str().expect("text");
    let status = Ran(place.run(&format!("status --json -a {target}")));
    assert!(status.done().contains("\"controller\":\"SMD3"), "{}", status.stdout());
    let shown = Ran(place.run("ports --api 127.0.0.1:1"));
    assert!(
        shown.done().starts_with("TARGET") && shown.stdout().contains("virtual, u of the rig"),
        "{}",
        shown.stdout()
    );
}

#[test]
fn a_rig_that_wants_a_token_is_told_so() {
    let rig = "[rig]\napi = \"127.0.0.1:0\"\napi_token = \"a-token-of-some-length\"\n[[drive]]\nname = \"a\"\n\
               model = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n";
    let bench = Rig::with(rig);
    let ran = Ran(bench.place.run(&format!("ports --api {}", bench.api())));
    assert_eq!(ran.code(), 0);
    assert!(ran.stderr().contains("lets nobody look"), "{}", ran.stderr());
    let ran = Ran(bench.place.run(&format!("ports --api {} --token a-token-of-some-length", bench.api())));
    assert!(ran.done().contains("a, an SMSD-4.2LAN of the rig at"), "{}", ran.stdout());
}

#[test]
fn where_there_is_no_rig_none_is_listed() {
    let place = Place::new();
    let ran = Ran(place.run("ports --json --api 127.0.0.1:1"));
    let told: Value = serde_json::from_str(ran.done()).expect("JSON");
    assert_eq!(told["rigs"], Value::Array(Vec::new()));
    assert_eq!(Ran(place.run("ports --api https://x")).code(), 1);
}
