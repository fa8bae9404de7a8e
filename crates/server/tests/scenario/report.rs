//! What is told about a scenario, to people and to machines.

use super::headless::play;
use expect_test::expect;
use proptest::prelude::*;
use stepdrive_server::scenario::{Outcome, Report, StepEvent, StepReport};

fn step(number: usize, name: &str, outcome: Outcome) -> StepReport {
    let came = outcome != Outcome::Skipped;
    let at = came.then_some(1_500_000_000);
    StepReport {
        number,
        name: name.to_owned(),
        began_ns: at,
        ended_ns: at.map(|at| at + 250_000_000),
        outcome,
    }
}

fn report() -> Report {
    Report {
        name: "a <b> & \"c\" 'd'".to_owned(),
        passed: false,
        began_ns: 1_000_000_000,
        ended_ns: 3_000_000_001,
        steps: vec![
            step(1, "goes", Outcome::Passed),
            step(
                2,
                "x < y && \"z\"",
                Outcome::Failed("expected x < y\u{0}\u{1b}[31m\nwas \u{FFFE}1".to_owned()),
            ),
            step(3, "größer", Outcome::CouldNot("`line uhv STOP`: no answer".to_owned())),
            step(4, "later", Outcome::Skipped),
        ],
    }
}

#[test]
fn people_get_a_line_a_step() {
    expect![[r#"
        ✓ ok             750ms  1. goes
        ✗ FAILED         750ms  2. x < y && "z": expected x < y��[31m�was ￾1
        ✗ ERROR          750ms  3. größer: `line uhv STOP`: no answer
        - skipped               4. later
        FAILED: a <b> & "c" 'd', 1 of 4 steps ok, 2.000000001s of rig time"#]]
    .assert_eq(&report().to_string());
}

#[test]
fn junit_is_escaped_and_has_a_case_a_step() {
    expect![[r#"
        <?xml version="1.0" encoding="UTF-8"?>
        <testsuite name="a &lt;b&gt; &amp; &quot;c&quot; 'd'" tests="4" failures="1" errors="1" skipped="1" time="2.000000001">
          <testcase classname="a &lt;b&gt; &amp; &quot;c&quot; 'd'" name="1. goes" time="0.250000000"/>
          <testcase classname="a &lt;b&gt; &amp; &quot;c&quot; 'd'" name="2. x &lt; y &amp;&amp; &quot;z&quot;" time="0.250000000"><failure message="expected x &lt; y[31m&#10;was 1">expected x &lt; y[31m&#10;was 1</failure></testcase>
          <testcase classname="a &lt;b&gt; &amp; &quot;c&quot; 'd'" name="3. größer" time="0.250000000"><error message="`line uhv STOP`: no answer">`line uhv STOP`: no answer</error></testcase>
          <testcase classname="a &lt;b&gt; &amp; &quot;c&quot; 'd'" name="4. later" time="0.000000000"><skipped/></testcase>
        </testsuite>
    "#]].assert_eq(&report().to_junit());
}

#[test]
fn json_has_what_the_api_says_and_is_read_back() {
    let json = serde_json::to_string_pretty(&report()).expect("json");
    expect![[r#"
        {
          "name": "a <b> & \"c\" 'd'",
          "passed": false,
          "began_ns": 1000000000,
          "ended_ns": 3000000001,
          "steps": [
            {
              "number": 1,
              "name": "goes",
              "began_ns": 1500000000,
              "ended_ns": 1750000000,
              "outcome": "passed"
            },
            {
              "number": 2,
              "name": "x < y && \"z\"",
              "began_ns": 1500000000,
              "ended_ns": 1750000000,
              "outcome": "failed",
              "why": "expected x < y\u0000\u001b[31m\nwas ￾1"
            },
            {
              "number": 3,
              "name": "größer",
              "began_ns": 1500000000,
              "ended_ns": 1750000000,
              "outcome": "could-not",
              "why": "`line uhv STOP`: no answer"
            },
            {
              "number": 4,
              "name": "later",
              "began_ns": null,
              "ended_ns": null,
              "outcome": "skipped"
            }
          ]
        }"#]]
    .assert_eq(&json);
    assert_eq!(serde_json::from_str::<Report>(&json).expect("a report"), report());
}

#[test]
fn an_event_tells_when_a_step_begins_and_how_it_ends() {
    let begins = StepEvent { number: 1, name: "go".to_owned(), now_ns: 2_500_000_000, outcome: None };
    let failed = StepEvent { outcome: Some(Outcome::Failed("expected x".to_owned())), ..begins.clone() };
    for event in [&begins, &failed] {
        let json = serde_json::to_string(event).expect("json");
        assert_eq!(&serde_json::from_str::<StepEvent>(&json).expect("an event"), event);
    }
    expect![[r#"{"number":1,"name":"go","now_ns":2500000000}"#]]
        .assert_eq(&serde_json::to_string(&begins).expect("json"));
    expect![[r#"{"number":1,"name":"go","now_ns":2500000000,"outcome":"failed","why":"expected x"}"#]]
        .assert_eq(&serde_json::to_string(&failed).expect("json"));
    expect!["… begins          1.5s  1. go"].assert_eq(&begins.text(1_000_000_000));
    expect!["✗ FAILED          1.5s  1. go: expected x"].assert_eq(&failed.text(1_000_000_000));
}

#[test]
fn a_step_without_a_name_is_called_what_it_does() {
    let report = play(
        "name = \"x\"\n[[step]]\ndo = ['clock real']\n[[step]]\ndo = ['clock real', 'clock x5']\n[[step]]\nexpect = 'stage.READY = 1'\n",
    );
    let names: Vec<&str> = report.steps.iter().map(|step| step.name.as_str()).collect();
    assert_eq!(names, ["clock real", "clock real and more", "expect stage.READY == 1"]);
}

proptest! {
    #[test]
    fn no_text_breaks_out_of_junit(text: String) {
        let mut hostile = report();
        hostile.name.clone_from(&text);
        for step in &mut hostile.steps {
            step.name.clone_from(&text);
        }
        hostile.steps[1].outcome = Outcome::Failed(text);
        let (xml, tame) = (hostile.to_junit(), report().to_junit());
        for mark in ['<', '>', '"'] {
            prop_assert_eq!(xml.matches(mark).count(), tame.matches(mark).count());
        }
        let allowed = |c: char| c == '\n' || !c.is_control() && !matches!(c, '\u{FFFE}' | '\u{FFFF}');
        prop_assert!(xml.chars().all(allowed));
    }
}
