//! `stepdrive settings`.

use crate::bench::{Bench, keys};
use crate::rig::Ran;
use serde_json::Value;
use std::fs;

fn read(bench: &Bench, name: &str) -> String {
    fs::read_to_string(bench.place().path(name)).expect("written")
}

/// What it printed when it ended with a code, however much it said.
#[track_caller]
fn ended(ran: &Ran, code: i32) -> (&str, String) {
    assert_eq!(ran.code(), code, "{}{}", ran.stdout(), ran.stderr());
    (ran.stdout(), ran.stderr())
}

fn names(list: &Value) -> Vec<&str> {
    list.as_array().expect("a list").iter().filter_map(|item| item["name"].as_str()).collect()
}

#[test]
fn what_was_saved_is_no_different_and_says_what_it_means() {
    let bench = Bench::start();
    for (axis, count) in [("stage", 11), ("uhv", 28)] {
        let ran = bench.run(&format!("settings save p.toml -a {axis}"));
        assert_eq!(ran.done(), format!("{count} settings of {axis} to p.toml\n"));
        let same = bench.run(&format!("settings diff p.toml -a {axis}"));
        assert_eq!(same.done(), format!("{axis} is as p.toml says\n"));
        let nothing = bench.run(&format!("settings apply p.toml -a {axis}"));
        assert_eq!(nothing.done(), format!("{axis} is as p.toml says\n"));
    }
    let text = read(&bench, "p.toml");
    assert!(text.contains("model = \"SMD3\"") && text.contains("\"LP+\" = 0"), "{text}");
    let stdout = bench.run("settings save - -a stage");
    assert!(
        stdout.done().contains("MICROSTEPPING = 4           # 1/16. Microstep mode"),
        "{}",
        stdout.stdout()
    );
}

#[test]
fn a_difference_is_told_and_ends_with_10() {
    let bench = Bench::start();
    bench.run("settings save p.toml -a stage").done();
    bench.run("set -a stage MAX_SPEED 800").done();
    let ran = bench.run("settings diff p.toml -a stage");
    let (stdout, stderr) = ended(&ran, 10);
    assert_eq!(
        stdout,
        "SETTING    FILE               CONTROLLER\nMAX_SPEED  1000 full steps/s  800 full steps/s\n"
    );
    assert_eq!(stderr, "stepdrive: 1 setting of stage not as p.toml says\n");
    let ran = bench.run("settings diff p.toml -a stage --json");
    let told: Value = serde_json::from_str(ended(&ran, 10).0).expect("JSON");
    assert_eq!(keys(&told), ["axis", "differences", "file", "same"]);
    assert_eq!((&told["same"], names(&told["differences"])), (&false.into(), vec!["MAX_SPEED"]));
    assert_eq!(
        (&told["differences"][0]["file"], &told["differences"][0]["controller"]),
        (&1000.into(), &800.into())
    );
}

#[test]
fn a_profile_is_planned_applied_and_read_back() {
    let bench = Bench::start();
    bench.write(
        "p.toml",
        "model = \"SMSD-4.2LAN\"\n[settings]\nMAX_SPEED = 700\nWORK_CURRENT = 20\nMask = 0xF0\n",
    );
    let ran = bench.run("settings apply p.toml -a stage --dry-run");
    let plan = ran.done();
    assert!(plan.contains("MAX_SPEED     1000 full steps/s  700 full steps/s"), "{plan}");
    assert!(plan.contains("20 (2.0 A)") && plan.contains("holding register 0x110D = 20"), "{plan}");
    assert_eq!(ended(&bench.run("settings diff p.toml -a stage"), 10).1.lines().count(), 1);

    let ran = bench.run("settings apply p.toml -a stage");
    let (stdout, stderr) = ended(&ran, 0);
    assert!(stdout.starts_with(plan), "{stdout}");
    assert!(stdout.ends_with("set, and all 3 settings of the file read back as they should\n"), "{stdout}");
    assert_eq!(stderr, "MIN_SPEED to FS_SPEED and Mask are in force until power-off\n");
    bench.run("settings diff p.toml -a stage").done();
    assert_eq!(bench.json("get -a stage WORK_CURRENT")["values"][0]["value"], 20);
}

#[test]
fn an_smd3_is_set_in_an_order_that_it_takes_and_rounds_and_stores() {
    let bench = Bench::start();
    bench.write(
        "p.toml",
        "model = \"SMD3\"\n[settings]\nRES = 8\nAMAX = 20000\nVSTART = 50\nVSTOP = 60\nPDDEL = 100\nIR = 0.7\n",
    );
    let told = bench.json("settings apply p.toml -a uhv --store");
    assert_eq!(names(&told["changes"]), ["RES", "IR", "AMAX", "VSTOP", "VSTART"]);
    assert_eq!(told["changes"][2]["sent"], "AMAX,20000.0");
    assert_eq!(
        (&told["verified"], &told["stored"], &told["dry_run"]),
        (&true.into(), &true.into(), &false.into())
    );
    assert_eq!(told["differences"], Value::Array(Vec::new()));
    bench.rig.rig("power uhv off").done();
    bench.rig.rig("power uhv on").done();
    bench.run("settings diff p.toml -a uhv").done();
}

#[test]
fn without_store_it_is_said_that_an_smd3_forgets() {
    let bench = Bench::start();
    bench.write("p.toml", "model = \"SMD3\"\n[settings]\nVMAX = 500\n");
    let ran = bench.run("settings apply p.toml -a uhv");
    assert_eq!(ended(&ran, 0).1, "the settings are in force until power-off; --store keeps them\n");
    let told = bench.run("settings apply p.toml -a stage --store").refused(1);
    assert_eq!(told, "p.toml is for an SMD3, and stage is an SMSD-4.2LAN");
}

