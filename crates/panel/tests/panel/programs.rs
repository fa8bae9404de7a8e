//! Programs: checked, laid out, tried out, stored, started.

use crate::link::Fault;
use crate::stage::{MS, SECOND, Stage, has};
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};

const PROGRAMS: &str = "/v1/axes/stage/programs";
const SHUTTLE: &str = "SET_MAX_SPEED 800\n.const far = 1600\nMOVE_F far\nWAIT_IN0\nMOVE_R far\nEND\n";

fn text(text: &str) -> String {
    json!({ "text": text }).to_string()
}

#[tokio::test(start_paused = true)]
async fn a_text_is_checked_with_the_places_of_its_mistakes() {
    let stage = Stage::new();
    let good = stage.post("/v1/programs/check", &text(SHUTTLE)).await.done();
    let memory = &good["mems"][0];
    assert_eq!(
        (&memory["mem"], &memory["size"], &memory["lines"]),
        (&json!(0), &json!(5), &json!([1, 3, 4, 5, 6]))
    );
    assert_eq!(memory["words"].as_array().map(Vec::len), Some(5));
    assert!(
        good["diagnostics"].as_array().expect("findings").iter().all(|found| found["severity"] == "warning")
    );
    let bad = stage.post("/v1/programs/check", &text("; ä\n  SET_MAX_SPEDD 100\n")).await.done();
    let found = &bad["diagnostics"][0];
    assert_eq!((&found["severity"], &found["code"]), (&json!("error"), &json!("unknown-instruction")));
    let place = ["line", "column", "end_line", "end_column"].map(|name| found[name].as_u64());
    assert_eq!(place, [Some(2), Some(3), Some(2), Some(16)]);
    assert_eq!(found["help"], "did you mean `SET_MAX_SPEED`?");
    assert_eq!(bad["mems"], json!([]));
    let model = json!({ "text": "END", "model": "SMD3" }).to_string();
    assert_eq!(stage.post("/v1/programs/check", &model).await.error().0, 422);
}

#[tokio::test(start_paused = true)]
async fn a_text_is_laid_out_unless_it_cannot_be_read() {
    let stage = Stage::new();
    let laid_out = stage.post("/v1/programs/format", &text("set_max_speed   100\nend")).await.done();
    assert_eq!(laid_out["text"], "    SET_MAX_SPEED 100\n    END\n");
    let words = async |text_: &str| {
        stage.post("/v1/programs/check", &text(text_)).await.done()["mems"][0]["words"].clone()
    };
    let laid_out = words(laid_out["text"].as_str().expect("a text")).await;
    assert_eq!(words("set_max_speed   100\nend").await, laid_out, "it is the same program");
    assert_ne!(words("SET_MAX_SPEED 101\nEND").await, laid_out);
    let answer = stage.post("/v1/programs/format", &text("what is this?")).await;
    assert_eq!((answer.status.as_u16(), answer.json()["diagnostics"][0]["line"].as_u64()), (422, Some(1)));
}

#[tokio::test(start_paused = true)]
async fn the_language_is_told_for_completion() {
    let language = Stage::new().get("/v1/language").await.done();
    let instructions = language["instructions"].as_array().expect("instructions");
    let found =
        |name: &str| instructions.iter().find(|row| row["name"] == name).cloned().unwrap_or(Value::Null);
    let row = found("SET_MAX_SPEED");
    assert_eq!((&row["operand"], &row["min"], &row["max"]), (&json!("speed"), &json!(16), &json!(15_600)));
    assert_eq!(found("MOVE_F")["operand"], "position");
    assert_eq!(found("GET_SPEED"), Value::Null, "it has no place in programs");
    assert_eq!(language["inputs"].as_array().map(Vec::len), Some(8));
    assert_eq!(language["directives"][1]["name"], ".mem");
}

