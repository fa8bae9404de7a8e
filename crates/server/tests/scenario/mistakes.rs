//! Scenarios with mistakes: what a person is told.

use expect_test::{Expect, expect};
use proptest::prelude::*;
use stepdrive_rig::file::{DEMO, RigFile};
use stepdrive_server::scenario::{Scenario, run_headless};

pub(crate) fn demo() -> RigFile {
    RigFile::parse(DEMO).expect("the demo rig")
}

/// What a person reads about the first mistake in a scenario.
fn check(text: &str, expect: Expect) {
    let shown = match Scenario::parse(text, &demo()) {
        Ok(scenario) => format!("valid, {} steps", scenario.steps().count()),
        Err(mistake) => mistake.render("s.toml"),
    };
    expect.assert_eq(&shown);
}

/// The same for the lines of a step.
pub(crate) fn check_step(lines: &str, expect: Expect) {
    check(&format!("name = \"x\"\n[[step]]\n{lines}\n"), expect);
}

#[test]
fn the_form_of_the_file_is_checked() {
    check(
        "",
        expect![[r#"
        s.toml:1:1: missing field `name`
          |
        1 | 
          | ^"#]],
    );
    check("name = \"x\"\n", expect!["s.toml: the scenario has no step; begin one with [[step]]"]);
    check(
        "name = \"x\"\n[[steps]]\n",
        expect![[r#"
        s.toml:2:3: unknown field `steps`, expected one of `name`, `rig`, `deadline`, `keep_going`, `password`, `step`
          |
        2 | [[steps]]
          |   ^^^^^"#]],
    );
    check(
        "name = \"x\"\n[step]\ndo = []\n",
        expect![[r#"
        s.toml:2:1: found one table where there may be several; its name stands in double brackets
          |
        2 | [step]
          | ^^^^^^"#]],
    );
    check(
        "name = \"\\n\"\n[[step]]\ndo = ['clock real']\n",
        expect![[r#"
        s.toml:1:8: the name is not 1 to 200 characters without line ends
          |
        1 | name = "\n"
          |        ^^^^"#]],
    );
    check(
        "name = \"x\"\nrig = \"\"\n",
        expect![[r#"
        s.toml:2:7: rig is no path, as in rig = "rig.toml"
          |
        2 | rig = ""
          |       ^^"#]],
    );
    check(
        "name = \"x\"\npassword = \"secret\"\n[[step]]\ndo = ['clock real']\n",
        expect![[r#"
        s.toml:2:12: the password is 1 to 16 hexadecimal digits, as in 0x0123456789ABCDEF
          |
        2 | password = "secret"
          |            ^^^^^^^^"#]],
    );
}

#[test]
fn the_form_of_a_step_is_checked() {
    check_step(
        "doo = ['clock real']",
        expect![[r#"
        s.toml:3:1: unknown field `doo`, expected one of `name`, `at`, `after`, `when`, `within`, `do`, `expect`
          |
        3 | doo = ['clock real']
          | ^^^"#]],
    );
    check_step(
        "do = 'clock real'",
        expect![[r#"
        s.toml:3:6: found string "clock real", expected a list
          |
        3 | do = 'clock real'
          |      ^^^^^^^^^^^^"#]],
    );
    check_step(
        "at = 2\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:6: found integer `2`, expected a string
          |
        3 | at = 2
          |      ^"#]],
    );
}

#[test]
fn a_step_begins_at_one_time_and_does_something() {
    check_step(
        "at = \"1s\"\nwhen = \"stage.READY\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:4:8: a step has one of at, after and when; here are at and when
          |
        4 | when = "stage.READY"
          |        ^^^^^^^^^^^^^"#]],
    );
    check_step(
        "after = \"1s\"\nat = \"1s\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:9: a step has one of at, after and when; here are at and after
          |
        3 | after = "1s"
          |         ^^^^"#]],
    );
    check_step(
        "at = \"1s\"",
        expect![[r#"
        s.toml:2:1: the step has nothing to do and nothing to expect; give it do or expect
          |
        2 | [[step]]
          | ^^^^^^^^"#]],
    );
    check_step(
        "do = []",
        expect![[r#"
        s.toml:2:1: the step has nothing to do and nothing to expect; give it do or expect
          |
        2 | [[step]]
          | ^^^^^^^^"#]],
    );
    check_step(
        "within = \"1s\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:10: within without when or expect; there is nothing to come
          |
        3 | within = "1s"
          |          ^^^^"#]],
    );
}

#[test]
fn durations_and_their_order_are_checked() {
    check_step(
        "at = \"5 parsec\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:6: at is no duration: the unit `parsec` is unknown; it is one of ns, us, ms, s, min, h
          |
        3 | at = "5 parsec"
          |      ^^^^^^^^^^"#]],
    );
    check_step(
        "after = \"-1s\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:9: after is no duration: a duration is not negative
          |
        3 | after = "-1s"
          |         ^^^^^"#]],
    );
    check_step(
        "within = \"5\"\nexpect = 'stage.READY'",
        expect![[r#"
        s.toml:3:10: within is no duration: the unit is missing; it is one of ns, us, ms, s, min, h
          |
        3 | within = "5"
          |          ^^^"#]],
    );
    check(
        "name = \"x\"\ndeadline = \"soon\"\n[[step]]\ndo = ['clock real']\n",
        expect![[r#"
        s.toml:2:12: deadline is no duration: a duration is a number and a unit, as in 5ms or 1.5s
          |
        2 | deadline = "soon"
          |            ^^^^^^"#]],
    );
    check_step(
        "at = \"2s\"\ndo = ['clock real']\n[[step]]\nat = \"1s\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:6:6: a step before is at 2s already; steps are written in the order of their times
          |
        6 | at = "1s"
          |      ^^^^"#]],
    );
    check_step(
        "at = \"61min\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:6: this is after the scenario's deadline of 1h
          |
        3 | at = "61min"
          |      ^^^^^^^"#]],
    );
}

#[test]
fn a_mistake_in_a_condition_has_its_own_place() {
    check_step(
        "when = \"stage.READY && nobody.READY\"\ndo = ['clock real']",
        expect![[r#"
        s.toml:3:24: unknown drive `nobody`; there are stage, uhv
          |
        3 | when = "stage.READY && nobody.READY"
          |                        ^^^^^^"#]],
    );
    check_step(
        "expect = 'stage.ABS_PSO >= 5'",
        expect![[r#"
        s.toml:3:17: unknown quantity `ABS_PSO` of `stage`; did you mean ABS_POS?
          |
        3 | expect = 'stage.ABS_PSO >= 5'
          |                 ^^^^^^^"#]],
    );
    check_step(
        "expect = 'stage.ABS_POS >= five'",
        expect![[r#"
        s.toml:3:28: `five` is no number, as in stage.SPEED >= 100
          |
        3 | expect = 'stage.ABS_POS >= five'
          |                            ^^^^"#]],
    );
    check_step(
        "expect = 'stage.ABS_POS >='",
        expect![[r#"
        s.toml:3:27: expected a number, as in stage.SPEED >= 100
          |
        3 | expect = 'stage.ABS_POS >='
          |                           ^"#]],
    );
    check_step(
        "expect = '!stage.ABS_POS > 5'",
        expect![[r#"
        s.toml:3:11: is this for the quantity or the comparison? For the latter, write !(stage.ABS_POS > 5)
          |
        3 | expect = '!stage.ABS_POS > 5'
          |           ^"#]],
    );
    check_step(
        "expect = ''",
        expect![[r#"
        s.toml:3:11: expected a quantity of a drive, as in stage.READY
          |
        3 | expect = ''
          |           ^"#]],
    );
    // Where it is not written out as it is, the whole is meant.
    check_step(
        "expect = \"\\u0073tage.ABS_PSO\"",
        expect![[r#"
        s.toml:3:10: column 7: unknown quantity `ABS_PSO` of `stage`; did you mean ABS_POS?
          |
        3 | expect = "\u0073tage.ABS_PSO"
          |          ^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_step(
        "expect = '''\nstage.ABS_PSO'''",
        expect![[r#"
        s.toml:3:10: column 7: unknown quantity `ABS_PSO` of `stage`; did you mean ABS_POS?
          |
        3 | expect = '''
          |          ^^^"#]],
    );
}

#[test]
fn a_rig_is_named_without_looking_at_it() {
    let text = "\u{FEFF}name = \"x\"\nrig = \"my rig.toml\"\n[[step]]\ndo = ['input nobody.IN0 1']\n";
    assert_eq!(Scenario::rig_named(text).expect("well formed").as_deref(), Some("my rig.toml"));
    assert_eq!(Scenario::rig_named("name = \"x\"\n"), Ok(None));
    let mistake = Scenario::rig_named("name = \"x\"\nrigs = 3\n").expect_err("a mistake");
    assert_eq!((mistake.line, mistake.column), (Some(2), Some(1)));
}

const WORDS: &[&str] = &[
    "line",
    "write",
    "command",
    "input",
    "fault",
    "power",
    "clock",
    "stage",
    "uhv",
    "stage.ACC",
    "uhv.TMOT",
    "stage.IN0",
    "GO_TO",
    "RUNR,5",
    "5",
    "-5",
    "0x",
    "expecting",
    "CMD_ERROR",
    "-1",
    "for",
    "2s",
    "\u{e9}",
    "\u{1b}",
    "\"",
    "'",
];

proptest! {
    #[test]
    fn no_text_panics(text: String) {
        let _ = Scenario::parse(&text, &demo());
        let _ = Scenario::rig_named(&text);
    }

    #[test]
    fn no_step_panics(
        key in "at|after|when|within|expect|name",
        value: String,
        words in proptest::collection::vec(proptest::sample::select(WORDS), 0..7),
    ) {
        let (value, act) = (format!("{value:?}"), format!("{:?}", words.join(" ")));
        let text = format!("name = \"x\"\ndeadline = \"1s\"\n[[step]]\n{key} = {value}\ndo = [{act}]\n");
        match Scenario::parse(&text, &demo()) {
            Ok(scenario) => drop(run_headless(&demo(), &scenario)),
            Err(mistake) => drop(mistake.render("s.toml")),
        }
    }

    #[test]
    fn no_condition_panics(text in "[a-z._ ]{0,3}stage[.]?[A-Z_é']{0,9}[ <>=!&|()0-9é]{0,9}") {
        let _ = Scenario::parse(&format!("name = 'x'\n[[step]]\nexpect = '{text}'\n"), &demo());
    }
}
