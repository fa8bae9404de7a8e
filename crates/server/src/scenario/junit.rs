//! Reports as `JUnit` XML.

use super::report::{Outcome, Report, StepReport};
use std::fmt::Write as _;

/// Writes a report.
pub(super) fn write(report: &Report) -> String {
    let count = |is: fn(&Outcome) -> bool| report.steps.iter().filter(|step| is(&step.outcome)).count();
    let name = escaped(&report.name);
    let mut xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned();
    // Writing to a String does not fail.
    let _ = writeln!(
        xml,
        "<testsuite name=\"{name}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\" time=\"{}\">",
        report.steps.len(),
        count(|outcome| matches!(outcome, Outcome::Failed(_))),
        count(|outcome| matches!(outcome, Outcome::CouldNot(_))),
        count(|outcome| matches!(outcome, Outcome::Skipped)),
        seconds(report.ended_ns.saturating_sub(report.began_ns)),
    );
    report.steps.iter().for_each(|step| put_step(&mut xml, &name, step));
    xml.push_str("</testsuite>\n");
    xml
}

fn put_step(xml: &mut String, suite: &str, step: &StepReport) {
    let took = step.began_ns.zip(step.ended_ns).map_or(0, |(began, ended)| ended.saturating_sub(began));
    let (name, took) = (escaped(&step.name), seconds(took));
    let _ = write!(xml, "  <testcase classname=\"{suite}\" name=\"{}. {name}\" time=\"{took}\"", step.number);
    let _ = match &step.outcome {
        Outcome::Passed => writeln!(xml, "/>"),
        Outcome::Skipped => writeln!(xml, "><skipped/></testcase>"),
        Outcome::Failed(why) => put_trouble(xml, "failure", why),
        Outcome::CouldNot(why) => put_trouble(xml, "error", why),
    };
}

/// What went wrong, as some readers show it and as others do.
fn put_trouble(xml: &mut String, element: &str, why: &str) -> std::fmt::Result {
    let why = escaped(why);
    writeln!(xml, "><{element} message=\"{why}\">{why}</{element}></testcase>")
}

fn seconds(nanos: u64) -> String {
    format!("{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)
}

/// A text as it may stand in an attribute or an element: escaped, and without what XML 1.0 has no place for.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => {
                // An attribute would be read with a space instead.
                let _ = write!(out, "&#{};", u32::from(c));
            }
            '\u{FFFE}' | '\u{FFFF}' => {}
            c if c.is_control() => {}
            c => out.push(c),
        }
    }
    out
}
