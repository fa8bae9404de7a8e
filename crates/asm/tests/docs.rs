//! `docs/programs.md` shows what really is: its programs assemble, and its generated parts are up to date.

use expect_test::expect_file;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;
use stepdrive_asm::{
    CheckOptions, Code, Origin, Severity, SourceFile, Style, allowed_operand, assemble, format, render,
};
use stepdrive_spec::smsd::instructions::INSTRUCTIONS;

fn page() -> (PathBuf, String) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/programs.md");
    let text = fs::read_to_string(&path).expect("the page");
    (path, text)
}

/// The fenced block with this mark.
fn block(page: &str, mark: &str) -> String {
    let (_, rest) = page.split_once(&format!("```{mark}\n")).expect("the block");
    rest.split_once("```").expect("its end").0.to_owned()
}

/// The page with a generated part replaced.
fn replace(page: &str, part: &str, content: &str) -> String {
    let mark = format!("<!-- generated: {part} -->\n");
    let (before, rest) = page.split_once(&mark).expect("the mark");
    let (_, after) = rest.split_once("<!-- end -->").expect("its end");
    format!("{before}{mark}{content}<!-- end -->{after}")
}

fn findings(text: &str) -> String {
    let source = SourceFile::new("example.smsd", text);
    let assembly = assemble(&source);
    let mut findings = assembly.diagnostics.clone();
    findings.extend(assembly.check(&CheckOptions::default()));
    render(&findings, Origin::Text(&source), Style::Plain)
}

fn codes() -> String {
    let mut table = "| code | | meaning |\n|---|---|---|\n".to_owned();
    for code in Code::ALL {
        let severity = match code.severity() {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        writeln!(table, "| `{code}` | {severity} | {} |", code.about()).expect("a string");
    }
    table
}

fn instructions() -> String {
    let mut table = "| code | instruction | operand | what it does |\n|---|---|---|---|\n".to_owned();
    for info in INSTRUCTIONS.iter().filter(|info| info.in_program) {
        let alias = if info.alias.is_empty() { String::new() } else { format!(", `{}`", info.alias) };
        let operand = allowed_operand(info.operand).replace('|', "\\|");
        writeln!(table, "| 0x{:02X} | `{}`{alias} | {operand} | {} |", info.code, info.name, info.about)
            .expect("a string");
    }
    table
}

#[test]
fn the_generated_parts_are_up_to_date() {
    let (path, page) = page();
    let shown = |mark| format!("```text\n{}```\n", findings(&block(&page, mark)));
    let mut new = replace(&page, "errors", &shown("smsd-wrong"));
    new = replace(&new, "warnings", &shown("smsd-repaired"));
    new = replace(&new, "codes", &codes());
    new = replace(&new, "instructions", &instructions());
    expect_file![path].assert_eq(&new);
}

#[test]
fn the_program_on_the_page_is_right_and_laid_out() {
    let (_, page) = page();
    let text = block(&page, "smsd");
    assert_eq!(findings(&text), "");
    assert_eq!(format(&SourceFile::new("x", text.clone())), Ok(text));
}

#[test]
fn the_wrong_programs_on_the_page_are_wrong_as_it_says() {
    let (_, page) = page();
    assert!(assemble(&SourceFile::new("x", block(&page, "smsd-wrong"))).image.is_none());
    assert!(assemble(&SourceFile::new("x", block(&page, "smsd-repaired"))).image.is_some());
}
