//! `stepdrive program`, as a person or a script uses it.

use expect_test::{Expect, expect};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// A folder with a program in it.
struct Folder(TempDir);

impl Folder {
    fn with(text: &str) -> Folder {
        let folder = Folder(TempDir::new().expect("a temporary folder"));
        fs::write(folder.path("p.smsd"), text).expect("written");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs `stepdrive program` with these words in the folder.
    fn program(&self, words: &str) -> Ran {
        run(self.0.path(), words, "")
    }
}

fn run(folder: &Path, words: &str, input: &str) -> Ran {
    let mut child = Command::new(env!("CARGO_BIN_EXE_stepdrive"))
        .arg("program")
        .args(words.split_whitespace())
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    // A command that reads no input may have ended already.
    let _ = child.stdin.take().expect("piped").write_all(input.as_bytes());
    Ran(child.wait_with_output().expect("ended"))
}

struct Ran(Output);

impl Ran {
    fn code(&self) -> i32 {
        self.0.status.code().expect("not killed")
    }

    fn stdout(&self) -> &str {
        std::str::from_utf8(&self.0.stdout).expect("text")
    }

    fn stderr(&self) -> &str {
        std::str::from_utf8(&self.0.stderr).expect("text")
    }

    /// The exit code, and what went where.
    fn shows(&self, expected: &Expect) {
        expected.assert_eq(&format!("{}--- stderr, exit {}\n{}", self.stdout(), self.code(), self.stderr()));
    }
}

const SHUTTLE: &str = "\
SET_ACC 20000
SET_DEC 20000
LOOP_PROGRAM 2 {
    MOVE_F 160
    WAIT_IN0
    MOVE_R 160
}
SET_RELE
END
";

#[test]
fn check_says_how_large_a_good_program_is() {
    Folder::with(SHUTTLE).program("check p.smsd").shows(&expect![[r#"
        p.smsd: 8 instructions in memory 0, no warnings
        --- stderr, exit 0
    "#]]);
}

#[test]
fn check_shows_every_mistake_and_exits_with_9() {
    Folder::with("SET_MAX_SPED 800\nGOTO_PROGRAM nowhere\n").program("check p.smsd").shows(&expect![[r#"
        --- stderr, exit 9
        error[unknown-instruction]: there is no instruction `SET_MAX_SPED`
         --> p.smsd:1:1
          |
        1 | SET_MAX_SPED 800
          | ^^^^^^^^^^^^ not an instruction
          |
          = help: did you mean `SET_MAX_SPEED`?

        error[unknown-label]: memory 0 has no label `nowhere`
         --> p.smsd:2:14
          |
        2 | GOTO_PROGRAM nowhere
          |              ^^^^^^^ not found
        stepdrive: p.smsd: 2 errors; nothing was built
    "#]]);
}

#[test]
fn check_as_json_has_the_findings_on_stdout_and_the_same_exit_code() {
    let ran = Folder::with("RUN_F 99999\n").program("check p.smsd --json");
    assert_eq!(ran.code(), 9);
    let findings: serde_json::Value = serde_json::from_str(ran.stdout()).expect("JSON");
    assert_eq!(findings[0]["code"], "out-of-range");
    assert_eq!(findings[0]["labels"][0]["at"]["start"]["column"], 7);
}

#[test]
fn warnings_do_not_fail() {
    let ran = Folder::with("RUN_F 500\nMOVE_F 5\nEND\n").program("check p.smsd");
    assert_eq!(ran.code(), 0);
    assert!(ran.stderr().contains("warning[motor-may-turn]"), "{}", ran.stderr());
    assert!(ran.stdout().contains("1 warning"), "{}", ran.stdout());
}

#[test]
fn what_is_built_is_dumped_and_built_again_to_the_same_bytes() {
    let folder = Folder::with(SHUTTLE);
    assert_eq!(folder.program("build p.smsd -o p.bin").code(), 0);
    let dumped = folder.program("dump p.bin");
    fs::write(folder.path("again.smsd"), dumped.stdout()).expect("written");
    assert_eq!(folder.program("build again.smsd -o again.bin").code(), 0);
    let bytes = |name| fs::read(folder.path(name)).expect("read");
    assert_eq!(bytes("p.bin"), bytes("again.bin"));
    folder.program("dump p.bin --hex").shows(&expect![[r#"
        mem0:0   0x01388070  SET_ACC 20000
        mem0:1   0x01388080  SET_DEC 20000
        mem0:2   0x00200EC0  LOOP_PROGRAM cycles=2 instructions=3
        mem0:3   0x00028100  MOVE_F 160
        mem0:4   0x00000270  WAIT_IN0
        mem0:5   0x00028110  MOVE_R 160
        mem0:6   0x00000240  SET_RELE
        mem0:7   0x00000000  END
        --- stderr, exit 0
    "#]]);
}

#[test]
fn bare_words_are_dumped_with_what_is_no_instruction_as_words() {
    let folder = Folder::with("");
    let words = [0x0001_9060_u32, 0x3F0, 0x0001_9061].map(u32::to_le_bytes).concat();
    fs::write(folder.path("words.bin"), &words).expect("written");
    folder.program("dump words.bin --mem 1").shows(&expect![[r#"
        .mem 1
            SET_MAX_SPEED 100
            .word 0x000003F0  ; instruction code 0x3F is not listed
            .word 0x00019061  ; the reserved bits 3:0 are 0x1, not 0
        --- stderr, exit 0
    "#]]);
}

#[test]
fn a_program_with_errors_leaves_the_output_file_as_it_was() {
    let folder = Folder::with("NONSENSE\n");
    fs::write(folder.path("p.bin"), "precious").expect("written");
    assert_eq!(folder.program("build p.smsd -o p.bin").code(), 9);
    assert_eq!(fs::read_to_string(folder.path("p.bin")).expect("read"), "precious");
}

#[test]
fn build_wants_to_know_where_the_result_goes() {
    let ran = Folder::with(SHUTTLE).program("build p.smsd");
    assert_eq!(ran.code(), 1);
    assert!(ran.stderr().contains("--output"), "{}", ran.stderr());
}

#[test]
fn fmt_lays_out_in_place_and_check_only_looks() {
    let folder = Folder::with("set_acc 20000\n  end\n");
    assert_eq!(folder.program("fmt p.smsd --check").code(), 10);
    assert_eq!(folder.program("fmt p.smsd").code(), 0);
    assert_eq!(folder.program("fmt p.smsd --check").code(), 0);
    assert_eq!(fs::read_to_string(folder.path("p.smsd")).expect("read"), "    SET_ACC 20000\n    END\n");
}

#[test]
fn fmt_leaves_a_program_that_it_cannot_read_alone() {
    let folder = Folder::with("SET_ACC )\n");
    assert_eq!(folder.program("fmt p.smsd").code(), 9);
    assert_eq!(fs::read_to_string(folder.path("p.smsd")).expect("read"), "SET_ACC )\n");
}

#[test]
fn run_prints_a_timeline_on_virtual_time_and_how_it_ended() {
    let folder = Folder::with(SHUTTLE);
    folder.program("run p.smsd --input IN0=at:10min..11min,at:30min --for 1h").shows(&expect![[r#"
                 time  line      position    speed  inputs        instruction
             0.000000  mem0:0           0      0.0  -             SET_ACC 20000
             0.001000  mem0:1           0      0.0  -             SET_DEC 20000
             0.002000  mem0:2           0      0.0  -             LOOP_PROGRAM cycles=2 instructions=3
             0.003000  mem0:3           0      0.0  -             MOVE_F 160
             0.047728  mem0:4         160      0.0  -             WAIT_IN0
           600.000000  mem0:5         160      0.0  IN0           MOVE_R 160
           600.044728  mem0:3           0      0.0  IN0           MOVE_F 160
           600.089455  mem0:4         160      0.0  IN0           WAIT_IN0
           600.090455  mem0:5         160      0.0  IN0           MOVE_R 160
           600.135183  mem0:6           0      0.0  IN0           SET_RELE
           600.136183  mem0:7           0      0.0  IN0           END

        ended at mem0:7, after 600.136183097 s at position 0; the motor holds
        --- stderr, exit 0
        p.smsd on a virtual SMSD-4.2LAN of the built-in demo rig, on virtual time
    "#]]);
}

#[test]
fn trace_tells_what_happens_between_the_instructions() {
    let folder = Folder::with("SET_ACC 20000\nSET_DEC 20000\nSCAN_ZERO_R 300\nSOFT_HI_Z\nEND\n");
    folder.program("run p.smsd --trace").shows(&expect![[r#"
                 time  line      position    speed  inputs        instruction
             0.000000  mem0:0           0      0.0  -             SET_ACC 20000
             0.001000  mem0:1           0      0.0  -             SET_DEC 20000
             0.002000  mem0:2           0      0.0  -             SCAN_ZERO_R 300
             0.017005                 -36    300.0  -             · constant speed
             0.342830  mem0:3           0      0.0  SET_ZERO      SOFT_HI_Z
             0.343830  mem0:4           0      0.0  SET_ZERO      END

        ended at mem0:4, after 0.343829945 s at position 0; the motor is de-energised
        --- stderr, exit 0
        p.smsd on a virtual SMSD-4.2LAN of the built-in demo rig, on virtual time
    "#]]);
}

#[test]
fn a_program_that_waits_for_what_never_comes_says_how_to_give_it() {
    let ran = Folder::with("WAIT_CONTINUE\n").program("run p.smsd");
    assert_eq!(ran.code(), 0);
    assert!(ran.stdout().contains("give it with --input CONTINUE=at:1s"), "{}", ran.stdout());
}

#[test]
fn a_refused_instruction_ends_the_run_with_9_and_says_why() {
    let ran = Folder::with("RUN_F 500\nMOVE_F 5\n").program("run p.smsd");
    assert_eq!(ran.code(), 9);
    let why = "program ended at mem0:1: MOVE_F refused: the motor is turning (SPEED 500)";
    assert!(ran.stderr().contains(why), "{}", ran.stderr());
}

#[test]
fn run_as_json_has_an_object_on_every_line_and_the_end_last() {
    let ran = Folder::with("SET_RELE\nSET_WAIT 1500ms\nEND\n").program("run p.smsd --json");
    let lines: Vec<serde_json::Value> =
        ran.stdout().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines.len(), 4);
    assert_eq!((&lines[1]["line"], &lines[1]["relay"]), (&"mem0:1".into(), &true.into()));
    assert_eq!((&lines[3]["event"], &lines[3]["t_ns"]), (&"end".into(), &1_501_000_000_u64.into()));
    assert_eq!(ran.stderr(), "");
}

#[test]
fn another_memory_can_be_started() {
    let ran = Folder::with(".mem 2\nSET_RELE\n").program("run p.smsd --mem 2");
    assert!(ran.stdout().contains("mem2:0"), "{}", ran.stdout());
}

#[test]
fn a_program_is_read_from_stdin() {
    let folder = Folder::with("");
    let ran = run(folder.0.path(), "check -", "SET_RELE\nEND\n");
    assert_eq!(ran.stdout(), "stdin: 2 instructions in memory 0, no warnings\n");
}

#[test]
fn wrong_arguments_and_files_are_one_sentence_and_1() {
    let folder = Folder::with(SHUTTLE);
    for (words, part) in [
        ("check nothing.smsd", "cannot read nothing.smsd"),
        ("run p.smsd --input IN9=on", "there is no input IN9"),
        ("run p.smsd --for soon", "is no time"),
        ("run p.smsd --mem 4", "4 is not in 0..=3"),
        ("check p.smsd --model SMSD-1.5", "it is SMSD-4.2LAN or SMSD-8.0LAN"),
        ("run p.smsd --rig nothing.toml", "cannot read the rig file nothing.toml"),
    ] {
        let ran = folder.program(words);
        assert_eq!(ran.code(), 1, "{words}: {}", ran.stderr());
        assert!(ran.stderr().contains(part), "{words}: {}", ran.stderr());
        assert_eq!(ran.stdout(), "", "{words}");
    }
}

#[test]
fn files_that_are_no_programs_are_refused_kindly() {
    let folder = Folder::with("");
    fs::write(folder.path("big.smsd"), vec![b'x'; 3 << 20]).expect("written");
    fs::write(folder.path("noise.smsd"), [0xFF, 0xFE, 0x00]).expect("written");
    fs::write(folder.path("cut.bin"), b"SMSDPROG\x01\x00").expect("written");
    fs::write(folder.path("odd.bin"), [1, 2, 3]).expect("written");
    for words in ["check big.smsd", "check noise.smsd", "check cut.bin", "dump odd.bin"] {
        let ran = folder.program(words);
        assert_eq!(ran.code(), 9, "{words}: {}", ran.stderr());
        assert!(!ran.stderr().is_empty() && !ran.stderr().contains("panicked"), "{words}: {}", ran.stderr());
    }
}
