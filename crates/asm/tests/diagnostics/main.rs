//! What a person reads when a program is wrong: a snapshot for every kind of finding.

mod forms;
mod operands;
mod structure;
mod text;
mod warnings;

use expect_test::Expect;
use stepdrive_asm::{CheckOptions, Origin, Severity, SourceFile, Style, assemble, render};

/// Assembles and checks a text, and compares all that is said about it.
fn check(text: &str, expect: &Expect) {
    expect.assert_eq(&findings(text, CheckOptions::default()));
}

fn findings(text: &str, options: CheckOptions) -> String {
    let source = SourceFile::new("test.smsd", text);
    let assembly = assemble(&source);
    let errors = assembly.diagnostics.iter().any(|one| one.severity() == Severity::Error);
    assert_eq!(errors, assembly.image.is_none(), "an image comes out when there is no error");
    let mut findings = assembly.diagnostics.clone();
    findings.extend(assembly.check(&options));
    render(&findings, Origin::Text(&source), Style::Plain)
}
