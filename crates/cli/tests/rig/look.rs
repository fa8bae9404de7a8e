//! `rig status`, and the lists of faults and wires.

use crate::bench::Bench;
use expect_test::expect;
use stepdrive_spec::smsd::registers::Reg;

#[test]
fn status_is_a_table_of_the_drives_with_the_clock_and_the_wires() {
    let bench = Bench::start();
    bench.rig("do 'input a.IN0 1' 'input a.SW 0' 'fault u.thermocouple open' 'power b off'").done();
    bench.client(0).set(Reg::Relay, true).expect("answered").expect("accepted");
    expect![[r#"
        clock paused, rig time 0s

        DRIVE  MODEL        STATE           POSITION  SPEED  SIGNALS                              FAULTS
        a      SMSD-4.2LAN  HiZ                    0      0  IN0=1 forced, SW=0 forced, relay on
        b      SMSD-8.0LAN  no power               0      0
        u      SMD3         STANDBY, TOPEN         0      0                                       thermocouple open

        WIRE                 STATE  LEVEL  DELAY
        a.relay  b.CONTINUE  whole  0      5ms
    "#]].assert_eq(bench.rig("status").done());
}

#[test]
fn status_of_a_drive_has_everything_that_has_a_value() {
    let bench = Bench::start();
    let shown = bench.rig("status a").done().replace(&bench.address(0).to_string(), "ADDRESS");
    let begin: String = shown.split_inclusive('\n').take(13).collect();
    expect![[r#"
        drive                    a, SMSD-4.2LAN
        state                    HiZ
        carriage                 0 full steps
        Modbus TCP               ADDRESS
        input IN0                0
        input IN1                0
        input SET_ZERO           0
        input SW                 0
        input EN                 0
        input STEP               0
        input DIR                0
        input CONTINUE           0
        output relay             off
    "#]]
    .assert_eq(&begin);
    let value = |name: &str| {
        let row = shown.lines().find(|line| line.starts_with(&format!("{name} ")));
        row.and_then(|row| row.split_whitespace().nth(1))
    };
    assert_eq!(
        [value("ABS_POS"), value("MAX_SPEED"), value("powered")],
        [Some("0"), Some("1000"), Some("1")]
    );
    let json = bench.json("status u");
    assert_eq!((json["name"].as_str(), json["model"].as_str()), (Some("u"), Some("SMD3")));
    assert_eq!(json["quantities"]["PACT"], 0.0);
}

#[test]
fn status_as_json_is_what_the_api_says() {
    let json = Bench::start().json("status");
    let names: Vec<&str> = json["drives"]
        .as_array()
        .expect("drives")
        .iter()
        .filter_map(|drive| drive["name"].as_str())
        .collect();
    assert_eq!(names, ["a", "b", "u"]);
    assert_eq!((&json["clock"]["mode"], &json["now_ns"]), (&"paused".into(), &0.into()));
    assert_eq!(json["wires"][0]["to"], "b.CONTINUE");
}

#[test]
fn the_faults_that_there_are_are_listed_with_those_that_are_on() {
    let bench = Bench::start();
    bench.rig("fault u.thermocouple short").done();
    bench.rig("fault a.IN1 stuck-open").done();
    let list = bench.rig("fault").0.stdout;
    let list = String::from_utf8(list).expect("text");
    let row = |name: &str| {
        let row = list.lines().find(|line| line.starts_with(&format!("{name} ")));
        row.map(|row| row.split_whitespace().nth(1).expect("what is on").to_owned())
    };
    assert_eq!(row("u.thermocouple").as_deref(), Some("short"), "{list}");
    assert_eq!(row("a.IN1").as_deref(), Some("stuck-open"));
    assert_eq!(row("b.rotor").as_deref(), Some("off"));
    assert_eq!((row("a.thermocouple"), row("a.IN0")), (None, None), "what a drive has not cannot fail");
    assert!(
        list.starts_with("FAULT ") && list.lines().all(|line| line.split_whitespace().count() > 3),
        "{list}"
    );
    let json = bench.json("fault");
    let on = json.as_array().expect("faults").iter().filter(|fault| fault["setting"] != "off").count();
    assert_eq!(on, 2);
}

#[test]
fn the_wires_are_listed() {
    let bench = Bench::start();
    bench.rig("wire a.relay b.CONTINUE cut").done();
    expect![[r#"
        WIRE                 STATE  LEVEL  DELAY
        a.relay  b.CONTINUE  cut    0      5ms
    "#]]
    .assert_eq(bench.rig("wire").done());
    let json = bench.json("wire");
    assert_eq!((&json[0]["from"], &json[0]["connected"]), (&"a.relay".into(), &false.into()));
}

#[test]
fn a_rig_without_wires_says_so() {
    let bench = Bench::with(
        "[rig]\napi = \"127.0.0.1:0\"\n[[drive]]\nname = \"u\"\nmodel = \"SMD3\"\nserial_tcp = \"127.0.0.1:0\"\n",
    );
    assert!(bench.rig("wire").done().starts_with("the rig has no wires"));
    assert_eq!(bench.json("wire"), serde_json::json!([]));
    assert!(!bench.rig("status").done().contains("WIRE"));
}
