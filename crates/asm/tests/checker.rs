//! What the checker warns of, and what it must not warn of. The words of its warnings are in `diagnostics.rs`.

use stepdrive_asm::{CheckOptions, Code, Image, SourceFile, assemble, check};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};

const MODE: &str = "SET_MODE control=current motor=0 microstep=1/16 current=1.0A hold=50%";

/// The warnings on a program as `code@line`, the lines of the text counted from 1.
fn warnings(text: &str) -> Vec<String> {
    let source = SourceFile::new("x", text);
    let assembly = assemble(&source);
    assert!(assembly.image.is_some(), "{:?}", assembly.diagnostics);
    let found = assembly.check(&CheckOptions::default());
    let line = |start| source.line_column(start).line;
    let of = |one: &stepdrive_asm::Diagnostic| {
        let span = one.labels.first().and_then(|label| label.span).expect("a place");
        format!("{}@{}", one.code, line(span.start))
    };
    found.iter().map(of).collect()
}

fn warns(text: &str, expected: &[&str]) {
    assert_eq!(warnings(text), expected, "{text}");
}

fn is_clean(text: &str) {
    warns(text, &[]);
}

#[test]
fn a_stopped_motor_may_move() {
    is_clean("RUN_F 100\nSOFT_STOP\nMOVE_F 1\nEND");
    is_clean("RUN_F 100\nHARD_HI_Z\nMOVE_F 1\nEND");
    is_clean("RUN_F 100\nGO_UNTIL_F IN0\nMOVE_F 1\nEND");
    is_clean("RUN_F 100\nGO_TO 0\nMOVE_F 1\nSET_ACC 100\nEND");
    is_clean("MOVE_F 1\nMOVE_R 1\nSET_MIN_SPEED 0\nEND");
    is_clean("RUN_F 100\nRESET_POWERSTEP01\nSET_DEC 100\nEND");
}

#[test]
fn a_motor_that_turns_on_one_path_only_may_turn() {
    warns("GOTO_PROGRAM_IF_IN0 on\nRUN_F 100\non: MOVE_F 1\nEND", &["motor-may-turn@3"]);
    warns("again: MOVE_F 1\nRUN_F 100\nSET_WAIT 1s\nGOTO_PROGRAM again", &["motor-may-turn@1"]);
    warns("LOOP_PROGRAM 2 {\nMOVE_F 1\nRUN_F 100\n}\nSOFT_STOP\nEND", &["motor-may-turn@2"]);
    is_clean("LOOP_PROGRAM 1 {\nMOVE_F 1\nRUN_F 100\n}\nSOFT_STOP\nEND");
}

#[test]
fn what_one_caller_did_is_not_blamed_on_another() {
    is_clean(
        "RUN_F 100\nCALL_PROGRAM beep\nSOFT_STOP\nCALL_PROGRAM beep\nMOVE_F 1\nEND\nbeep: SET_RELE\nCLR_RELE\nRETURN_PROGRAM",
    );
    warns(
        "RUN_F 100\nCALL_PROGRAM beep\nMOVE_F 1\nEND\nbeep: SET_RELE\nCLR_RELE\nRETURN_PROGRAM",
        &["motor-may-turn@3"],
    );
    is_clean("RUN_F 100\nCALL_PROGRAM halt\nMOVE_F 1\nEND\nhalt: SOFT_STOP\nRETURN_PROGRAM");
    warns("CALL_PROGRAM go\nMOVE_F 1\nEND\ngo: RUN_F 100\nRETURN_PROGRAM", &["motor-may-turn@2"]);
}

#[test]
fn the_mode_is_set_before_anything_holds_the_motor() {
    is_clean(&format!("{MODE}\nMOVE_F 1\nEND"));
    is_clean(&format!("MOVE_F 1\nSOFT_HI_Z\n{MODE}\nMOVE_F 1\nEND"));
    warns(&format!("SOFT_STOP\n{MODE}\nEND"), &["may-be-energised@2"]);
    warns(&format!("again: {MODE}\nMOVE_F 1\nGOTO_PROGRAM again"), &["may-be-energised@1"]);
}

#[test]
fn the_state_goes_with_a_program_that_starts_another() {
    let text = |stop| format!("RUN_F 100\n{stop}\nSTART_PROGRAM_MEM1\n.mem 1\nMOVE_F 1\nEND");
    warns(&text("SET_RELE"), &["motor-may-turn@5"]);
    is_clean(&text("SOFT_STOP"));
}

