//! What is served where, to whom, and what is left when it ends.

use crate::bench::{Bench, Running};
use crate::rig::{ready, until};
use serde_json::{Value, json};

const TOKEN: &str = "sixteen-letters!";

/// A panel that runs.
struct Panel {
    running: Running,
    /// The line that said that it is ready.
    ready: Value,
}

impl Panel {
    fn start(bench: &Bench, words: &str) -> Panel {
        let mut running = bench.start_command(&format!("panel --listen 127.0.0.1:0 --json {words}"));
        let line = running.lines().next().expect("a line");
        Panel { running, ready: serde_json::from_str(&line).expect("JSON") }
    }

    fn url(&self, path: &str) -> String {
        format!("{}{path}", self.ready["panel"].as_str().expect("a URL"))
    }

    fn get(&self, path: &str) -> Value {
        read(ureq::get(self.url(path)).call())
    }

    fn post(&self, path: &str, body: &str) -> Value {
        read(ureq::post(self.url(path)).content_type("application/json").send(body))
    }
}

#[track_caller]
fn read(answer: Result<ureq::http::Response<ureq::Body>, ureq::Error>) -> Value {
    let text = answer.expect("answered").body_mut().read_to_string().expect("a body");
    serde_json::from_str(&text).expect("JSON")
}

/// The status of a refusal.
fn status(answer: Result<ureq::http::Response<ureq::Body>, ureq::Error>) -> u16 {
    match answer {
        Ok(answer) => answer.status().as_u16(),
        Err(ureq::Error::StatusCode(status)) => status,
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn the_axes_of_stepdrive_toml_are_shown_and_moved() {
    let bench = Bench::start();
    bench.energise();
    let panel = Panel::start(&bench, "");
    assert_eq!(panel.ready["event"], "ready");
    let names: Vec<&Value> =
        panel.ready["axes"].as_array().expect("axes").iter().map(|axis| &axis["name"]).collect();
    assert_eq!(names, ["stage", "uhv"]);
    let axes = panel.get("v1/axes");
    assert_eq!((&axes["axes"][0]["unit"], &axes["axes"][0]["virtual"]), (&json!("mm"), &json!(false)));
    assert_eq!(axes["axes"][0]["limits"], json!([-10.0, 200.0]));
    panel.post("v1/axes/stage/zero", "{}");
    panel.post("v1/axes/stage/move", r#"{"to":"20mm"}"#);
    until(|| panel.get("v1/axes/stage")["p"] == 20.0);
    assert_eq!(
        bench.json("status -a stage")["trust"],
        "trusted",
        "the next command knows what the panel did"
    );
    let page = ureq::get(panel.url("")).call().expect("a page").body_mut().read_to_string().expect("text");
    assert!(page.starts_with("<!doctype html>"), "{page}");
}

#[test]
fn what_another_command_does_is_known_to_the_panel() {
    let bench = Bench::start();
    let panel = Panel::start(&bench, "stage");
    assert_eq!(panel.get("v1/axes/stage")["doubt"], "the axis has not been homed");
    bench.energise();
    bench.run("zero -a stage").done();
    until(|| panel.get("v1/axes/stage")["doubt"].is_null());
    bench.run("stop -a stage --free").done();
    until(|| panel.get("v1/axes/stage")["doubt"] == "the motor was de-energised");
}

#[test]
fn ctrl_c_ends_a_jog() {
    let bench = Bench::in_real_time();
    let panel = Panel::start(&bench, "uhv");
    panel.post("v1/axes/uhv/jog", r#"{"direction":"+","speed":0.5,"id":"me"}"#);
    until(|| bench.json("status -a uhv")["moving"] == true);
    panel.running.signal("INT");
    let ran = panel.running.end();
    assert_eq!((ran.code(), ran.stderr()), (0, String::new()));
    until(|| bench.json("status -a uhv")["moving"] == false);
}

#[test]
fn beyond_this_computer_a_token_is_needed() {
    let bench = Bench::start();
    let refused = bench.run("panel --listen 0.0.0.0:0").refused(1);
    assert!(refused.contains("give a token with --token-file or STEPDRIVE_PANEL_TOKEN"), "{refused}");
    bench.write("short.txt", "sesame\n");
    let refused = bench.run("panel --token-file short.txt").refused(1);
    assert!(refused.ends_with("16 to 256 printable ASCII characters without spaces"), "{refused}");
    bench.write("token.txt", &format!("{TOKEN}\n"));
    let panel = Panel::start(&bench, "--token-file token.txt");
    assert_eq!(status(ureq::get(panel.url("")).call()), 200, "the page asks for it");
    assert_eq!(status(ureq::get(panel.url("v1/axes")).call()), 401);
    let shown = format!("Bearer {TOKEN}");
    assert_eq!(status(ureq::get(panel.url("v1/axes")).header("Authorization", &shown).call()), 200);
    assert_eq!(status(ureq::get(panel.url("v1/axes")).header("Host", "evil.example").call()), 403);
}

#[test]
fn mistakes_are_told_before_anything_is_served() {
    let bench = Bench::start();
    assert!(bench.run("panel nosuch").refused(3).starts_with("there is no axis `nosuch`"));
    assert_eq!(bench.run("panel stage -a stage").refused(1), "stage is named twice; name each axis once");
    bench
        .write("ports.toml", "[axis.a]\nuri = \"smsd+usb:///dev/ttyS99\"\n[axis.b]\nuri = \"/dev/ttyS99\"\n");
    let said = bench.run("panel --config ports.toml").refused(1);
    assert_eq!(said, "a and b are both at /dev/ttyS99; a port is for one axis at a time: name one of them");
    let panel = Panel::start(&bench, "");
    let taken = panel.url("").replace("http://", "").replace('/', "");
    let refused = bench.run(&format!("panel --listen {taken}")).refused(2);
    assert!(refused.starts_with(&format!("cannot serve the panel on {taken}: ")), "{refused}");
}

#[test]
fn a_rig_that_is_up_has_its_panel_beside_its_api() {
    let bench = Bench::in_real_time();
    let ready = ready(&bench.rig.up);
    let (panel, api) = (ready["panel"].as_str().expect("a panel"), ready["api"].as_str().expect("an API"));
    assert_eq!(panel, format!("{api}/"));
    let axes = read(ureq::get(format!("{panel}v1/axes")).call());
    assert_eq!((&axes["axes"][1]["name"], &axes["axes"][1]["virtual"]), (&json!("uhv"), &json!(true)));
    let begun = ureq::post(format!("{panel}v1/axes/uhv/move")).content_type("application/json");
    read(begun.send(r#"{"by":"300 steps"}"#));
    until(|| bench.rig.drive(1)["position"] == 300.0);
    assert_eq!(status(ureq::get(format!("{api}/v1/rig")).call()), 200);
    assert_eq!(status(ureq::get(format!("{api}/v1/nosuch")).call()), 404);
}
