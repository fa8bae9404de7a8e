//! Hostile input: nothing panics, nothing hangs, everything is answered.

use proptest::prelude::*;
use stepdrive_asm::{
    CheckOptions, Code, Diagnostic, Image, Origin, SourceFile, Style, assemble, check, disassemble, format,
    render, report,
};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// Does everything that can be done with a text.
fn use_all(text: &str) {
    let source = SourceFile::new("x", text);
    let assembly = assemble(&source);
    let mut findings = assembly.diagnostics.clone();
    findings.extend(assembly.check(&CheckOptions::default()));
    assert!(findings.len() <= 202);
    assert!(!render(&findings, Origin::Text(&source), Style::Plain).is_empty() || findings.is_empty());
    for finding in report(&findings, Some(&source)) {
        assert!(
            finding.labels.iter().filter_map(|label| label.at.as_ref()).all(|at| at.bytes.end <= text.len())
        );
    }
    if let Ok(formatted) = format(&source) {
        let again = format(&SourceFile::new("x", formatted.clone()));
        assert!(again.as_deref() == Ok(formatted.as_str()), "the layout is not stable");
    }
    if let Some(image) = &assembly.image {
        let again = assemble(&SourceFile::new("y", disassemble(image)));
        assert_eq!(again.image.as_ref(), Some(image));
    }
}

fn use_all_words(areas: &[Vec<u32>]) {
    let mut image = Image::new();
    for (memory, words) in areas.iter().enumerate() {
        image.set_area(memory, words).expect("at most 255 words");
    }
    let findings = check(&image, None, &CheckOptions::default());
    assert!(findings.len() <= 101);
    assert!(render(&findings, Origin::Image("x"), Style::Colour).len() >= findings.len());
    assert_eq!(image.listing().lines().count(), image.words().count());
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn any_text_is_answered(text in "\\PC{0,200}") {
        use_all(&text);
    }

    #[test]
    fn any_text_of_the_languages_characters_is_answered(
        text in "([A-Za-z_0-9.:=|{};%/+\\- \n\r\t\u{FEFF}é]|MOVE_F|LOOP_PROGRAM|GOTO_PROGRAM|SET_MODE|\\.mem|\\.const|mem1:){0,120}"
    ) {
        use_all(&text);
    }

    #[test]
    fn any_bytes_are_an_image_or_not(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let marked = [&b"SMSDPROG"[..], &bytes].concat();
        prop_assert!(Image::from_bytes(&bytes).is_err());
        prop_assert!(Image::from_bytes(&marked).is_err());
        prop_assert_eq!(Image::from_words(0, &bytes).is_ok(), bytes.len().is_multiple_of(4));
        if let Ok(source) = SourceFile::from_bytes("x", bytes) {
            use_all(source.text());
        }
    }

    #[test]
    fn any_words_are_checked(areas in prop::collection::vec(prop::collection::vec(any::<u32>(), 0..60), 4)) {
        use_all_words(&areas);
        let plain = |word: &u32| word & !0xF;
        use_all_words(&areas.iter().map(|area| area.iter().map(plain).collect()).collect::<Vec<_>>());
    }
}

#[test]
fn long_texts_are_answered_in_time() {
    for piece in [
        "x",
        "x ",
        "x:",
        "a:\n",
        "}",
        "}\n",
        "{",
        "LOOP_PROGRAM 1 {\n",
        "0",
        "9_",
        "-",
        "= ",
        "IN0 | ",
        ";",
        "\u{0}",
        "é",
        "MOVE_F 1\n",
        "MOVE_F y\n",
        "GOTO_PROGRAM y\n",
        ".mem 0\n",
        ".const a = 1\n",
        ".const a = IN0 | IN1 | ",
        "SET_MODE a=1 ",
        "a: a: ",
        "\u{200B}",
    ] {
        use_all(&piece.repeat((1 << 17) / piece.len()));
    }
    use_all(&"\n".repeat(1 << 20));
    use_all(&(0..10_000).map(|number| format!("label{number}:")).collect::<Vec<_>>().join("\n"));
    use_all(&(0..10_000).map(|number| format!(".const name{number} = 5")).collect::<Vec<_>>().join("\n"));
}

#[test]
fn megabytes_are_refused_by_everything_that_takes_a_text() {
    let source = SourceFile::new("x", "END\n".repeat(1 << 20));
    let codes = |findings: &[Diagnostic]| findings.iter().map(|one| one.code).collect::<Vec<Code>>();
    let assembly = assemble(&source);
    assert_eq!(codes(&assembly.diagnostics), [Code::TooLarge]);
    assert_eq!(assembly.check(&CheckOptions::default()), []);
    assert_eq!(format(&source).map_err(|findings| codes(&findings)), Err(vec![Code::TooLarge]));
}

/// Calls and jumps from everywhere to everywhere, in every state of the motor: the most that the checker ever has to do.
#[test]
fn a_program_that_goes_everywhere_is_checked_in_time() {
    let mut seed = 1_u32;
    let mut random = |below: u32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) % below
    };
    let mut word = || {
        let place = (random(2) << 8) | random(255);
        let (opcode, data) = match random(100) {
            0..38 => (Opcode::CallProgram, place),
            38..40 => (Opcode::ReturnProgram, 0),
            40..80 => (Opcode::GotoProgramIfIn0, place),
            80..85 => (Opcode::RunF, 100),
            85..90 => (Opcode::SoftHiZ, 0),
            90..95 => (Opcode::SetMaxSpeed, 100),
            _ => (Opcode::SoftStop, 0),
        };
        Instruction { opcode, data }.word()
    };
    let mut area = || (0..255).map(|_| word()).collect::<Vec<u32>>();
    use_all_words(&[area(), area()]);
}

/// A call chain through all memories, so that the search for recursion goes as deep as it can.
#[test]
fn a_thousand_calls_within_each_other_are_checked() {
    let next = |line: u32| (((line + 1) / 255) << 8) | ((line + 1) % 255);
    let call = |line| Instruction { opcode: Opcode::CallProgram, data: next(line) % 0x400 }.word();
    let words: Vec<u32> = (0..1020).map(call).collect();
    use_all_words(&words.chunks(255).map(<[u32]>::to_vec).collect::<Vec<_>>());
}
