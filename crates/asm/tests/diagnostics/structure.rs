//! Labels, memories, loops, sizes.

use super::check;
use expect_test::expect;

#[test]
fn a_label_twice() {
    check(
        "a: END\na: END\n",
        &expect![[r#"
        error[duplicate-name]: there are two labels `a`
         --> test.smsd:2:1
          |
        2 | a: END
          | ^ here again
          |
         ::: test.smsd:1:1
          |
        1 | a: END
          | - first here
          |
          = help: names that differ only in case are the same
    "#]],
    );
}

#[test]
fn a_label_called_like_an_instruction() {
    check(
        "end: GO_ZERO\nEND\n",
        &expect![[r#"
        error[reserved-name]: `end` is an instruction and cannot name a label
         --> test.smsd:1:1
          |
        1 | end: GO_ZERO
          | ^^^ choose another name
    "#]],
    );
}

#[test]
fn a_misspelt_label() {
    check(
        "start: SET_WAIT 1s\nGOTO_PROGRAM strat\n",
        &expect![[r#"
        error[unknown-label]: memory 0 has no label `strat`
         --> test.smsd:2:14
          |
        2 | GOTO_PROGRAM strat
          |              ^^^^^ not found
          |
          = help: did you mean `start`?
    "#]],
    );
}

#[test]
fn a_label_of_another_memory() {
    check(
        "GOTO_PROGRAM pick\n.mem 1\npick: END\n",
        &expect![[r#"
        error[unknown-label]: memory 0 has no label `pick`
         --> test.smsd:1:14
          |
        1 | GOTO_PROGRAM pick
          |              ^^^^ not found
          |
          = help: memory 1 has one: write `mem1:pick`
    "#]],
    );
}

#[test]
fn a_memory_as_target() {
    check(
        "GOTO_PROGRAM mem1\n.mem 1\nEND\n",
        &expect![[r#"
        error[wrong-operand]: `mem1` is a memory, not a place in it
         --> test.smsd:1:14
          |
        1 | GOTO_PROGRAM mem1
          |              ^^^^ which instruction?
          |
          = help: its first one is `mem1:0`
    "#]],
    );
}

#[test]
fn a_target_in_a_memory_that_is_not() {
    check(
        "GOTO_PROGRAM mem4:0\n",
        &expect![[r#"
        error[out-of-range]: there is no memory 4
         --> test.smsd:1:14
          |
        1 | GOTO_PROGRAM mem4:0
          |              ^^^^ a controller has mem0 to mem3
    "#]],
    );
}

#[test]
fn a_line_that_is_not() {
    check(
        "GOTO_PROGRAM 256\n",
        &expect![[r#"
        error[out-of-range]: there is no line 256
         --> test.smsd:1:14
          |
        1 | GOTO_PROGRAM 256
          |              ^^^ lines are 0 to 254, and 255 the end
    "#]],
    );
}

#[test]
fn a_memory_that_is_not() {
    check(
        ".mem 4\nEND\n",
        &expect![[r#"
        error[out-of-range]: there is no memory 4
         --> test.smsd:1:6
          |
        1 | .mem 4
          |      ^
          |
          = help: `.mem` takes a memory from 0 to 3
    "#]],
    );
}

#[test]
fn a_memory_twice() {
    check(
        "END\n.mem 1\nEND\n.mem 0\nEND\n",
        &expect![[r#"
        error[duplicate-memory]: memory 0 already has its instructions
         --> test.smsd:4:6
          |
        4 | .mem 0
          |      ^ here again
          |
         ::: test.smsd:1:1
          |
        1 | END
          | --- it begins here
          |
          = help: put all of a memory behind one `.mem`; what stands above the first `.mem` is in memory 0
    "#]],
    );
}

#[test]
fn a_label_before_a_memory() {
    check(
        "END\nx: .mem 1\nEND\n",
        &expect![[r#"
        error[syntax]: a label cannot stand before `.mem`
         --> test.smsd:2:1
          |
        2 | x: .mem 1
          | ^ in which memory?
          |
          = help: put it on the line behind `.mem`
    "#]],
    );
}

#[test]
fn a_loop_without_end() {
    check(
        "LOOP_PROGRAM 3 {\nMOVE_F 1\n.mem 1\nEND\n",
        &expect![[r#"
        error[unclosed-loop]: the loop has no end
         --> test.smsd:1:1
          |
        1 | LOOP_PROGRAM 3 {
          | ^^^^^^^^^^^^ its `{` is not closed
          |
          = help: put `}` on a line behind the last instruction of its body
    "#]],
    );
}

#[test]
fn an_end_without_loop() {
    check(
        "MOVE_F 1\n}\nEND\n",
        &expect![[r#"
        error[unopened-loop]: `}` closes no loop
         --> test.smsd:2:1
          |
        2 | }
          | ^ no loop is open here
          |
          = help: a loop begins with `LOOP_PROGRAM 10 {`
    "#]],
    );
}

#[test]
fn a_loop_on_one_line() {
    check(
        "LOOP_PROGRAM 3 { MOVE_F 1 }\nEND\n",
        &expect![[r#"
        error[syntax]: `{` cannot stand in the middle of a line
         --> test.smsd:1:16
          |
        1 | LOOP_PROGRAM 3 { MOVE_F 1 }
          |                ^
          |
          = help: the body of a loop has a line for each instruction, and `}` a line of its own
    "#]],
    );
}

#[test]
fn a_brace_behind_something_else() {
    check(
        "MOVE_F 3 {\n}\nEND\n",
        &expect![[r#"
        error[syntax]: `MOVE_F` has no body in braces
         --> test.smsd:1:1
          |
        1 | MOVE_F 3 {
          | ^^^^^^ not a loop
          |
          = help: only `LOOP_PROGRAM 10 {` opens a body
    "#]],
    );
}

#[test]
fn something_behind_a_closing_brace() {
    check(
        "LOOP_PROGRAM 3 {\nMOVE_F 1\n} END\n",
        &expect![[r#"
        error[syntax]: `}` stands on a line of its own
         --> test.smsd:3:1
          |
        3 | } END
          | ^ ends a loop
          |
          = help: put what follows it on the next line
    "#]],
    );
}

#[test]
fn a_loop_without_body() {
    check(
        "LOOP_PROGRAM 3\nEND\n",
        &expect![[r#"
        error[syntax]: `LOOP_PROGRAM` has either braces or `instructions=`
         --> test.smsd:1:14
          |
        1 | LOOP_PROGRAM 3
          |              ^ which instructions shall be repeated?
          |
          = help: `LOOP_PROGRAM` takes `10 {` with the body behind it, or `cycles=10 instructions=3`, each up to 1023
    "#]],
    );
}

#[test]
fn a_loop_with_too_many_cycles() {
    check(
        "LOOP_PROGRAM 2000 {\nMOVE_F 1\n}\nEND\n",
        &expect![[r#"
            error[out-of-range]: `2000` is out of the range of `LOOP_PROGRAM`
             --> test.smsd:1:14
              |
            1 | LOOP_PROGRAM 2000 {
              |              ^^^^
              |
              = help: `LOOP_PROGRAM` takes `10 {` with the body behind it, or `cycles=10 instructions=3`, each up to 1023
        "#]],
    );
}

#[test]
fn a_raw_loop_that_is_not_complete() {
    check(
        "LOOP_PROGRAM cycles=3\nEND\n",
        &expect![[r#"
            error[missing-field]: `LOOP_PROGRAM` lacks instructions
             --> test.smsd:1:1
              |
            1 | LOOP_PROGRAM cycles=3
              | ^^^^^^^^^^^^^^^^^^^^^ not complete
              |
              = help: it takes `cycles=10 instructions=3`
        "#]],
    );
}

#[test]
fn a_memory_with_too_many_instructions() {
    check(
        &"MOVE_F 1\n".repeat(300),
        &expect![[r#"
        error[memory-full]: memory 0 is full: it holds 255 instructions
           --> test.smsd:256:1
            |
        256 | MOVE_F 1
            | ^^^^^^^^ the first one without room
            |
            = help: go on in another memory: end with `GOTO_PROGRAM mem1:more` and put `.mem 1`, `more:` here
    "#]],
    );
}
