//! What the checker says, and the assembler of what it takes all the same.

use super::{check, findings};
use expect_test::expect;
use stepdrive_asm::CheckOptions;
use stepdrive_spec::smsd::models::Model;

#[test]
fn a_word_that_no_controller_stores() {
    check(
        ".word 0x000003F0\nEND\n",
        &expect![[r#"
        warning[not-an-instruction]: 0x000003F0 is no instruction: instruction code 0x3F is not listed
         --> test.smsd:1:1
          |
        1 | .word 0x000003F0
          | ^^^^^^^^^^^^^^^^
          |
          = help: a controller refuses to store it
    "#]],
    );
}

#[test]
fn a_raw_word_out_of_range() {
    check(
        ".word 0x00001460\nEND\n",
        &expect![[r#"
        warning[refused-instruction]: `SET_MAX_SPEED` with the data 5 is refused, which stops the program
         --> test.smsd:1:1
          |
        1 | .word 0x00001460
          | ^^^^^^^^^^^^^^^^ the program stops here with an error
          |
          = help: write the instruction by its name, and the assembler says what it takes
    "#]],
    );
}

#[test]
fn a_raw_word_for_usb_only() {
    check(
        ".word 0x10\nEND\n",
        &expect![[r#"
        warning[refused-instruction]: `GET_SPEED` cannot stand in a program, and stops it
         --> test.smsd:1:1
          |
        1 | .word 0x10
          | ^^^^^^^^^^ the program stops here with an error
          |
          = help: write the instruction by its name, and the assembler says what it takes
    "#]],
    );
}

#[test]
fn a_label_at_the_end_of_a_loop() {
    check(
        "LOOP_PROGRAM 3 {\n    GOTO_PROGRAM_IF_IN0 next\n    MOVE_F 100\nnext:\n}\nEND\n",
        &expect![[r#"
        warning[label-at-loop-end]: the label `next` stands behind the loop's last instruction
         --> test.smsd:4:1
          |
        4 | next:
          | ^^^^ a jump to it leaves the loop
          |
         ::: test.smsd:5:1
          |
        5 | }
          | - the loop ends here
          |
          = help: put it behind `}` to leave the loop, or before the last instruction to stay in it
    "#]],
    );
}

#[test]
fn instructions_that_nothing_leads_to() {
    check(
        "GOTO_PROGRAM done\nMOVE_F 1\nMOVE_F 2\ndone: END\n",
        &expect![[r#"
        warning[unreachable]: these 2 instructions are never reached
         --> test.smsd:2:1
          |
        2 | MOVE_F 1
          | ^^^^^^^^ from here on
          |
          = help: no path leads here: what stands above it always goes elsewhere
    "#]],
    );
}

#[test]
fn a_loop_that_goes_round_for_ever() {
    check(
        "SET_RELE\nround:\nCLR_RELE\nGOTO_PROGRAM_IF_IN0 other\nother: GOTO_PROGRAM round\n",
        &expect![[r#"
        warning[endless-loop]: this loop can neither end nor wait
         --> test.smsd:5:8
          |
        5 | other: GOTO_PROGRAM round
          |        ^^^^^^^^^^^^^^^^^^ goes round
          |
         ::: test.smsd:3:1
          |
        3 | CLR_RELE
          | -------- from here
          |
          = help: give it a wait or a way out; `END` leaves the motor as it is
    "#]],
    );
}

#[test]
fn a_program_without_end() {
    check(
        "MOVE_F 100\n",
        &expect![[r#"
        warning[runs-past-end]: the program runs past the end of memory 0, which ends it
         --> test.smsd:1:1
          |
        1 | MOVE_F 100
          | ^^^^^^^^^^ nothing follows
          |
          = help: write `END` behind it if that is meant
    "#]],
    );
}

#[test]
fn a_jump_past_the_end() {
    check(
        "MOVE_F 100\nGOTO_PROGRAM 7\n",
        &expect![[r#"
        warning[jump-past-end]: mem0:7 is past the end of memory 0, which ends the program
         --> test.smsd:2:1
          |
        2 | GOTO_PROGRAM 7
          | ^^^^^^^^^^^^^^ goes there
          |
          = help: memory 0 has lines 0 to 1; write `END` to end
    "#]],
    );
}

#[test]
fn a_jump_into_an_empty_memory() {
    check(
        "GOTO_PROGRAM mem2:0\n",
        &expect![[r#"
        warning[empty-memory]: memory 2 is empty here, so the program ends
         --> test.smsd:1:1
          |
        1 | GOTO_PROGRAM mem2:0
          | ^^^^^^^^^^^^^^^^^^^ goes there
          |
          = help: that is right only if the controller has another program stored there
    "#]],
    );
}

#[test]
fn a_move_while_the_motor_runs() {
    check(
        "RUN_F 400\nWAIT_IN0\nMOVE_F 100\nEND\n",
        &expect![[r#"
        warning[motor-may-turn]: the motor may still turn at `MOVE_F`
         --> test.smsd:3:1
          |
        3 | MOVE_F 100
          | ^^^^^^^^^^ refused then, which stops the program
          |
         ::: test.smsd:1:1
          |
        1 | RUN_F 400
          | --------- it turns since here
          |
          = help: stop it first, with `SOFT_STOP`
    "#]],
    );
}

#[test]
fn an_acceleration_while_the_motor_runs() {
    check(
        "RUN_R 400\nSET_ACC 100\nSOFT_STOP\nEND\n",
        &expect![[r#"
        warning[motor-may-turn]: the motor may still turn at `SET_ACC`
         --> test.smsd:2:1
          |
        2 | SET_ACC 100
          | ^^^^^^^^^^^ refused then, which stops the program
          |
         ::: test.smsd:1:1
          |
        1 | RUN_R 400
          | --------- it turns since here
          |
          = help: stop it first, with `SOFT_STOP`
    "#]],
    );
}

#[test]
fn a_mode_while_the_motor_is_held() {
    check(
        "MOVE_F 100\nSET_MODE control=current motor=0 microstep=1/16 current=1.0A hold=50%\nEND\n",
        &expect![[r#"
            warning[may-be-energised]: the motor may be energised at `SET_MODE`
             --> test.smsd:2:1
              |
            2 | SET_MODE control=current motor=0 microstep=1/16 current=1.0A hold=50%
              | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ refused then, which stops the program
              |
             ::: test.smsd:1:1
              |
            1 | MOVE_F 100
              | ---------- it is energised since here
              |
              = help: de-energise it first, with `SOFT_HI_Z`
        "#]],
    );
}

#[test]
fn a_return_without_call() {
    check(
        "MOVE_F 100\nRETURN_PROGRAM\n",
        &expect![[r#"
        warning[return-without-call]: no `CALL_PROGRAM` leads to this return
         --> test.smsd:2:1
          |
        2 | RETURN_PROGRAM
          | ^^^^^^^^^^^^^^ the program stops here with an error
          |
          = help: let `CALL_PROGRAM` lead here, or write `END` before it
    "#]],
    );
}

#[test]
fn a_subroutine_that_calls_itself() {
    check(
        "CALL_PROGRAM sub\nEND\nsub:\nMOVE_F 1\nCALL_PROGRAM sub\nRETURN_PROGRAM\n",
        &expect![[r#"
            warning[recursive-call]: this call may call itself again
             --> test.smsd:5:1
              |
            5 | CALL_PROGRAM sub
              | ^^^^^^^^^^^^^^^^ calls a subroutine that is not finished
              |
              = help: each round adds a pending call, and 16 are the most: leave a subroutine by `RETURN_PROGRAM`, not by a jump

            warning[unreachable]: this instruction is never reached
             --> test.smsd:6:1
              |
            6 | RETURN_PROGRAM
              | ^^^^^^^^^^^^^^
              |
              = help: no path leads here: what stands above it always goes elsewhere
        "#]],
    );
}

#[test]
fn a_subroutine_left_by_a_jump() {
    check(
        "start:\nCALL_PROGRAM sub\nEND\nsub:\nWAIT_IN0\nGOTO_PROGRAM_IF_IN1 start\nRETURN_PROGRAM\n",
        &expect![[r#"
            warning[recursive-call]: this call may call itself again
             --> test.smsd:2:1
              |
            2 | CALL_PROGRAM sub
              | ^^^^^^^^^^^^^^^^ calls a subroutine that is not finished
              |
              = help: each round adds a pending call, and 16 are the most: leave a subroutine by `RETURN_PROGRAM`, not by a jump
        "#]],
    );
}

#[test]
fn a_loop_run_no_times() {
    check(
        "LOOP_PROGRAM 0 {\nMOVE_F 1\n}\nEND\n",
        &expect![[r#"
            warning[idle-loop]: the loop is run 0 times
             --> test.smsd:1:1
              |
            1 | LOOP_PROGRAM 0 {
              | ^^^^^^^^^^^^^^
              |
              = help: take it out, or give it a body and cycles

            warning[unreachable]: this instruction is never reached
             --> test.smsd:2:1
              |
            2 | MOVE_F 1
              | ^^^^^^^^
              |
              = help: no path leads here: what stands above it always goes elsewhere
        "#]],
    );
}

#[test]
fn a_loop_with_nothing_in_it() {
    check(
        "LOOP_PROGRAM 5 {\n}\nEND\n",
        &expect![[r#"
        warning[idle-loop]: the loop has nothing to repeat
         --> test.smsd:1:1
          |
        1 | LOOP_PROGRAM 5 {
          | ^^^^^^^^^^^^^^
          |
          = help: take it out, or give it a body and cycles
    "#]],
    );
}

#[test]
fn a_loop_past_the_end() {
    check(
        "LOOP_PROGRAM cycles=3 instructions=9\nMOVE_F 1\nEND\n",
        &expect![[r#"
        warning[loop-past-end]: the body has 9 instructions, and only 2 follow
         --> test.smsd:1:1
          |
        1 | LOOP_PROGRAM cycles=3 instructions=9
          | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
          |
          = help: the program ends before the first cycle does
    "#]],
    );
}

#[test]
fn loops_that_cross() {
    check(
        "LOOP_PROGRAM cycles=2 instructions=2\nLOOP_PROGRAM cycles=2 instructions=2\nMOVE_F 1\nMOVE_F 2\nEND\n",
        &expect![[r#"
            warning[loops-cross]: the bodies of two loops cross
             --> test.smsd:2:1
              |
            2 | LOOP_PROGRAM cycles=2 instructions=2
              | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ its body goes on behind the other one's end
              |
             ::: test.smsd:1:1
              |
            1 | LOOP_PROGRAM cycles=2 instructions=2
              | ------------------------------------ the loop around it
              |
              = help: let the inner body end first
        "#]],
    );
}

#[test]
fn a_jump_into_a_loop() {
    check(
        "GOTO_PROGRAM inside\nLOOP_PROGRAM 2 {\nMOVE_F 1\ninside: MOVE_F 2\n}\nEND\n",
        &expect![[r#"
            warning[jump-into-loop]: `GOTO_PROGRAM` goes into the body of a loop
             --> test.smsd:1:1
              |
            1 | GOTO_PROGRAM inside
              | ^^^^^^^^^^^^^^^^^^^ from outside
              |
             ::: test.smsd:2:1
              |
            2 | LOOP_PROGRAM 2 {
              | -------------- the loop, which does not count then
              |
              = help: jump to the loop itself, or to what stands behind it

            warning[unreachable]: this instruction is never reached
             --> test.smsd:2:1
              |
            2 | LOOP_PROGRAM 2 {
              | ^^^^^^^^^^^^^^
              |
              = help: no path leads here: what stands above it always goes elsewhere
        "#]],
    );
}

#[test]
fn a_memory_with_little_room() {
    check(
        &("MOVE_F 1\n".repeat(249) + "END\n"),
        &expect![[r#"
        warning[nearly-full]: memory 0 is nearly full: 249 of 255 instructions
           --> test.smsd:249:1
            |
        249 | MOVE_F 1
            | ^^^^^^^^
            |
            = help: move a part of it into a memory of its own and call it with `CALL_PROGRAM mem1:part`
    "#]],
    );
}

#[test]
fn calls_too_deep() {
    let sub = |number| format!("s{number}: CALL_PROGRAM s{}\nRETURN_PROGRAM\n", number + 1);
    let subs: String = (1..=17).map(sub).collect();
    check(
        &format!("CALL_PROGRAM s1\nEND\n{subs}s18: RETURN_PROGRAM\n"),
        &expect![[r#"
        warning[call-too-deep]: 16 calls may be pending here already
          --> test.smsd:33:6
           |
        33 | s16: CALL_PROGRAM s17
           |      ^^^^^^^^^^^^^^^^ one more stops the program with an error
           |
           = help: call from further out, or jump
    "#]],
    );
}

#[test]
fn loops_too_deep() {
    let text = "LOOP_PROGRAM 2 {\n".repeat(9) + "SET_WAIT 1s\n" + &"}\n".repeat(9) + "END\n";
    check(
        &text,
        &expect![[r#"
        warning[loop-too-deep]: 8 loops may be running here already
         --> test.smsd:9:1
          |
        9 | LOOP_PROGRAM 2 {
          | ^^^^^^^^^^^^^^ one more stops the program with an error
          |
          = help: loops around a call count as well
    "#]],
    );
}

#[test]
fn loops_too_deep_by_a_call() {
    let around = |count, body: &str| "LOOP_PROGRAM 2 {\n".repeat(count) + body + &"}\n".repeat(count);
    let text =
        around(5, "CALL_PROGRAM sub\n") + "END\nsub:\n" + &around(4, "SET_WAIT 1s\n") + "RETURN_PROGRAM\n";
    check(
        &text,
        &expect![[r#"
        warning[loop-too-deep]: 8 loops may be running here already
          --> test.smsd:17:1
           |
        17 | LOOP_PROGRAM 2 {
           | ^^^^^^^^^^^^^^ one more stops the program with an error
           |
           = help: loops around a call count as well
    "#]],
    );
}

#[test]
fn a_current_beyond_the_smaller_model() {
    let text = "SET_MODE control=current motor=0 microstep=1/16 current=5.0A hold=50%\nEND\n";
    let said = |model| findings(text, CheckOptions { model });
    assert_eq!(said(None), "");
    assert_eq!(said(Some(Model::Smsd80)), "");
    expect![[r#"
        warning[beyond-model]: the current is more than the 4.2 A of an SMSD-4.2LAN
         --> test.smsd:1:1
          |
        1 | SET_MODE control=current motor=0 microstep=1/16 current=5.0A hold=50%
          | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ refused, which stops the program
          |
          = help: choose a lower current
    "#]].assert_eq(&said(Some(Model::Smsd42)));
}

#[test]
fn a_motor_beyond_the_smaller_model() {
    let text = "SET_MODE control=voltage motor=54 microstep=1/16 current=1.0A hold=50%\nEND\n";
    assert_eq!(findings(text, CheckOptions::default()), "");
    expect![[r#"
        warning[beyond-model]: an SMSD-4.2LAN knows motors 0 to 45
         --> test.smsd:1:1
          |
        1 | SET_MODE control=voltage motor=54 microstep=1/16 current=1.0A hold=50%
          | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ refused, which stops the program
          |
          = help: choose a motor of its table
    "#]].assert_eq(&findings(text, CheckOptions { model: Some(Model::Smsd42) }));
}
