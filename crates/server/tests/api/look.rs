//! What can be seen of the rig.

use crate::bench::{Bench, THREE};
use serde_json::{Value, json};

#[tokio::test]
async fn the_rig_is_told_with_its_clock_drives_and_wires() {
    let bench = Bench::start().await;
    let rig = bench.get("/v1/rig").await.json();
    assert_eq!(rig["now_ns"], 0);
    assert_eq!(rig["clock"], json!({ "mode": "paused", "speed_reached": 1.0 }));
    assert_eq!(rig["playing"], Value::Null);
    let drives = rig["drives"].as_array().expect("drives");
    let names: Vec<&str> = drives.iter().filter_map(|drive| drive["name"].as_str()).collect();
    assert_eq!(names, ["a", "b", "uhv"]);
    let wires = json!([
        { "from": "a.relay", "to": "b.CONTINUE", "delay_ns": 0, "invert": false, "connected": true, "level": false },
        { "from": "b.relay", "to": "a.IN0", "delay_ns": 5_000_000, "invert": true, "connected": true, "level": true },
    ]);
    assert_eq!(rig["wires"], wires);
}

#[tokio::test]
async fn a_drive_of_each_family_is_told_as_it_is() {
    let bench = Bench::start().await;
    let served = bench.server.drives();
    let smsd = bench.see("/drives/0").await;
    let free = json!({ "level": false, "forced": null });
    let high = json!({ "level": true, "forced": null });
    let expected = json!({
        "name": "a", "model": "SMSD-4.2LAN", "powered": true, "state": "HiZ",
        "position": 0.0, "speed": 0.0, "carriage": 0.0, "stalled": false,
        "inputs": {
            "IN0": high, "IN1": high, "SET_ZERO": free, "SW": free,
            "EN": free, "STEP": free, "DIR": free, "CONTINUE": free,
        },
        "outputs": { "relay": false }, "faults": {},
        "modbus_tcp": served[0].modbus_tcp.expect("it listens").to_string(),
    });
    assert_eq!(smsd, expected);
    let smd3 = bench.see("/drives/2").await;
    assert_eq!(
        (&smd3["model"], &smd3["state"], &smd3["outputs"]),
        (&json!("SMD3"), &json!("STANDBY"), &json!({}))
    );
    assert_eq!(smd3["serial_tcp"], served[2].serial_tcp.expect("it listens").to_string());
    assert_eq!(smd3.get("serial"), None);
    assert_eq!(smd3["inputs"]["LIMIT_NEGATIVE"], free);
}

#[tokio::test]
async fn a_drive_without_its_supply_is_off_and_shows_nothing() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/uhv/power", r#"{"on": false}"#).await;
    let drive = bench.see("/drives/2").await;
    assert_eq!((&drive["powered"], &drive["state"]), (&json!(false), &json!("OFF")));
    assert_eq!((&drive["position"], &drive["speed"]), (&json!(0.0), &json!(0.0)));
}

#[tokio::test]
async fn the_state_of_an_smd3_names_its_errors() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/uhv/faults/motor", r#"{"setting": "short"}"#).await;
    let state = bench.see("/drives/2/state").await;
    assert_eq!(state, "STANDBY, MOTOR SHORT");
}

#[tokio::test]
async fn one_drive_is_told_with_everything_that_can_be_asked_of_it() {
    let bench = Bench::start().await;
    let smsd = bench.get("/v1/drives/A").await.json();
    assert_eq!(smsd["name"], "a", "case does not matter");
    let quantities = smsd["quantities"].as_object().expect("quantities");
    for (name, value) in [("ABS_POS", 0.0), ("HiZ", 1.0), ("IN1", 1.0), ("carriage", 0.0), ("powered", 1.0)] {
        assert_eq!(quantities.get(name), Some(&json!(value)), "{name}");
    }
    let smd3 = bench.get("/v1/drives/uhv").await.json();
    assert_eq!(smd3["quantities"]["PACT"], 0.0);
    assert_eq!(smd3["quantities"]["STANDBY"], 1.0);
    for name in bench.server.control().rig().drives[2].quantities().map(|quantity| quantity.to_string()) {
        assert!(smd3["quantities"][&name].is_number(), "{name}");
    }
}

