//! Settings: shown, checked, applied, read back.

use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage};
use serde_json::{Value, json};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::sleep;

const SMSD: &str = "/v1/axes/stage/settings";
const SMD3: &str = "/v1/axes/uhv/settings";

async fn row(stage: &Stage, path: &str, name: &str) -> Value {
    let rows = stage.get(path).await.done();
    let rows = rows["rows"].as_array().expect("rows").iter();
    rows.clone().find(|row| row["name"] == name).unwrap_or_else(|| panic!("{name}")).clone()
}

fn set(what: &Value) -> String {
    json!({ "set": what }).to_string()
}

#[tokio::test(start_paused = true)]
async fn every_setting_is_shown_with_what_its_table_says() {
    let stage = Stage::new();
    let row = row(&stage, SMSD, "MAX_SPEED").await;
    let expected = json!({
        "name": "MAX_SPEED", "group": "Motion", "about": Reg::MaxSpeed.info().about, "unit": "full step/s",
        "kind": "integer", "min": 16.0, "max": 15600.0, "default": Reg::MaxSpeed.info().default, "at_default": true,
        "stored": null, "value": Reg::MaxSpeed.info().default, "writable": true, "volatile": true, "source": Reg::MaxSpeed.info().source,
    });
    assert_eq!(row, expected);
    let current = self::row(&stage, SMSD, "WORK_CURRENT").await;
    assert_eq!((&current["max"], &current["kind"]), (&json!(42.0), &json!("integer")), "of this model");
    let control = self::row(&stage, SMSD, "MICROSTEPPING").await;
    assert_eq!(
        (&control["kind"], &control["choices"][4]),
        (&json!("choice"), &json!({ "value": 4, "name": "1/16" }))
    );
    let mode = self::row(&stage, SMD3, "MODE").await;
    assert_eq!((&mode["choices"][2]["name"], &mode["value"]), (&json!("Remote"), &json!(2)));
    let limits = self::row(&stage, SMD3, "L+").await;
    assert_eq!((&limits["kind"], &limits["group"]), (&json!("bool"), &json!("Limit inputs")));
    let rows = stage.get(SMD3).await.done();
    let settings = stepdrive_spec::smd3::commands::COMMANDS.iter().filter(|row| row.stored);
    assert_eq!(rows["rows"].as_array().map(Vec::len), Some(settings.count()));
}

#[tokio::test(start_paused = true)]
async fn a_default_that_the_controller_rounds_is_still_its_default() {
    let stage = Stage::new();
    let amax = row(&stage, SMD3, "AMAX").await;
    assert_eq!((&amax["default"], &amax["value"]), (&json!(1000), &json!(999.904)));
    let rows = stage.get(SMD3).await.done();
    let differing: Vec<&Value> = rows["rows"]
        .as_array()
        .expect("rows")
        .iter()
        .filter(|row| row["at_default"] != true)
        .map(|row| &row["name"])
        .collect();
    assert_eq!(differing, [""; 0], "fresh from the factory");
    stage.put(SMD3, &set(&json!({ "AMAX": 1001 }))).await.done();
    assert_eq!(row(&stage, SMD3, "AMAX").await["at_default"], false);
}

#[tokio::test(start_paused = true)]
async fn lan_parameters_stand_with_the_rest_and_are_in_effect_when_that_is_asked_for() {
    let stage = Stage::new();
    let ip = row(&stage, SMSD, "IP").await;
    assert_eq!((&ip["kind"], &ip["group"], &ip["writable"]), (&json!("text"), &json!("LAN"), &json!(true)));
    assert_eq!(row(&stage, SMSD, "MAC").await["writable"], false);
    let applied = stage.put(SMSD, &set(&json!({ "IP": "10.0.0.7", "Port": 1502, "ID": 1 }))).await.done();
    assert_eq!(applied["differs"], json!([]));
    let changed: Vec<&Value> =
        applied["changed"].as_array().expect("changes").iter().map(|one| &one["name"]).collect();
    assert_eq!(changed, ["IP", "Port"], "the rest was so already");
    assert_eq!(stage.smsd.look(Reg::LanIp, 3), 7);
    assert_eq!(row(&stage, SMSD, "IP").await["value"], "10.0.0.7");
    stage.post(&format!("{SMSD}/apply-lan"), "").await.done();
    assert!(stage.smsd.acts().contains(&(Reg::ApplyNetworkConfiguration, 1)));
}

#[tokio::test(start_paused = true)]
async fn what_is_set_is_read_back() {
    let stage = Stage::new();
    let applied =
        stage.put(SMSD, &set(&json!({ "ACC": 2000, "max_speed": "700", "DEC": 1000 }))).await.done();
    assert_eq!(applied["differs"], json!([]));
    let changed = applied["changed"].as_array().expect("changes");
    assert!(
        changed.contains(&json!({ "name": "ACC", "from": 1000, "to": 2000, "reads": 2000 })),
        "{changed:?}"
    );
    assert_eq!((stage.smsd.look(Reg::Acc, 0), stage.smsd.look(Reg::MaxSpeed, 0)), (2000, 700));
    let again = stage.put(SMSD, &set(&json!({ "ACC": 2000 }))).await.done();
    assert_eq!(again, json!({ "changed": [], "differs": [] }));
}

#[tokio::test(start_paused = true)]
async fn settings_are_sent_in_an_order_that_the_drive_takes() {
    let stage = Stage::new();
    let applied =
        stage.put(SMD3, &set(&json!({ "VSTART": 50, "VSTOP": 60, "RES": 8, "L": true }))).await.done();
    assert_eq!(applied["differs"], json!([]));
    assert!((stage.smd3.setting(Command::Vstart) - 50.0).abs() < 1.0);
    assert_eq!(stage.smd3.setting(Command::Res).to_bits(), 8_f64.to_bits());
}

