//! What a step may do, with mistakes.

use super::mistakes::check_step;
use expect_test::{Expect, expect};

/// What a person reads about a step that does this.
fn check_act(act: &str, expect: Expect) {
    check_step(&format!("do = ['{act}']"), expect);
}

#[test]
fn actions_are_checked() {
    check_act(
        "",
        expect![[r#"
        s.toml:3:7: there is no action; as in: input stage.IN0 1
          |
        3 | do = ['']
          |       ^^"#]],
    );
    check_act(
        "jump up",
        expect![[r#"
        s.toml:3:7: unknown action `jump`; there are input, fault, power, panel, wire, and in scenarios clock, line, write, command
          |
        3 | do = ['jump up']
          |       ^^^^^^^^^"#]],
    );
    check_act(
        "input nobody.IN0 1",
        expect![[r#"
        s.toml:3:7: unknown drive `nobody`; there are stage, uhv
          |
        3 | do = ['input nobody.IN0 1']
          |       ^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "fault uhv.colour red",
        expect![[r#"
        s.toml:3:7: unknown fault `colour` of uhv; there are INPUT, rotor, motor, temperature, thermocouple, flash, connection, reply-delay, reply-drop, reply-pieces, reply-duplicate, reply-damage (INPUT: an input with a switch)
          |
        3 | do = ['fault uhv.colour red']
          |       ^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "clock warp",
        expect![[r#"
        s.toml:3:7: clock `warp` is unknown; it is real, paused, or x and a factor, as in x100
          |
        3 | do = ['clock warp']
          |       ^^^^^^^^^^^^"#]],
    );
    check_step(
        "do = ['clock real', \"power stage of\"]",
        expect![[r#"
        s.toml:3:21: the power is switched so: power DRIVE on|off [for DURATION]
          |
        3 | do = ['clock real', "power stage of"]
          |                     ^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn lines_are_checked() {
    check_act(
        "line",
        expect![[r#"
        s.toml:3:7: a line is sent so: line DRIVE LINE [expecting ERROR], as in line uhv RUNR,1000
          |
        3 | do = ['line']
          |       ^^^^^^"#]],
    );
    check_act(
        "line uhv",
        expect![[r#"
        s.toml:3:7: a line is sent so: line DRIVE LINE [expecting ERROR], as in line uhv RUNR,1000
          |
        3 | do = ['line uhv']
          |       ^^^^^^^^^^"#]],
    );
    check_act(
        "line nobody STOP",
        expect![[r#"
        s.toml:3:7: unknown drive `nobody`; there are stage, uhv
          |
        3 | do = ['line nobody STOP']
          |       ^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "line stage STOP",
        expect![[r#"
        s.toml:3:7: stage is an SMSD, which takes no lines; see write and command
          |
        3 | do = ['line stage STOP']
          |       ^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "line uhv JUMP",
        expect![[r#"
        s.toml:3:7: the drive will refuse this with -4 (Unknown command); if that is the point, add: expecting -4
          |
        3 | do = ['line uhv JUMP']
          |       ^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "line uhv RUNR",
        expect![[r#"
        s.toml:3:7: the drive will refuse this with -3 (Unable to get); if that is the point, add: expecting -3
          |
        3 | do = ['line uhv RUNR']
          |       ^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "line uhv STORE expecting 5",
        expect![[r#"
        s.toml:3:7: a line is refused with one of -1, -2, -3, -4, -5, -6, -7, -101, -102
          |
        3 | do = ['line uhv STORE expecting 5']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_step(
        "do = [\"line uhv ST\\u0007OP\"]",
        expect![[r#"
        s.toml:3:7: a line is at most 256 printable ASCII characters
          |
        3 | do = ["line uhv ST\u0007OP"]
          |       ^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act("line uhv JUMP expecting -4", expect!["valid, 1 steps"]);
}

#[test]
fn the_register_of_a_write_is_checked() {
    check_act(
        "write",
        expect![[r#"
        s.toml:3:7: a register is written so: write DRIVE.REGISTER VALUE [expecting EXCEPTION], as in write stage.MAX_SPEED 800
          |
        3 | do = ['write']
          |       ^^^^^^^"#]],
    );
    check_act(
        "write stage",
        expect![[r#"
        s.toml:3:7: `stage` is not a drive and a part of it, as in stage.IN0
          |
        3 | do = ['write stage']
          |       ^^^^^^^^^^^^^"#]],
    );
    check_act(
        "write uhv.ACC 5",
        expect![[r#"
        s.toml:3:7: uhv is an SMD3, which has no registers; see line
          |
        3 | do = ['write uhv.ACC 5']
          |       ^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "write stage.COLOUR 5",
        expect![[r#"
        s.toml:3:7: unknown register `COLOUR` of `stage`; they are called as in docs/registers.md, with _ for a space
          |
        3 | do = ['write stage.COLOUR 5']
          |       ^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "write stage.SPEED 5",
        expect![[r#"
        s.toml:3:7: the register `SPEED` of `stage` can only be read
          |
        3 | do = ['write stage.SPEED 5']
          |       ^^^^^^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn the_value_of_a_write_is_checked() {
    check_act(
        "write stage.MAX_SPEED",
        expect![[r#"
        s.toml:3:7: a register is written so: write DRIVE.REGISTER VALUE [expecting EXCEPTION], as in write stage.MAX_SPEED 800
          |
        3 | do = ['write stage.MAX_SPEED']
          |       ^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "write stage.MAX_SPEED fast",
        expect![[r#"
        s.toml:3:7: a value is a whole number, as in -5000 or 0x1F
          |
        3 | do = ['write stage.MAX_SPEED fast']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "write stage.MAX_SPEED 15",
        expect![[r#"
        s.toml:3:7: MAX_SPEED is 16 to 15600, not 15
          |
        3 | do = ['write stage.MAX_SPEED 15']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act("write stage.MAX_SPEED 15 expecting 3", expect!["valid, 1 steps"]);
    check_act(
        "write stage.MAX_SPEED 65536 expecting 3",
        expect![[r#"
        s.toml:3:7: MAX_SPEED is 0 to 65535, not 65536
          |
        3 | do = ['write stage.MAX_SPEED 65536 expecting 3']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "write stage.RELAY 2",
        expect![[r#"
        s.toml:3:7: Relay is 0 to 1, not 2
          |
        3 | do = ['write stage.RELAY 2']
          |       ^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act("write stage.SOFT_STOP", expect!["valid, 1 steps"]);
    check_act("write stage.cmd_31 0x7FFFFFFF", expect!["valid, 1 steps"]);
    check_act(
        "write stage.ACC 5 expecting trouble",
        expect![[r#"
        s.toml:3:7: a request is refused with a Modbus exception: 1, 2, 3, 4 or 6
          |
        3 | do = ['write stage.ACC 5 expecting trouble']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn the_name_of_a_command_is_checked() {
    check_act(
        "command stage",
        expect![[r#"
        s.toml:3:7: a command is given so: command DRIVE COMMAND [OPERAND] [expecting CMD_ERROR], as in command stage GO_TO 5000
          |
        3 | do = ['command stage']
          |       ^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command uhv GO_TO",
        expect![[r#"
        s.toml:3:7: uhv is an SMD3, which has no registers; see line
          |
        3 | do = ['command uhv GO_TO']
          |       ^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage GO_HOME",
        expect![[r#"
        s.toml:3:7: unknown command `GO_HOME`; there are RUN_F, RUN_R, MOVE_F, MOVE_R, GO_TO_F, GO_TO_R, GO_UNTIL_F, GO_UNTIL_R, SCAN_ZERO_F, SCAN_ZERO_R, SCAN_MARK_F, SCAN_MARK_R, GO_ZERO, GO_MARK, GO_TO, SOFT_STOP, HARD_STOP, SOFT_HI_Z, HARD_HI_Z, START_PROGRAM_MEM0, START_PROGRAM_MEM1, START_PROGRAM_MEM2, START_PROGRAM_MEM3, STOP_PROGRAM_MEM, SCAN_MARK2_F, SCAN_MARK2_R
          |
        3 | do = ['command stage GO_HOME']
          |       ^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage SET_WAIT 5",
        expect![[r#"
        s.toml:3:7: CMD does not take SET_WAIT; it takes RUN_F, RUN_R, MOVE_F, MOVE_R, GO_TO_F, GO_TO_R, GO_UNTIL_F, GO_UNTIL_R, SCAN_ZERO_F, SCAN_ZERO_R, SCAN_MARK_F, SCAN_MARK_R, GO_ZERO, GO_MARK, GO_TO, SOFT_STOP, HARD_STOP, SOFT_HI_Z, HARD_HI_Z, START_PROGRAM_MEM0, START_PROGRAM_MEM1, START_PROGRAM_MEM2, START_PROGRAM_MEM3, STOP_PROGRAM_MEM, SCAN_MARK2_F, SCAN_MARK2_R
          |
        3 | do = ['command stage SET_WAIT 5']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn the_operand_of_a_command_is_checked() {
    check_act(
        "command stage GO_ZERO 5",
        expect![[r#"
        s.toml:3:7: GO_ZERO has no operand
          |
        3 | do = ['command stage GO_ZERO 5']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage GO_TO far",
        expect![[r#"
        s.toml:3:7: a value is a whole number, as in -5000 or 0x1F
          |
        3 | do = ['command stage GO_TO far']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage GO_TO 2097152",
        expect![[r#"
        s.toml:3:7: TARGET_POS is -2097152 to 2097151, not 2097152
          |
        3 | do = ['command stage GO_TO 2097152']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage RUN_F 5",
        expect![[r#"
        s.toml:3:7: TARGET_SPEED is 15 to 15600, not 5
          |
        3 | do = ['command stage RUN_F 5']
          |       ^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage GO_UNTIL_F IN9",
        expect![[r#"
        s.toml:3:7: GO_UNTIL_F takes an input, IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE or 0 to 7
          |
        3 | do = ['command stage GO_UNTIL_F IN9']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act(
        "command stage GO_UNTIL_F 8",
        expect![[r#"
        s.toml:3:7: GO_UNTIL_F takes an input, IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE or 0 to 7
          |
        3 | do = ['command stage GO_UNTIL_F 8']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
    check_act("command stage GO_UNTIL_F 8 expecting CMD_ERROR", expect!["valid, 1 steps"]);
    check_act("command stage GO_UNTIL_F set_zero", expect!["valid, 1 steps"]);
    check_act(
        "command stage GO_ZERO expecting 3",
        expect![[r#"
        s.toml:3:7: a command that is refused sets CMD_ERROR: expecting CMD_ERROR
          |
        3 | do = ['command stage GO_ZERO expecting 3']
          |       ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^"#]],
    );
}
