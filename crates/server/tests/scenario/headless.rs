//! Headless runs: what happens when, and what is said of what does not.

use super::mistakes::demo;
use expect_test::{Expect, expect};
use stepdrive_drive::smd3::Stored;
use stepdrive_proto::smd3::Line;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::condition::Condition;
use stepdrive_rig::course::{Arrival, Goal, run};
use stepdrive_rig::file::{DEMO, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_server::scenario::{Outcome, Report, Scenario, run_headless};
use stepdrive_spec::time::Instant;

pub(crate) fn play(text: &str) -> Report {
    let scenario =
        Scenario::parse(text, &demo()).unwrap_or_else(|mistake| panic!("{}", mistake.render("s.toml")));
    run_headless(&demo(), &scenario)
}

/// The report on steps, a line each.
fn check(steps: &str, expect: Expect) {
    let report = play(&format!("name = \"x\"\n{steps}"));
    expect.assert_eq(&report.to_string());
}

/// When each step began.
fn beginnings(report: &Report) -> Vec<Option<u64>> {
    report.steps.iter().map(|step| step.began_ns).collect()
}

#[test]
fn steps_come_at_their_exact_times() {
    let report = play(
        "name = \"x\"
        [[step]]
        at = \"2s\"
        do = ['command stage RUN_F 500']
        [[step]]
        at = \"2.000000001s\"
        do = ['input stage.IN0 1']
        expect = 'stage.IN0'
        [[step]]
        after = \"333ns\"
        do = ['input stage.IN0 0']
        expect = '!stage.IN0'
        [[step]]
        expect = 'stage.CONST_SPEED'
        within = \"10s\"
        [[step]]
        after = \"1us\"
        do = ['command stage SOFT_STOP']
        ",
    );
    assert!(report.passed, "{report}");
    let [first, second, third, fourth, fifth] = beginnings(&report).try_into().expect("five steps");
    assert_eq!(
        [first, second, third, fourth],
        [2_000_000_000, 2_000_000_001, 2_000_000_334, 2_000_000_334].map(Some)
    );
    assert_eq!(fifth, report.steps[3].ended_ns.map(|ended| ended + 1_000));
    assert_eq!(report.ended_ns, fifth.expect("it began"));
}

#[test]
fn a_condition_is_met_at_the_very_nanosecond() {
    let rig = demo();
    // The same by hand: two lines at 1 s, then until the position is reached.
    let section = &rig.drives[1];
    let machine = section.smd3().expect("an SMD3").power_up(section, Stored::Nothing);
    let mut group = Group::new(vec![(1, AnyMachine::Smd3(Box::new(machine)))], &[], rig.seed);
    group.advance(Instant::from_nanos(1_000_000_000), &mut u32::MAX.clone());
    for line in ["VMAX,700", "RUNV,+"] {
        group.change(0, |machine, now| {
            let reply =
                machine.smd3_mut().expect("an SMD3").handle(now, Line::Text(line.as_bytes()).decode());
            assert!(reply.outcome.is_ok(), "{line}");
        });
    }
    let condition = Condition::parse("uhv.PACT >= 1234", &rig).expect("a condition");
    let goal = Goal::Condition(&condition);
    let Arrival::Reached(at) = run(&mut [&mut group], goal, Instant::FAR_FUTURE, &mut u32::MAX.clone())
    else {
        panic!("it is reached");
    };
    let report = play(
        "name = \"x\"
        [[step]]
        at = \"1s\"
        do = ['line uhv VMAX,700', 'line uhv RUNV,+']
        [[step]]
        when = 'uhv.PACT >= 1234'
        do = ['line uhv SSTOP']
        ",
    );
    assert_eq!(beginnings(&report), [Some(1_000_000_000), Some(at.as_nanos())]);
    assert!(at.as_nanos() > 1_000_000_000);
}

#[test]
fn an_expectation_that_fails_says_what_was_found() {
    check(
        "[[step]]\nat = \"2s\"\nexpect = '!stage.READY'\n[[step]]\nexpect = 'stage.READY'\n",
        expect![[r#"
        ✗ FAILED            2s  1. expect !stage.READY: expected !stage.READY: stage.READY was 1 at 2s
        - skipped               2. expect stage.READY
        FAILED: x, 0 of 2 steps ok, 2s of rig time"#]],
    );
    check(
        "[[step]]\nat = \"1s\"\ndo = ['command stage RUN_F 500']\nexpect = 'stage.ABS_POS >= 50000'\nwithin = \"3s\"\n",
        expect![[r#"
            ✗ FAILED            4s  1. command stage RUN_F 500: expected stage.ABS_POS >= 50000 within 3s: stage.ABS_POS was 22007 at 4s
            FAILED: x, 0 of 1 steps ok, 4s of rig time"#]],
    );
    check(
        "[[step]]\nexpect = 'stage.READY && uhv.TMOT > 100 || uhv.BAKE or stage.SPEED == 7'\nwithin = \"1.5s\"\n",
        expect![[r#"
            ✗ FAILED          1.5s  1. expect stage.READY && uhv.TMOT > 100 || uhv.BAKE || stage.SPEED == 7: expected stage.READY && uhv.TMOT > 100 || uhv.BAKE || stage.SPEED == 7 within 1.5s: stage.READY was 1 and uhv.TMOT was 20.001645890997768 and uhv.BAKE was 0 and stage.SPEED was 0 at 1.5s
            FAILED: x, 0 of 1 steps ok, 1.5s of rig time"#]],
    );
}

#[test]
fn what_never_comes_ends_at_its_deadline_exactly() {
    check(
        "[[step]]\nafter = \"1s\"\ndo = ['clock real']\n[[step]]\nwhen = 'stage.IN0'\nwithin = \"5s\"\ndo = ['clock real']\n",
        expect![[r#"
        ✓ ok                1s  1. clock real
        ✗ FAILED            6s  2. clock real: stage.IN0 did not come within 5s: stage.IN0 was 0 at 6s
        FAILED: x, 1 of 2 steps ok, 6s of rig time"#]],
    );
    check(
        "deadline = \"7s\"\n[[step]]\nwhen = 'stage.ABS_POS == 1'\ndo = ['clock real']\n",
        expect![[r#"
        ✗ FAILED            7s  1. clock real: stage.ABS_POS == 1 did not come before the scenario's deadline of 7s: stage.ABS_POS was 0 at 7s
        FAILED: x, 0 of 1 steps ok, 7s of rig time"#]],
    );
    check(
        "deadline = \"7s\"\n[[step]]\nat = \"4s\"\nexpect = 'stage.SPEED > 0'\nwithin = \"5s\"\n",
        expect![[r#"
        ✗ FAILED            7s  1. expect stage.SPEED > 0: expected stage.SPEED > 0 before the scenario's deadline of 7s: stage.SPEED was 0 at 7s
        FAILED: x, 0 of 1 steps ok, 7s of rig time"#]],
    );
    check(
        "deadline = \"7s\"\n[[step]]\nafter = \"8s\"\ndo = ['clock real']\n",
        expect![[r#"
        ✗ ERROR             7s  1. clock real: it was to be at 8s, after the scenario's deadline of 7s
        FAILED: x, 0 of 1 steps ok, 7s of rig time"#]],
    );
}

#[test]
fn a_step_that_comes_too_late_is_told() {
    check(
        "[[step]]\nat = \"1s\"\ndo = ['input stage.IN0 1 for 3s']\n[[step]]\nexpect = '!stage.IN0'\nwithin = \"5s\"\n\
         [[step]]\nat = \"2s\"\ndo = ['clock real']\n",
        expect![[r#"
            ✓ ok                1s  1. input stage.IN0 1 for 3s
            ✓ ok                4s  2. expect !stage.IN0
            ✗ ERROR             4s  3. clock real: it was to be at 2s, but the step before ended only at 4s
            FAILED: x, 2 of 3 steps ok, 4s of rig time"#]],
    );
}

#[test]
fn the_scenario_goes_on_after_a_failure_when_it_is_to() {
    check(
        "keep_going = true\ndeadline = \"10s\"\n[[step]]\nexpect = 'stage.IN0'\n[[step]]\nwhen = 'stage.IN0'\nwithin = \"2s\"\n\
         do = ['clock real']\n[[step]]\nafter = \"1s\"\nexpect = 'stage.READY'\n[[step]]\nexpect = 'stage.IN0'\nwithin = \"1h\"\n\
         [[step]]\nexpect = 'stage.READY'\n",
        expect![[r#"
            ✗ FAILED            0s  1. expect stage.IN0: expected stage.IN0: stage.IN0 was 0 at 0s
            ✗ FAILED            2s  2. clock real: stage.IN0 did not come within 2s: stage.IN0 was 0 at 2s
            ✓ ok                3s  3. expect stage.READY
            ✗ FAILED           10s  4. expect stage.IN0: expected stage.IN0 before the scenario's deadline of 10s: stage.IN0 was 0 at 10s
            - skipped               5. expect stage.READY
            FAILED: x, 1 of 5 steps ok, 10s of rig time"#]],
    );
}

#[test]
fn what_a_drive_refuses_fails_the_step() {
    check(
        "[[step]]\ndo = ['line uhv RUNH,+']\n",
        expect![[r#"
        ✗ ERROR             0s  1. line uhv RUNH,+: `line uhv RUNH,+`: it was refused: -6 (Not possible in mode)
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['line uhv RUNH,+ expecting -5']\n",
        expect![[r#"
        ✗ ERROR             0s  1. line uhv RUNH,+ expecting -5: `line uhv RUNH,+ expecting -5`: it was refused with -6 (Not possible in mode), and not -5 (Action failed)
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['line uhv STOP expecting -5']\n",
        expect![[r#"
        ✗ ERROR             0s  1. line uhv STOP expecting -5: `line uhv STOP expecting -5`: it was taken, and not refused with -5 (Action failed)
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['line uhv RUNH,+ expecting -6', 'line uhv JUMP expecting -4']\n",
        expect![[r#"
        ✓ ok                0s  1. line uhv RUNH,+ expecting -6 and more
        passed: x, 1 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['command stage RUN_F 100', 'write stage.ACC 100']\n",
        expect![[r#"
        ✗ ERROR             0s  1. command stage RUN_F 100 and more: `write stage.ACC 100`: it was refused: Modbus exception 06 (server device busy)
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['command stage RUN_F 100', 'write stage.ACC 100 expecting 6']\n",
        expect![[r#"
        ✓ ok                0s  1. command stage RUN_F 100 and more
        passed: x, 1 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['write stage.ACC 100 expecting 6']\n",
        expect![[r#"
        ✗ ERROR             0s  1. write stage.ACC 100 expecting 6: `write stage.ACC 100 expecting 6`: it was taken, and not refused with Modbus exception 06 (server device busy)
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['command stage RUN_F 100', 'command stage MOVE_F 100']\n",
        expect![[r#"
        ✗ ERROR             0s  1. command stage RUN_F 100 and more: `command stage MOVE_F 100`: CMD_ERROR is set: it was refused now, or a command before was
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['command stage RUN_F 100 expecting CMD_ERROR']\n",
        expect![[r#"
        ✗ ERROR             0s  1. command stage RUN_F 100 expecting CMD_ERROR: `command stage RUN_F 100 expecting CMD_ERROR`: it was not refused with CMD_ERROR
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
}

#[test]
fn a_drive_that_does_not_answer_fails_the_step() {
    check(
        "[[step]]\ndo = ['power stage off', 'write stage.RELAY 1']\n",
        expect![[r#"
        ✗ ERROR             0s  1. power stage off and more: `write stage.RELAY 1`: stage gave no answer: it is switched off
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['fault uhv.connection silent', 'line uhv STOP']\n",
        expect![[r#"
        ✗ ERROR             0s  1. fault uhv.connection silent and more: `line uhv STOP`: uhv gave no answer
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "[[step]]\ndo = ['fault stage.connection cut', 'write stage.RELAY 1']\n",
        expect![[r#"
        ✗ ERROR             0s  1. fault stage.connection cut and more: `write stage.RELAY 1`: stage gave no answer
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
    check(
        "password = \"1\"\n[[step]]\ndo = ['write stage.RELAY 1']\n",
        expect![[r#"
        ✗ ERROR             0s  1. write stage.RELAY 1: `write stage.RELAY 1`: stage does not accept the password; give its own as password = "0x…" at the top
        FAILED: x, 0 of 1 steps ok, 0s of rig time"#]],
    );
}

#[test]
fn a_connection_does_not_outlive_the_supply() {
    check(
        "[[step]]\ndo = ['write stage.RELAY 1', 'power stage off', 'power stage on', 'write stage.RELAY 1']\nexpect = 'stage.RELAY'\n",
        expect![[r#"
            ✓ ok                0s  1. write stage.RELAY 1 and more
            passed: x, 1 of 1 steps ok, 0s of rig time"#]],
    );
}

#[test]
fn both_words_of_a_value_arrive_whatever_their_order() {
    for order in ["low-first", "high-first"] {
        let rig = RigFile::parse(&DEMO.replace("\"low-first\" ", &format!("\"{order}\" "))).expect("a rig");
        let text = "name = 'x'\n[[step]]\ndo = ['write stage.TARGET_POS -70000']\nexpect = 'stage.TARGET_POS == -70000'\n";
        let report = run_headless(&rig, &Scenario::parse(text, &rig).expect("a scenario"));
        assert!(report.passed, "{order}: {report}");
    }
}

#[test]
fn what_is_done_at_one_instant_is_done_in_its_order() {
    let report = play(
        "name = \"x\"
        [[step]]
        at = \"1s\"
        do = ['write stage.TARGET_POS 100', 'write stage.TARGET_POS 200', 'command stage GO_TO', 'command stage HARD_STOP']
        expect = 'stage.TARGET_POS == 200 && stage.STOP'
        ",
    );
    assert!(report.passed, "{report}");
    assert_eq!(report.ended_ns, 1_000_000_000);
}

#[test]
fn the_same_scenario_has_the_same_report() {
    let text = include_str!("../../../../examples/scenarios/limit-switch-breaks.toml");
    let (first, second) = (play(text), play(text));
    assert_eq!(first.to_string(), second.to_string());
    assert_eq!(first.to_junit(), second.to_junit());
    assert_eq!(first, second);
    assert!(first.steps.iter().all(|step| step.outcome == Outcome::Passed));
}
