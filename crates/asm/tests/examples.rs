//! The programs under `examples/programs` assemble, check clean, and are laid out as the formatter would.

use std::fs;
use std::path::PathBuf;
use stepdrive_asm::{CheckOptions, Origin, SourceFile, Style, assemble, disassemble, format, render};

fn examples() -> Vec<(PathBuf, SourceFile)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/programs");
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder).expect("the examples").map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    let source = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a text");
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        (path, SourceFile::new(name, text))
    };
    paths.into_iter().filter(|path| path.extension().is_some_and(|end| end == "smsd")).map(source).collect()
}

#[test]
fn there_are_examples() {
    assert!(examples().len() >= 6);
}

#[test]
fn every_example_assembles_and_checks_clean() {
    for (_, source) in examples() {
        let assembly = assemble(&source);
        let mut findings = assembly.diagnostics.clone();
        findings.extend(assembly.check(&CheckOptions::default()));
        assert_eq!(render(&findings, Origin::Text(&source), Style::Plain), "", "{}", source.name());
        assert!(assembly.image.is_some());
    }
}

#[test]
fn every_example_says_first_what_it_does() {
    for (_, source) in examples() {
        let comment = source.text().lines().next().expect("a line");
        assert!(comment.starts_with("; ") && comment.len() > 40, "{}", source.name());
    }
}

#[test]
fn every_example_is_formatted() {
    for (path, source) in examples() {
        let formatted = format(&source).expect("a readable text");
        expect_test::expect_file![path].assert_eq(&formatted);
    }
}

#[test]
fn every_example_survives_disassembly() {
    for (_, source) in examples() {
        let image = assemble(&source).image.expect("no errors");
        let text = disassemble(&image);
        let again = assemble(&SourceFile::new("again", text.clone()));
        assert_eq!(again.image.as_ref(), Some(&image), "{text}");
        assert_eq!(format(&SourceFile::new("again", text.clone())).as_deref(), Ok(text.as_str()));
        assert_eq!(again.check(&CheckOptions::default()), [], "{text}");
    }
}