#[test]
fn a_target_may_be_given_while_the_motor_runs_whatever_its_highest_speed() {
    is_clean("RUN_F 100\nGO_TO 0\nEND");
    is_clean("SET_MAX_SPEED 100\nGO_TO 0\nEND");
    is_clean("RUN_F 100\nSET_MAX_SPEED 50\nSET_WAIT 1s\nGO_ZERO\nEND");
    is_clean("RUN_F 100\nSET_MAX_SPEED 50\nGO_ZERO\nEND");
}

#[test]
fn loops_that_wait_move_or_can_be_left_are_right() {
    is_clean("a: SET_RELE\nSET_WAIT 1ms\nGOTO_PROGRAM a");
    is_clean("a: MOVE_F 1\nGOTO_PROGRAM a");
    is_clean("a: GOTO_PROGRAM_IF_IN0 b\nGOTO_PROGRAM a\nb: END");
    is_clean("a: CALL_PROGRAM b\nGOTO_PROGRAM a\nb: SET_WAIT 1s\nRETURN_PROGRAM");
    is_clean("LOOP_PROGRAM 1000 {\nSET_RELE\nCLR_RELE\n}\nEND");
    is_clean("RUN_F 100\na: GOTO_PROGRAM_IF_ZERO b\nGOTO_PROGRAM a\nb: SOFT_STOP\nEND");
}

#[test]
fn loops_that_do_nothing_for_ever_are_found() {
    warns("a: GOTO_PROGRAM a", &["endless-loop@1"]);
    warns("a: SET_WAIT 0\nGOTO_PROGRAM a", &["endless-loop@2"]);
    warns("a: CALL_PROGRAM b\nGOTO_PROGRAM a\nb: SET_RELE\nRETURN_PROGRAM", &["endless-loop@2"]);
    warns("GOTO_PROGRAM mem1:a\n.mem 1\na: SET_RELE\nGOTO_PROGRAM mem0:0", &["endless-loop@4"]);
    warns("SET_RELE\nSTART_PROGRAM_MEM0", &["endless-loop@2"]);
    // Two rounds in one program are two findings.
    warns(
        "GOTO_PROGRAM_IF_IN0 b\na: GOTO_PROGRAM a\nb: GOTO_PROGRAM b",
        &["endless-loop@2", "endless-loop@3"],
    );
}

#[test]
fn returns_are_matched_with_calls() {
    is_clean("CALL_PROGRAM a\nEND\na: RETURN_PROGRAM");
    is_clean("CALL_PROGRAM mem1:a\nEND\n.mem 1\na: SET_RELE\nRETURN_PROGRAM");
    // A memory of subroutines is no program, also when its first line is not the one that is called.
    is_clean(
        "CALL_PROGRAM mem2:b\nCALL_PROGRAM mem2:a\nEND\n.mem 2\na: SET_RELE\nRETURN_PROGRAM\nb: CLR_RELE\nRETURN_PROGRAM",
    );
    warns("CALL_PROGRAM a\na: SET_RELE\nRETURN_PROGRAM", &["return-without-call@3"]);
    warns(".mem 1\nRETURN_PROGRAM", &["return-without-call@2"]);
}

#[test]
fn each_memory_to_which_nothing_leads_is_a_program() {
    is_clean("MOVE_F 1\nEND\n.mem 1\nMOVE_F 2\nEND\n.mem 3\nMOVE_F 3\nEND");
    // Two that only lead to each other are reached all the same.
    is_clean(".mem 1\na: MOVE_F 1\nGOTO_PROGRAM mem2:0\n.mem 2\nMOVE_F 2\nGOTO_PROGRAM mem1:a");
}

#[test]
fn what_nothing_leads_to_is_found_except_for_ends() {
    warns("END\nMOVE_F 1\nEND", &["unreachable@2"]);
    warns("CALL_PROGRAM a\nMOVE_F 1\nEND\na: END", &["unreachable@2"]);
    is_clean("a: MOVE_F 1\nGOTO_PROGRAM a\nEND");
    warns(
        "GOTO_PROGRAM a\nSET_RELE\na: MOVE_F 1\nEND\nCLR_RELE\nCLR_RELE",
        &["unreachable@2", "unreachable@5"],
    );
}

