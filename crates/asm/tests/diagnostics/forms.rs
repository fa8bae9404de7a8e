//! The forms in which findings come out.

use super::{check, findings};
use expect_test::expect;
use stepdrive_asm::{CheckOptions, Code, Origin, SourceFile, Style, assemble, render};

#[test]
fn a_text_that_is_too_long() {
    check(
        &" ".repeat(2_000_000),
        &expect![[r#"
        error[too-large]: the text has 2000000 bytes, which cannot be a program
        --> test.smsd
         = help: a text may have 1048576 bytes; four full memories take far less
    "#]],
    );
}

#[test]
fn a_text_that_is_no_program() {
    let said = findings(&"lorem ipsum\n".repeat(5000), CheckOptions::default());
    assert_eq!(said.matches("error[unknown-instruction]").count(), 100);
    let (_, last) = said.rsplit_once("\n\n").expect("several findings");
    expect![[r#"
        warning[too-many]: 4901 more findings are not shown
        --> test.smsd
         = help: see to these first, then look again
    "#]]
    .assert_eq(last);
}

#[test]
fn an_image_without_text() {
    let image = stepdrive_asm::Image::from_words(1, &[0, 0x39, 6, 0, 0x60, 0x90, 1, 0]).expect("two words");
    let findings = stepdrive_asm::check(&image, None, &CheckOptions::default());
    expect![[r#"
        warning[runs-past-end]: the program runs past the end of memory 1, which ends it
        --> motor.img mem1:1
         = note: mem1:1: nothing follows
         = help: write `END` behind it if that is meant
    "#]]
    .assert_eq(&render(&findings, Origin::Image("motor.img"), Style::Plain));
}

#[test]
fn a_finding_far_to_the_right_of_a_very_long_line() {
    let text = " ".repeat(5000) + "MOVEF 1 ; " + &"x".repeat(5000);
    check(
        &text,
        &expect![[r#"
        error[unknown-instruction]: there is no instruction `MOVEF`
        --> test.smsd:1:5001
         = help: did you mean `MOVE_F`?
    "#]],
    );
}

#[test]
fn colours_are_for_terminals() {
    let source = SourceFile::new("test.smsd", "MOVEF 1\n");
    let findings = assemble(&source).diagnostics;
    let coloured = render(&findings, Origin::Text(&source), Style::Colour);
    assert!(coloured.contains("\u{1b}["));
    assert!(!render(&findings, Origin::Text(&source), Style::Plain).contains('\u{1b}'));
}

#[test]
fn findings_for_machines_have_lines_columns_and_suggestions() {
    let source = SourceFile::new("test.smsd", "END\n  MOVEF 1\n");
    let reports = stepdrive_asm::report(&assemble(&source).diagnostics, Some(&source));
    expect![[r#"
        [
          {
            "severity": "error",
            "code": "unknown-instruction",
            "message": "there is no instruction `MOVEF`",
            "labels": [
              {
                "at": {
                  "file": "test.smsd",
                  "bytes": {
                    "start": 6,
                    "end": 11
                  },
                  "start": {
                    "line": 2,
                    "column": 3
                  },
                  "end": {
                    "line": 2,
                    "column": 8
                  }
                },
                "place": null,
                "text": "not an instruction"
              }
            ],
            "help": [
              "did you mean `MOVE_F`?"
            ],
            "suggestion": {
              "at": {
                "file": "test.smsd",
                "bytes": {
                  "start": 6,
                  "end": 11
                },
                "start": {
                  "line": 2,
                  "column": 3
                },
                "end": {
                  "line": 2,
                  "column": 8
                }
              },
              "replacement": "MOVE_F"
            }
          }
        ]"#]]
    .assert_eq(&serde_json::to_string_pretty(&reports).expect("JSON"));
}

/// Every code is met in these files, so that none is without its snapshot.
#[test]
fn every_code_has_a_snapshot() {
    let here = [
        include_str!("text.rs"),
        include_str!("operands.rs"),
        include_str!("structure.rs"),
        include_str!("warnings.rs"),
        include_str!("forms.rs"),
    ]
    .concat();
    // A file that is not text has no snapshot: `SourceFile::from_bytes` reports it.
    for code in Code::ALL.iter().filter(|code| **code != Code::NotText) {
        assert!(here.contains(&format!("[{code}]")), "{code}");
    }
}