#[test]
fn what_the_state_of_the_motor_forbids_is_refused_before_anything_is_sent() {
    let bench = Bench::start();
    bench.energise();
    bench.write("p.toml", "model = \"SMSD-4.2LAN\"\n[settings]\nMAX_SPEED = 700\nMICROSTEPPING = 3\n");
    let ran = bench.run("settings apply p.toml -a stage");
    let (_, stderr) = ended(&ran, 7);
    assert!(
        stderr.contains("its motor is energised, and MICROSTEPPING can be set only while it is not"),
        "{stderr}"
    );
    assert!(stderr.trim_end().ends_with("nothing was changed"), "{stderr}");
    assert_eq!(bench.json("get -a stage MAX_SPEED")["values"][0]["value"], 1000);

    bench.write("u.toml", "model = \"SMD3\"\n[settings]\nVMAX = 700\nRES = 64\n");
    bench.run("run -a uhv +").done();
    let ran = bench.run("settings apply u.toml -a uhv");
    let (_, stderr) = ended(&ran, 7);
    assert!(stderr.contains("its motor is not in standby, which RES can be set in only"), "{stderr}");
    assert_eq!(bench.json("get -a uhv VMAX")["values"][0]["value"], 1000.0);
}

#[test]
fn mistakes_in_a_profile_are_told_with_their_place() {
    let bench = Bench::start();
    let told = |text: &str, axis: &str| {
        bench.write("p.toml", text);
        let ran = bench.run(&format!("settings apply p.toml -a {axis}"));
        assert_eq!((ran.code(), ran.stdout()), (1, ""), "{}", ran.stderr());
        ran.stderr()
    };
    let smsd = "model = \"SMSD-4.2LAN\"\n[settings]\n";
    let smd3 = "model = \"SMD3\"\n[settings]\n";
    for (text, axis, part) in [
        (
            format!("{smsd}MAX_SPED = 1\n"),
            "stage",
            "p.toml:3:1: unknown setting `MAX_SPED`; did you mean MAX_SPEED?",
        ),
        (format!("{smsd}ACC = 1\n"), "stage", "p.toml:3:7: ACC takes 15 to 59000 full steps/s², not 1"),
        (
            "model = \"SMSD-8.0LAN\"\n[settings]\nWORK_CURRENT = 60\n".to_owned(),
            "stage",
            "p.toml:3:16: WORK_CURRENT takes 1 to 42",
        ),
        (
            format!("{smd3}AMAX = 20000\n"),
            "uhv",
            "p.toml:3:8: AMAX goes up to 16763.6 Hz/s when RES is 256, not 20000",
        ),
        (format!("{smd3}VSTART = 500\n"), "uhv", "p.toml:3:10: VSTART would be 500"),
        ("model = ".to_owned(), "uhv", "p.toml:1:"),
    ] {
        let stderr = told(&text, axis);
        assert!(stderr.contains(part), "{text}: {stderr}");
    }
    let told = bench.run("settings diff none.toml -a uhv").refused(1);
    assert!(told.starts_with("cannot read none.toml: "), "{told}");
    let told = bench.run("settings diff -a uhv").refused(1);
    assert_eq!(told, "name a file: stepdrive.toml says no `profile` for uhv");
}

#[test]
fn the_profile_of_stepdrive_toml_is_meant_when_none_is_named() {
    let bench = Bench::with("profile = \"stage.profile.toml\"");
    bench.run("settings save -a stage").done();
    bench.run("settings diff -a stage").done();
    assert!(read(&bench, "stage.profile.toml").contains("The settings of stage"));
    bench.run("set -a stage ACC 500").done();
    ended(&bench.run("settings diff -a stage"), 10);
    ended(&bench.run("settings apply -a stage"), 0);
    assert_eq!(bench.json("get -a stage ACC")["values"][0]["value"], 1000);
}

#[test]
fn lan_parameters_are_saved_and_applied_only_when_asked_for() {
    let bench = Bench::start();
    bench.run("settings save p.toml -a stage").done();
    assert!(!read(&bench, "p.toml").contains("[lan]"));
    bench.run("settings save p.toml -a stage --lan").done();
    let text = read(&bench, "p.toml");
    assert!(text.contains("[lan]\nid = 1\nip = \"192.168.1.2\"\n"), "{text}");
    bench.write("p.toml", &text.replace("gateway = \"192.168.1.1\"", "gateway = \"192.168.1.9\""));
    let ran = bench.run("settings diff p.toml -a stage");
    assert!(ended(&ran, 10).0.contains("lan.gateway  \"192.168.1.9\"  \"192.168.1.1\""), "{}", ran.stdout());
    let ran = bench.run("settings apply p.toml -a stage");
    assert_eq!(ended(&ran, 0).1, "the LAN parameters are left as they are; --lan applies them too\n");
    let ran = bench.run("settings apply p.toml -a stage --lan");
    assert!(
        ended(&ran, 0)
            .1
            .starts_with("the LAN parameters are in effect; the controller is now at 192.168.1.2")
    );
    bench.run("settings diff p.toml -a stage").done();
    let told = bench.run("settings save u.toml -a uhv --lan").refused(1);
    assert_eq!(told, "an SMD3 has no LAN parameters; leave --lan out");
}
