//! Lines, words, constants.

use super::check;
use expect_test::expect;

#[test]
fn a_character_without_meaning() {
    check(
        "MOVE_F 100, 200\n",
        &expect![[r#"
        error[unexpected-character]: `,` has no meaning here
         --> test.smsd:1:11
          |
        1 | MOVE_F 100, 200
          |           ^ not part of the language
          |
          = help: operands are separated by spaces
    "#]],
    );
}

#[test]
fn a_comment_of_another_language() {
    check(
        "END # done\n",
        &expect![[r#"
        error[unexpected-character]: `#` has no meaning here
         --> test.smsd:1:5
          |
        1 | END # done
          |     ^ not part of the language
          |
          = help: a comment begins with `;`
    "#]],
    );
}

#[test]
fn a_misspelt_instruction() {
    check(
        "    MOVEF 3200\n    END\n",
        &expect![[r#"
        error[unknown-instruction]: there is no instruction `MOVEF`
         --> test.smsd:1:5
          |
        1 |     MOVEF 3200
          |     ^^^^^ not an instruction
          |
          = help: did you mean `MOVE_F`?
    "#]],
    );
}

#[test]
fn the_makers_prefix() {
    check(
        "CMD_PowerSTEP01_GO_TO 5\nEND\n",
        &expect![[r#"
        error[unknown-instruction]: there is no instruction `CMD_PowerSTEP01_GO_TO`
         --> test.smsd:1:1
          |
        1 | CMD_PowerSTEP01_GO_TO 5
          | ^^^^^^^^^^^^^^^^^^^^^ not an instruction
          |
          = help: did you mean `GO_TO`?
    "#]],
    );
}

#[test]
fn a_word_that_is_nothing_near() {
    check(
        "fly 5\n",
        &expect![[r#"
            error[unknown-instruction]: there is no instruction `fly`
             --> test.smsd:1:1
              |
            1 | fly 5
              | ^^^ not an instruction
              |
              = help: a line is an instruction with its operand, as in `MOVE_F 3200`
        "#]],
    );
}

#[test]
fn a_misspelt_directive() {
    check(
        ".men 1\nEND\n",
        &expect![[r#"
        error[unknown-directive]: there is no directive `.men`
         --> test.smsd:1:1
          |
        1 | .men 1
          | ^^^^ not a directive
          |
          = help: did you mean `.mem`?
          = help: there are .mem, .const and .word
    "#]],
    );
}

#[test]
fn a_line_that_begins_wrong() {
    check(
        "= 5\n",
        &expect![[r#"
        error[syntax]: a line cannot begin with `=`
         --> test.smsd:1:1
          |
        1 | = 5
          | ^ expected an instruction, a label or a directive
          |
          = help: for example `MOVE_F 3200`, `start:` or `.mem 1`
    "#]],
    );
}

#[test]
fn an_instruction_for_usb_only() {
    check(
        "GET_SPEED\nEND\n",
        &expect![[r#"
        error[not-in-programs]: `GET_SPEED` cannot stand in a program
         --> test.smsd:1:1
          |
        1 | GET_SPEED
          | ^^^^^^^^^ a program that meets it stops with an error
          |
          = help: a host can send it over USB
    "#]],
    );
}

#[test]
fn an_operand_missing() {
    check(
        "SET_MAX_SPEED\nEND\n",
        &expect![[r#"
        error[missing-operand]: `SET_MAX_SPEED` needs an operand
         --> test.smsd:1:1
          |
        1 | SET_MAX_SPEED
          | ^^^^^^^^^^^^^ nothing stands behind it
          |
          = help: `SET_MAX_SPEED` takes a number from 16 to 15600 full step/s
    "#]],
    );
}

#[test]
fn an_operand_too_many() {
    check(
        "SET_MAX_SPEED 800 900\nEND\n",
        &expect![[r#"
        error[too-many-operands]: `900` is one operand too many
         --> test.smsd:1:19
          |
        1 | SET_MAX_SPEED 800 900
          |                   ^^^ not expected here
          |
          = help: `SET_MAX_SPEED` takes a number from 16 to 15600 full step/s
    "#]],
    );
}

#[test]
fn an_operand_where_none_belongs() {
    check(
        "END 5\n",
        &expect![[r#"
        error[too-many-operands]: `END` takes no operand
         --> test.smsd:1:5
          |
        1 | END 5
          |     ^ not expected here
    "#]],
    );
}

#[test]
fn a_misspelt_constant() {
    check(
        ".const fast = 800\nSET_MAX_SPEED fats\nEND\n",
        &expect![[r#"
        error[unknown-name]: there is no constant or input `fats`
         --> test.smsd:2:15
          |
        2 | SET_MAX_SPEED fats
          |               ^^^^ not known here
          |
          = help: did you mean `fast`?
          = help: a constant is set above its first use, as in `.const fast = 800`
          = help: `SET_MAX_SPEED` takes a number from 16 to 15600 full step/s
    "#]],
    );
}

#[test]
fn a_constant_without_directive() {
    check(
        "fast = 800\n",
        &expect![[r#"
        error[syntax]: `fast =` is no statement
         --> test.smsd:1:1
          |
        1 | fast = 800
          | ^^^^ a constant?
          |
          = help: a constant is written `.const fast = …`
    "#]],
    );
}

#[test]
fn a_constant_set_twice() {
    check(
        ".const fast = 800\n.const FAST = 900\nEND\n",
        &expect![[r#"
        error[duplicate-name]: there are two constants `FAST`
         --> test.smsd:2:8
          |
        2 | .const FAST = 900
          |        ^^^^ here again
          |
         ::: test.smsd:1:8
          |
        1 | .const fast = 800
          |        ---- first here
          |
          = help: names that differ only in case are the same
    "#]],
    );
}

#[test]
fn a_constant_without_value() {
    check(
        ".const fast\nEND\n",
        &expect![[r#"
        error[syntax]: this is no constant
         --> test.smsd:1:1
          |
        1 | .const fast
          | ^^^^^^^^^^^ expected a name, `=` and a value
          |
          = help: a constant is written `.const fast = 800`
    "#]],
    );
}

#[test]
fn a_word_too_large() {
    check(
        ".word 0x1_0000_0000\nEND\n",
        &expect![[r#"
        error[out-of-range]: 0x1_0000_0000 is no instruction word
         --> test.smsd:1:7
          |
        1 | .word 0x1_0000_0000
          |       ^^^^^^^^^^^^^
          |
          = help: `.word` takes a number from 0 to 0xFFFFFFFF
    "#]],
    );
}

#[test]
fn several_errors_in_one_run() {
    check(
        "MOV_F 1\nSET_WAIT 1s\nGO_TO x\nGOTO_PROGRAM y\n",
        &expect![[r#"
        error[unknown-instruction]: there is no instruction `MOV_F`
         --> test.smsd:1:1
          |
        1 | MOV_F 1
          | ^^^^^ not an instruction
          |
          = help: did you mean `MOVE_F`?

        error[unknown-name]: there is no constant or input `x`
         --> test.smsd:3:7
          |
        3 | GO_TO x
          |       ^ not known here
          |
          = help: a constant is set above its first use, as in `.const fast = 800`
          = help: `GO_TO` takes a number of microsteps from -2097152 to 2097151

        error[unknown-label]: memory 0 has no label `y`
         --> test.smsd:4:14
          |
        4 | GOTO_PROGRAM y
          |              ^ not found
    "#]],
    );
}

#[test]
fn an_error_behind_tabs_and_umlauts() {
    check(
        "\tEND ; schön\n\tMÖVE 5\n",
        &expect![[r#"
        error[unexpected-character]: `Ö` has no meaning here
         --> test.smsd:2:3
          |
        2 |     MÖVE 5
          |      ^ not part of the language
    "#]],
    );
}

#[test]
fn a_constant_with_a_wrong_value_is_one_error_however_often_it_is_used() {
    check(
        ".const fast = 5kg\n.const faster = fast\nSET_MAX_SPEED fast\nSET_MAX_SPEED faster\nEND\n",
        &expect![[r#"
            error[bad-number]: `5kg` cannot be read as a number
             --> test.smsd:1:15
              |
            1 | .const fast = 5kg
              |               ^^^ `kg` is no unit
              |
              = help: numbers are 800, -1_500, 0x1F, 500ms, 2s, 1min, 1.5A, 50%, 1/16
        "#]],
    );
}