#[tokio::test(start_paused = true)]
async fn one_mistake_and_nothing_is_changed() {
    let stage = Stage::new();
    for (body, field, told) in [
        (json!({ "ACC": 2000, "MAX_SPEED": 5 }), "MAX_SPEED", "takes 16 to 15600 full steps/s"),
        (json!({ "ACC": 2000, "WORK_CURRENT": 43 }), "WORK_CURRENT", "takes 1 to 42 × 0.1 A"),
        (json!({ "ACC": 2000, "DEC": 100.5 }), "DEC", "is a whole number"),
        (json!({ "ACC": 2000, "DEC": "fast" }), "DEC", "takes a number"),
        (json!({ "ACC": 2000, "DEC": null }), "DEC", "takes a number"),
        (json!({ "ACC": 2000, "SPEED": 1 }), "SPEED", "there is no such setting"),
        (json!({ "ACC": 2000, "VMAX": 1 }), "VMAX", "there is no such setting"),
        (json!({ "ACC": 2000, "IP": "1.2.3" }), "IP", "takes an address, as in 192.168.1.2"),
    ] {
        let answer = stage.put(SMSD, &set(&body)).await;
        assert_eq!(
            (answer.status.as_u16(), &answer.json()["fields"][field]),
            (422, &json!(told)),
            "{answer:?}"
        );
        assert_eq!(stage.smsd.look(Reg::Acc, 0), 1000);
    }
    let answer = stage.put(SMD3, &set(&json!({ "VMAX": 500, "VSTART": 500 }))).await;
    let told = answer.json()["fields"]["VSTART"].as_str().expect("why").to_owned();
    assert!(told.contains("VSTART may not be above VSTOP"), "{told}");
    assert!(stage.smd3.lines().iter().all(|line| !line.contains(',') || line.starts_with(',')), "only asked");
}

#[tokio::test(start_paused = true)]
async fn what_cannot_be_set_now_says_why_and_changes_nothing() {
    let stage = Stage::new();
    stage.energise().await;
    let current = row(&stage, SMSD, "WORK_CURRENT").await;
    assert_eq!(
        (&current["writable"], &current["why_not"]),
        (&json!(false), &json!("its motor is energised; de-energise it (stop and free it) first"))
    );
    let (status, why) = stage.put(SMSD, &set(&json!({ "MAX_SPEED": 700, "WORK_CURRENT": 20 }))).await.error();
    assert_eq!(status, 409);
    assert!(why.starts_with("stage was left as it is: its motor is energised, and WORK_CURRENT can be set only while it is not"), "{why}");
    assert_eq!(stage.smsd.look(Reg::MaxSpeed, 0), 1000);
    stage.jog("me").await.done();
    let (status, why) = stage.put(SMSD, &set(&json!({ "MAX_SPEED": 700 }))).await.error();
    assert_eq!((status, why.contains("is being jogged")), (409, true), "{why}");
    sleep(3 * SECOND).await;
    stage.put(SMSD, &set(&json!({ "MAX_SPEED": 700 }))).await.done();
    assert_eq!(stage.smsd.look(Reg::MaxSpeed, 0), 700);
}

#[tokio::test(start_paused = true)]
async fn what_halts_half_way_says_what_was_done() {
    let stage = Stage::new();
    row(&stage, SMSD, "ACC").await;
    let sent = stage.begin("PUT", SMSD, &set(&json!({ "MAX_SPEED": 700, "ACC": 2000 })));
    stage.smsd.otherwise(Fault::Delay(10 * MS));
    while stage.smsd.look(Reg::MaxSpeed, 0) != 700 {
        sleep(MS).await;
    }
    stage.smsd.refuse_connections(u32::MAX);
    stage.smsd.cut();
    let (status, why) = sent.await.expect("no panic").error();
    assert_eq!(status, 502);
    assert!(why.contains("ACC"), "{why}");
}

#[tokio::test(start_paused = true)]
async fn an_smd3_stores_and_loads_its_settings() {
    let stage = Stage::new();
    stage.put(SMD3, &set(&json!({ "VMAX": 500 }))).await.done();
    stage.post(&format!("{SMD3}/store"), "").await.done();
    stage.put(SMD3, &set(&json!({ "VMAX": 900 }))).await.done();
    stage.post(&format!("{SMD3}/load"), "").await.done();
    assert_eq!(stage.smd3.carried_out(), [Command::Store, Command::Load]);
    for path in [format!("{SMSD}/store"), format!("{SMSD}/load"), format!("{SMD3}/apply-lan")] {
        assert_eq!(stage.post(&path, "").await.error().0, 422, "{path}");
    }
}

#[tokio::test(start_paused = true)]
async fn what_an_smd3_keeps_is_known_once_it_was_stored_or_loaded_from_here() {
    let stage = Stage::new();
    let stored = async || row(&stage, SMD3, "VSTOP").await["stored"].clone();
    assert_eq!(stored().await, Value::Null);
    stage.put(SMD3, &set(&json!({ "VSTOP": 20 }))).await.done();
    assert_eq!(stored().await, Value::Null, "nobody has stored it");
    stage.post("/v1/axes/uhv/settings/store", "").await.done();
    let kept = stored().await;
    assert_eq!(kept, row(&stage, SMD3, "VSTOP").await["value"]);
    stage.put(SMD3, &set(&json!({ "VSTOP": 30 }))).await.done();
    assert_eq!(stored().await, kept);
    assert_ne!(row(&stage, SMD3, "VSTOP").await["value"], kept);
    stage.post("/v1/axes/uhv/settings/load", "").await.done();
    assert_eq!(row(&stage, SMD3, "VSTOP").await["value"], kept);
    assert_eq!(stored().await, kept);
}
