//! `cargo xtask test`: everything, on a fresh machine, stopping at the first failure.

use crate::workspace::{Workspace, finish};
use crate::{Outcome, docs, setup, tidy};

/// The manifest of the proof that the cores do without `std`.
const NOSTD: &str = "crates/nostd/Cargo.toml";

/// A step: what is announced, and what is done.
type Step = (&'static str, fn(&Workspace) -> Outcome);

/// The steps before the client tests, in order.
const STEPS: [Step; 7] = [
    ("install what is missing", setup::run),
    ("format", |workspace| cargo(workspace, &["fmt", "--all", "--check"])),
    ("clippy", |workspace| {
        cargo(workspace, &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"])
    }),
    ("cores without std", |workspace| {
        cargo(workspace, &["build", "--locked", "--manifest-path", NOSTD, "--target-dir", "target/nostd"])
    }),
    ("cargo test", |workspace| cargo(workspace, &["test", "--workspace"])),
    ("generated documents", docs::check),
    ("house rules", tidy::run),
];

/// Runs every step. The client tests come last and nothing is printed behind their summary, so that the last line of
/// the output says how it went.
pub(crate) fn run(workspace: &Workspace) -> Outcome {
    let total = STEPS.len() + 1;
    for (number, (name, step)) in (1..).zip(STEPS) {
        eprintln!("==> {number}/{total} {name}");
        let seconds = timed(|| step(workspace)).map_err(|error| format!("{name}: {error}"))?;
        eprintln!("    {name}: {seconds:.1} s");
    }
    eprintln!("==> {total}/{total} client tests");
    client_tests(workspace).map_err(|error| format!("client tests: {error}"))
}

/// Runs `work` and gives back how many seconds it took.
#[expect(clippy::disallowed_methods, reason = "a task runner says how long its steps take")]
fn timed(work: impl FnOnce() -> Outcome) -> Outcome<f64> {
    let start = std::time::Instant::now();
    work()?;
    Ok(start.elapsed().as_secs_f64())
}

fn cargo(workspace: &Workspace, arguments: &[&str]) -> Outcome {
    workspace.run("cargo", arguments)
}

/// Builds the program as people run it and lets clients that nobody here wrote talk to it.
fn client_tests(workspace: &Workspace) -> Outcome {
    cargo(workspace, &["build", "--release", "--bin", "stepdrive", "--target-dir", "target"])?;
    let mut pytest = workspace.command(&setup::python(), &["-m", "pytest", "tests/clients"]);
    pytest.env("STEPDRIVE", workspace.path("target/release/stepdrive")).env("PYTHONDONTWRITEBYTECODE", "1");
    finish(&mut pytest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failing_step_stops_with_its_message_and_a_passing_one_is_timed() {
        assert_eq!(timed(|| Err("broken".to_owned())), Err("broken".to_owned()));
        assert!(timed(|| Ok(())).is_ok_and(|seconds| seconds >= 0.0));
    }
}
