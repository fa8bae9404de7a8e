//! `docs/control.md` has a row for every fault, as the tables have it.

use std::fs;
use std::path::Path;
use stepdrive_rig::fault::MACHINE_FAULTS;
use stepdrive_rig::line::{Family, LINE_FAULTS};

fn row(name: &str, settings: &str, family: Option<Family>, about: &str) -> String {
    let only = family.map_or(String::new(), |family| format!("; {family} only"));
    let settings: Vec<String> = settings.split(" | ").map(|setting| format!("`{setting}`")).collect();
    format!("| `{name}` | {} | {about}{only} |", settings.join(", "))
}

#[test]
fn every_fault_has_its_row_in_the_documentation() {
    let machine = MACHINE_FAULTS
        .iter()
        .map(|fault| row(fault.name, &fault.settings.join(" | "), fault.family, fault.about));
    let line = LINE_FAULTS.iter().map(|fault| row(fault.name, fault.settings, fault.family, fault.about));
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/control.md");
    let page = fs::read_to_string(page).expect("the page is there");
    let missing: Vec<String> = machine.chain(line).filter(|row| !page.contains(row.as_str())).collect();
    assert!(missing.is_empty(), "put these rows into docs/control.md:\n{}", missing.join("\n"));
}