#[tokio::test(start_paused = true)]
async fn a_program_is_tried_out_on_virtual_time() {
    let stage = Stage::new();
    let body =
        json!({ "text": SHUTTLE, "for": "60s", "inputs": { "IN0": "at:20s" }, "axis": "stage" }).to_string();
    let done = stage.post("/v1/programs/simulate", &body).await.done();
    let steps = done["steps"].as_array().expect("steps");
    let lines: Vec<u64> = steps.iter().filter_map(|step| step["source_line"].as_u64()).collect();
    assert_eq!(lines, [1, 3, 4, 5, 6]);
    assert_eq!(
        (&steps[1]["text"], &steps[1]["mem"], &steps[1]["line"]),
        (&json!("MOVE_F 1600"), &json!(0), &json!(1))
    );
    assert!(steps[3]["t"].as_f64() >= Some(20.0), "it waits for the signal: {}", steps[3]);
    assert_eq!((&done["end"], &done["end_line"]), (&json!("ended at mem0:4"), &json!(6)));
    let curve = done["curve"].as_array().expect("a curve");
    assert!((1000..=2000).contains(&curve.len()), "{}", curve.len());
    let places = curve.iter().filter_map(|point| point[1].as_f64());
    assert!((places.fold(0.0, f64::max) - 1600.0).abs() < 1e-9);
    let fastest = curve.iter().filter_map(|point| point[2].as_f64()).fold(0.0, f64::max);
    assert!(fastest > 200.0 && fastest <= 800.0, "{fastest}");
    let back = curve.iter().filter_map(|point| point[2].as_f64()).fold(0.0, f64::min);
    assert!((-800.0..-200.0).contains(&back), "on its way back its speed is negative: {back}");
    let times: Vec<f64> = curve.iter().filter_map(|point| point[0].as_f64()).collect();
    assert!(times.is_sorted() && times[0] == 0.0);
    assert!((times[times.len() - 1] - steps[4]["t"].as_f64().expect("a time")).abs() < 2.0);
    assert_eq!(stage.smsd.requests(), 0, "no controller was asked");
}

#[tokio::test(start_paused = true)]
async fn trying_out_ends_in_words_and_within_bounds() {
    let stage = Stage::new();
    let run = async |text: &str, time: &str| {
        let body = json!({ "text": text, "for": time }).to_string();
        stage.post("/v1/programs/simulate", &body).await
    };
    let waits = run("WAIT_IN1\nEND\n", "5s").await.done();
    assert_eq!(waits["end"], "waits at mem0:0 for IN1, which never comes; give it a signal");
    let endless = run("again:\nSET_MAX_SPEED 100\nGOTO_PROGRAM again\n", "20s").await.done();
    assert_eq!((endless["steps"].as_array().map(Vec::len), &endless["cut"]), (Some(5000), &json!(true)));
    assert!(endless["curve"].as_array().map(Vec::len) <= Some(2000));
    assert_eq!(run("END", "2h").await.error(), (422, "a program is tried out for 1h at most".to_owned()));
    assert_eq!(run("NONSENSE", "1s").await.status, 422);
    assert!(run("NONSENSE", "1s").await.json()["diagnostics"].is_array());
    for (body, part) in [
        (json!({ "text": "END", "inputs": { "IN9": "on" } }), "there are IN0"),
        (json!({ "text": "END", "inputs": { "IN0": "soon" } }), "at:TIME"),
        (json!({ "text": "END", "inputs": { "IN0": "on", "in0": "at:1s" } }), "IN0 is given twice"),
        (json!({ "text": "END", "mem": 4 }), "0 to 3"),
        (json!({ "text": "END", "axis": "uhv" }), "only an SMSD has this"),
        (json!({ "text": "END", "axis": "nobody" }), "there is no axis"),
    ] {
        let (status, why) = stage.post("/v1/programs/simulate", &body.to_string()).await.error();
        assert_eq!((status, why.contains(part)), (422, true), "{why}");
    }
    let same_name = r#"{"text":"END","inputs":{"IN1":"at:1s","IN1":"at:2s"}}"#;
    let (status, why) = stage.post("/v1/programs/simulate", same_name).await.error();
    assert_eq!((status, why.contains("IN1 is given twice")), (422, true), "{why}");
    for nothing in [r#"{"text":"END","inputs":{"IN0":null}}"#, r#"{"text":"END","inputs":["IN0"]}"#] {
        let answer = stage.post("/v1/programs/simulate", nothing).await;
        assert!(answer.status.is_client_error(), "{answer:?}");
    }
}

#[tokio::test]
async fn trying_out_takes_no_more_than_its_share_of_the_processor() {
    let stage = Stage::new();
    let body = json!({ "text": "again:\nSET_MAX_SPEED 100\nGOTO_PROGRAM again\n", "for": "1h" }).to_string();
    let began = Instant::now();
    let done = stage.post("/v1/programs/simulate", &body).await.done();
    let told = done["end"].as_str().expect("an end");
    // A fast computer comes to the end of the hour.
    assert!(told.contains("as it took 1s of the processor") || told.starts_with("still running"), "{told}");
    assert!(began.elapsed() < 10 * SECOND, "{:?}", began.elapsed());
}