#[tokio::test]
async fn an_unknown_drive_is_refused_with_those_there_are() {
    let bench = Bench::start().await;
    let reply = bench.get("/v1/drives/c").await;
    assert_eq!((reply.status, reply.error().as_str()), (422, "unknown drive `c`; there are a, b, uhv"));
    let reply = bench.get("/v1/drives/%ff").await;
    assert_eq!((reply.status, reply.error().as_str()), (400, "the path is not UTF-8"));
    assert_eq!(bench.get("/v1/drives/a%20b%0A").await.status, 422);
}

#[tokio::test]
async fn every_fault_that_a_drive_can_have_is_listed_with_its_setting() {
    let bench = Bench::start().await;
    bench.done("PUT /v1/drives/uhv/faults/thermocouple", r#"{"setting": "open"}"#).await;
    bench.done("PUT /v1/drives/a/faults/IN1", r#"{"setting": "bounce"}"#).await;
    let faults = bench.get("/v1/faults").await.json();
    let faults = faults.as_array().expect("faults");
    let setting = |drive: &str, name: &str| {
        let mut named = faults.iter().filter(|fault| fault["drive"] == drive && fault["name"] == name);
        let found = named.next().map(|fault| (fault["setting"].clone(), fault["settings"].clone()));
        assert!(named.next().is_none(), "{drive}.{name} is there twice");
        found
    };
    assert_eq!(setting("uhv", "thermocouple"), Some((json!("open"), json!("open | short"))));
    assert_eq!(setting("a", "IN1"), Some((json!("bounce"), json!("stuck-open | stuck-closed | bounce"))));
    assert_eq!(setting("b", "rotor"), Some((json!("off"), json!("blocked"))));
    assert_eq!(
        (setting("a", "thermocouple"), setting("b", "IN1"), setting("a", "INPUT")),
        (None, None, None)
    );
    for fault in faults {
        let (drive, name) =
            (fault["drive"].as_str().expect("a drive"), fault["name"].as_str().expect("a name"));
        bench.done(&format!("PUT /v1/drives/{drive}/faults/{name}"), r#"{"setting": "off"}"#).await;
    }
}

#[tokio::test]
async fn the_document_and_the_routes_are_served() {
    let bench = Bench::start().await;
    let document = bench.get("/openapi.json").await.json();
    assert_eq!(document["openapi"], "3.1.0");
    for (path, item) in document["paths"].as_object().expect("paths") {
        let path = path.replace("{drive}", "a").replace("{input}", "IN0").replace("{fault}", "rotor");
        for method in item.as_object().expect("operations").keys().filter(|key| *key != "parameters") {
            let method = method.to_ascii_uppercase();
            if ["/v1/events", "/v1/traffic"].contains(&path.as_str()) {
                continue;
            }
            let reply = bench.ask(&format!("{method} {path}"), "[]").await;
            let expected = if method == "GET" { 200 } else { 400 };
            assert_eq!(reply.status, expected, "{method} {path}: {}", reply.body);
        }
    }
}

#[tokio::test]
async fn what_is_not_there_and_what_cannot_be_done_there_are_told_apart() {
    let bench = Bench::start().await;
    for path in ["/", "/v1", "/v1/rig/", "/v1/drives", "/v1/drives/a/inputs", "/v2/rig"] {
        let reply = bench.get(path).await;
        assert_eq!(reply.status, 404, "{path}");
        assert!(reply.error().contains("/openapi.json"));
    }
    for (line, allowed) in
        [("POST /v1/rig", "GET,HEAD"), ("GET /v1/clock", "PUT"), ("OPTIONS /v1/actions", "POST")]
    {
        let reply = bench.ask(line, "").await;
        assert_eq!((reply.status, reply.header("allow")), (405, Some(allowed)), "{line}");
        assert!(reply.error().contains("Allow"));
    }
}

#[tokio::test]
async fn replies_are_neither_kept_nor_guessed_at_nor_given_to_other_origins() {
    let bench = Bench::start().await;
    for path in ["/v1/rig", "/nothing"] {
        let reply = bench.get(path).await;
        assert_eq!(reply.header("cache-control"), Some("no-store"));
        assert_eq!(reply.header("x-content-type-options"), Some("nosniff"));
        assert_eq!(reply.header("access-control-allow-origin"), None);
    }
}

#[tokio::test]
async fn a_rig_without_an_api_has_none() {
    let bench = Bench::with(&THREE.replace("api = \"127.0.0.1:0\"", "")).await;
    assert_eq!(bench.server.api(), None);
}
