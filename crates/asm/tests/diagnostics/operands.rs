//! Numbers, units, inputs, fields.

use super::check;
use expect_test::expect;

#[test]
fn a_speed_out_of_range() {
    check(
        ".const crawl = 5\nSET_MAX_SPEED crawl\nEND\n",
        &expect![[r#"
            error[out-of-range]: `crawl` is out of the range of `SET_MAX_SPEED`
             --> test.smsd:2:15
              |
            2 | SET_MAX_SPEED crawl
              |               ^^^^^ this is 5
              |
              = help: `SET_MAX_SPEED` takes a number from 16 to 15600 full step/s
        "#]],
    );
}

#[test]
fn a_position_out_of_range() {
    check(
        "GO_TO 2_097_152\nEND\n",
        &expect![[r#"
            error[out-of-range]: `2_097_152` is out of the range of `GO_TO`
             --> test.smsd:1:7
              |
            1 | GO_TO 2_097_152
              |       ^^^^^^^^^
              |
              = help: `GO_TO` takes a number of microsteps from -2097152 to 2097151
        "#]],
    );
}

#[test]
fn a_time_out_of_range() {
    check(
        "SET_WAIT 2h\nEND\n",
        &expect![[r#"
            error[out-of-range]: `2h` is out of the range of `SET_WAIT`
             --> test.smsd:1:10
              |
            1 | SET_WAIT 2h
              |          ^^
              |
              = help: `SET_WAIT` takes a time from 0 to 3600000 ms, as in 500ms, 2s, 1min
        "#]],
    );
}

#[test]
fn a_time_where_a_speed_belongs() {
    check(
        "SET_MAX_SPEED 500ms\nEND\n",
        &expect![[r#"
        error[wrong-unit]: `SET_MAX_SPEED` takes no such value
         --> test.smsd:1:15
          |
        1 | SET_MAX_SPEED 500ms
          |               ^^^^^ this is a time
          |
          = help: `SET_MAX_SPEED` takes a number from 16 to 15600 full step/s
    "#]],
    );
}

#[test]
fn a_time_finer_than_the_controller() {
    check(
        "SET_WAIT 0.5ms\nEND\n",
        &expect![[r#"
        error[bad-number]: `0.5ms` cannot be read as a number
         --> test.smsd:1:10
          |
        1 | SET_WAIT 0.5ms
          |          ^^^^^ finer than 1ms
          |
          = help: numbers are 800, -1_500, 0x1F, 500ms, 2s, 1min, 1.5A, 50%, 1/16
          = help: `SET_WAIT` takes a time from 0 to 3600000 ms, as in 500ms, 2s, 1min
    "#]],
    );
}

#[test]
fn a_number_with_an_unknown_unit() {
    check(
        "SET_WAIT 5sec\nEND\n",
        &expect![[r#"
        error[bad-number]: `5sec` cannot be read as a number
         --> test.smsd:1:10
          |
        1 | SET_WAIT 5sec
          |          ^^^^ `sec` is no unit
          |
          = help: numbers are 800, -1_500, 0x1F, 500ms, 2s, 1min, 1.5A, 50%, 1/16
          = help: `SET_WAIT` takes a time from 0 to 3600000 ms, as in 500ms, 2s, 1min
    "#]],
    );
}

#[test]
fn a_number_with_a_fraction() {
    check(
        "MOVE_F 10.5\nEND\n",
        &expect![[r#"
        error[bad-number]: `10.5` cannot be read as a number
         --> test.smsd:1:8
          |
        1 | MOVE_F 10.5
          |        ^^^^ finer than 1: it is no whole number
          |
          = help: numbers are 800, -1_500, 0x1F, 500ms, 2s, 1min, 1.5A, 50%, 1/16
          = help: `MOVE_F` takes a number of microsteps from -2097152 to 2097151
    "#]],
    );
}

#[test]
fn a_misspelt_field() {
    check(
        "SET_MODE control=current motor=0 microstep=1/16 curent=1.0A hold=50%\nEND\n",
        &expect![[r#"
        error[unknown-field]: `SET_MODE` has no field `curent`
         --> test.smsd:1:49
          |
        1 | SET_MODE control=current motor=0 microstep=1/16 curent=1.0A hold=50%
          |                                                 ^^^^^^ not a field
          |
          = help: did you mean `current`?
          = help: its fields are control, motor, microstep, current, hold
    "#]],
    );
}

#[test]
fn a_missing_field() {
    check(
        "SET_MODE control=current motor=0 microstep=1/16\nEND\n",
        &expect![[r#"
            error[missing-field]: `SET_MODE` lacks current, hold
             --> test.smsd:1:1
              |
            1 | SET_MODE control=current motor=0 microstep=1/16
              | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ not complete
              |
              = help: it takes all of `control=current motor=0 microstep=1/16 current=1.0A hold=50%`
        "#]],
    );
}

#[test]
fn a_field_twice() {
    check(
        "SET_MODE control=current control=voltage\nEND\n",
        &expect![[r#"
            error[duplicate-field]: `control` is given twice
             --> test.smsd:1:26
              |
            1 | SET_MODE control=current control=voltage
              |          -------         ^^^^^^^ here again
              |          |
              |          first here
        "#]],
    );
}

#[test]
fn a_word_that_is_no_field() {
    check(
        "SET_MODE 10813\nEND\n",
        &expect![[r#"
            error[syntax]: expected a field, found `10813`
             --> test.smsd:1:10
              |
            1 | SET_MODE 10813
              |          ^^^^^ a field is `name=value`
              |
              = help: `SET_MODE` takes all of `control=current motor=0 microstep=1/16 current=1.0A hold=50%`
        "#]],
    );
}

#[test]
fn a_microstep_that_is_not() {
    check(
        "SET_MODE control=current motor=0 microstep=1/10 current=1.0A hold=50%\nEND\n",
        &expect![[r#"
        error[out-of-range]: `microstep` cannot be 1/10
         --> test.smsd:1:44
          |
        1 | SET_MODE control=current motor=0 microstep=1/10 current=1.0A hold=50%
          |                                            ^^^^
          |
          = help: `microstep` is 1 (full steps), 1/2, 1/4, 1/8, 1/16, 1/32, 1/64 or 1/128
    "#]],
    );
}

#[test]
fn a_current_between_two_steps() {
    check(
        "SET_MODE control=current motor=0 microstep=1/16 current=1.25A hold=50%\nEND\n",
        &expect![[r#"
        error[out-of-range]: `current` cannot be 1.25A
         --> test.smsd:1:57
          |
        1 | SET_MODE control=current motor=0 microstep=1/16 current=1.25A hold=50%
          |                                                         ^^^^^
          |
          = help: `current` is 0.1A steps from 0.1A to 8.0A, as in 1.5A
    "#]],
    );
}

#[test]
fn a_control_that_is_not() {
    check(
        "SET_MODE control=power motor=0 microstep=1/16 current=1.0A hold=50%\nEND\n",
        &expect![[r#"
        error[out-of-range]: `control` cannot be power
         --> test.smsd:1:18
          |
        1 | SET_MODE control=power motor=0 microstep=1/16 current=1.0A hold=50%
          |                  ^^^^^
          |
          = help: `control` is `current` or `voltage`
    "#]],
    );
}

#[test]
fn an_input_that_is_not() {
    check(
        "SET_MASK_EVENT IN0 | IN2\nEND\n",
        &expect![[r#"
        error[unknown-name]: there is no constant or input `IN2`
         --> test.smsd:1:22
          |
        1 | SET_MASK_EVENT IN0 | IN2
          |                      ^^^ not known here
          |
          = help: did you mean `IN0`?
          = help: a constant is set above its first use, as in `.const fast = 800`
    "#]],
    );
}

#[test]
fn numbers_joined_as_inputs() {
    check(
        "SET_MASK_EVENT IN0 | 4\nEND\n",
        &expect![[r#"
        error[wrong-operand]: only inputs can be joined by `|`, and `4` is none
         --> test.smsd:1:22
          |
        1 | SET_MASK_EVENT IN0 | 4
          |                      ^ not an input
          |
          = help: write `IN0 | SET_ZERO`, or one number
    "#]],
    );
}

#[test]
fn inputs_joined_to_nothing() {
    check(
        "SET_MASK_EVENT IN0 |\nEND\n",
        &expect![[r#"
        error[missing-operand]: nothing stands behind `|`
         --> test.smsd:1:20
          |
        1 | SET_MASK_EVENT IN0 |
          |                    ^ expected an input
    "#]],
    );
}

#[test]
fn several_inputs_where_one_belongs() {
    check(
        ".const any = IN0 | IN1\nGO_UNTIL_F any\nEND\n",
        &expect![[r#"
        error[wrong-operand]: `GO_UNTIL_F` takes one input, not several
         --> test.smsd:2:12
          |
        2 | GO_UNTIL_F any
          |            ^^^ several inputs
          |
          = help: `GO_UNTIL_F` takes an input (IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE), or its number from 0 to 7
    "#]],
    );
}

#[test]
fn an_input_number_that_is_not() {
    check(
        "GO_UNTIL_F 8\nEND\n",
        &expect![[r#"
            error[out-of-range]: `8` is out of the range of `GO_UNTIL_F`
             --> test.smsd:1:12
              |
            1 | GO_UNTIL_F 8
              |            ^
              |
              = help: `GO_UNTIL_F` takes an input (IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE), or its number from 0 to 7
        "#]],
    );
}
