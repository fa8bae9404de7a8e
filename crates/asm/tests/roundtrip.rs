//! Words to text and back, and text to its layout: nothing is lost.

use proptest::prelude::*;
use stepdrive_asm::{Image, SourceFile, assemble, disassemble, format};
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Opcode, Operand};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// The text of an image, after it was shown to assemble to the same image.
fn there_and_back(image: &Image) -> String {
    let text = disassemble(image);
    let assembly = assemble(&SourceFile::new("x", text.clone()));
    assert_eq!(assembly.image.as_ref(), Some(image), "{:?}\n{text}", assembly.diagnostics);
    text
}

fn image(areas: &[Vec<u32>]) -> Image {
    let mut image = Image::new();
    for (memory, words) in areas.iter().enumerate() {
        image.set_area(memory, words).expect("at most 255 words");
    }
    image
}

/// A word of a certain instruction, its data more often sensible than not.
fn word() -> impl Strategy<Value = u32> {
    let data = prop_oneof![0..0x40_u32, 0..0x400_u32, 0..0x40_0000_u32];
    let instruction = (0..INSTRUCTIONS.len(), data.clone()).prop_map(|(index, data)| {
        let opcode = INSTRUCTIONS.get(index).map_or(Opcode::End, |info| info.opcode);
        Instruction { opcode, data }.word()
    });
    let small_loop = (0..6_u32, 0..12_u32).prop_map(|(cycles, body)| {
        Instruction { opcode: Opcode::LoopProgram, data: cycles << 10 | body }.word()
    });
    let jump = (0..1024_u32, 0..4_usize).prop_map(|(target, index)| {
        let jumps =
            [Opcode::GotoProgram, Opcode::CallProgram, Opcode::GotoProgramIfIn0, Opcode::GotoProgramIfZero];
        Instruction { opcode: jumps.get(index).copied().unwrap_or(Opcode::GotoProgram), data: target }.word()
    });
    prop_oneof![3 => instruction, 1 => any::<u32>(), 2 => small_loop, 2 => jump]
}

fn memory() -> impl Strategy<Value = Vec<u32>> {
    prop_oneof![prop::collection::vec(word(), 0..40), prop::collection::vec(word(), 0..=255)]
}

proptest! {
    #![proptest_config(config(150))]

    #[test]
    fn any_memories_assemble_from_their_text(areas in prop::collection::vec(memory(), 4)) {
        let image = image(&areas);
        let text = there_and_back(&image);
        prop_assert_eq!(Image::from_bytes(&image.to_bytes()), Ok(image));
        // What the disassembler writes is laid out already.
        let formatted = format(&SourceFile::new("x", text.clone()));
        prop_assert_eq!(formatted, Ok(text));
    }
}

#[test]
fn the_worked_example_of_the_manual_is_one_line() {
    let image = image(&[vec![0x0001_9060]]);
    assert_eq!(there_and_back(&image), ".mem 0\n    SET_MAX_SPEED 100\n");
}

#[test]
fn every_instruction_survives_with_the_edges_of_its_operand() {
    for info in &INSTRUCTIONS {
        let edges = match info.operand {
            Operand::Number { min, max, .. } => vec![min.saturating_sub(1), min, max, max + 1],
            Operand::None
            | Operand::Position
            | Operand::Mask
            | Operand::Input
            | Operand::Mode
            | Operand::Jump
            | Operand::Loop => {
                vec![
                    0, 1, 2, 7, 8, 0xFF, 0x100, 0x3FF, 0x400, 10_813, 0xF_FFFF, 0x10_0000, 0x1F_FFFF,
                    0x20_0000,
                ]
            }
        };
        let words = edges.iter().chain(&[0x3F_FFFF]);
        let words = words.map(|data| Instruction { opcode: info.opcode, data: *data }.word()).collect();
        there_and_back(&image(&[words]));
    }
}