#[tokio::test(start_paused = true)]
async fn a_program_is_stored_read_back_started_and_stopped() {
    let stage = Stage::new();
    let both = format!("{SHUTTLE}.mem 2\nRUN_F 100\nEND\n");
    let stored = stage.put(PROGRAMS, &text(&both)).await.done();
    assert_eq!(stored["stored"], json!([{ "mem": 0, "instructions": 5 }, { "mem": 2, "instructions": 2 }]));
    let fetched = stage.get(PROGRAMS).await.done();
    let fetched = fetched["text"].as_str().expect("a text");
    assert!(fetched.contains("MOVE_F 1600") && fetched.contains(".mem 2"), "{fetched}");
    let mut viewer = stage.watch("?focus=stage").await;
    stage.post(&format!("{PROGRAMS}/0/start"), "").await.done();
    sleep(SECOND).await;
    viewer.state(0, |state| has(state, 1024)).await;
    let mut focus = viewer.event("focus").await;
    while focus["program"]["line"] != 2 {
        focus = viewer.event("focus").await;
    }
    assert_eq!(focus["program"], json!({ "running": true, "mem": 0, "line": 2 }));
    let (status, why) = stage.put(PROGRAMS, &text(&both)).await.error();
    assert_eq!((status, why.as_str()), (409, "a program runs in stage; stop it first; nothing was sent"));
    let (status, why) = stage.post("/v1/axes/stage/move", r#"{"by":1}"#).await.error();
    assert_eq!((status, why.contains("a user program runs in stage")), (409, true), "{why}");
    stage.post(&format!("{PROGRAMS}/stop"), "").await.done();
    viewer.state(0, |state| !has(state, 1024)).await;
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_comes_while_a_program_is_being_started_wins() {
    for delay in (0..300).step_by(15) {
        let stage = Stage::new();
        stage.put(PROGRAMS, &text("SET_MAX_SPEED 300\nRUN_F 300\nSET_WAIT 5s\nEND\n")).await.done();
        stage.smsd.otherwise(Fault::Delay(30 * MS));
        let starting = stage.begin("POST", &format!("{PROGRAMS}/0/start"), "");
        sleep(delay * MS).await;
        let was_starting = !starting.is_finished();
        stage.post("/v1/axes/stage/stop", "{}").await.done();
        let answer = starting.await.expect("no panic");
        stage.smsd.otherwise(Fault::Delay(MS));
        sleep(3 * SECOND).await;
        if was_starting {
            let (status, why) = answer.error();
            assert_eq!((status, why.contains("was told to stop")), (409, true), "after {delay} ms: {why}");
            assert!(stage.speed() == 0.0, "a stop after {delay} ms was lost");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn what_cannot_be_stored_changes_nothing() {
    let stage = Stage::new();
    stage.put(PROGRAMS, &text("END\n")).await.done();
    stage.smsd.acts();
    for (body, part) in
        [(text("NONSENSE\n"), "the program has 1 error"), (text("; nothing\n"), "has no instructions")]
    {
        let (status, why) = stage.put(PROGRAMS, &body).await.error();
        assert_eq!((status, why.contains(part)), (422, true), "{why}");
    }
    assert_eq!(stage.smsd.acts(), []);
    assert_eq!(stage.post(&format!("{PROGRAMS}/4/start"), "").await.error().0, 422);
    assert_eq!(stage.get("/v1/axes/uhv/programs").await.error().0, 422);
    sleep(MS).await;
}

#[tokio::test(start_paused = true)]
async fn an_smd3_bakes_until_it_is_told_to_end() {
    let stage = Stage::new();
    let bake = "/v1/axes/uhv/bake";
    assert_eq!(stage.post(bake, r#"{"setpoint":500}"#).await.error().0, 422);
    stage.post(bake, r#"{"setpoint":120}"#).await.done();
    let axis = stage.get("/v1/axes/uhv").await.done();
    assert_eq!((&axis["flags"]["BAKE"], &axis["q"]["BAKET"]), (&json!(true), &json!(120.0)));
    stage.begin("DELETE", bake, "").await.expect("no panic").done();
    let axis = stage.get("/v1/axes/uhv").await.done();
    assert_eq!((&axis["flags"]["BAKE"], &axis["q"]["MODE"]), (&json!(false), &json!(2.0)));
    assert_eq!(stage.post("/v1/axes/stage/bake", r#"{"setpoint":120}"#).await.error().0, 422);
}
