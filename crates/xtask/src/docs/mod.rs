//! The reference pages under `docs/`, written from the tables of `stepdrive-spec` and from the comments in the sources.

mod assumptions;
mod instructions;
mod motors;
mod page;
mod registers;
mod smd3;
mod smsd_usb;

use crate::Outcome;
use crate::workspace::Workspace;

/// A page: its path, and its text.
type Page = (&'static str, String);

fn pages(workspace: &Workspace) -> Outcome<[Page; 6]> {
    Ok([
        ("docs/registers.md", registers::page()),
        ("docs/instructions.md", instructions::page()),
        ("docs/motors.md", motors::page()),
        ("docs/smd3-commands.md", smd3::page()),
        ("docs/smsd-usb-tables.md", smsd_usb::page()),
        ("docs/assumptions.md", assumptions::page(workspace)?),
    ])
}

/// Writes the pages that have drifted, or are not there.
pub(crate) fn write(workspace: &Workspace) -> Outcome {
    for (path, text) in drifted(workspace)? {
        workspace.write(path, &text)?;
        eprintln!("    wrote {path}");
    }
    Ok(())
}

/// Fails when a page is not what its sources say.
pub(crate) fn check(workspace: &Workspace) -> Outcome {
    let drifted = drifted(workspace)?;
    if drifted.is_empty() {
        return Ok(());
    }
    let paths: Vec<&str> = drifted.iter().map(|(path, _)| *path).collect();
    Err(format!("drifted from its source: {}; run `cargo xtask docs`", paths.join(", ")))
}

fn drifted(workspace: &Workspace) -> Outcome<Vec<Page>> {
    let is_current = |path, text: &str| workspace.read(path).is_ok_and(|written| written == text);
    Ok(pages(workspace)?.into_iter().filter(|(path, text)| !is_current(path, text)).collect())
}