#[test]
fn what_has_no_form_stands_as_a_word_with_a_remark() {
    let words =
        vec![0x0001_9061, 0x3F0, 0x400, 0x10, 5 << 10 | 0x60, 0x400 << 10 | 0x290, 0x30_0000 << 10 | 0x2C0];
    expect_test::expect![[r"
        .mem 0
            .word 0x00019061  ; the reserved bits 3:0 are 0x1, not 0
            .word 0x000003F0  ; instruction code 0x3F is not listed
            .word 0x00000400  ; END, data bits 0x1 are ignored
            .word 0x00000010  ; GET_SPEED cannot stand in a program
            .word 0x00001460  ; SET_MAX_SPEED 5, out of its range
            .word 0x00100290  ; GOTO_PROGRAM, data bits 0x400 are ignored
            .word 0xC00002C0  ; LOOP_PROGRAM, data bits 0xC00 are ignored
    "]]
    .assert_eq(&there_and_back(&image(&[words])));
}

#[test]
fn jumps_have_labels_and_loops_have_braces_where_they_can() {
    let text = "\
.mem 0
L0:
    LOOP_PROGRAM 3 {
        MOVE_F 100
        LOOP_PROGRAM 2 {
            SET_WAIT 500ms
        }
    }
L4:
    LOOP_PROGRAM cycles=2 instructions=9
    GOTO_PROGRAM_IF_IN0 L0
    CALL_PROGRAM mem2:L1
    GOTO_PROGRAM mem1:0
    GOTO_PROGRAM 200
    GOTO_PROGRAM L11
    GOTO_PROGRAM L4
L11:

.mem 2
    SET_MODE control=voltage motor=30 microstep=1 current=8.0A hold=100%
L1:
    GO_UNTIL_R SET_ZERO
    SET_MASK_EVENT IN0 | CONTINUE
    SET_MASK_EVENT 0
    SET_MASK_EVENT 0xFF
    SET_WAIT 1min
    RETURN_PROGRAM
";
    let image = assemble(&SourceFile::new("x", text)).image.expect("no errors");
    assert_eq!(there_and_back(&image), text);
}

#[test]
fn loops_nested_as_deep_as_a_memory_goes_stay_readable() {
    let mut words: Vec<u32> = (1..255)
        .rev()
        .map(|body| Instruction { opcode: Opcode::LoopProgram, data: 1 << 10 | body }.word())
        .collect();
    words.push(0);
    let text = there_and_back(&image(&[words.clone(), words.clone(), words.clone(), words]));
    assert!(text.len() < 200_000, "{}", text.len());
}

/// Text of which a good part is a program.
fn text() -> impl Strategy<Value = String> {
    let pieces = [
        "MOVE_F 100",
        "set_wait 2S",
        "go_label",
        "SET_MODE Control=current motor=0 microstep=1/16 current=1.5A hold=50%",
        "SET_MASK_EVENT in0|IN1",
        "LOOP_PROGRAM 3 {",
        "}",
        "GOTO_PROGRAM a",
        "goto_program Mem1:0",
        "a:",
        "b: END",
        ".mem 1",
        ".MEM 0",
        ".const x = 0X1F",
        ".const longer=5ms",
        "MOVE_F x",
        ".word 0x3f0",
        "; comment",
        ";;",
        ";x ",
        "  ",
        "",
        "LOOP_PROGRAM cycles=2 Instructions=1",
    ];
    let piece = (0..pieces.len()).prop_map(move |index| pieces.get(index).copied().unwrap_or("").to_owned());
    let line = (piece, prop_oneof![3 => Just(""), 1 => Just(" ; why"), 1 => Just("\t;tab\t")]);
    let line = (prop_oneof![Just(""), Just("   "), Just("\t")], line);
    prop::collection::vec(line, 0..25).prop_map(|lines| {
        lines
            .into_iter()
            .flat_map(|(indent, (piece, end))| [indent.to_owned(), piece, format!("{end}\r\n")])
            .collect()
    })
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn formatting_twice_is_formatting_once_and_changes_no_word(text in text()) {
        let source = SourceFile::new("x", text);
        let formatted = SourceFile::new("x", format(&source).expect("every line can be read"));
        let again = format(&formatted);
        prop_assert_eq!(again.as_deref(), Ok(formatted.text()));
        let (before, after) = (assemble(&source), assemble(&formatted));
        prop_assert_eq!(before.image, after.image);
        let codes = |findings: &[stepdrive_asm::Diagnostic]| findings.iter().map(|one| one.code).collect::<Vec<_>>();
        prop_assert_eq!(codes(&before.diagnostics), codes(&after.diagnostics));
        let comments = |text: &str| text.matches(';').count();
        prop_assert_eq!(comments(source.text()), comments(formatted.text()));
    }
}