#[test]
fn the_end_of_a_memory_is_the_end_of_the_program() {
    warns("MOVE_F 1", &["runs-past-end@1"]);
    warns("LOOP_PROGRAM 2 {\nMOVE_F 1\n}", &["runs-past-end@2"]);
    warns("GOTO_PROGRAM done\nSET_RELE\ndone:", &["jump-past-end@1", "unreachable@2"]);
    warns("WAIT_IN0\nGOTO_PROGRAM_IF_IN1 9\nEND", &["jump-past-end@2"]);
    warns("CALL_PROGRAM mem3:0\nEND", &["empty-memory@1"]);
    is_clean("MOVE_F 1\nSTOP_PROGRAM_MEM");
}

#[test]
fn loops_may_stand_in_each_other_and_be_left() {
    is_clean("LOOP_PROGRAM 2 {\nLOOP_PROGRAM 3 {\nMOVE_F 1\n}\n}\nEND");
    is_clean("LOOP_PROGRAM 2 {\nMOVE_F 1\nGOTO_PROGRAM_IF_IN0 out\n}\nout: END");
    is_clean("LOOP_PROGRAM 2 {\na: MOVE_F 1\nGOTO_PROGRAM_IF_IN0 a\n}\nEND");
    is_clean("LOOP_PROGRAM 2 {\nCALL_PROGRAM a\n}\nEND\na: MOVE_F 1\nRETURN_PROGRAM");
}

#[test]
fn loops_within_each_other_that_end_together_all_repeat() {
    // Only by the outer loop's way back does the inner one's head come after the RUN.
    warns(
        "LOOP_PROGRAM 2 {\nMOVE_F 1\nLOOP_PROGRAM 1 {\nRUN_F 100\n}\n}\nSOFT_STOP\nEND",
        &["motor-may-turn@2"],
    );
}

#[test]
fn a_filled_up_read_out_is_not_full() {
    let mut words = vec![Instruction::with_position(Opcode::MoveF, 100).word()];
    words.resize(255, 0);
    let mut image = Image::new();
    image.set_area(0, &words).expect("255 words");
    assert_eq!(check(&image, None, &CheckOptions::default()), []);
}

#[test]
fn a_read_out_is_checked_by_place() {
    let run = Instruction { opcode: Opcode::RunF, data: 100 }.word();
    let step = Instruction::with_position(Opcode::MoveF, 1).word();
    let mut image = Image::new();
    image.set_area(2, &[run, step, 0]).expect("three words");
    let found = check(&image, None, &CheckOptions::default());
    let places: Vec<String> = found
        .iter()
        .flat_map(|one| one.labels.iter().filter_map(|label| label.place).map(|place| place.to_string()))
        .collect();
    assert_eq!(found.iter().map(|one| one.code).collect::<Vec<_>>(), [Code::MotorMayTurn]);
    assert_eq!(places, ["mem2:1", "mem2:0"]);
}

#[test]
fn a_source_map_leads_from_place_to_text_and_back() {
    let text = "start:\n  MOVE_F 1\n.mem 1\n; nothing\nother: END ; here\n";
    let assembly = assemble(&SourceFile::new("x", text));
    let map = &assembly.source_map;
    let place = stepdrive_asm::Place { memory: 1, line: 0 };
    assert_eq!(map.span(place).map(|span| span.of(text)), Some("END"));
    assert_eq!(map.label(place), Some("other"));
    assert_eq!(map.place(text.find("END").unwrap_or(0) + 2), Some(place));
    assert_eq!(map.place(0), None);
    let past = stepdrive_asm::Place { memory: 0, line: 3 };
    assert_eq!(map.nearest_label(past), Some(("start", 3)));
    assert_eq!(map.labels().count(), 2);
}

#[test]
fn the_instruction_that_set_the_motor_going_is_named_whatever_came_between() {
    let text = "RUN_F 100\nSET_MAX_SPEED 50\nSET_WAIT 1s\nCALL_PROGRAM beep\nMOVE_F 1\nEND\nbeep: SET_RELE\nRETURN_PROGRAM";
    let found = assemble(&SourceFile::new("x", text)).check(&CheckOptions::default());
    let places = found.iter().flat_map(|one| &one.labels).filter_map(|label| label.place);
    assert_eq!(places.map(|place| place.line).collect::<Vec<u8>>(), [4, 0]);
}
